"""Index of a capture: in which packet or message a byte of a stream begins.

Numbers are those of the file, as Wireshark counts them. Memory is bounded: of a long capture the
oldest half is dropped, so that recent evidence is found.
"""

from array import array
from bisect import bisect_right
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent, WireRange

_MAX_ENTRIES: Final = 1 << 18


class PacketIndex:
    """The offsets and packet numbers of the streams of a capture."""

    def __init__(self) -> None:
        self._streams: dict[tuple[str, Direction], tuple[array[int], array[int]]] = {}
        self._entries = 0

    def add(self, event: WireEvent) -> None:
        """Add the bytes of an event, if it has a packet number."""
        if event.kind is Kind.OPENED:
            for direction in Direction:
                self._streams.pop((event.connection, direction), None)
        if event.kind is not Kind.BYTES or not event.packet:
            return
        key = (event.connection, event.direction)
        if key not in self._streams:
            self._streams[key] = array("Q"), array("Q")
        offsets, packets = self._streams[key]
        offsets.append(event.offset_bytes)
        packets.append(event.packet)
        self._entries += 1
        if self._entries > _MAX_ENTRIES:
            self._drop_half()

    def find(self, place: WireRange) -> int:
        """Return the number of the packet with the first byte of a range; 0 if it is unknown."""
        offsets, packets = self._streams.get((place.connection, place.direction), ((), ()))
        at = bisect_right(offsets, place.offset_bytes)
        return packets[at - 1] if at else 0

    def _drop_half(self) -> None:
        for key, (offsets, packets) in list(self._streams.items()):
            half = (len(offsets) + 1) // 2
            del offsets[:half], packets[:half]
            if not offsets:
                del self._streams[key]
        self._entries = sum(len(offsets) for offsets, _ in self._streams.values())
