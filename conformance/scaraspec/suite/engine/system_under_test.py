"""System under test: the interface of a controller or client for the case runner."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from scaraspec.suite.engine.connection import Connection
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer


@dataclass(frozen=True, slots=True)
class StopFailure:
    """A failure of the emergency stop of a controller, and the requirement that it violates."""

    requirement: str
    message: str
    expected: str
    observed: str


class ToleratedReading(NamedTuple):
    """A listed reading that a case has observed and that does not fail it.

    Attributes:
        requirement: The requirement that the reading concerns; empty for none.
        key: The key of the open point, or its entry in the register.
        option: The option that the subject follows.
        message: What was observed, one sentence.
    """

    requirement: str
    key: str
    option: str
    message: str


class Interference:
    """What other clients do to a subject during a run. This base class knows of none.

    A failure that another client may have caused does not count.
    """

    def begin(self) -> None:
        """Begin a case, or its repetition."""

    @property
    def suspected(self) -> bool:
        """Whether another client may have caused the failure of the running case."""
        return False

    def passed_again(self) -> None:
        """Note that the running case has failed, was suspected, and has passed when repeated."""

    def reason(self, case: str) -> str:
        """Return why a failure of this case does not count; empty if it counts."""
        del case
        return ""


class SystemUnderTest(Protocol):
    """The controller or client under test, called the subject.

    Attributes:
        observer: Observes the traffic.
        tolerated: The listed readings that the running case has observed.
        detected_readings: The readings that were detected, by key.
        survival_requirement: The requirement that the subject violates if it does not survive a
            case; empty for the first requirement of the case.
        served: For each command that the ICS calls unsupported and that was tested: whether it is
            answered.
        off: The subject was switched off and has not come back.
        notices: Sentences at the head of the results.
    """

    observer: Observer
    tolerated: list[ToleratedReading]
    detected_readings: dict[str, str]
    survival_requirement: str
    served: dict[str, bool]
    off: bool
    notices: list[str]

    @property
    def stop_failure(self) -> StopFailure | None:
        """The failure of the emergency stop; None if none was observed."""

    def report_stop_failure(self, requirement: str, message: str) -> None:
        """Note that a case has shown that the emergency stop does not work."""

    def notify(self, sentence: str) -> None:
        """Add a sentence to the head of the results."""

    @property
    def withheld(self) -> str:
        """Why a request of the running case was not sent; empty if all were sent."""

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that forgets what is detected from now on."""

    def begin_case(self) -> None:
        """Reset the state that belongs to one case: tolerated readings, withheld requests."""

    @property
    def others(self) -> Interference:
        """What other clients do to the subject."""

    @property
    def no_verdict_reason(self) -> str:
        """Why a case that raised nothing has no verdict; empty if it has one."""

    @property
    def ics(self) -> Ics:
        """The implementation conformance statement of the subject."""

    @property
    def complaints(self) -> str:
        """The end of the stderr of the subject's process; empty if the suite did not start it."""

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""

    def open(self) -> Connection:
        """Return a connection that is logged in.

        Raises:
            CaseFailed: The subject does not connect, or the login fails.
        """

    def close_lines(self) -> None:
        """Close every connection."""

    def settle(self) -> None:
        """Bring the subject to rest after a case, and check that it still responds.

        Raises:
            CaseFailed: The subject does not respond correctly.
            CaseInconclusive: The subject does not come to rest.
        """

    def revive(self) -> None:
        """Restart the subject if possible.

        Raises:
            CaseInconclusive: The restart failed.
        """
