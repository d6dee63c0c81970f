"""Reassembles TCP segments of any number of connections into wire events in order of time.

This module does no I/O, uses bounded memory and guesses nothing. A byte is delivered once, at its
own offset. A byte that was sent but not captured becomes part of a gap, but only when it cannot
arrive any more:

- The receiver acknowledged it, and it is not among the next `Limits.late_segments` segments (a
  capture may swap packets, so that an acknowledgment precedes its data).
- The connection was reset, its ports were reused, or the capture ended.
- The segments that wait for it use more memory than `Limits.held_bytes`.

Until then, all later events wait, including those of other connections: a reply is never delivered
before its request, even if that request is lost.

If the capture's clock is set back or forward, event times stay constant and continue from there. A
gap of zero bytes marks that earlier traffic must not cause failures. A clock was set forward if a
long silence begins while bytes are not acknowledged, and no one repeats them.
"""

from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.wire import Kind, WireEvent, WireRange
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sources.bytestream import (
    ITEM_BYTES,
    NO_POSITION,
    ByteStream,
    OrderedEvent,
    PacketTime,
)
from scaraspec_recorder.tcp_segment import ACK, FIN, RST, SYN, Endpoint, Segment

_MAX_UNRELIABLE: Final = 100
STEP_NS: Final = 1_000_000_000
"""Minimum decrease of the time that counts as a clock set back; swapped packets differ less."""
_FORWARD_NS: Final = 60_000_000_000
"""In this time a sender repeats bytes that are not acknowledged many times."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of waiting for missing bytes.

    Attributes:
        late_segments: Number of segments by which a packet may be late in the capture.
        held_bytes: Memory for waiting events of all connections.
        connections: Maximum number of open connections. If there are more, the one with the
            longest silence is given up.
    """

    late_segments: int = 256
    held_bytes: int = 16 << 20
    connections: int = 4096


@dataclass(eq=False, slots=True)
class _Connection:
    """A connection and its two streams."""

    name: str
    ends: tuple[Endpoint, Endpoint]
    streams: tuple[ByteStream, ByteStream]  # sent by ends[0], sent by ends[1]
    oriented: bool = False  # which end is the controller is known
    under_way: bool = False  # a segment after the opening handshake was captured
    reset: tuple[ByteStream, PacketTime] | None = None  # sender and time of the RST
    over: bool = False
    counted_bytes: int = 0  # its part of the memory in use

    def is_missing(self, stream: ByteStream) -> bool:
        """Whether bytes of `stream` were sent and are not captured so far."""
        if stream.start is None:
            return self.under_way
        return stream.next < stream.known_end

    def answers_at_once(self, segment: Segment) -> bool:
        """Whether a segment is the first that acknowledges bytes of its receiver.

        The receiver would have repeated them in a long silence. In an artificial capture without
        acknowledgments of their own, this is known for requests only.
        """
        at = self.ends.index(segment.src)
        sender, receiver = self.streams[at], self.streams[1 - at]
        known = receiver.direction is Direction.A2C or sender.acknowledges
        return bool(segment.flags & ACK) and known and receiver.would_acknowledge(segment.ack)

    def peer_of(self, stream: ByteStream) -> ByteStream:
        """Return the stream of the other direction."""
        a, b = self.streams
        return b if stream is a else a

    def orient(self, controller: Endpoint) -> tuple[Endpoint, Endpoint]:
        """Set the directions of the streams. Return both ends, client first."""
        self.oriented = True
        at = self.ends.index(controller)
        self.streams[at].direction, self.streams[1 - at].direction = Direction.C2A, Direction.A2C
        return self.ends[1 - at], controller


@dataclass(eq=False, slots=True)
class _Hole:
    """Missing bytes at the front of a stream that may still arrive."""

    connection: _Connection
    stream: ByteStream
    offset_bytes: int
    since: PacketTime
    proof: int = 0  # if proven: position before which no byte will be sent again
    proven_at: int = 0  # number of the segment that proved it


class Reassembler:
    """Reassembles TCP connections and names them "1", "2", … in the order of their appearance.

    A connection appears with a SYN or, if the capture started later, with its first payload. The
    controller is the destination of the SYN; otherwise the only end with one of `ports`; otherwise
    the end whose peer sends more segments that begin with 0xAA than with 0xCC (clause 3, L92-94);
    otherwise the end with the lower port.

    Args:
        ports: Connections with none of these ports are ignored; None ignores no connection.
        limits: Limits of waiting for missing bytes.
        between: If given, connections between other ends are ignored, too.
        on_oriented: Called with the name of each connection, its client and its controller, before
            its first event.

    Attributes:
        connections: Number of connections so far.
        clock_steps: Number of times that the clock of the capture was set back or forward.
        far_segments: Number of segments far outside the window, which were ignored.
        corrupt_segments: Number of segments with a wrong checksum from a sender with right ones.
            They are used only if no other copy of their bytes was captured.
        conflicts: Number of repeated segments that differ from the first copy.
        unreliable: The bytes of the first conflicts.
    """

    def __init__(
        self,
        ports: Collection[int] | None = (DEFAULT_PORT,),
        limits: Limits | None = None,
        *,
        between: Collection[tuple[Endpoint, Endpoint]] | None = None,
        on_oriented: Callable[[str, Endpoint, Endpoint], None] = lambda *_: None,
    ) -> None:
        self.connections = 0
        self.clock_steps = 0
        self.far_segments = 0
        self.corrupt_segments = 0
        self.conflicts = 0
        self.unreliable: list[WireRange] = []
        self._computes_checksums: set[Endpoint] = set()
        self._ports = ports
        self._between = between
        self._on_oriented = on_oriented
        self._limits = limits or Limits()
        self._received = 0
        self._serial = 0
        self._latest_ns = 0
        self._clock_offset_ns = 0  # total time by which the clock of the capture was set back
        self._released_ns = 0
        self._held_bytes = 0
        self._followed: OrderedDict[tuple[Endpoint, Endpoint], _Connection] = (
            OrderedDict()
        )  # longest silent first
        self._holes: dict[ByteStream, _Hole] = {}
        self._ages: list[tuple[PacketTime, int, _Hole]] = []  # of holes, including filled ones
        self._proven: dict[ByteStream, _Hole] = {}  # in the order of the proof
        self._queue: list[
            tuple[PacketTime, int, ByteStream, ByteStream]
        ] = []  # stream of the event, peer stream

    def receive(self, segment: Segment) -> list[WireEvent]:
        """Process the next segment of the capture.

        Args:
            segment: The segment; the order of the capture may differ from that of sending.

        Returns:
            The events that no later segment can precede. Their times never decrease: the time of
            bytes is that of the segment which completed them.
        """
        self._received += 1
        events = self._receive_in_order(segment)
        if events is not None:
            return events
        connection = self._connection_of(segment)
        if connection is not None:
            steps = self.clock_steps
            segment = self._on_one_clock(connection, segment)
            if self.clock_steps > steps:
                self._report_clock_step(connection, segment)
            self._take(connection, segment)
        return self._settle()

    def _receive_in_order(self, segment: Segment) -> list[WireEvent] | None:
        """Process a segment that continues its stream while no byte of any stream is missing.

        Most segments do. No event waits then, so that the bytes of the segment are an event.

        Returns:
            The event, if the segment has bytes; None if the segment must be processed in general.
        """
        if self._holes or self._queue or segment.cut_bytes or segment.corrupt:
            return None
        src, dst = segment.src, segment.dst
        ends = (src, dst) if src < dst else (dst, src)
        connection = self._followed.get(ends)
        if connection is None or connection.over or connection.reset or not connection.oriented:
            return None
        a, b = connection.streams
        sender, receiver = (a, b) if ends[0] is src else (b, a)
        time_ns = segment.time_ns + self._clock_offset_ns
        if not (
            segment.flags & (SYN | FIN | RST | ACK) == ACK
            and segment.time_ns
            and 0 <= time_ns - self._latest_ns <= _FORWARD_NS
            and sender.continues_at(segment.seq)
        ):
            return None
        position = receiver.delivered_up_to(segment.ack)
        if position is None:
            return None
        self._followed.move_to_end(ends)
        self._latest_ns = time_ns
        connection.under_way = True
        receiver.acknowledged = max(receiver.acknowledged, position)
        if not segment.payload:
            sender.note_acknowledgment()
            return []
        self._computes_checksums.add(src)
        at = PacketTime(time_ns, 3 * self._received, segment.packet)
        self._released_ns = time_ns
        return [sender.append(segment.payload, at)]

    def _on_one_clock(self, connection: _Connection, segment: Segment) -> Segment:
        """Return the segment with a monotonic time; by default, with the latest time."""
        time_ns = segment.time_ns + self._clock_offset_ns if segment.time_ns else self._latest_ns
        back_ns = self._latest_ns - time_ns
        set_forward = -back_ns > _FORWARD_NS and connection.answers_at_once(segment)
        if back_ns > STEP_NS or set_forward:
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
                connection,
                stream,
                [stream.uncertainty(at, "the capture clock was set")],
            )

    def follows(self, segment: Segment) -> bool:
        """Whether the ends of the segment are selected; `receive` ignores other segments."""
        ports, between, ends = self._ports, self._between, (segment.src, segment.dst)
        if between is not None and not (ends in between or ends[::-1] in between):
            return False
        return ports is None or segment.src.port in ports or segment.dst.port in ports

    def finish(self) -> list[WireEvent]:
        """End the capture: missing bytes become gaps.

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
            has_payload = segment.payload or segment.cut_bytes
            if not opens and (not has_payload or segment.flags & RST):
                return None  # the rest of an ended connection, or a keep-alive
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
        if not segment.flags & SYN and (
            sender.is_far(segment.seq) or (segment.flags & ACK and receiver.is_far(segment.ack))
        ):
            self.far_segments += 1
            return
        now = PacketTime(segment.time_ns, 3 * self._received, segment.packet)
        acknowledged_at, sent_at = (PacketTime(segment.time_ns, now.number - n) for n in (2, 1))
        if segment.flags & SYN:
            self._open(connection, segment, sender, receiver, now)
        acknowledged = receiver.acknowledge(segment.ack) if segment.flags & ACK else NO_POSITION
        if segment.flags & RST:
            connection.reset = connection.reset or (sender, now)
        elif not segment.flags & SYN:
            connection.under_way = True
        # The receiver first: its missing bytes were sent before this segment acknowledged them.
        self._progress(connection, receiver, acknowledged_at)
        if not segment.flags & RST:  # the payload of a RST is a diagnostic text
            sender.put(self._with_doubt(segment), now, acknowledged)
        self._progress(connection, sender, sent_at)
        self._report_conflict(connection, sender, now)
        self._conclude(connection)

    def _with_doubt(self, segment: Segment) -> Segment:
        """Return the segment; it is not corrupt if its sender has had no right checksum so far.

        Its network card may compute them after the capture.
        """
        if segment.payload and not segment.corrupt and not segment.cut_bytes:
            self._computes_checksums.add(segment.src)
        elif segment.corrupt and segment.src not in self._computes_checksums:
            return segment._replace(corrupt=False)
        self.corrupt_segments += segment.corrupt
        return segment

    def _report_conflict(
        self, connection: _Connection, stream: ByteStream, now: PacketTime
    ) -> None:
        """Report repeated bytes that differ: what depends on them is uncertain."""
        if stream.conflict is None or stream.start is None:
            return
        (position, length_bytes), stream.conflict = stream.conflict, None
        self.conflicts += 1
        if len(self.unreliable) < _MAX_UNRELIABLE:
            place = (connection.name, stream.direction, position - stream.start, length_bytes)
            self.unreliable.append(WireRange(*place, now.time_ns))
        note = "two different copies of the same bytes were captured"
        self._enqueue(connection, stream, [stream.uncertainty(now, note)])

    def _open(
        self,
        connection: _Connection,
        segment: Segment,
        sender: ByteStream,
        receiver: ByteStream,
        now: PacketTime,
    ) -> None:
        """Process a SYN or a SYN-ACK, the first one or a repeated one."""
        sender.begin(segment.seq)
        is_syn_ack = segment.flags & ACK
        if is_syn_ack and receiver.may_begin(segment.ack - 1):
            receiver.begin(segment.ack - 1)
        if connection.oriented:
            return
        note = self._orient(connection, segment.src if is_syn_ack else segment.dst)
        opener = receiver if is_syn_ack else sender
        for stream in connection.streams:
            stream.last = max(stream.last, now)
            stream.missing_start_note = "the SYN-ACK was not captured"
        self._mark(connection, opener, Kind.OPENED, opener.last, note)

    def _progress(self, connection: _Connection, stream: ByteStream, now: PacketTime) -> None:
        """Deliver events that are in order, and track missing bytes."""
        self._enqueue(connection, stream, stream.advance())
        missing = connection.is_missing(stream)
        hole = self._holes.get(stream)
        if hole and (not missing or hole.offset_bytes != stream.offset_bytes):
            self._forget(stream)
            hole = None
        if not missing:
            return
        stream.note_end(now)
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
        """Add the end of the connection when no bytes before it are missing; update the memory."""
        a, b = connection.streams
        if not (connection.over or connection.is_missing(a) or connection.is_missing(b)):
            if a.ended and b.ended:
                self._end(connection, Kind.CLOSED, max(a, b, key=lambda stream: stream.last))
            elif connection.reset:
                sender, at = connection.reset
                sender.last = max(sender.last, at)
                note = "the connection was refused" if sender.start is None else ""
                self._end(connection, Kind.RESET, sender, note)
        self._held_bytes += a.held_bytes + b.held_bytes - connection.counted_bytes
        connection.counted_bytes = a.held_bytes + b.held_bytes

    def _end(self, connection: _Connection, kind: Kind, stream: ByteStream, note: str = "") -> None:
        connection.over = True
        at = max(each.last for each in connection.streams)
        self._mark(connection, stream, kind, at, note)

    def _mark(
        self, connection: _Connection, stream: ByteStream, kind: Kind, at: PacketTime, note: str
    ) -> None:
        """Add an event without bytes, such as an opening."""
        event = WireEvent(at.time_ns, connection.name, stream.direction, kind, note=note)
        self._enqueue(connection, stream, [OrderedEvent(at, NO_POSITION, NO_POSITION, event)])

    def _give_up_hole(self, hole: _Hole, limit: int) -> None:
        """Replace the bytes missing before position `limit` by gaps."""
        connection, stream = hole.connection, hole.stream
        if not connection.oriented:
            addresses = self._orient(connection, self._guess_controller(connection))
            for each in connection.streams:
                each.missing_start_note = UserMessage(
                    "the capture begins mid-stream ({addresses})", addresses=addresses
                )
        self._enqueue(connection, stream, stream.give_up_missing(limit, hole.since))
        self._forget(stream)
        self._progress(connection, stream, hole.since)
        self._conclude(connection)

    def _orient(self, connection: _Connection, controller: Endpoint) -> str:
        """Set the directions of a connection. Return both addresses, client first."""
        client, controller = connection.orient(controller)
        self._on_oriented(connection.name, client, controller)
        return f"{client} → {controller}"

    def _guess_controller(self, connection: _Connection) -> Endpoint:
        a, b = connection.ends
        if self._ports is not None and (a.port in self._ports) != (b.port in self._ports):
            return a if a.port in self._ports else b
        balance = (
            connection.streams[0].start_byte_balance - connection.streams[1].start_byte_balance
        )
        if balance:
            return b if balance > 0 else a
        return min(a, b, key=lambda end: end.port)

    def _give_up(self, connection: _Connection) -> None:
        """Stop waiting for missing bytes of this connection."""
        for stream in connection.streams:
            if hole := self._holes.get(stream):
                self._give_up_hole(hole, stream.known_end)

    def _forget(self, stream: ByteStream) -> None:
        self._holes.pop(stream, None)
        self._proven.pop(stream, None)

    def _settle(self) -> list[WireEvent]:
        """Give up bytes after the limits of waiting; return the events that are complete."""
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
        """Queue events in the order of time."""
        for ready in events:
            self._serial += 1
            stream.ready.append(ready)
            heappush(self._queue, (ready.at, self._serial, stream, connection.peer_of(stream)))
            self._held_bytes += len(ready.event.data) + ITEM_BYTES

    def _release(self) -> list[WireEvent]:
        """Return the events before the oldest hole, each after the bytes that it acknowledges.

        The order of acknowledgment also applies if the clock of the capture stands still, or if
        two interfaces have different clocks.
        """
        oldest = self._oldest_hole()
        events = []
        while self._queue and (oldest is None or self._queue[0][0] < oldest.since):
            _, _, stream, peer = self._queue[0]
            if stream.ready and stream.ready[0].acknowledged_peer > peer.released:
                if peer.ready and peer.released < peer.queued_end:
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
