"""Attempts of a case: when a case is repeated, and what follows from all its attempts.

A failure must not depend on one delayed message. A failure of an attempt in which every message
came in time rests on received bytes: it is final, and the case is repeated once to report whether
it is reproducible. A failure of an attempt in which a message was missing or late must occur in two
attempts. A case that is never repeated waits longer for the message instead: a late message proves
nothing, a missing one fails the case. An attempt during which this machine stalled proves nothing,
unless it passed, or unless the subject has answered nothing since; nor does one in which a command
ended before the case could use it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from scaraspec.judge.verdicts import Cause, Reason, Verdict
from scaraspec.report.failed_step import AttemptResult
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.user_message import UserMessage

MAX_STALLED: Final = 3
"""How often a case is tried if this machine stalls each time."""

MAX_TOO_SHORT: Final = 8
"""How often a case is tried if a command ends too soon each time, which takes little time."""

_MAX_VALID: Final = 3
_CONFIRMED: Final = 2
_UNDECIDED: Final = (Verdict.FAIL, Verdict.INCONCLUSIVE)


@dataclass(frozen=True, slots=True)
class Attempt:
    """One attempt of a case.

    Attributes:
        outcome: The outcome of this attempt alone.
        violated: The requirements that the judge found violated during it, and not before.
        late: Whether a message was missing or late during it.
        delayed: Whether a message that was due came late, and the case is not repeated.
        stall_s: The longest time for which this machine stalled during it, in seconds; 0 for none.
        died: Whether the subject has answered nothing since.
    """

    outcome: Outcome
    violated: frozenset[str] = frozenset()
    late: bool = False
    delayed: bool = False
    stall_s: float = 0.0
    died: bool = False

    @property
    def valid(self) -> bool:
        """Whether the attempt counts."""
        if self.died and self.failed:
            return True
        stalled = self.stall_s and self.outcome.verdict in _UNDECIDED
        return not stalled and self.outcome.reason not in (Reason.TOO_SHORT, Reason.STALLED)

    @property
    def failed(self) -> bool:
        """Whether the case failed."""
        return self.outcome.verdict is Verdict.FAIL

    @property
    def result(self) -> AttemptResult:
        """The part of this attempt that the results contain."""
        outcome = self.outcome
        return AttemptResult(
            outcome.verdict, outcome.requirement, outcome.message, self.late, self.stall_s
        )


def needs_another(attempts: Sequence[Attempt]) -> bool:
    """Return whether a repeatable case must be tried again.

    Args:
        attempts: The attempts so far, at least one.
    """
    if not attempts[-1].valid:
        too_short = attempts[-1].outcome.reason is Reason.TOO_SHORT
        return len(attempts) < (MAX_TOO_SHORT if too_short else MAX_STALLED)
    valid = [attempt for attempt in attempts if attempt.valid]
    wrong = [attempt for attempt in valid if attempt.failed or attempt.violated]
    if not wrong:
        return False
    if len(valid) == 1:
        return True
    if not all(attempt.late for attempt in wrong if attempt.failed):
        return False
    failures = sum(attempt.failed for attempt in valid)
    return 0 < failures < _CONFIRMED and len(valid) < _MAX_VALID


def settle(attempts: Sequence[Attempt], *, repeatable: bool = True) -> Outcome:
    """Return the outcome that follows from all attempts of a case.

    Args:
        attempts: All attempts, at least one.
        repeatable: Whether a failure could be confirmed by another attempt.
    """
    outcome = _settled(attempts, repeatable=repeatable)
    if len(attempts) == 1:
        return outcome
    return replace(
        outcome,
        attempts=tuple(attempt.result for attempt in attempts),
        operator=tuple(each for attempt in attempts for each in attempt.outcome.operator),
    )


def _settled(attempts: Sequence[Attempt], *, repeatable: bool) -> Outcome:
    valid = [attempt for attempt in attempts if attempt.valid]
    if not valid:
        last = attempts[-1]
        if not last.stall_s:
            return last.outcome
        return _inconclusive(
            last.outcome,
            Reason.STALLED,
            UserMessage(
                "this machine stalled for {stall_s:.1f} s: {message}",
                stall_s=last.stall_s,
                message=last.outcome.message,
            ),
        )
    failed = [attempt for attempt in valid if attempt.failed]
    if not failed:
        return valid[-1].outcome
    confirmed = len(failed) >= _CONFIRMED or not all(attempt.late for attempt in failed)
    if confirmed or not (repeatable or failed[0].delayed):
        outcome, number = failed[0].outcome, attempts.index(failed[0]) + 1
        return replace(outcome, step=outcome.step and replace(outcome.step, attempt=number))
    return _inconclusive(
        failed[0].outcome,
        Reason.INTERMITTENT,
        UserMessage(
            "intermittent: the case failed in 1 of {count} attempts, in which a message was "
            "missing or late: {message}",
            count=len(valid),
            message=failed[0].outcome.message,
        ),
    )


def _inconclusive(outcome: Outcome, reason: Reason, message: str) -> Outcome:
    return replace(
        outcome,
        verdict=Verdict.INCONCLUSIVE,
        requirement="",
        cause=Cause.SET_UP,
        reason=reason,
        message=message,
    )
