"""Timeouts: how long to wait for a reply or for rest, and the requirement of each reply.

If a reply was missing twice after its full timeout and has never come, later waits are shorter:
otherwise a run would take hours. The missing reply is then the failure, whatever requirement the
case has. A case that runs alone waits for the full timeout.
"""

from collections import Counter
from typing import Final, NamedTuple

from scaraspec.judge.requirements import SUCCESS

ANSWERED: Final = "3/31"
"""The requirement that every request is answered."""

_TWICE: Final = 2
_REPLY_S: Final = 1.0
_RESULT_S: Final = 5.0


class ExpectedReply(NamedTuple):
    """The first reply to a command, or its final result."""

    name: str
    result: bool = False

    @property
    def requirement(self) -> str:
        """The requirement that it is sent."""
        return SUCCESS[self.name] if self.result else ANSWERED


class TimeoutPolicy:
    """Knows which replies were missing after their full timeout, and which have ever come."""

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
        """Note that the reply has come; a final result only if it reports success.

        A command that was stopped or fails may have a result although one that succeeds has none.
        """
        self._came.add(due)

    def note_timeout(self, due: ExpectedReply) -> None:
        """Note that the reply did not come within its full timeout.

        A final result is also missing if the robot was idle and the result did not follow.
        """
        self._missed[due] += 1

    def given_up(self, due: ExpectedReply) -> bool:
        """Whether the reply was missing twice after its full timeout and has never come."""
        return due not in self._came and self._missed[due] >= _TWICE

    def timeout_s(self, due: ExpectedReply, full_s: float) -> float:
        """Return the timeout for a reply, in seconds; at most `full_s`."""
        short_s = _RESULT_S if due.result else _REPLY_S
        return min(full_s, short_s) if self.given_up(due) else full_s

    def rest_timeout_s(self, full_s: float) -> float:
        """Return the timeout for rest, in seconds; shorter after two waits without rest."""
        return min(full_s, _RESULT_S) if self._restless >= _TWICE else full_s

    def note_rest(self, for_s: float, *, rests: bool) -> None:
        """Note a wait for rest. A long successful wait restores the full timeout.

        Args:
            for_s: The duration of the wait, in seconds.
            rests: Whether the robot came to rest.
        """
        if not rests:
            self._restless += 1
        elif for_s > _RESULT_S:
            self._restless = 0

    def unanswered(self) -> frozenset[str]:
        """Return the commands whose first reply is given up."""
        return frozenset(due.name for due in self._missed if not due.result and self.given_up(due))
