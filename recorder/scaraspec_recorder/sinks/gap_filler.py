"""Mending: a gap wherever the offsets of a stream leave a hole.

Law: offsets alone tell what is missing. A file or a sink that begins in the middle of a connection
has a hole at its beginning, a damaged file has some within; nobody may take the bytes on both sides
of one for neighbours.
"""

from collections.abc import Iterator

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent


class GapFiller:
    """Follows the offsets of all streams; memory is given back when a connection ends."""

    def __init__(self) -> None:
        self._ends: dict[tuple[str, Direction], int] = {}  # -1 behind a gap of unknown length

    def fill(self, event: WireEvent) -> Iterator[WireEvent]:
        """Give the event, and before it a gap where bytes of its stream are missing."""
        if event.kind in (Kind.OPENED, Kind.CLOSED, Kind.RESET):
            for direction in Direction:
                self._ends.pop((event.connection, direction), None)
        elif event.kind in (Kind.BYTES, Kind.GAP):
            key, offset = (event.connection, event.direction), event.offset_bytes
            end = self._ends.get(key, 0)
            if 0 <= end < offset:
                note = "not in this recording"
                yield WireEvent(event.time_ns, *key, Kind.GAP, b"", end, offset - end, note)
            length = len(event.data) if event.kind is Kind.BYTES else event.length_bytes
            self._ends[key] = offset + length if length >= 0 else -1
        yield event
