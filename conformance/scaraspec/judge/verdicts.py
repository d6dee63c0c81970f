"""Verdicts: their order, their cause, and the conclusion of a run.

Verdicts only rise, none < pass < tolerated < inconclusive < fail < error, so the order of the
evidence does not matter. The cause is a separate field and not part of the verdict.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from scaraspec.traffic.wire import WireRange


class Verdict(Enum):
    """The verdicts, from the least to the most severe."""

    NONE = "none"
    """Nothing was judged."""
    PASS = "pass"  # noqa: S105 - a verdict, not a password
    """The SUT did what is required."""
    TOLERATED = "tolerated"
    """The document contradicts itself or is silent, and the SUT follows a listed reading."""
    INCONCLUSIVE = "inconclusive"
    """The evidence does not suffice, for example after a gap in a recording."""
    FAIL = "fail"
    """The SUT violates the requirement."""
    ERROR = "error"
    """The suite or the judge itself failed."""


class Cause(Enum):
    """Who is responsible for a verdict that is not a pass."""

    SUBJECT = "subject"
    SET_UP = "set-up"
    """A prerequisite was missing: a program, an open link, a permission."""
    DEPENDENCY = "dependency"
    """A dependency had failed before."""
    SUITE = "suite"


class Side(Enum):
    """What a finding is about; the values are a public interface."""

    CLIENT = "client"
    CONTROLLER = "controller"
    NETWORK = "network"
    """The link, or a fault that was injected into it."""
    RECORDING = "recording"
    """Bytes are missing in the recording, or are not reliable."""


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
    FAIL_FAST = "fail-fast"
    """A case had failed, and the run was to end then."""
    NOT_APPLICABLE = "not-applicable"
    """The SUT does not support it, or follows another reading of the open point."""
    TOO_SHORT = "too-short"
    """In each attempt, a command ended before the case could use it."""
    DEPENDENCY = "dependency"
    """A dependency has failed."""
    UNREACHABLE = "unreachable"
    """The SUT cannot be used any more."""
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
    """The exit status of a command."""

    CONFORMANT = 0
    NONCONFORMANT = 1
    USAGE = 2
    """The arguments or the configuration were wrong."""
    INCONCLUSIVE = 3
    """The evidence does not suffice, or the command was interrupted or failed."""
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
        """The exit status of a run with this conclusion."""
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
        verdict: The verdict.
        cause: What is responsible for it.
        message: One sentence that is clear without the traffic.
        expected: The expected value.
        observed: The observed value.
        evidence: The bytes that prove it.
        reading: If a listed reading decided: its key and the observed option.
        side: What it is about; None for both sides.

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
    side: Side | None = None

    def __post_init__(self) -> None:
        if self.verdict is Verdict.TOLERATED and self.reading is None:
            raise ValueError(f"The toleration of {self.requirement} must name the reading it saw.")
        if self.verdict is Verdict.FAIL and self.cause is not Cause.SUBJECT:
            raise ValueError(
                f"A failure of {self.requirement} blames the subject, not the {self.cause.value}."
            )


_RANK = {verdict: rank for rank, verdict in enumerate(Verdict)}


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the most severe verdict, ``Verdict.NONE`` if there are none."""
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
