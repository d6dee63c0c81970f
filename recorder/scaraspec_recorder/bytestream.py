"""One direction of one TCP connection: segments in any order in, bytes and gaps in order out.

Law: sequence arithmetic and nothing else. Positions count bytes, are unwrapped from 32 bits and may
be negative until the stream's start is known. When to stop waiting for a missing byte is decided by
`reassembly`; nothing here delivers a byte at an offset that is not its own.
"""

from collections.abc import Iterator
from heapq import heappop, heappush
from typing import Final

from scaraspec.judgement.wire import Kind, WireEvent
from scaraspec.protocol.direction import Direction
from scaraspec_recorder.segment import FIN, SYN, Segment

ITEM_BYTES: Final = 256  # what a held segment or event costs in memory besides its data
_MODULUS: Final = 1 << 32


class ByteStream:
    """The bytes that one endpoint sends.

    Attributes:
        connection: Name of the connection.
        direction: Set before the first event is made.
        start: Position of the stream's first byte; None while it is not known.
        next: Position of the next byte to deliver; the lowest one known while `start` is None.
        acknowledged: Position up to which the receiver has said that it has the bytes.
        last_ns: Time of the latest event; no later one is earlier.
        ended: The end (FIN) has been delivered.
        held_bytes: Memory taken by segments that wait for a missing byte.
        beginning: Why the start was not seen, in words.
    """

    def __init__(self, connection: str) -> None:
        self.connection = connection
        self.direction = Direction.A2C
        self.start: int | None = None
        self.next = 0
        self.acknowledged = 0
        self.last_ns = 0
        self.ended = False
        self.held_bytes = 0
        self.beginning = ""
        self._origin: int | None = None  # sequence number of position 0: the first one seen
        self._seen = 0  # up to here bytes passed, captured or not
        self._fin: int | None = None
        self._fin_ns = 0
        self._arrivals = 0
        self._waiting: list[tuple[int, int, int, bytes]] = []  # position, arrival, time, data

    @property
    def known_end(self) -> int:
        """Position up to which bytes are known to have been sent."""
        end = max(self.acknowledged, self._seen)
        return end if self._fin is None else min(end, self._fin)

    @property
    def offset_bytes(self) -> int:
        """Stream offset of the next byte to deliver; -1 while the start is not known."""
        return -1 if self.start is None else self.next - self.start

    @property
    def leaning(self) -> int:
        """Of the waiting segments, how many more begin with 0xAA than with 0xCC."""
        starts = [data[0] for *_, data in self._waiting]
        return starts.count(Direction.A2C.start) - starts.count(Direction.C2A.start)

    def may_begin(self, isn: int) -> bool:
        """Whether a SYN with this initial sequence number can belong to this stream."""
        if self.start is not None:
            return self._position(isn + 1) == self.start
        return self._origin is None or self._position(isn + 1) <= self.next

    def begin(self, isn: int) -> None:
        """Take the start of the stream from a SYN that `may_begin`."""
        if self.start is None:
            self.start = self.next = self._position(isn + 1)

    def acknowledge(self, ack: int) -> None:
        """The receiver has every byte before this sequence number."""
        self.acknowledged = max(self.acknowledged, self._position(ack))

    def put(self, segment: Segment) -> None:
        """Take a segment of this stream, in whatever order they were captured."""
        data, fin = segment.payload, segment.flags & FIN
        if self.ended or not (data or segment.cut_bytes or fin):
            return
        position = self._position(segment.seq + bool(segment.flags & SYN))
        if self.start is None:
            self.next = min(self.next, position)
        captured_end = position + len(data)
        end = captured_end + segment.cut_bytes
        self._seen = max(self._seen, end)
        if fin and self._fin is None:
            self._fin, self._fin_ns = end, segment.time_ns
        if data and captured_end > self.next:
            self._arrivals += 1
            self.held_bytes += len(data) + ITEM_BYTES
            heappush(self._waiting, (position, self._arrivals, segment.time_ns, data))

    def advance(self) -> Iterator[WireEvent]:
        """Deliver what now is in order. Where segments overlap, the one that begins first wins."""
        if self.start is None or self.ended:
            return
        while self._waiting and self._waiting[0][0] <= self.next:
            position, _, time_ns, data = heappop(self._waiting)
            self.held_bytes -= len(data) + ITEM_BYTES
            if fresh := data[self.next - position :]:
                yield self._event(Kind.BYTES, time_ns, data=fresh)
                self.next += len(fresh)
        if self._fin is not None and self.next >= self._fin:
            self.ended = True
            self._waiting.clear()
            self.held_bytes = 0
            yield self._event(Kind.HALF_CLOSED, self._fin_ns)

    def concede(self, limit: int, since_ns: int) -> Iterator[WireEvent]:
        """Give up the bytes missing before position `limit`: gaps take their place.

        Args:
            limit: What is missing from here on is still waited for.
            since_ns: When the first of these gaps showed.
        """
        if self.start is None:
            self.start = self.next
            yield self._event(Kind.GAP, since_ns, length_bytes=-1, note=self.beginning)
            yield from self.advance()
        while self.next < (end := min(limit, self.known_end)):
            if self._waiting:
                end = min(end, self._waiting[0][0])
            note = "not captured"
            if end == self.acknowledged > self._seen:
                note += "; the last byte may have been the end of the stream (FIN)"
            yield self._event(Kind.GAP, since_ns, length_bytes=end - self.next, note=note)
            self.next = end
            yield from self.advance()

    def _position(self, number: int) -> int:
        """Position of a sequence number: of those it may mean, the one nearest to `next`."""
        if self._origin is None:
            self._origin = number - self.next
        ahead = (number - self._origin - self.next + _MODULUS // 2) % _MODULUS - _MODULUS // 2
        return self.next + ahead

    def _event(
        self, kind: Kind, time_ns: int, *, data: bytes = b"", length_bytes: int = 0, note: str = ""
    ) -> WireEvent:
        self.last_ns = max(self.last_ns, time_ns)
        located = kind in {Kind.BYTES, Kind.GAP}
        return WireEvent(
            self.last_ns,
            self.connection,
            self.direction,
            kind,
            data,
            self.offset_bytes if located else 0,
            length_bytes,
            note,
        )
