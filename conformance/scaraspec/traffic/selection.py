"""Selection: a part of the traffic, by time, connection and command."""

from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.direction import A2C
from scaraspec.traffic.events import (
    Exchange,
    FrameSeen,
    InvalidBytes,
    TrafficEvent,
    Transfer,
    UnsolicitedReply,
)
from scaraspec.traffic.wire import WireRange


@dataclass(frozen=True, slots=True)
class Selection:
    """The traffic events that count. The others are read, too: they change the robot's state.

    Attributes:
        since_ns: Events from this time on, in nanoseconds since the Unix epoch; None for all.
        until_ns: Events before this time; None for all.
        connection: Events of this connection; empty for all.
        commands: Events of these commands; empty for all. A file transfer belongs to
            ``upload_name`` or ``download_name``.
    """

    since_ns: int | None = None
    until_ns: int | None = None
    connection: str = ""
    commands: frozenset[str] = frozenset()

    def includes(self, event: TrafficEvent) -> bool:
        """Return whether an event is selected."""
        place = place_of(event)
        return (
            (self.since_ns is None or place.time_ns >= self.since_ns)
            and (self.until_ns is None or place.time_ns < self.until_ns)
            and self.connection in ("", place.connection)
            and (not self.commands or _command(event) in self.commands)
        )


EVERYTHING: Final = Selection()
"""All traffic."""


def place_of(event: TrafficEvent) -> WireRange:
    """Return where and when an event was: an exchange at its request, a transfer at its end."""
    match event:
        case FrameSeen() | InvalidBytes():
            return event.place
        case Exchange():
            return event.request.place
        case UnsolicitedReply():
            return event.seen.place
        case Transfer():
            connection = event.opening.request.place.connection if event.opening else ""
            return WireRange(connection, A2C, 0, 0, event.ended_ns)
        case _:
            wire = event.event
            return WireRange(wire.connection, wire.direction, wire.offset_bytes, 0, wire.time_ns)


def _command(event: TrafficEvent) -> str:
    """Return the command that an event belongs to; empty if it belongs to none."""
    match event:
        case Exchange() | FrameSeen():
            return event.name
        case UnsolicitedReply():
            return event.seen.name
        case Transfer():
            return "upload_name" if event.upload else "download_name"
        case _:
            return ""
