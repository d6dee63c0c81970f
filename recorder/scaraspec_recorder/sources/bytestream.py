"""Reassembles one direction of a TCP connection: segments in, ordered bytes and gaps out.

This module contains only sequence arithmetic.
Positions count bytes, are unwrapped from 32 bits and may be
negative until the stream's start is known. `reassembly` decides when to stop waiting for a missing
byte.
"""

from collections import deque
from collections.abc import Iterator
from heapq import heappop, heappush
from typing import Final, NamedTuple

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.tcp_segment import FIN, SYN, Segment

ITEM_BYTES: Final = 256  # memory of a held segment or event in addition to its data
_MODULUS: Final = 1 << 32
_COMPARED_BYTES: Final = 1 << 13  # of delivered bytes, to compare repeated ones
_FAR_BYTES: Final = 1 << 24  # more than a capture loses at a time

NO_POSITION: Final = -(1 << 63)
"""A position before all others."""


class PacketTime(NamedTuple):
    """Time of an event: by the clock of the capture, then by the packet number.

    Attributes:
        time_ns: Nanoseconds since the Unix epoch.
        number: Three times the number of the segment; the two numbers before it are just before it.
        packet: Number of the packet in the capture; 0 if unknown.
    """

    time_ns: int
    number: int
    packet: int = 0


class OrderedEvent(NamedTuple):
    """An event of a stream, in the order of the stream.

    Attributes:
        at: Its time.
        acknowledged_peer: Position of the other stream that the sender had acknowledged.
        end: Position of this stream after the event.
        event: The event.
    """

    at: PacketTime
    acknowledged_peer: int
    end: int
    event: WireEvent


class ByteStream:
    """The byte stream that one endpoint sends.

    Attributes:
        connection: Name of the connection.
        direction: Set before the first event is made.
        start: Position of the stream's first byte; None while it is unknown.
        next: Position of the next byte to deliver; the lowest known one while `start` is None.
        acknowledged: Position up to which the receiver has acknowledged the bytes.
        last: Time of the latest event; later events do not have an earlier time.
        ready: Events in order that are not released yet.
        released: Position up to which events have been released.
        ended: The end (FIN) has been delivered.
        held_bytes: Memory of the segments that wait for a missing byte.
        missing_start_note: Why the start was not captured.
        acknowledges: Whether the sender has sent a segment without data after its first data.
        used_corrupt: Number of corrupt segments that were used, because no other copy was captured.
        conflict: Position and length of the last repeated bytes that differ from the first copy;
            the reader sets it to None.
    """

    def __init__(self, connection: str) -> None:
        self.connection = connection
        self.direction = Direction.A2C
        self.start: int | None = None
        self.next = 0
        self.acknowledged = 0
        self.last = PacketTime(0, 0)
        self.ready: deque[OrderedEvent] = deque()
        self.released = NO_POSITION
        self.ended = False
        self.held_bytes = 0
        self.missing_start_note = ""
        self._origin: int | None = None  # sequence number of position 0: the first one seen
        self._far: int | None = None  # position of the last number that was far away
        self._seen = 0  # position up to which bytes were sent, captured or not
        self._fin: int | None = None
        self._fin_at = self.last
        self.acknowledges = False
        self.used_corrupt = 0
        self.conflict: tuple[int, int] | None = None
        self._delivered = bytearray()  # the last bytes before `next`, and some before them
        self._ends: deque[tuple[int, PacketTime]] = deque()  # each known end after `next`, and when
        self._corrupt: dict[int, tuple[PacketTime, int, bytes]] = {}  # by position, as in _waiting
        self._waiting: list[
            tuple[int, PacketTime, int, bytes]
        ] = []  # position, time, acknowledged_peer, data

    @property
    def known_end(self) -> int:
        """Position up to which bytes are known to have been sent."""
        end = max(self.acknowledged, self._seen)
        return end if self._fin is None else min(end, self._fin)

    @property
    def queued_end(self) -> int:
        """Position after the events that were delivered; the end (FIN) occupies one position."""
        return self.next + self.ended

    @property
    def offset_bytes(self) -> int:
        """Stream offset of the next byte to deliver; -1 while the start is unknown."""
        return -1 if self.start is None else self.next - self.start

    @property
    def start_byte_balance(self) -> int:
        """Number of waiting segments that begin with 0xAA, minus those that begin with 0xCC."""
        starts = [data[0] for *_, data in self._waiting]
        return starts.count(Direction.A2C.start) - starts.count(Direction.C2A.start)

    def may_begin(self, isn: int) -> bool:
        """Whether a SYN with this initial sequence number can belong to this stream."""
        if self.start is not None:
            return self._position(isn + 1) == self.start
        return self._origin is None or self._position(isn + 1) <= self.next

    def begin(self, isn: int) -> None:
        """Set the start of the stream from a SYN that `may_begin` accepts."""
        if self.start is None:
            self.start = self.next = self.released = self._position(isn + 1)

    def is_far(self, number: int) -> bool:
        """Whether a sequence or acknowledgment number is far outside the window.

        If the stream continues there, a longer part of it was not captured: the next number after a
        far one is not far, if no near one is between them.
        """
        if self._origin is None:
            return False
        position = self._position(number)
        distance = position - max(self.known_end, self.next)
        if self.start is None:
            distance = max(distance, self.next - position)
        if distance <= _FAR_BYTES:
            self._far = None
            return False
        before, self._far = self._far, position
        return before is None or not 0 < position - before <= _FAR_BYTES

    def continues_at(self, number: int) -> bool:
        """Whether a segment with this sequence number continues the stream, and no end was sent."""
        return (
            self.start is not None
            and self._fin is None
            and self._far is None
            and self.conflict is None
            and self._origin is not None
            and (number - self._origin - self.next) % _MODULUS == 0
        )

    def delivered_up_to(self, ack: int) -> int | None:
        """Return the position of an acknowledgment; None if not every byte before was delivered."""
        if self.start is None or self._far is not None:
            return None
        position = self._position(ack)
        return position if position <= self.next else None

    def append(self, data: bytes, at: PacketTime) -> WireEvent:
        """Deliver bytes that continue the stream, while none is missing.

        Returns:
            Their event, which is released.
        """
        self.last = max(self.last, at)
        fields = (self.last.time_ns, self.connection, self.direction, Kind.BYTES)
        event = WireEvent(*fields, data, self.offset_bytes, packet=at.packet)
        self._seen = self.released = self.next = self.next + len(data)
        self._keep(data)
        return event

    def _keep(self, data: bytes) -> None:
        """Keep delivered bytes for comparison."""
        self._delivered += data
        if len(self._delivered) > 2 * _COMPARED_BYTES:
            del self._delivered[:-_COMPARED_BYTES]

    def note_acknowledgment(self) -> None:
        """Note a segment without data from this sender, while no byte is missing."""
        self.acknowledges |= self.start is not None and self.next > self.start

    def would_acknowledge(self, ack: int) -> bool:
        """Whether an acknowledgment is the first one for the last bytes of this stream."""
        if self.start is None or self.ended:
            return False
        return self.acknowledged < self._seen == self._position(ack)

    def acknowledge(self, ack: int) -> int:
        """Process an acknowledgment: the receiver has every byte before it. Return its position."""
        position = self._position(ack)
        self.acknowledged = max(self.acknowledged, position)
        return position

    def note_end(self, at: PacketTime) -> None:
        """Note when bytes up to `known_end` were sent at the latest, while bytes are missing."""
        self._drop_ends()
        if self.known_end > (self._ends[-1][0] if self._ends else self.next):
            self._ends.append((self.known_end, at))

    def put(self, segment: Segment, at: PacketTime, acknowledged_peer: int) -> None:
        """Add a segment of this stream. Segments may be captured in any order.

        Args:
            segment: The segment.
            at: When it was captured.
            acknowledged_peer: Position of the other stream that the segment acknowledges.
        """
        data, fin = segment.payload, segment.flags & FIN
        if self.ended or not (data or segment.cut_bytes or fin):
            self.acknowledges |= self.start is not None and self.next > self.start
            return
        position = self._position(segment.seq + bool(segment.flags & SYN))
        if self.start is None:
            self.next = min(self.next, position)
        captured_end = position + len(data)
        end = captured_end + segment.cut_bytes
        self._seen = max(self._seen, end)
        if fin and self._fin is None:
            self._fin, self._fin_at = end, at
        if segment.corrupt and captured_end > self.next:
            if position not in self._corrupt:
                self.held_bytes += len(data) + ITEM_BYTES
                self._corrupt[position] = (at, acknowledged_peer, data)
        elif not segment.corrupt and data and captured_end <= self.next:
            self._compare(position, data)
        elif data and captured_end > self.next:
            self.held_bytes += len(data) + ITEM_BYTES
            heappush(self._waiting, (position, at, acknowledged_peer, data))

    def advance(self) -> Iterator[OrderedEvent]:
        """Yield the events that are now in order. If segments overlap, the earlier start wins."""
        if self.start is None or self.ended:
            return
        while self._waiting and self._waiting[0][0] <= self.next:
            position, at, acknowledged_peer, data = heappop(self._waiting)
            self.held_bytes -= len(data) + ITEM_BYTES
            self._compare(position, data[: self.next - position])
            if fresh := data[self.next - position :]:
                end = self.next + len(fresh)
                yield self._ready(Kind.BYTES, at, end, acknowledged_peer, data=fresh)
                self.next = end
                self._keep(fresh)
        self._drop_corrupt()
        if self._fin is not None and self.next >= self._fin:
            self.ended = True
            self._waiting.clear()
            self._corrupt.clear()
            self.held_bytes = 0
            yield self._ready(Kind.HALF_CLOSED, self._fin_at, self.queued_end)

    def uncertainty(self, at: PacketTime, note: str) -> OrderedEvent:
        """Return a gap of zero bytes: no byte is missing, but earlier traffic is not reliable."""
        return self._ready(Kind.GAP, at, self.next, note=note)

    def give_up_missing(self, limit: int, since: PacketTime) -> Iterator[OrderedEvent]:
        """Replace the bytes missing before position `limit` by gaps.

        Bytes that were sent at different times are different gaps: the other side may have sent
        between them.

        Args:
            limit: Position up to which missing bytes are given up.
            since: When the first of these gaps was detected.
        """
        if self.start is None:
            self.start = self.next
            yield self._ready(
                Kind.GAP, since, self.next, length_bytes=-1, note=self.missing_start_note
            )
            yield from self.advance()
        while self.next < (end := min(limit, self.known_end)):
            if self._use_corrupt():
                yield from self.advance()
                continue
            if self._corrupt:
                end = min(end, *self._corrupt)
            if self._waiting:
                end = min(end, self._waiting[0][0])
            self._drop_ends()
            if self._ends:
                end, since = min(end, self._ends[0][0]), max(since, self._ends[0][1])
            note = "not captured"
            if end == self.acknowledged > self._seen:
                note += "; the last byte may have been the end of the stream (FIN)"
            yield self._ready(Kind.GAP, since, end, length_bytes=end - self.next, note=note)
            self.next = end
            self._delivered.clear()
            yield from self.advance()

    def _compare(self, position: int, data: bytes) -> None:
        """Compare repeated bytes with those that were delivered, as far as these are kept."""
        if len(data) == 1 and position == self.next - 1:
            return  # a keep-alive, whose byte has no meaning
        delivered = self._delivered[-_COMPARED_BYTES:]
        first = self.next - len(delivered)
        data, position = data[max(first - position, 0) :], max(position, first)
        kept = delivered[position - first :][: len(data)]
        if kept != data[: len(kept)]:
            self.conflict = (position, len(kept))

    def _use_corrupt(self) -> bool:
        """Take a corrupt segment with the next byte as a copy, if there is one."""
        found = [p for p, (_, _, data) in self._corrupt.items() if p <= self.next < p + len(data)]
        if not found:
            return False
        at, acknowledged_peer, data = self._corrupt.pop(found[0])
        self.used_corrupt += 1
        heappush(self._waiting, (found[0], at, acknowledged_peer, data))
        return True

    def _drop_ends(self) -> None:
        """Drop the noted ends before the next byte."""
        while self._ends and self._ends[0][0] <= self.next:
            self._ends.popleft()

    def _drop_corrupt(self) -> None:
        """Drop the corrupt segments of which another copy was captured."""
        for position, (_, _, data) in list(self._corrupt.items()):
            if position + len(data) <= self.next:
                del self._corrupt[position]
                self.held_bytes -= len(data) + ITEM_BYTES

    def _position(self, number: int) -> int:
        """Return the position of a sequence number: the one that is nearest to `next`."""
        if self._origin is None:
            self._origin = number - self.next
        ahead = (number - self._origin - self.next + _MODULUS // 2) % _MODULUS - _MODULUS // 2
        return self.next + ahead

    def _ready(  # noqa: PLR0913 - the fields of an event
        self,
        kind: Kind,
        at: PacketTime,
        end: int,
        acknowledged_peer: int = NO_POSITION,
        *,
        data: bytes = b"",
        length_bytes: int = 0,
        note: str = "",
    ) -> OrderedEvent:
        self.last = max(self.last, at)
        offset_bytes = 0 if kind is Kind.HALF_CLOSED else self.offset_bytes
        fields = (self.last.time_ns, self.connection, self.direction, kind)
        event = WireEvent(*fields, data, offset_bytes, length_bytes, note, packet=at.packet)
        return OrderedEvent(self.last, acknowledged_peer, end, event)
