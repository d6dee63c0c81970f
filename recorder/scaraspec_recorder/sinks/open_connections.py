"""Seams: where one file ends and another goes on with the same connections.

Law: a file that begins in the middle of a connection says so: it is opened again, with the offsets
that it had come to, and nothing of what came before counts as lost. Names of files stand here too,
for they tell when a file began.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.file_names import utc_time


@dataclass(slots=True)
class _Link:
    opened: WireEvent | None = None  # where the recording came too late for it
    ends: dict[Direction, int | WireEvent] = field(default_factory=dict)
    """Where each direction has come to: an offset, or a gap of unknown length before all."""


class OpenConnections:
    """Follows which connections are open, and how far each direction has come."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def __bool__(self) -> bool:
        """Whether any is open."""
        return bool(self._links)

    def update(self, event: WireEvent) -> None:
        """Take the next event."""
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

    def reopening_events(self, time_ns: int) -> Iterator[WireEvent]:
        """How the connections that are open begin in a file that begins at this time.

        Behind each opening stands an empty piece of every direction in which something has passed:
        it shows a reader at once that there was a beginning, and not only at the next byte.
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


def _since(opened: WireEvent) -> str:
    """The note of an opening that is told again, with the time at which it was."""
    note = opened.note or "open"
    return f"{note}, since {utc_time(opened.time_ns):%Y-%m-%d %H:%M:%S} UTC"
