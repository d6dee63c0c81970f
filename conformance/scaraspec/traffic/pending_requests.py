"""Waiting: the requests of one connection that have no first reply, and which reply is whose.

No number in a frame says it (A-3-14): a reply answers the oldest open request of its opcode. How
long one is waited for stands here too; what silence costs is for the rules.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.protocol.readings import Dialect
from scaraspec.traffic.events import Ending, Exchange, FrameSeen

NS_PER_S: Final = 1_000_000_000
_MOST: Final = 256
_CHUNKS: Final = ("upload_chunk", "download_chunk")


@dataclass(eq=False, slots=True)
class _Open:
    """A request and how long its answer is waited for."""

    exchange: Exchange
    name: str
    due_ns: int
    give_up_ns: int
    repeated: bool = False


class PendingRequests:
    """Open requests, oldest first; the oldest is given up where there are too many.

    Args:
        dialect: What the subject claims about reply time and transfer time-out.
    """

    def __init__(self, dialect: Dialect) -> None:
        self.reply_ns = int((dialect.seconds("reply_timeout") or 5) * NS_PER_S)
        self._chunk_ns = int((dialect.seconds("xfer_timeout") or 30) * NS_PER_S)
        self._open: list[_Open] = []
        self._late_replies_expected: Counter[str] = Counter()

    def open_requests(self, direction: Direction) -> tuple[Exchange, ...]:
        """The open requests of one side."""
        open_ = (entry.exchange for entry in self._open)
        return tuple(x for x in open_ if x.request.frame.direction is direction)

    def add(self, exchange: Exchange) -> Iterator[Exchange]:
        """A request was sent; give those that are no longer waited for."""
        time_ns, request, name = exchange.time_ns, exchange.request, exchange.name
        limit_ns = self._chunk_ns if name in _CHUNKS else self.reply_ns
        open_ = self.open_requests(request.frame.direction)
        exchange.pipelined = any(0 < time_ns - older.time_ns <= self.reply_ns for older in open_)
        for older in [e for e in self._open if e.name == name]:
            if request.certain and not older.exchange.request.certain:
                yield self._drop(older, Ending.UNSEEN)  # perhaps it was no request
            elif name in _CHUNKS and older.exchange.error_signal:
                yield self._drop(older, Ending.UNANSWERED)  # it need not be (A-5-10)
            elif older.due_ns < time_ns:  # asked again: the next answer may be to either
                older.repeated = True
            elif older.exchange.request.frame.opcode == request.frame.opcode:
                exchange.same_opcode_pending = True
        if len(self._open) >= _MOST:
            yield self._drop(self._open[0], Ending.UNSEEN)
        due_ns = time_ns + limit_ns
        self._open.append(_Open(exchange, name, due_ns, due_ns))

    def match(self, reply: FrameSeen) -> Exchange | None:
        """Take out the request that this first reply answers."""
        opcode, name = reply.frame.opcode, reply.name
        best: _Open | None = None
        best_rank = 9
        for entry in self._open:
            request = entry.exchange.request
            if request.frame.direction is reply.frame.direction:
                continue
            rank = 4 * (entry.name != name) + 2 * (request.frame.opcode != opcode)
            if rank > 4:  # noqa: PLR2004 - neither the name nor the opcode agrees
                continue
            rank += entry.repeated or entry.exchange.overtaken
            if rank < best_rank:
                best, best_rank = entry, rank
        if best is None:
            return None
        self._answer(best, reply.place.time_ns)
        return best.exchange

    def match_malformed(self, direction: Direction, opcode: int) -> Exchange | None:
        """Take out the request whose reply these bytes with its opcode should have been."""
        for entry in self._open:
            frame = entry.exchange.request.frame
            if frame.opcode == opcode and frame.direction is not direction:
                self._open.remove(entry)
                return entry.exchange
        return None

    def _answer(self, answered: _Open, time_ns: int) -> None:
        exchange = answered.exchange
        exchange.overdue = exchange.overtaken and time_ns > answered.due_ns
        for older in self._open:
            if older is answered:
                break
            overtaken, direction = older.exchange, exchange.request.frame.direction
            if overtaken.request.frame.direction is direction and not overtaken.overtaken:
                overtaken.overtaken = True
                older.give_up_ns = max(older.give_up_ns, time_ns + self.reply_ns)
        self._open.remove(answered)

    def overdue(self, now_ns: int) -> list[Exchange]:
        """Give up what was waited for long enough while a later request was answered."""
        late = [e for e in self._open if e.give_up_ns < now_ns and e.exchange.overtaken]
        return [self._drop(entry, Ending.UNANSWERED) for entry in late]

    def mark_uncertain(self) -> None:
        """What is asked may not be what was received, nor the answer."""
        for entry in self._open:
            entry.exchange.certain = False

    def lose(self, direction: Direction) -> Iterator[Exchange]:
        """Bytes of this direction passed unseen: answers among them will not be seen."""
        for entry in self._open.copy():
            if entry.exchange.request.frame.direction is not direction:
                yield self._drop(entry, Ending.UNSEEN)

    def replace(self, opening: Exchange, now_ns: int) -> Iterator[Exchange]:
        """The controller has begun a transfer: its chunks of another one are over (A-5-17)."""
        for entry in self._open.copy():
            transfer = entry.exchange.transfer
            if entry.name == "download_chunk" and transfer and transfer.opening is not opening:
                overdue = entry.due_ns < now_ns
                yield self._drop(entry, Ending.UNANSWERED if overdue else Ending.CUT_OFF)

    def close(self, now_ns: int, hung_up: Direction | None) -> Iterator[Exchange]:
        """The link has ended, `hung_up` having ended it first."""
        for entry in self._open.copy():
            if entry.due_ns < now_ns:
                ending = Ending.UNANSWERED
            elif hung_up and entry.exchange.request.frame.direction is not hung_up:
                ending = Ending.HUNG_UP
            else:
                ending = Ending.CUT_OFF
            yield self._drop(entry, ending)

    def _drop(self, entry: _Open, ending: Ending) -> Exchange:
        self._open.remove(entry)
        entry.exchange.ending = ending
        self.expect_late_reply(entry.name)
        return entry.exchange

    def expect_late_reply(self, name: str) -> None:
        """An answer to this command may come that no open request will claim."""
        self._late_replies_expected[name] += 1

    def take_late_reply(self, name: str) -> bool:
        """Whether an unexpected reply may be such a late reply; each counts once."""
        owed = self._late_replies_expected[name] > 0
        self._late_replies_expected[name] -= owed
        return owed
