"""Link: what every carrier offers its user, and what can be told of its end.

No carrier is met here, and no frame. Times are stamped by the link, so that whoever records needs
no clock of its own.
"""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple, Protocol


class LinkError(Exception):
    """A link cannot be opened or used; the text is one sentence for a user."""


class Ending(Enum):
    """How the peer ended what it sends; what it had sent before has been received."""

    CLOSED = "closed"  # in order (FIN), or the line is gone
    RESET = "reset"  # cut off (RST)


class Arrival(NamedTuple):
    """Bytes, never none of them, or the end; and when, in nanoseconds since the Unix epoch."""

    time_ns: int
    content: bytes | Ending


class Link(Protocol):
    """One open connection to a controller.

    One thread may send while another one receives; whatever ends the link waits for both. Where
    time passes only in whoever waits (`memory`), all is for one thread.

    Attributes:
        step_s: For how long somebody who may be interrupted should wait at once.
    """

    step_s: float

    @property
    def now_s(self) -> float:
        """The present instant on the link's own monotonic clock, which deadlines refer to."""

    def send(self, data: bytes) -> int:
        """Send all of `data`.

        Returns:
            When sending began, in nanoseconds since the Unix epoch.

        Raises:
            LinkError: The peer has ended the link or takes no more, or it was closed here.
        """

    def receive(self, deadline_s: float, others: Sequence["Link"] = (), /) -> Arrival | None:
        """Wait for the next bytes or the end; None if nothing came by `deadline_s`.

        A deadline that has passed takes what is there already. The end is told again and again.

        Args:
            deadline_s: Until when to wait.
            others: Open links of the same carrier: the waiting ends when anything is there to be
                received on one of them, too.

        Raises:
            LinkError: The link was closed here.
        """

    def half_close(self) -> None:
        """Send no more, but go on receiving.

        Raises:
            LinkError: The peer has ended the link, or this carrier has no such thing.
        """

    def close(self) -> None:
        """End the link in order; nothing if it has been closed already."""

    def reset(self) -> None:
        """Cut the link off (RST) where the carrier can, else close it."""
