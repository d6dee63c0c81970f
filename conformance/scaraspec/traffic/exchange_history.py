"""Memory: what was said before, for rules that hold one value against another.

Only exchanges that no gap could have touched are kept, and a gap empties it: what is remembered
can be relied on. It is bounded, and knows nothing of right or wrong.
"""

from bisect import bisect_left, bisect_right, insort
from collections import OrderedDict, deque
from collections.abc import Iterator
from itertools import islice
from typing import Final

from scaraspec.protocol.errors import Kind, lookup
from scaraspec.traffic.events import Exchange, FrameSeen, TrafficEvent

KEPT_EXCHANGES: Final = 64
"""Exchanges remembered of each command."""
_KEPT_NAMES: Final = 4096


class ExchangeHistory:
    """What the recording has shown since its last gap, over all connections."""

    def __init__(self) -> None:
        self.recent: dict[str, list[Exchange]] = {}
        """The last answered exchanges of each command, the latest answer last."""
        self.last_requests: dict[str, FrameSeen] = {}
        """The last request of each command, answered or not."""
        self.previous_requests: dict[str, FrameSeen] = {}
        """The one before it."""
        self.accepted: deque[Exchange] = deque(maxlen=KEPT_EXCHANGES)
        """The last two-stage commands that were accepted, the latest last."""
        self.deleted: OrderedDict[bytes, Exchange] = OrderedDict()
        """Deletions that were confirmed, by name, until the name is uploaded again."""
        self.passwords: set[bytes] = set()
        """Passwords that were accepted since one was set: the first two, of which one is wrong."""
        self.hung_up_ns = -1
        """When the controller had last ended all its connections: it may have been switched off."""
        self.idle_since_ns: int | None = None
        """Since when the robot does nothing, as far as results and statuses show; None: unknown."""
        self.idle_seen_ns = -1
        """When a status 00 or a final result last showed it."""

    def last(self, name: str, *, before_ns: int | None = None) -> Exchange | None:
        """The last answered exchange of a command, of those answered before a time."""
        recent = self.recent.get(name, [])
        if before_ns is None or not recent or answered_ns(recent[-1]) < before_ns:
            return recent[-1] if recent else None
        after = bisect_left(recent, before_ns, key=answered_ns)
        return recent[after - 1] if after else None

    def awaits(self, name: str, since_ns: int) -> bool:
        """Whether the last request of a command was sent after this time and is not answered."""
        asked, last = self.last_requests.get(name), self.last(name)
        if asked is None or asked.place.time_ns < since_ns:
            return False
        return last is None or last.request is not asked

    def between(self, name: str, begin_ns: int, end_ns: int) -> Iterator[Exchange]:
        """The exchanges of a command that lie between two times, oldest first."""
        recent = self.recent.get(name, [])
        first = bisect_right(recent, begin_ns, key=answered_ns)
        for x in islice(recent, first, None):
            if answered_ns(x) >= end_ns:  # and so are all after it
                break
            if begin_ns < x.time_ns:
                yield x

    def take(self, traffic_event: TrafficEvent, *, busy: bool) -> None:
        """Add a traffic event that has been judged.

        Args:
            traffic_event: Any traffic event.
            busy: Whether a two-stage command is executing.
        """
        if isinstance(traffic_event, FrameSeen):
            if traffic_event.parsed and traffic_event.parsed.part == "request":
                self._ask(traffic_event)
        elif isinstance(traffic_event, Exchange) and traffic_event.reply and traffic_event.certain:
            if traffic_event.transfer or traffic_event.previous_transfer:  # they hold files
                return
            recent = self.recent.setdefault(traffic_event.name, [])
            insort(recent, traffic_event, key=answered_ns)
            del recent[:-KEPT_EXCHANGES]
            self._learn(traffic_event, busy=busy)

    def _ask(self, request: FrameSeen) -> None:
        name, before = request.name, self.last_requests.get(request.name)
        if name == "upload_name":
            self.deleted.pop(request.text, None)
        elif name == "set_password" and before:
            answered = self.last(name)
            if answered is None or answered.request is not before:
                self.passwords.clear()  # whether the previous one was set is unknown
        if before:
            self.previous_requests[name] = before
        self.last_requests[name] = request

    def connection_closed(self, time_ns: int) -> None:
        """The controller has ended the last of its connections; what survives is open (A-4-6)."""
        self.hung_up_ns = time_ns
        self.passwords.clear()

    def _learn(self, x: Exchange, *, busy: bool) -> None:
        if x.name == "get_status":
            self._status(x, busy=busy)
        if not x.accepted:
            return
        if x.name == "login":
            if len(self.passwords) < 2:  # noqa: PLR2004 - two contradict each other, more say no more
                self.passwords.add(x.request.text)
        elif x.name == "set_password":
            self.passwords = {x.request_value.new} if x.request_value else set()
        elif x.name == "delete_program":
            self.deleted[x.request.text] = x
            if len(self.deleted) > _KEPT_NAMES:
                self.deleted.popitem(last=False)

    def _status(self, x: Exchange, *, busy: bool) -> None:
        code = lookup(x.reply_value) if x.reply_value else None
        if code is None or code.kind is not Kind.IDLE:
            self.idle_since_ns = None
        elif not busy:
            self.idle_seen_ns = answered_ns(x)
            self.idle_since_ns = self.idle_since_ns or self.idle_seen_ns

    def begun(self, exchange: Exchange) -> None:
        """A two-stage command was accepted."""
        self.accepted.append(exchange)
        self.idle_since_ns = None

    def ended(self, exchange: Exchange, *, busy: bool) -> None:
        """A two-stage command ended; only a final result shows when, its own or a stop's."""
        if exchange.result and not busy:
            self.idle_since_ns = self.idle_seen_ns = exchange.result.place.time_ns
        elif not exchange.interrupted_by:
            self.idle_since_ns = None


def answered_ns(x: Exchange) -> int:
    """When the first reply was complete; of what was not answered, when it was asked."""
    return x.reply.place.time_ns if x.reply else x.time_ns
