"""System under test: the interface of a controller or client for the case runner."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from scaraspec.suite.engine.connection import Connection
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.observer import Observer


@dataclass(frozen=True, slots=True)
class StopFailure:
    """What is wrong with a controller's emergency stop, and which requirement says so."""

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
    """What other clients do to a subject during a run: nothing is known of it.

    A failure that another client may have caused does not count.
    """

    def begin(self) -> None:
        """A case begins, or is repeated."""

    @property
    def suspected(self) -> bool:
        """Whether another client may have caused the failure of the running case."""
        return False

    def passed_again(self) -> None:
        """The running case has failed and was suspected, and has passed when it was repeated."""

    def reason(self, case: str) -> str:
        """Why a failure of this case does not count; empty if it does."""
        del case
        return ""


class SystemUnderTest(Protocol):
    """A subject.

    Attributes:
        observer: Watches everything.
        tolerated: The listed readings that the running case has observed.
        found: The readings that were found out, by key.
        survival: The requirement that it violates by not surviving a case; empty for the case's.
        off: It was switched off, and has not come back.
        notices: What the reader of the results must know first.
    """

    observer: Observer
    tolerated: list[ToleratedReading]
    found: dict[str, str]
    survival: str
    off: bool
    notices: list[str]

    @property
    def stop_failure(self) -> StopFailure | None:
        """What is wrong with the emergency stop; None as long as nothing is."""

    def stop_has_failed(self, requirement: str, message: str) -> None:
        """A case has found that the emergency stop does not work."""

    def notify(self, sentence: str) -> None:
        """Say what the reader of the results must know first."""

    @property
    def withheld(self) -> str:
        """Why a request of the running case was not sent; empty if all were."""

    def begin_case(self) -> None:
        """A case begins: nothing was tolerated or withheld in it."""

    @property
    def others(self) -> Interference:
        """What other clients do to it."""

    @property
    def untried(self) -> str:
        """Why a case that raised nothing has found out nothing; empty where it has."""

    @property
    def ics(self) -> Ics:
        """What it claims."""

    @property
    def complaints(self) -> str:
        """The end of what its process complained of."""

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""

    def open(self) -> Connection:
        """A connection with a login.

        Raises:
            CaseFailed: There is none to be had.
        """

    def close_lines(self) -> None:
        """End every connection."""

    def settle(self) -> None:
        """Bring it back to rest, and show that it is alive.

        Raises:
            CaseFailed: It is not.
            CaseInconclusive: It does not come to rest.
        """

    def revive(self) -> None:
        """Restart it, if possible.

        Raises:
            CaseInconclusive: It failed.
        """
