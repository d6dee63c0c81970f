"""Link: the interface of all kinds of links, and the ways in which a link ends.

The link stamps the time of sent and received bytes, so that a recorder needs no clock. This module
contains no implementation and does not know frames.
"""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple, Protocol


class LinkError(Exception):
    """A link cannot be opened or used; the message is one sentence for the user."""


class Ending(Enum):
    """How the peer ended its side; all bytes that it sent before have been received."""

    CLOSED = "closed"  # orderly (FIN), or the serial line has failed
    RESET = "reset"  # aborted (RST)


class Arrival(NamedTuple):
    """Received bytes (at least one) or the end, with the time in ns since the Unix epoch."""

    time_ns: int
    content: bytes | Ending


class Link(Protocol):
    """One open connection to a controller.

    One thread may send while another one receives. Close the link only after both have finished.
    Links with a simulated clock (`memory`, `simulated`) may be used by one thread only.

    Attributes:
        step_s: The maximum duration of one `receive` call if the caller must react to interrupts.
    """

    step_s: float

    @property
    def now_s(self) -> float:
        """The current time of the link's monotonic clock; deadlines refer to this clock."""

    def send(self, data: bytes) -> int:
        """Send all of `data`.

        Returns:
            The time at which sending began, in nanoseconds since the Unix epoch.

        Raises:
            LinkError: The peer has ended the link or reads no more, or the link was closed here.
        """

    def receive(self, deadline_s: float, others: Sequence["Link"] = (), /) -> Arrival | None:
        """Wait for the next bytes or the end.

        If the deadline has passed, return what has already arrived. After the end, every call
        returns the end again.

        Args:
            deadline_s: The deadline, a time of `now_s`.
            others: Open links of the same kind. The call also returns when data or the end is
                available on one of them.

        Returns:
            None if nothing has arrived on this link.

        Raises:
            LinkError: The link was closed here.
        """

    def half_close(self) -> None:
        """End the sending direction; receiving is still possible.

        Raises:
            LinkError: The peer has ended the link, or this kind of link has no half-close.
        """

    def close(self) -> None:
        """Close the link; no effect if it is already closed."""

    def reset(self) -> None:
        """Abort the link (RST) if this kind of link supports it, else close it."""
