"""Wait budget: how long the failing cases of a run may wait for replies that never come.

Otherwise a subject that never sends something would make a run much longer than a good one. The
budget changes no wait during a case, so it causes neither a failure nor a pass.
"""

from typing import Final

from scaraspec.judge.verdicts import Verdict
from scaraspec.suite.engine.outcome import Outcome

_TIMES: Final = 4.0
_LEAST_S: Final = 60.0


class WaitBudget:
    """Four times the duration of the passing cases so far, plus a minute."""

    def __init__(self) -> None:
        self._passed_s = self._spent_s = 0.0
        self._used_up = False
        self._failed: dict[str, str] = {}

    def begin_case(self) -> None:
        """Begin a case: all its attempts have the same budget."""
        self._used_up = self._spent_s > _TIMES * self._passed_s + _LEAST_S

    def end_case(self, outcome: Outcome, for_s: float, *, late: bool) -> None:
        """Record the end of a case.

        Args:
            outcome: Its outcome.
            for_s: The duration of all its attempts, in seconds.
            late: Whether a message was missing or late.
        """
        if outcome.verdict in (Verdict.PASS, Verdict.TOLERATED):
            self._passed_s += for_s
        elif outcome.verdict is Verdict.FAIL and late:
            self._spent_s += for_s
            self._failed.setdefault(outcome.requirement, outcome.case.id)

    def dependency(self, requirement: str) -> str:
        """Return the case that failed this requirement if the budget is used up; else ``""``."""
        return self._failed.get(requirement, "") if self._used_up else ""
