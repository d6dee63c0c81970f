"""Verdicts: how one is raised, who caused it, what a run of them amounts to.

Verdicts only rise, none < pass < tolerated < inconclusive < fail < error, so the order in which
evidence arrives never matters. The cause is a field of its own and not part of the verdict. No test
is judged here and nothing is printed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from scaraspec.traffic.wire import WireRange


class Verdict(Enum):
    """What was found, from the least to the gravest."""

    NONE = "none"
    """Nothing was judged."""
    PASS = "pass"  # noqa: S105 - a verdict, not a password
    """The subject did what is required."""
    TOLERATED = "tolerated"
    """The document contradicts itself or is silent, and the subject follows a listed reading."""
    INCONCLUSIVE = "inconclusive"
    """The evidence does not suffice, for example after a gap in a recording."""
    FAIL = "fail"
    """The subject violates the requirement."""
    ERROR = "error"
    """The judging itself broke down."""


class Cause(Enum):
    """Who is responsible for a verdict that is not a pass."""

    SUBJECT = "subject"
    SET_UP = "set-up"
    """What the run needed was not in place: a program, an open link, a permission."""
    DEPENDENCY = "dependency"
    """Something this relies on had failed before."""
    SUITE = "suite"


class Reason(Enum):
    """Why a case has the verdict none or inconclusive; the values are a public interface."""

    HAZARD = "hazard"
    """Its hazard was not allowed."""
    UNDEFINED_OPCODES = "undefined-opcodes"
    """It sends undefined opcodes, which was not allowed."""
    SLOW = "slow"
    """It is slow and was not requested."""
    HOOK = "hook"
    """The ICS names no hook that it needs."""
    ENDED_BEFORE = "earlier-session"
    """An earlier session has completed it."""
    FAILED_BEFORE = "failed-before"
    """Its requirements have failed already."""
    NOT_APPLICABLE = "not-applicable"
    """The subject lacks what it tests, or the open point is read in another way."""
    DEPENDENCY = "dependency"
    """Something that it relies on has failed."""
    UNREACHABLE = "unreachable"
    """The subject cannot be used any more."""
    WITHHELD = "withheld"
    """A request that can start a motion was not sent: the emergency stop does not work."""
    STALLED = "stalled"
    """The tester's machine stalled during each attempt."""
    INTERMITTENT = "intermittent"
    """It failed in one attempt only, in which a message was missing or late."""
    OTHER_CLIENT = "other-client"
    """Another client may have caused the failure."""
    UNDECIDED = "undecided"
    """The evidence does not suffice; the message gives the reason."""
    INTERRUPTED = "interrupted"
    """The user ended the run."""
    COVERAGE = "coverage"
    """Fewer requirements were judged than the user requires."""
    NOT_RESTORED = "not-restored"
    """Something that the run has changed is left on the subject."""


class ExitStatus(IntEnum):
    """What the command line returns."""

    CONFORMANT = 0
    NONCONFORMANT = 1
    USAGE = 2
    """The arguments or the configuration were wrong."""
    INCONCLUSIVE = 3
    """The evidence does not suffice, or the command was ended or broke down."""
    NOTHING_TESTED = 4


class Conclusion(Enum):
    """The conclusion of a whole run."""

    CONFORMANT = "conformant"
    """Every requirement in scope was judged, and none is violated."""
    NO_VIOLATION = "no-violation-found"
    """Some of the requirements in scope were judged, and none is violated."""
    NONCONFORMANT = "nonconformant"
    INCONCLUSIVE = "inconclusive"
    NOTHING_TESTED = "nothing-tested"

    @property
    def exit_status(self) -> ExitStatus:
        """The exit status of a run that ends so."""
        return ExitStatus.CONFORMANT if self.good else ExitStatus[self.name]

    @property
    def good(self) -> bool:
        """Whether something was judged and nothing is wrong."""
        return self in (Conclusion.CONFORMANT, Conclusion.NO_VIOLATION)


@dataclass(frozen=True, slots=True)
class Finding:
    """A requirement judged on evidence.

    Attributes:
        requirement: Its id, for example ``"4.15/3"``.
        verdict: What was found.
        cause: Who is responsible for it.
        message: One sentence for a reader who has not seen the traffic.
        expected: What the requirement leads to expect here.
        observed: What was there instead.
        evidence: The bytes it rests on.
        reading: Where a listed reading decided: its key and the option seen.

    Raises:
        ValueError: A toleration names no reading, or a failure blames someone other than the
            subject.
    """

    requirement: str
    verdict: Verdict
    cause: Cause
    message: str
    expected: str = ""
    observed: str = ""
    evidence: tuple[WireRange, ...] = ()
    reading: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        if self.verdict is Verdict.TOLERATED and self.reading is None:
            raise ValueError(f"The toleration of {self.requirement} must name the reading it saw.")
        if self.verdict is Verdict.FAIL and self.cause is not Cause.SUBJECT:
            raise ValueError(
                f"A failure of {self.requirement} blames the subject, not the {self.cause.value}."
            )


_RANK = {verdict: rank for rank, verdict in enumerate(Verdict)}


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the gravest of the verdicts, ``Verdict.NONE`` where there are none."""
    return max(verdicts, key=_RANK.__getitem__, default=Verdict.NONE)


def conclude(counts: Mapping[Verdict, int], *, complete: bool = True) -> Conclusion:
    """Return the conclusion of a run, from the number of its cases or findings by verdict.

    A failure decides, whatever else went wrong. Without one, anything unsettled makes the run
    inconclusive. Only a run in which something was judged can be conformant.

    Args:
        counts: The number of cases or findings by verdict.
        complete: Whether every requirement in scope was judged.
    """

    def any_of(*verdicts: Verdict) -> bool:
        return any(counts.get(verdict, 0) for verdict in verdicts)

    if any_of(Verdict.FAIL):
        return Conclusion.NONCONFORMANT
    if any_of(Verdict.INCONCLUSIVE, Verdict.ERROR):
        return Conclusion.INCONCLUSIVE
    if any_of(Verdict.PASS, Verdict.TOLERATED):
        return Conclusion.CONFORMANT if complete else Conclusion.NO_VIOLATION
    return Conclusion.NOTHING_TESTED
