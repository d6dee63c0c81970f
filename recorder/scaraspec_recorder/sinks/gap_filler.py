"""Inserts a gap event wherever the offsets of a stream have a hole.

A file or sink that starts in the middle of a connection has a hole at its start; a damaged file has
holes inside. The bytes on both sides of a hole must not be treated as consecutive.
"""

from collections.abc import Sequence
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import EARLIER_FILE, Kind, WireEvent

NOT_RECORDED: Final = "not in this recording"
"""Note of the gaps that are lost."""


class GapFiller:
    """Tracks the offsets of all streams; memory is freed when a connection ends."""

    def __init__(self) -> None:
        self._ends: dict[tuple[str, Direction], int] = {}  # -1 after a gap of unknown length

    def fill(self, event: WireEvent) -> Sequence[WireEvent]:
        """Return the event, and a gap before it if bytes of its stream are missing."""
        filled = [event]
        if event.kind in (Kind.OPENED, Kind.CLOSED, Kind.RESET):
            for direction in Direction:
                self._ends.pop((event.connection, direction), None)
        elif event.kind in (Kind.BYTES, Kind.GAP):
            key, offset = (event.connection, event.direction), event.offset_bytes
            end = self._ends.get(key, 0)
            if 0 <= end < offset:
                # A new file of a recording begins with the offsets of the open connections.
                reopened = event.kind is Kind.BYTES and not event.data
                note = EARLIER_FILE if reopened else NOT_RECORDED
                gap = WireEvent(event.time_ns, *key, Kind.GAP, b"", end, offset - end, note)
                filled.insert(0, gap)
            length = len(event.data) if event.kind is Kind.BYTES else event.length_bytes
            self._ends[key] = offset + length if length >= 0 else -1
        return filled
