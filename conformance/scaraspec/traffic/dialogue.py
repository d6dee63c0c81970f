"""Dialogue: turns the wire events of one connection into traffic events.

Bytes become frames, and frames become exchanges and transfers. This module does not decide whether
they conform. Memory is bounded: finished events are returned and dropped.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final

from scaraspec.protocol.commands import BY_OPCODE, COMMANDS
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import TAG, SkipReason
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.traffic.events import (
    CaptureGap,
    Ending,
    Exchange,
    FrameSeen,
    Injected,
    InvalidBytes,
    LinkChange,
    TrafficEvent,
    UnsolicitedReply,
)
from scaraspec.traffic.pending_requests import PendingRequests
from scaraspec.traffic.pending_results import PendingResults
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.stream import Stream
from scaraspec.traffic.transfers import CHUNKS, NAMES, TransferTracker, refuses_reply
from scaraspec.traffic.wire import Kind, WireEvent

_QUERY_BYTES: Final = 4  # a request without data
_MAX_PARTS: Final = 256  # kept parts of one program list; older ones are dropped
_POLLS: Final = frozenset(
    command.name
    for command in COMMANDS
    if command.hazard is Hazard.READ_ONLY
    and command.name not in ("login", "list_programs", *NAMES, *CHUNKS)
)
"""Queries with one reply, which change nothing: most of the traffic."""


class Dialogue:
    """Follows one connection. An `OPENED` event with the same name resets all state.

    Args:
        connection: The name of the connection in the recording.
        robot: The state of the robot, shared by all connections; read and written.
        dialect: The reply and transfer timeouts that the SUT claims.
        needs_login: False for links that need no login (L83).
    """

    def __init__(
        self,
        connection: str,
        robot: RobotState,
        dialect: Dialect = DEFAULT,
        *,
        needs_login: bool = True,
    ) -> None:
        self.connection = connection
        self.robot = robot
        self._dialect = dialect
        self._needs_login = needs_login
        self._now_ns = 0
        self._reset()

    def _reset(self) -> None:
        self.logged_in: bool | None = not self._needs_login
        self._login_sent = False
        self._refused_login: FrameSeen | None = None
        self._streams = {d: Stream(self.connection, d) for d in Direction}
        self._pending_requests = PendingRequests(self._dialect)
        self._pending_results = PendingResults(self.connection, self.robot)
        self._transfers = TransferTracker(self.robot, self._dialect)
        self._listing: Exchange | None = None  # a program list with outstanding parts
        self._last: dict[str, Exchange] = {}
        self._closed_by: Direction | None = None
        self._replies_missing = False  # since the last bytes of the controller
        self._hides_query = False  # whether a gap may hide one query, and nothing else
        self._started = False
        self._last_bytes_ns = dict.fromkeys(Direction, -1)
        self.robot.connected.add(self.connection)

    @property
    def transferring(self) -> bool:
        """Whether a file transfer may be active."""
        return self._transfers.unfinished

    def hidden_since_ns(self, gap: WireEvent) -> int:
        """Return a time before all bytes of a gap: its answer comes within the reply timeout."""
        timeout_ns = self._pending_requests.reply_ns
        return max(self._last_bytes_ns[gap.direction], gap.time_ns - timeout_ns)

    def feed(self, event: WireEvent) -> Iterable[TrafficEvent]:
        """Process the next event of this connection; return the traffic events it completes."""
        if event.kind is Kind.BYTES and self._is_quiet(event):
            seen = self._streams[event.direction].take_whole(event)
            if seen:
                self._now_ns = self._last_bytes_ns[event.direction] = event.time_ns
                return (seen.name in _POLLS and self._poll(seen)) or self._process(seen)
        return self._feed(event)

    def _is_quiet(self, event: WireEvent) -> bool:
        """Whether nothing but the reply to one request is expected, and nothing is missing.

        `_feed` then processes the frames of an event, and has nothing else to do. While a gap may
        matter, a stream is not settled, or takes no whole frame.
        """
        return (
            self._started
            and self._pending_requests.at_most_one
            and self._streams[event.direction.opposite].settled
            and not self._transfers.unfinished
            and self.robot.gaps.is_over(event.time_ns)
        )

    def _poll(self, seen: FrameSeen) -> tuple[TrafficEvent, ...]:
        """The short path of `_process` for the usual frame: of a poll, or its expected reply.

        Returns:
            What `_process` would give; empty if `_process` is needed, and nothing has changed.
        """
        if seen.frame.direction is A2C:
            request = self._make_exchange(seen, certain=seen.certain)
            dropped = self._pending_requests.add(request)
            self._pending_results.request_sent(request)
            return (seen, *dropped)
        exchange = self._pending_requests.answer_only(seen)
        if exchange is None:
            return ()
        unseen = self._pending_requests.take_unseen(seen.name, seen.place.time_ns)
        exchange.reply = seen
        exchange.certain = exchange.certain and seen.certain and not unseen
        self._pending_results.reply_received(exchange)
        self._last[exchange.name] = exchange
        if exchange.certain and _shows_idle(seen):
            self.robot.seen_idle(exchange.time_ns)
        exchange.ending = Ending.ANSWERED
        exchange.plain = bool(exchange.certain and exchange.logged_in) and not (
            exchange.pipelined
            or exchange.same_opcode_pending
            or exchange.unmatched_reply
            or exchange.concurrent
            or exchange.concurrent_uncertain
        )
        return seen, exchange

    def _feed(self, event: WireEvent) -> Iterator[TrafficEvent]:
        self._now_ns = event.time_ns
        if event.kind is Kind.BYTES and event.offset_bytes and not self._started:
            yield from self._start_midway(event)
        self._started = True
        match event.kind:
            case Kind.BYTES:
                yield from self._process_bytes(event)
            case Kind.GAP:
                self.robot.bytes_missing = True
                stream = self._streams[event.direction]
                whole = not stream.buffered_bytes
                for item in stream.skip_gap(event.length_bytes):
                    yield from self._process(item)
                yield CaptureGap(event)
                yield from self._process_gap(event, between_frames=whole)
            case Kind.INJECTED:
                yield Injected(event)
                self.robot.fault_injected = True
                yield from self._mark_uncertain(event.direction)
            case Kind.OPENED:
                yield from self.close()
                self._reset()
                yield LinkChange(event)
            case _:
                self._closed_by = self._closed_by or event.direction
                yield LinkChange(event)
                self._pending_results.mark_stop_requested()
                if event.kind is not Kind.HALF_CLOSED:
                    yield from self.close()
                    self.robot.connection_closed(event.time_ns, self._closed_by)

    def _start_midway(self, event: WireEvent) -> Iterator[TrafficEvent]:
        """Begin in the middle of a connection: the earlier bytes are not known."""
        self.robot.bytes_missing = True
        for direction, stream in self._streams.items():
            yield from stream.skip_gap(event.offset_bytes if direction is event.direction else 0)
            yield from self._mark_uncertain(direction)

    def _process_bytes(self, event: WireEvent) -> Iterator[TrafficEvent]:
        yield from self._end_silent_frames()
        yield from self._pending_requests.expire(self._now_ns)
        yield from self._transfers.expire(self._now_ns)
        if event.direction is A2C:
            self._explain_gap(None)
        self._last_bytes_ns[event.direction] = self._now_ns
        self.robot.gaps.end_gap(self.connection, event.direction, self._now_ns, self._answered_ns)
        for invalid in self._streams[event.direction.opposite].settle():
            yield from self._process(invalid)
        executing = self.robot.executing.copy() if self._replies_missing else []
        for item in self._streams[event.direction].feed(event):
            yield from self._process(item)
        if event.direction is C2A and self._replies_missing:
            self._replies_missing = False
            yield from self._forget_replies(executing)
            yield from self._pending_requests.drop_unseen(C2A, self._now_ns)

    def _end_silent_frames(self) -> Iterator[TrafficEvent]:
        for stream in self._streams.values():
            for item in stream.end_silent_frame(self._now_ns):
                yield from self._process(item)

    def close(self) -> Iterator[TrafficEvent]:
        """End the link or the capture: yield what is still pending. May be called again."""
        if self._replies_missing:
            self._pending_requests.mark_uncertain()
        yield from self._end_silent_frames()
        for stream in self._streams.values():
            for item in stream.finish():
                yield from self._process(item)
        yield from self._pending_requests.expire(self._now_ns)
        yield from self._transfers.expire(self._now_ns)
        yield from self._end_listing(Ending.CUT_OFF)
        yield from self._pending_requests.close(self._now_ns, self._closed_by)
        yield from self._pending_results.close(
            Ending.CUT_OFF, self._now_ns - self._pending_requests.reply_ns
        )
        yield from self._transfers.end("the link or the capture ended", self._now_ns)
        self._explain_gap(None)
        self.robot.connected.discard(self.connection)
        self.robot.sessions.discard(self.connection)
        self.robot.gaps.close(self.connection, self._answered_ns)

    @property
    def _answered_ns(self) -> int:
        """The time by which every request sent until now is answered or has timed out."""
        return self._now_ns + self._pending_requests.reply_ns

    def _process_gap(self, event: WireEvent, *, between_frames: bool) -> Iterator[TrafficEvent]:
        """Process a gap, which may hide requests, replies and results."""
        direction, length_bytes = event.direction, event.length_bytes
        if length_bytes == 0:  # no byte is missing, but earlier times or bytes are not reliable
            yield from self._mark_uncertain(direction)
            return
        if direction is C2A and length_bytes > 0:
            self._replies_missing = True
            if not self._pending_requests.sent_by(A2C):  # an earlier reply answered another request
                self.robot.forget_after_gap(self._now_ns)
            yield from self._forget_replies(self.robot.executing)
        else:
            may_hide_query = direction is A2C and between_frames and length_bytes == _QUERY_BYTES
            keep_state = may_hide_query and not self._transfers.unfinished
            yield from self._mark_uncertain(
                direction, ended=length_bytes < 0, keep_state=keep_state
            )
        yield from self._pending_requests.drop_unseen(direction, self._now_ns)
        if direction is C2A:
            yield from self._end_listing(Ending.UNSEEN)
            yield from self._pending_results.close(Ending.UNSEEN, -1)

    def _forget_replies(self, executing: list[Exchange]) -> Iterator[TrafficEvent]:
        """Mark what is pending as uncertain: its replies and results may be missing.

        The state of the robot is uncertain if it depends on them.

        Args:
            executing: The two-stage commands that were accepted before the end of the gap.
        """
        pending = self._pending_requests.sent_by(A2C)
        changes = any(not x.command or x.command.hazard is not Hazard.READ_ONLY for x in pending)
        executes = any(x.request.place.connection == self.connection for x in executing)
        if changes or executes or self._transfers.unfinished:
            self.robot.forget_after_gap(self._now_ns)
        yield from self._forget_pending()

    def _mark_uncertain(
        self, direction: Direction, *, ended: bool = True, keep_state: bool = False
    ) -> Iterator[TrafficEvent]:
        """Mark what is pending, and what follows, as uncertain: bytes were lost or changed."""
        until_ns = self._answered_ns
        self.robot.gaps.begin(self.connection, direction, self._now_ns, until_ns, ended=ended)
        self._hides_query = keep_state and not self._hides_query
        if not self._hides_query:
            self.robot.forget_after_gap(self._now_ns)
        yield from self._forget_pending()

    def _explain_gap(self, reply: FrameSeen | None) -> None:
        """Decide whether the gap hides one query only: the reply to a hidden request shows it.

        Args:
            reply: A reply without a request; None if the gap hides something else.
        """
        if self._hides_query:
            self._hides_query = False
            command = reply.command if reply and reply.certain else None
            query = command and command.hazard is Hazard.READ_ONLY and not command.request.fields
            if reply and query and not (self.robot.executing and _shows_idle(reply)):
                self.robot.gaps.resolve(self.connection)
            else:
                self.robot.forget_after_gap(self._now_ns)
        elif reply and self.robot.gaps.may_owe_reply(self.connection, self._now_ns):
            self.robot.gaps.reopen(self.connection, self._now_ns, self._answered_ns)
            self._pending_requests.mark_uncertain()
            self.robot.forget_after_gap(self._now_ns)

    def _forget_pending(self) -> Iterator[TrafficEvent]:
        self._pending_requests.mark_uncertain()
        if self._listing:
            self._listing.certain = False
        yield from self._transfers.mark_uncertain(self._now_ns)
        self.logged_in = self.logged_in or None
        self._refused_login = None

    def _certain(self, seen: FrameSeen) -> bool:
        """Whether no gap can hide what this frame belongs to."""
        return seen.certain and not self.robot.gaps.covers(self.connection, seen.place.time_ns)

    def _process(self, item: FrameSeen | InvalidBytes) -> Iterator[TrafficEvent]:
        yield item
        if isinstance(item, InvalidBytes):
            yield from self._malformed(item)
            return
        command, direction = item.command, item.frame.direction
        initiator = command.initiator if command else A2C
        if item.frame.tagged:
            yield from self._result(item)
        elif refuses_reply(item.frame) and self._is_stray(item):
            pass  # the refusal of a reply that was not expected
        elif direction is initiator:
            yield from self._request(item)
        else:
            yield from self._reply(item)

    def _is_stray(self, refusal: FrameSeen) -> bool:
        return self._transfers.take_unexpected_reply() or not self._certain(refusal)

    def _request(self, seen: FrameSeen) -> Iterator[TrafficEvent]:
        unseen = self._replies_missing and self._pending_requests.sent_by(seen.frame.direction)
        exchange = self._make_exchange(seen, certain=self._certain(seen) and not unseen)
        if self._listing and exchange.name == "list_programs":
            exchange.parts = self._listing.parts.copy()  # requests the next part (A-4.10-3)
            self._pending_requests.expect_late_reply(exchange.name)  # or it is already sent
            yield from self._end_listing(Ending.ANSWERED)
        yield from self._pending_requests.add(exchange)
        self._pending_results.request_sent(exchange)
        if exchange.name == "login":
            self._login_sent = True
        elif exchange.name == "set_password":
            self.robot.last.pop("login", None)  # the valid password is not known any more
        elif exchange.name == "delete_program":
            self.robot.forget(exchange.request_value or b"")
        yield from self._transfers.request(exchange)

    def _make_exchange(self, request: FrameSeen, *, certain: bool) -> Exchange:
        return Exchange(
            request,
            request.command,
            logged_in=self.logged_in,
            login_sent_before=self._login_sent,
            refused_login=self._refused_login,
            certain=certain,
        )

    def _reply(self, seen: FrameSeen) -> Iterator[TrafficEvent]:
        exchange = self._pending_requests.match(seen)
        unseen = self._pending_requests.take_unseen(seen.name, seen.place.time_ns)
        if seen.name == "download_chunk":
            self._transfers.chunk_reply_sent(exchange, seen.place.time_ns)
        if exchange is None:
            self._transfers.extra_reply_seen(seen.name)
            if self._listing and seen.name == self._listing.name:
                yield from self._list_part(self._listing, seen)
            else:
                late = self._pending_requests.take_late_reply(seen.name)
                yield self._unsolicited(seen, late=late, certain=not unseen)
                yield from self._pending_results.end_untagged(seen)
                self._explain_gap(seen)
            return
        self._explain_gap(None)
        if self._replies_missing:  # it may answer any pending request with its opcode
            pending = self._pending_requests.sent_by(exchange.request.frame.direction)
            unseen = unseen or any(x.name == exchange.name for x in pending)
        exchange.reply = seen
        exchange.certain = exchange.certain and self._certain(seen) and not unseen
        self._pending_results.reply_received(exchange)
        self._last[exchange.name] = exchange
        if exchange.name == "list_programs":
            yield from self._list_part(exchange, seen)
        elif exchange.command and exchange.command.two_stage and exchange.accepted:
            self._settle(exchange)
            yield from self._pending_results.accept(exchange)
        else:
            self._apply_effects(exchange)
            if exchange.name in NAMES and exchange.accepted:
                yield from self._pending_requests.cut_off_chunks(exchange, self._now_ns)
            yield from self._transfers.reply(exchange)
            yield self._answered(exchange)

    def _list_part(self, exchange: Exchange, seen: FrameSeen) -> Iterator[TrafficEvent]:
        exchange.parts.append(seen)
        exchange.certain = exchange.certain and seen.certain
        if len(exchange.parts) > _MAX_PARTS:
            del exchange.parts[0]
            exchange.certain = False
        if seen.value is not None and seen.value.more:
            self._listing = exchange
        else:
            self._listing = None
            yield self._answered(exchange)

    def _end_listing(self, ending: Ending) -> Iterator[TrafficEvent]:
        listing, self._listing = self._listing, None
        if listing:
            listing.ending = ending
            yield listing

    def _answered(self, exchange: Exchange) -> Exchange:
        exchange.ending = Ending.ANSWERED
        self._settle(exchange)
        return exchange

    def _settle(self, exchange: Exchange) -> None:
        """End the uncertainty after a gap, if a request that was sent after it has its reply."""
        if exchange.request.certain and exchange.reply and exchange.reply.certain:
            pending = self._pending_requests.sent_by(exchange.request.frame.direction)
            self.robot.gaps.settle(self.connection, exchange.time_ns, alone=not pending)

    def _apply_effects(self, exchange: Exchange) -> None:
        """Apply what a one-stage command changes for later events."""
        name, accepted = exchange.name, exchange.accepted
        if name == "login" and accepted:
            self.logged_in, self._refused_login = True, None
            self.robot.sessions.add(self.connection)
        elif name == "login" and self.logged_in:
            self.logged_in = None  # it may have logged out (A-4.1-2)
        elif name == "login" and self.logged_in is False:
            self._refused_login = exchange.reply
        elif name in ("shutdown", "set_network") and accepted:
            self.logged_in = None  # the link may be dead
            self.robot.version += 1
        elif exchange.reply and _shows_idle(exchange.reply) and exchange.certain:
            self.robot.seen_idle(exchange.time_ns)

    def _result(self, seen: FrameSeen) -> Iterator[TrafficEvent]:
        exchange = self._pending_results.match(seen)
        if exchange:
            yield self._answered(exchange)
        else:
            yield self._unsolicited(seen, late=self._pending_results.take_late_reply(seen.name))

    def _unsolicited(
        self, seen: FrameSeen, *, late: bool, certain: bool = True
    ) -> UnsolicitedReply:
        tagged = seen.frame.tagged
        waiting = self._pending_requests.sent_by(seen.frame.direction.opposite)
        if not late and not tagged:
            for exchange in waiting:
                exchange.unmatched_reply = exchange.unmatched_reply or seen
            _note_mismatches(waiting)
        after = self._last.get(seen.name)
        doubtful = tagged and self.robot.hides_command(after)
        certain = certain and self._certain(seen) and not (doubtful or self._replies_missing)
        # An earlier command of another connection has ended before this one was accepted.
        since_ns = after.time_ns if after and after.result else -1
        elsewhere = tagged and self.robot.was_accepted_elsewhere(
            seen.name, self.connection, seen.place.time_ns, since_ns
        )
        return UnsolicitedReply(seen, after, waiting, certain, late, elsewhere)

    def _malformed(self, invalid: InvalidBytes) -> Iterator[TrafficEvent]:
        """End the exchange whose reply the invalid bytes begin like, if there is one."""
        cut = invalid.touches_gap or invalid.reason in (SkipReason.STRAY, SkipReason.TRUNCATED)
        direction, head = invalid.place.direction, invalid.data[1:3]
        if cut or len(head) < 2:  # noqa: PLR2004 - tag and opcode, or opcode and length
            return
        if direction is C2A and head[0] == TAG:
            exchange = self._pending_results.match_malformed(invalid, head[1])
        else:
            exchange = self._pending_requests.match_malformed(direction, head[0])
        if exchange:
            exchange.malformed = invalid
            self._last[exchange.name] = exchange
            yield self._answered(exchange)
        elif direction is A2C and head[0] in BY_OPCODE:
            self._pending_requests.expect_late_reply(
                BY_OPCODE[head[0]].name
            )  # a lenient controller answers it


def _shows_idle(reply: FrameSeen) -> bool:
    return reply.name == "get_status" and reply.value == "00"


def _note_mismatches(waiting: Sequence[Exchange]) -> None:
    """Mark requests in a row of which each was followed only by another command's reply."""
    for older, newer in pairwise(waiting):
        followed = older.unmatched_reply
        if followed and newer.unmatched_reply and followed.place.time_ns <= newer.time_ns:
            older.mismatched = newer.mismatched = True
