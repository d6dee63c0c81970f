"""Party: what the bracket asks of whoever is under test, controller or client."""

from typing import Protocol

from scaraspec.suite.observer import Observer
from scaraspec.suite.statement import Statement
from scaraspec.suite.wire import Wire


class Party(Protocol):
    """A subject.

    Attributes:
        observer: Watches everything.
        tolerated: What the running case saw of listed readings: requirement, key, option, sentence.
        found: The readings that were found out, by key.
        survival: The requirement that it violates by not surviving a case; empty for the case's.
        off: It was switched off, and has not come back.
        notices: What the reader of the results must know first.
    """

    observer: Observer
    tolerated: list[tuple[str, str, str, str]]
    found: dict[str, str]
    survival: str
    off: bool
    notices: list[str]

    @property
    def untried(self) -> str:
        """Why a case that raised nothing has found out nothing; empty where it has."""

    @property
    def statement(self) -> Statement:
        """What it claims."""

    @property
    def complaints(self) -> str:
        """The end of what its process complained of."""

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""

    def open(self) -> Wire:
        """A connection on which somebody is logged in.

        Raises:
            Unmet: There is none to be had.
        """

    def close_lines(self) -> None:
        """End every connection."""

    def settle(self) -> None:
        """Bring it back to rest, and show that it is alive.

        Raises:
            Unmet: It is not.
            Undecided: It does not come to rest.
        """

    def revive(self) -> None:
        """Start it anew, where that can be done.

        Raises:
            Undecided: It failed.
        """
