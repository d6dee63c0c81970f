"""Pending requests: the requests of one connection without a first reply.

Frames have no sequence number (A-3-14): a reply answers the oldest pending request with its opcode.
If the client has given up this request and has sent another one with its opcode, the reply may also
answer the newer request; see `PendingRequests.match`.
This module also has the reply timeouts; the rules decide what a missing reply means.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.direction import C2A, Direction
from scaraspec.protocol.readings import Dialect
from scaraspec.traffic.events import Ending, Exchange, FrameSeen

NS_PER_S: Final = 1_000_000_000
_MAX_PENDING: Final = 256
_CHUNKS: Final = ("upload_chunk", "download_chunk")
_WORST_RANK: Final = (True, True, True)
"""Above the rank of every request that a reply may answer."""
_PROMPT_NS: Final = 200_000_000
"""A reply within this time after a request answers it rather than one given up before."""


@dataclass(eq=False, slots=True)
class _PendingRequest:
    """A pending request, its deadlines, and the request with its opcode that followed a timeout."""

    exchange: Exchange
    name: str
    due_ns: int
    drop_after_ns: int
    repeated_by: Exchange | None = None


class PendingRequests:
    """The pending requests, oldest first. If there are too many, the oldest is dropped.

    Args:
        dialect: The reply and transfer timeouts that the SUT claims.
    """

    def __init__(self, dialect: Dialect) -> None:
        self.reply_ns = int(float(dialect["reply_timeout"]) * NS_PER_S)
        self._transfer_ns = int(float(dialect["xfer_timeout"]) * NS_PER_S)
        self._open: list[_PendingRequest] = []
        self._late_replies_expected: Counter[str] = Counter()
        self._unseen: Counter[str] = Counter()  # requests whose replies a gap may hide
        self._unseen_until_ns = -1  # when they have timed out
        self._owed_until_ns: dict[str, int] = {}  # until then a late reply may come

    def sent_by(self, direction: Direction) -> tuple[Exchange, ...]:
        """Return the pending requests that one side sent."""
        open_ = (entry.exchange for entry in self._open)
        return tuple(x for x in open_ if x.request.frame.direction is direction)

    @property
    def at_most_one(self) -> bool:
        """Whether at most one request is pending, and no later one has overtaken it."""
        pending = self._open
        return not pending or (len(pending) == 1 and not pending[0].exchange.overtaken_by)

    def answer_only(self, reply: FrameSeen) -> Exchange | None:
        """Remove and return the only pending request, if it has the opcode of this reply.

        It gives what `match` would give. None if `match` has to decide; nothing has changed then.
        """
        if len(self._open) != 1:
            return None
        entry = self._open[0]
        request = entry.exchange.request.frame
        if (
            request.opcode != reply.frame.opcode
            or request.direction is reply.frame.direction
            or entry.repeated_by
            or entry.exchange.overtaken_by
        ):
            return None
        self._open.clear()
        return entry.exchange

    def add(self, exchange: Exchange) -> list[Exchange]:
        """Add a request; return the requests that are not pending any more."""
        dropped: list[Exchange] = []
        time_ns, request, name = exchange.time_ns, exchange.request, exchange.name
        limit_ns = given_up_ns = self.reply_ns
        if name in _CHUNKS:  # a client may give up sooner than a controller must reply
            given_up_ns = self._transfer_ns
            limit_ns = max(limit_ns, given_up_ns)
        open_ = self.sent_by(request.frame.direction)
        exchange.pipelined = any(0 < time_ns - older.time_ns <= self.reply_ns for older in open_)
        for older in [e for e in self._open if e.name == name]:
            if request.certain and not older.exchange.request.certain:
                dropped.append(self._drop(older, Ending.UNSEEN))  # it may not have been a request
            elif name in _CHUNKS and older.exchange.error_signal:
                dropped.append(self._drop(older, Ending.UNANSWERED))  # needs no reply (A-5-10)
            elif older.exchange.time_ns + given_up_ns < time_ns:
                older.repeated_by = exchange
            elif older.exchange.ambiguous:  # the client has taken another reply for its own
                dropped.append(self._drop(older, Ending.UNSEEN))
                self._owed_until_ns[name] = time_ns + self.reply_ns
            elif older.exchange.request.frame.opcode == request.frame.opcode:
                exchange.same_opcode_pending = name not in _CHUNKS or not exchange.error_signal
        if len(self._open) >= _MAX_PENDING:
            dropped.append(self._drop(self._open[0], Ending.UNSEEN))
        if time_ns < self._owed_until_ns.get(name, -1):
            exchange.set_ambiguous()
        due_ns = time_ns + limit_ns
        self._open.append(_PendingRequest(exchange, name, due_ns, due_ns))
        return dropped

    def match(self, reply: FrameSeen) -> Exchange | None:
        """Remove and return the request that this first reply answers.

        A reply that comes when a request was given up and repeated answers the oldest of them,
        unless it comes promptly after the newest. In both cases the answered exchange is ambiguous:
        a missing reply and a late one look the same.
        """
        opcode, name = reply.frame.opcode, reply.name
        best: _PendingRequest | None = None
        best_rank = _WORST_RANK
        for entry in self._open:
            request = entry.exchange.request
            if request.frame.direction is reply.frame.direction:
                continue
            other_name, other_opcode = entry.name != name, request.frame.opcode != opcode
            if other_name and other_opcode:
                continue
            repeated = entry.repeated_by
            later_fits = (
                0 <= reply.begun_ns - repeated.time_ns < _PROMPT_NS
                if repeated
                else entry.exchange.overtaken
            )
            # A reply that was first read as the data of another frame is older than later requests.
            is_older = reply.begun_ns < entry.exchange.time_ns
            rank = (other_name, other_opcode, later_fits or is_older)
            if rank < best_rank:
                best, best_rank = entry, rank
        if best is None:
            return None
        self._answer(best, reply)
        if not best.repeated_by or reply.begun_ns >= best.repeated_by.time_ns:
            self._mark_ambiguous(best)
        return best.exchange

    def _mark_ambiguous(self, answered: _PendingRequest) -> None:
        """Mark an answered exchange whose reply may answer another request of its name."""
        repeated = answered.repeated_by
        if repeated:
            answered.exchange.requested_again = repeated.request
        for entry in self._open:
            if entry.repeated_by is answered.exchange or entry.exchange is repeated:
                answered.exchange.set_ambiguous()
                entry.exchange.ambiguous = True

    def match_malformed(self, direction: Direction, opcode: int) -> Exchange | None:
        """Remove and return the request whose reply these invalid bytes should have been."""
        for entry in self._open:
            frame = entry.exchange.request.frame
            if frame.opcode == opcode and frame.direction is not direction:
                self._open.remove(entry)
                return entry.exchange
        return None

    def _answer(self, answered: _PendingRequest, reply: FrameSeen) -> None:
        exchange, time_ns = answered.exchange, reply.place.time_ns
        exchange.overdue = exchange.overtaken and time_ns > answered.due_ns
        for older in self._open:
            if older is answered:
                break
            overtaken, direction = older.exchange, exchange.request.frame.direction
            if overtaken.request.frame.direction is direction and not overtaken.overtaken:
                overtaken.overtaken_by = reply
                older.drop_after_ns = max(older.drop_after_ns, time_ns + self.reply_ns)
        self._open.remove(answered)

    def expire(self, now_ns: int) -> list[Exchange]:
        """Remove and return requests that timed out and that a later request has overtaken."""
        late = [e for e in self._open if e.drop_after_ns < now_ns and e.exchange.overtaken]
        return [self._drop(entry, Ending.UNANSWERED) for entry in late]

    def mark_uncertain(self) -> None:
        """Mark all pending requests as uncertain: bytes may be lost or changed."""
        for entry in self._open:
            entry.exchange.certain = False

    def drop_unseen(self, direction: Direction, now_ns: int) -> Iterator[Exchange]:
        """Drop the requests whose replies may be among missing bytes of this direction."""
        self._unseen_until_ns = now_ns + self.reply_ns
        if direction is C2A:
            self._unseen["download_chunk"] += 1  # the bytes may be requests of the controller
        for entry in self._open.copy():
            if entry.exchange.request.frame.direction is not direction:
                self._unseen[entry.name] += 1
                yield self._drop(entry, Ending.UNSEEN)

    def take_unseen(self, name: str, time_ns: int) -> bool:
        """Whether a reply may answer a dropped or missing request; each of them counts once."""
        if time_ns > self._unseen_until_ns:
            self._unseen.clear()
        unseen = self._unseen.get(name, 0)
        if unseen:
            self._unseen[name] -= 1
        return unseen > 0

    def cut_off_chunks(self, opening: Exchange, now_ns: int) -> Iterator[Exchange]:
        """Drop the pending chunks of an earlier transfer: a new one has begun (A-5-17)."""
        for entry in self._open.copy():
            transfer = entry.exchange.transfer
            if entry.name == "download_chunk" and transfer and transfer.opening is not opening:
                overdue = entry.due_ns < now_ns
                yield self._drop(entry, Ending.UNANSWERED if overdue else Ending.CUT_OFF)

    def close(self, now_ns: int, closed_by: Direction | None) -> Iterator[Exchange]:
        """Drop all requests: the link has ended. `closed_by` is the side that closed it first.

        If only the capture has ended, the reply to an overtaken request may have come later.
        """
        for entry in self._open.copy():
            if (entry.due_ns if closed_by else entry.drop_after_ns) < now_ns:
                ending = Ending.UNANSWERED
            elif closed_by and entry.exchange.request.frame.direction is not closed_by:
                ending = Ending.HUNG_UP
            else:
                ending = Ending.CUT_OFF
            yield self._drop(entry, ending)

    def _drop(self, entry: _PendingRequest, ending: Ending) -> Exchange:
        self._open.remove(entry)
        entry.exchange.ending = ending
        self.expect_late_reply(entry.name)
        return entry.exchange

    def expect_late_reply(self, name: str) -> None:
        """Expect a reply to this command that matches no pending request."""
        self._late_replies_expected[name] += 1

    def take_late_reply(self, name: str) -> bool:
        """Whether an unsolicited reply may be an expected late reply; each counts once."""
        expected = self._late_replies_expected[name] > 0
        self._late_replies_expected[name] -= expected
        return expected
