"""Open connections, which a new file must open again.

A file that starts in the middle of a connection starts with OPENED and the current offsets. Earlier
bytes do not count as lost.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.file_names import utc_time

_SINCE: Final = ", since "


@dataclass(slots=True)
class _Link:
    opened: WireEvent | None = None  # None if the recording started later
    ends: dict[Direction, int | WireEvent] = field(default_factory=dict)
    """Position of each direction: an offset, or a gap of unknown length at the start."""


class OpenConnections:
    """Tracks open connections and the offset of each direction."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def __bool__(self) -> bool:
        """Whether a connection is open."""
        return bool(self._links)

    def update(self, event: WireEvent) -> None:
        """Process the next event."""
        if event.kind is Kind.OPENED:
            self._links[event.connection] = _Link(event)
        elif event.kind in (Kind.CLOSED, Kind.RESET):
            self._links.pop(event.connection, None)
        else:
            link = self._links.get(event.connection)
            if link is None:
                link = self._links[event.connection] = _Link()
            end_bytes = event.offset_bytes + (len(event.data) or max(event.length_bytes, 0))
            if end_bytes:
                link.ends[event.direction] = end_bytes
            elif event.kind is Kind.GAP:
                link.ends[event.direction] = event

    def has(self, event: WireEvent) -> bool:
        """Return whether an event has nothing new: a connection or bytes of an earlier file.

        A reader of several files of one recording skips such an event: an opening again, as
        `reopening_events` yields it, or a gap of bytes that an earlier file has.
        """
        link = self._links.get(event.connection)
        if link is None:
            return False
        if event.kind is Kind.OPENED:
            return is_reopening(event) and link.opened is not None
        if event.kind is Kind.GAP:
            known = link.ends.get(event.direction)
            end = event.offset_bytes + event.length_bytes
            return isinstance(known, int) and event.offset_bytes < end <= known
        return event.kind is Kind.BYTES and not event.data

    def reopening_events(self, time_ns: int) -> Iterator[WireEvent]:
        """Yield the events that open the current connections in a file that starts at this time.

        After each opening, every direction with traffic gets an empty BYTES event with its offset:
        a reader sees that the earlier bytes are not missing.
        """
        for name, link in self._links.items():
            if opened := link.opened:
                end = link.ends.get(opened.direction, opened)
                offset = end if isinstance(end, int) else end.offset_bytes
                yield replace(opened, time_ns=time_ns, offset_bytes=offset, note=_since(opened))
            for direction, end in link.ends.items():
                if isinstance(end, int):
                    yield WireEvent(time_ns, name, direction, Kind.BYTES, b"", end)
                else:
                    yield replace(end, time_ns=time_ns)


def is_reopening(event: WireEvent) -> bool:
    """Return whether an event opens a connection that was open before the file began."""
    return _SINCE in event.note


def _since(opened: WireEvent) -> str:
    """Return the note of a repeated opening, with the original time."""
    note = opened.note or "open"
    return f"{note}{_SINCE}{utc_time(opened.time_ns):%Y-%m-%d %H:%M:%S} UTC"
