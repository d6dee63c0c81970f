"""Due: the answers that a subject owes, who says so, and for how long to wait for one, or for rest.

One that was awaited in full twice, and never came, is not waited for in full again: every case that
meets it would be, and all of them for hours. That it is missing is then what fails, whatever the
case is about. A case that is tried alone waits in full.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Final, NamedTuple

ANSWERED: Final = "3/31"
"""Which requirement says that a request is answered."""

SUCCESS: Final[Mapping[str, str]] = {
    "run_program": "4.15/5",
    "simulate_program": "4.16/3",
    "emergency_stop": "4.17/4",
    "reset": "4.18/4",
    "set_tool_coordinates": "4.24/6",
    "release_joints": "4.25/3",
    "lock_joints": "4.26/3",
    "jog": "4.28/5",
}
"""The requirement that success is reported by the tagged result "11"."""

_TWICE: Final = 2
_REPLY_S: Final = 1.0
_RESULT_S: Final = 5.0


class ExpectedReply(NamedTuple):
    """A kind of answer: the first reply to a command of the table, or its final result."""

    name: str
    result: bool = False

    @property
    def requirement(self) -> str:
        """Which requirement says that it comes."""
        return SUCCESS[self.name] if self.result else ANSWERED


class TimeoutPolicy:
    """What was awaited in full, and what has ever come."""

    def __init__(self) -> None:
        self._missed: Counter[ExpectedReply] = Counter()
        self._came: set[ExpectedReply] = set()
        self._restless = 0

    def copy(self) -> "TimeoutPolicy":
        """Return an independent copy."""
        copy = TimeoutPolicy()
        copy._missed, copy._came = self._missed.copy(), self._came.copy()
        copy._restless = self._restless
        return copy

    def note_received(self, due: ExpectedReply) -> None:
        """It is there, so it is worth waiting for."""
        self._came.add(due)

    def note_timeout(self, due: ExpectedReply) -> None:
        """It did not come in the time that it has."""
        self._missed[due] += 1

    def given_up(self, due: ExpectedReply) -> bool:
        """Whether it was awaited in full twice, and never came."""
        return due not in self._came and self._missed[due] >= _TWICE

    def timeout_s(self, due: ExpectedReply, full_s: float) -> float:
        """For how long to wait for what has so much time."""
        short_s = _RESULT_S if due.result else _REPLY_S
        return min(full_s, short_s) if self.given_up(due) else full_s

    def rest_timeout_s(self, full_s: float) -> float:
        """For how long to wait until the robot rests: shorter if waiting had no result before."""
        return min(full_s, _RESULT_S) if self._restless >= _TWICE else full_s

    def note_rest(self, for_s: float, *, rests: bool) -> None:
        """The waits so far, with or without result; one successful long wait justifies others."""
        if not rests:
            self._restless += 1
        elif for_s > _RESULT_S:
            self._restless = 0

    def unanswered(self) -> frozenset[str]:
        """The commands whose first reply never comes."""
        return frozenset(due.name for due in self._missed if not due.result and self.given_up(due))
