"""Reassembles TCP segments of any number of connections into wire events in order of time.

No I/O, bounded memory, no guesses. A byte is delivered once, at its own offset. A byte that was
sent but not captured becomes part of a gap, but only when it cannot arrive any more:

- The receiver acknowledged it, and it is not among the next `Limits.late_segments` segments (a
  capture may swap packets, so that an acknowledgment precedes its data).
- The connection was reset, its ports were reused, or the capture ended.
- What waits for it takes more memory than `Limits.held_bytes`.

Until then, all later events wait, including those of other connections: a reply is never delivered
before its request, even if that request is lost.

If the capture's clock is set back, event times stay constant and continue from there. A gap of zero
bytes marks that earlier traffic must not cause failures.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sources.bytestream import (
    ITEM_BYTES,
    NO_POSITION,
    ByteStream,
    OrderedEvent,
    PacketTime,
)
from scaraspec_recorder.tcp_segment import ACK, RST, SYN, Endpoint, Segment

STEP_NS: Final = 1_000_000_000
"""By how much times fall where the capture's clock was set back; packets are swapped by less."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of waiting for missing bytes.

    Attributes:
        late_segments: By how many segments a packet may stand too late in the capture.
        held_bytes: Memory for what waits, of all connections together.
        connections: How many connections are followed at once; beyond it the one that was silent
            for longest is given up.
    """

    late_segments: int = 256
    held_bytes: int = 16 << 20
    connections: int = 4096


@dataclass(eq=False, slots=True)
class _Connection:
    """Two streams and what concerns both."""

    name: str
    ends: tuple[Endpoint, Endpoint]
    streams: tuple[ByteStream, ByteStream]  # what ends[0] sends, what ends[1] sends
    oriented: bool = False  # who is the controller is settled
    under_way: bool = False  # something other than the opening handshake was seen
    reset: tuple[ByteStream, PacketTime] | None = None  # whose RST, and when
    over: bool = False
    counted_bytes: int = 0  # what it adds to the memory in use

    def is_missing(self, stream: ByteStream) -> bool:
        """Whether bytes of `stream` passed that have not been captured so far."""
        if stream.start is None:
            return self.under_way
        return stream.next < stream.known_end

    def peer_of(self, stream: ByteStream) -> ByteStream:
        """The other direction's stream."""
        a, b = self.streams
        return b if stream is a else a

    def orient(self, controller: Endpoint) -> str:
        """Name the directions.

        Returns:
            Both addresses, client first.
        """
        self.oriented = True
        at = self.ends.index(controller)
        self.streams[at].direction, self.streams[1 - at].direction = Direction.C2A, Direction.A2C
        return f"{self.ends[1 - at]} → {controller}"


@dataclass(eq=False, slots=True)
class _Hole:
    """Missing bytes at the front of a stream, while they are waited for."""

    connection: _Connection
    stream: ByteStream
    offset_bytes: int
    since: PacketTime
    proof: int = 0  # once proven: position before which nothing will be sent again
    proven_at: int = 0  # number of the segment that proved it


class Reassembler:
    """Reassembles TCP connections and names them "1", "2", … in the order of their appearance.

    A connection appears with a SYN or, where the capture came late, with its first payload. The
    controller is the end that the SYN went to; else the end with one of `ports`, where only one
    has; else the end whose peer's segments begin with 0xAA more often than with 0xCC (clause 3,
    L92-94); else the end with the lower port.

    Args:
        ports: Connections with none of these ports are ignored; None ignores no connection.
        limits: How long and how much to wait.

    Attributes:
        connections: How many connections have appeared.
        clock_steps: How often the capture's clock was set back.
    """

    def __init__(
        self, ports: Collection[int] | None = (DEFAULT_PORT,), limits: Limits | None = None
    ) -> None:
        self.connections = 0
        self.clock_steps = 0
        self._ports = ports
        self._limits = limits or Limits()
        self._received = 0
        self._serial = 0
        self._latest_ns = 0
        self._clock_offset_ns = 0  # by how much the capture's clock was set back, in all
        self._released_ns = 0
        self._held_bytes = 0
        self._followed: dict[tuple[Endpoint, Endpoint], _Connection] = {}  # silent ones first
        self._holes: dict[ByteStream, _Hole] = {}
        self._ages: list[
            tuple[PacketTime, int, _Hole]
        ] = []  # of holes, also of some that are filled
        self._proven: dict[ByteStream, _Hole] = {}  # first proven first
        self._queue: list[
            tuple[PacketTime, int, ByteStream, ByteStream]
        ] = []  # whose event, its peer

    def receive(self, segment: Segment) -> list[WireEvent]:
        """Take the next segment of the capture.

        Args:
            segment: In the order of the capture, which need not be that of sending.

        Returns:
            The events that no later segment can precede. Their times never fall: the time of bytes
            is that of the segment which completed them.
        """
        self._received += 1
        connection = self._connection_of(segment)
        if connection is not None:
            steps = self.clock_steps
            segment = self._on_one_clock(segment)
            if self.clock_steps > steps:
                self._report_clock_step(connection, segment)
            self._take(connection, segment)
        return self._settle()

    def _on_one_clock(self, segment: Segment) -> Segment:
        """The segment at a time that does not fall far; where it has none, at the latest one."""
        time_ns = segment.time_ns + self._clock_offset_ns if segment.time_ns else self._latest_ns
        back_ns = self._latest_ns - time_ns
        if back_ns > STEP_NS:
            self.clock_steps += 1
            self._clock_offset_ns += back_ns
            time_ns = self._latest_ns
        self._latest_ns = max(self._latest_ns, time_ns)
        return segment if time_ns == segment.time_ns else segment._replace(time_ns=time_ns)

    def _report_clock_step(self, connection: _Connection, segment: Segment) -> None:
        stream = connection.streams[connection.ends.index(segment.src)]
        if stream.start is not None:
            at = PacketTime(segment.time_ns, 3 * self._received - 2)
            self._enqueue(
                connection, stream, [stream.uncertainty(at, "the capture's clock went back")]
            )

    def follows(self, segment: Segment) -> bool:
        """Whether the segment's ports are of interest; `receive` passes over others."""
        ports = self._ports
        return ports is None or segment.src.port in ports or segment.dst.port in ports

    def finish(self) -> list[WireEvent]:
        """The capture has ended: what is missing stays missing.

        Returns:
            The remaining events.
        """
        for connection in self._followed.values():
            self._give_up(connection)
        self._followed.clear()
        return self._release()

    def _connection_of(self, segment: Segment) -> _Connection | None:
        src, dst = segment.src, segment.dst
        if not self.follows(segment):
            return None
        ends = (src, dst) if src < dst else (dst, src)
        connection = self._followed.pop(ends, None)
        opens = segment.flags & SYN
        if connection and opens:
            sender = connection.streams[ends.index(src)]
            if not sender.may_begin(segment.seq):  # the same ports, reused
                self._give_up(connection)
                connection = None
        if connection is None:
            carries = segment.payload or segment.cut_bytes
            if not opens and (not carries or segment.flags & RST):
                return None  # the rest of a connection that is over, or a sign of life
            self.connections += 1
            name = str(self.connections)
            connection = _Connection(name, ends, (ByteStream(name), ByteStream(name)))
            if len(self._followed) >= self._limits.connections:
                self._give_up(self._followed.pop(next(iter(self._followed))))
        self._followed[ends] = connection
        return None if connection.over else connection

    def _take(self, connection: _Connection, segment: Segment) -> None:
        at = connection.ends.index(segment.src)
        sender, receiver = connection.streams[at], connection.streams[1 - at]
        now = PacketTime(segment.time_ns, 3 * self._received)
        heard_at, sent_at = (PacketTime(segment.time_ns, now.number - n) for n in (2, 1))
        if segment.flags & SYN:
            self._open(connection, segment, sender, receiver, now)
        heard = receiver.acknowledge(segment.ack) if segment.flags & ACK else NO_POSITION
        if segment.flags & RST:
            connection.reset = connection.reset or (sender, now)
        elif not segment.flags & SYN:
            connection.under_way = True
        # The receiver first: what it lost, it lost before this segment answered it.
        self._progress(connection, receiver, heard_at)
        if not segment.flags & RST:  # the payload of a RST is a diagnostic text
            sender.put(segment, now, heard)
        self._progress(connection, sender, sent_at)
        self._conclude(connection)

    def _open(
        self,
        connection: _Connection,
        segment: Segment,
        sender: ByteStream,
        receiver: ByteStream,
        now: PacketTime,
    ) -> None:
        """A SYN, first or repeated, or the answer to one."""
        sender.begin(segment.seq)
        answers = segment.flags & ACK
        if answers and receiver.may_begin(segment.ack - 1):
            receiver.begin(segment.ack - 1)
        if connection.oriented:
            return
        note = connection.orient(segment.src if answers else segment.dst)
        opener = receiver if answers else sender
        for stream in connection.streams:
            stream.last = max(stream.last, now)
            stream.missing_start_note = "the answer to the SYN was not captured"
        self._mark(connection, opener, Kind.OPENED, opener.last, note)

    def _progress(self, connection: _Connection, stream: ByteStream, now: PacketTime) -> None:
        """Deliver what is in order, and watch what is missing."""
        self._enqueue(connection, stream, stream.advance())
        missing = connection.is_missing(stream)
        hole = self._holes.get(stream)
        if hole and (not missing or hole.offset_bytes != stream.offset_bytes):
            self._forget(stream)
            hole = None
        if not missing:
            return
        if hole is None:
            hole = self._holes[stream] = _Hole(connection, stream, stream.offset_bytes, now)
            self._schedule(hole)
        elif now < hole.since:  # an older packet reports it later
            hole.since = now
            self._schedule(hole)
        if stream not in self._proven:
            if connection.reset:
                hole.proof = stream.known_end
            elif stream.start is None or stream.acknowledged > stream.next:
                hole.proof = stream.acknowledged
            else:
                return
            hole.proven_at = self._received
            self._proven[stream] = hole

    def _conclude(self, connection: _Connection) -> None:
        """Tell the end of the connection once nothing before it is missing, and count memory."""
        a, b = connection.streams
        if not (connection.over or connection.is_missing(a) or connection.is_missing(b)):
            if a.ended and b.ended:
                self._end(connection, Kind.CLOSED, max(a, b, key=lambda stream: stream.last))
            elif connection.reset:
                cutter, at = connection.reset
                cutter.last = max(cutter.last, at)
                note = "the connection was refused" if cutter.start is None else ""
                self._end(connection, Kind.RESET, cutter, note)
        self._held_bytes += a.held_bytes + b.held_bytes - connection.counted_bytes
        connection.counted_bytes = a.held_bytes + b.held_bytes

    def _end(self, connection: _Connection, kind: Kind, stream: ByteStream, note: str = "") -> None:
        connection.over = True
        at = max(each.last for each in connection.streams)
        self._mark(connection, stream, kind, at, note)

    def _mark(
        self, connection: _Connection, stream: ByteStream, kind: Kind, at: PacketTime, note: str
    ) -> None:
        """A change of the link takes its place."""
        event = WireEvent(at.time_ns, connection.name, stream.direction, kind, note=note)
        self._enqueue(connection, stream, [OrderedEvent(at, NO_POSITION, NO_POSITION, event)])

    def _give_up_hole(self, hole: _Hole, limit: int) -> None:
        """Let gaps take the place of what is missing before position `limit`."""
        connection, stream = hole.connection, hole.stream
        if not connection.oriented:
            addresses = connection.orient(self._guess_controller(connection))
            for each in connection.streams:
                each.missing_start_note = f"capture begins mid-stream ({addresses})"
        self._enqueue(connection, stream, stream.give_up_missing(limit, hole.since))
        self._forget(stream)
        self._progress(connection, stream, hole.since)
        self._conclude(connection)

    def _guess_controller(self, connection: _Connection) -> Endpoint:
        a, b = connection.ends
        if self._ports is not None and (a.port in self._ports) != (b.port in self._ports):
            return a if a.port in self._ports else b
        leaning = (
            connection.streams[0].start_byte_balance - connection.streams[1].start_byte_balance
        )
        if leaning:
            return b if leaning > 0 else a
        return min(a, b, key=lambda end: end.port)

    def _give_up(self, connection: _Connection) -> None:
        """Wait no longer for anything of this connection."""
        for stream in connection.streams:
            if hole := self._holes.get(stream):
                self._give_up_hole(hole, stream.known_end)

    def _forget(self, stream: ByteStream) -> None:
        self._holes.pop(stream, None)
        self._proven.pop(stream, None)

    def _settle(self) -> list[WireEvent]:
        """Give up what has been waited for long enough, and tell what waits for nothing."""
        while self._proven:
            hole = next(iter(self._proven.values()))
            if self._received - hole.proven_at < self._limits.late_segments:
                break
            self._give_up_hole(hole, hole.proof)
        events = self._release()
        while self._held_bytes > self._limits.held_bytes and (oldest := self._oldest_hole()):
            self._give_up_hole(oldest, oldest.stream.known_end)
            events += self._release()
        return events

    def _oldest_hole(self) -> _Hole | None:
        while self._ages:
            since, _, hole = self._ages[0]
            if self._holes.get(hole.stream) is hole and hole.since == since:
                return hole
            heappop(self._ages)
        return None

    def _schedule(self, hole: _Hole) -> None:
        self._serial += 1
        heappush(self._ages, (hole.since, self._serial, hole))

    def _enqueue(
        self, connection: _Connection, stream: ByteStream, events: Iterable[OrderedEvent]
    ) -> None:
        """Put events in their place."""
        for ready in events:
            self._serial += 1
            stream.ready.append(ready)
            heappush(self._queue, (ready.at, self._serial, stream, connection.peer_of(stream)))
            self._held_bytes += len(ready.event.data) + ITEM_BYTES

    def _release(self) -> list[WireEvent]:
        """Tell what is older than the oldest hole, and nothing ahead of what it acknowledges.

        So it is where the capture's clock stands still, or two interfaces have different ones.
        """
        oldest = self._oldest_hole()
        events = []
        while self._queue and (oldest is None or self._queue[0][0] < oldest.since):
            _, _, stream, peer = self._queue[0]
            if stream.ready and stream.ready[0].acknowledged_peer > peer.released:
                if peer.ready:
                    events.append(self._release_next(peer))
                    continue
                if peer in self._holes:
                    break
            heappop(self._queue)
            if stream.ready:  # otherwise it was released early
                events.append(self._release_next(stream))
        return events

    def _release_next(self, stream: ByteStream) -> WireEvent:
        _, _, end, event = stream.ready.popleft()
        stream.released = max(stream.released, end)
        self._held_bytes -= len(event.data) + ITEM_BYTES
        if event.time_ns < self._released_ns:
            event = replace(event, time_ns=self._released_ns)
        self._released_ns = event.time_ns
        return event
