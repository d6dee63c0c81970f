"""Exchange history: earlier requests and replies, for rules that compare two values.

It contains only exchanges that no gap can have affected, and a gap clears it, so rules can rely on
its content. Its size is bounded. It does not decide what conforms.
"""

from bisect import bisect_left, insort
from collections import OrderedDict, deque
from collections.abc import Iterator
from itertools import islice
from typing import Final, NamedTuple

from scaraspec.protocol import errors
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, LinkChange, TrafficEvent
from scaraspec.traffic.wire import Kind

KEPT_EXCHANGES: Final = 64
"""Maximum number of kept exchanges of each command."""
_MAX_NAMES: Final = 4096
_WITHOUT_END: Final = (Ending.CUT_OFF, Ending.HUNG_UP, Ending.UNANSWERED)


class LostCommand(NamedTuple):
    """A two-stage command whose link ended before its first reply or its final result.

    Attributes:
        exchange: The command.
        lost_ns: When its link ended.
    """

    exchange: Exchange
    lost_ns: int


class ExchangeHistory:
    """What the recording shows since its last gap, over all connections."""

    def __init__(self) -> None:
        self.recent: dict[str, list[Exchange]] = {}
        """The last answered exchanges of each command, ordered by the time of the reply."""
        self.last_requests: dict[str, FrameSeen] = {}
        """The last request of each command, answered or not."""
        self.previous_requests: dict[str, FrameSeen] = {}
        """The request before the last one, of each command."""
        self.accepted: deque[Exchange] = deque(maxlen=KEPT_EXCHANGES)
        """The last accepted two-stage commands, the latest last."""
        self.deleted: OrderedDict[bytes, Exchange] = OrderedDict()
        """Confirmed deletions, by file name, until the name is uploaded again."""
        self.uploaded_ns: OrderedDict[bytes, int] = OrderedDict()
        """When an upload of a name was last requested."""
        self.passwords: set[bytes] = set()
        """The first two different passwords that were accepted since one was set; one is wrong."""
        self.all_closed_ns = -1
        """When the controller last closed all its connections: it may have been switched off."""
        self.lost: dict[str, LostCommand] = {}
        """The last lost two-stage command of each name, until one of this name is answered."""
        self._last_link_end: tuple[str, int] = ("", -1)
        self.idle_since_ns: int | None = None
        """Since when the robot is idle, as far as results and statuses show; None if unknown."""
        self.idle_seen_ns = -1
        """When a status 00 or a final result last showed that the robot is idle."""
        self.idle_status_ns = -1
        """When a status 00 last showed that the robot is idle."""

    def last(self, name: str, *, before_ns: int | None = None) -> Exchange | None:
        """Return the last answered exchange of a command, if given before a time; else None."""
        recent = self.recent.get(name, [])
        if before_ns is None or not recent or answered_ns(recent[-1]) < before_ns:
            return recent[-1] if recent else None
        after = bisect_left(recent, before_ns, key=answered_ns)
        return recent[after - 1] if after else None

    def is_pending(self, name: str, since_ns: int) -> bool:
        """Whether the last request of a command was sent after this time and is unanswered."""
        request, last = self.last_requests.get(name), self.last(name)
        if request is None or request.place.time_ns < since_ns:
            return False
        answered = last is not None and last.request is request
        return not answered and all(x.request is not request for x in self.accepted)

    def between(self, name: str, begin_ns: int, end_ns: int) -> Iterator[Exchange]:
        """Yield the exchanges of a command that are within two times, oldest first."""
        recent = self.recent.get(name)
        if not recent or answered_ns(recent[-1]) <= begin_ns:  # the usual answer: none
            return
        first = len(recent) - 1  # few are searched: most callers ask for the last seconds
        while first and answered_ns(recent[first - 1]) > begin_ns:
            first -= 1
        for x in islice(recent, first, None):
            if answered_ns(x) >= end_ns:  # so are all later ones
                break
            if begin_ns < x.time_ns:
                yield x

    def add(self, traffic_event: TrafficEvent, *, busy: bool) -> None:
        """Add a traffic event that has been judged.

        Args:
            traffic_event: Any traffic event.
            busy: Whether a two-stage command is executing.
        """
        if isinstance(traffic_event, FrameSeen):
            if traffic_event.parsed and traffic_event.parsed.part == "request":
                self._add_request(traffic_event)
        elif isinstance(traffic_event, LinkChange):
            event = traffic_event.event
            if event.kind in (Kind.CLOSED, Kind.RESET):
                self._last_link_end = (event.connection, event.time_ns)
        elif isinstance(traffic_event, Exchange) and traffic_event.certain:
            if traffic_event.command and traffic_event.command.two_stage:
                self._add_two_stage(traffic_event)
            if not traffic_event.reply:
                return
            if (
                traffic_event.transfer or traffic_event.previous_transfer
            ):  # they contain file content
                return
            recent = self.recent.setdefault(traffic_event.name, [])
            if recent and answered_ns(recent[-1]) > answered_ns(traffic_event):
                insort(recent, traffic_event, key=answered_ns)
            else:
                recent.append(traffic_event)
            del recent[:-KEPT_EXCHANGES]
            self._add_reply(traffic_event, busy=busy)

    def _add_two_stage(self, x: Exchange) -> None:
        connection, ended_ns = self._last_link_end
        if x.ending in _WITHOUT_END and x.request.place.connection == connection:
            self.lost[x.name] = LostCommand(x, ended_ns)
        else:
            self.lost.pop(x.name, None)

    def _add_request(self, request: FrameSeen) -> None:
        name, before = request.name, self.last_requests.get(request.name)
        if name == "upload_name":
            self.deleted.pop(request.text, None)
            self.uploaded_ns[request.text] = request.place.time_ns
            if len(self.uploaded_ns) > _MAX_NAMES:
                self.uploaded_ns.popitem(last=False)
        elif name == "set_password" and before:
            answered = self.last(name)
            if answered is None or answered.request is not before:
                self.passwords.clear()  # it is unknown whether the previous one was set
        if before:
            self.previous_requests[name] = before
        self.last_requests[name] = request

    def all_connections_closed(self, time_ns: int) -> None:
        """Process the close of the last connection; what survives it is open (A-4-6)."""
        self.all_closed_ns = time_ns
        self.passwords.clear()

    def _add_reply(self, x: Exchange, *, busy: bool) -> None:
        if x.name == "get_status":
            self._add_status(x, busy=busy)
        if not x.accepted:
            return
        if x.name == "login":
            if len(self.passwords) < 2:  # noqa: PLR2004 - two contradict each other
                self.passwords.add(x.request.text)
        elif x.name == "set_password":
            self.passwords = {x.request_value.new} if x.request_value else set()
        elif x.name == "delete_program":
            self.deleted.setdefault(x.request.text, x)
            if len(self.deleted) > _MAX_NAMES:
                self.deleted.popitem(last=False)

    def _add_status(self, x: Exchange, *, busy: bool) -> None:
        code = errors.lookup(x.reply_value) if x.reply_value else None
        if code is None or code.kind is not errors.Kind.IDLE:
            self.idle_since_ns = None
        elif not busy:
            self.idle_seen_ns = self.idle_status_ns = answered_ns(x)
            self.idle_since_ns = self.idle_since_ns or self.idle_seen_ns

    def begun(self, exchange: Exchange) -> None:
        """Process the acceptance of a two-stage command."""
        self.accepted.append(exchange)
        self.idle_since_ns = None

    def ended(self, exchange: Exchange, *, busy: bool) -> None:
        """Process the end of a two-stage command; only a final result shows when it ended."""
        if exchange.result and not busy:
            self.idle_since_ns = self.idle_seen_ns = exchange.result.place.time_ns
        elif not exchange.interrupted_by:
            self.idle_since_ns = None


def answered_ns(x: Exchange) -> int:
    """Return when the first reply was complete; without a reply, when the request was."""
    return x.reply.place.time_ns if x.reply else x.time_ns
