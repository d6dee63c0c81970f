"""Scene: what all connections of one robot have shown so far, in bounded memory.

Dialogues write here what rules of other exchanges need: the last exchange of each command, the
two-stage commands that execute, the files that were transferred. A gap on one connection may hide
what changed for all of them, so it empties the scene.
"""

from collections import OrderedDict
from typing import Final

from scaraspec.protocol.direction import C2A, Direction
from scaraspec.traffic.events import Exchange, TrafficEvent, Transfer
from scaraspec.traffic.exchange_history import ExchangeHistory
from scaraspec.traffic.gap_uncertainty import GapUncertainty

FILES_LIMIT_BYTES: Final = 64 * 2**20
FILES_LIMIT: Final = 4096


class RobotState:
    """The robot, as far as the wire shows it."""

    def __init__(self) -> None:
        self.last: dict[str, Exchange] = {}
        """The last certain exchange of each command that was answered, over all connections."""
        self.executing: list[Exchange] = []
        """Two-stage commands whose first reply was "1" and whose end has not been seen."""
        self.version = 0
        """Rises with every change of what executes: equal numbers mean that nothing changed."""
        self.files: OrderedDict[bytes, Transfer] = OrderedDict()
        """The last completed upload of each name, until it may be gone; oldest dropped first."""
        self.history = ExchangeHistory()
        """What was said before, for rules that hold one value against another."""
        self.connected: set[str] = set()
        """Connections that have not ended."""
        self.sessions: set[str] = set()
        """Those of them that have logged in."""
        self.gaps = GapUncertainty()
        """Which happenings a gap may have touched."""
        self.results_doubtful = False
        """A two-stage command may be executing that was accepted in a gap."""
        self._files_bytes = 0
        self._initiator_connections: dict[str, str] = {}

    @property
    def executing_uncertain(self) -> bool:
        """Whether it is not sure that all of `executing` still execute."""
        return bool(self.executing) and any(
            x.stop_requested or not x.certain for x in self.executing
        )

    @property
    def busy(self) -> bool:
        """Whether a two-stage command executes that no stop has interrupted."""
        return bool(self.executing) and any(not x.interrupted_by for x in self.executing)

    def remember(self, traffic_event: TrafficEvent) -> None:
        """Keep what was said, once it has been judged."""
        if isinstance(traffic_event, Exchange) and traffic_event.reply:
            if traffic_event.certain:
                self.last[traffic_event.name] = traffic_event
            else:
                self.last.pop(traffic_event.name, None)
        self.history.take(traffic_event, busy=self.busy)

    def begin(self, exchange: Exchange) -> None:
        """A two-stage command was accepted."""
        self.executing.append(exchange)
        self.history.begun(exchange)
        self.version += 1
        connection = exchange.request.place.connection
        first = self._initiator_connections.setdefault(exchange.name, connection)
        if first != connection:
            self._initiator_connections[exchange.name] = ""

    def end(self, exchange: Exchange) -> None:
        """A two-stage command ended, or it is no longer known that it executes."""
        if exchange in self.executing:
            self.executing.remove(exchange)
        self.history.ended(exchange, busy=self.busy)
        self.version += 1

    def connection_closed(self, time_ns: int, hung_up: Direction) -> None:
        """A connection has ended, `hung_up` having ended it first."""
        if hung_up is C2A and not self.connected:
            self.history.connection_closed(time_ns)
            self.last.pop("login", None)

    def was_accepted_elsewhere(self, name: str, connection: str) -> bool:
        """Whether a two-stage command was ever accepted on another connection than this."""
        return self._initiator_connections.get(name, connection) != connection

    def forget_after_gap(self) -> None:
        """Bytes passed unseen: nothing of what was known is sure."""
        self.results_doubtful = True
        self.history = ExchangeHistory()
        self.last.clear()
        self.files.clear()
        self._files_bytes = 0
        for exchange in self.executing:
            exchange.certain = False

    def stored(self, transfer: Transfer) -> None:
        """An upload was completed."""
        self.forget(transfer.name)
        self.files[transfer.name] = transfer
        self._files_bytes += len(transfer.content)
        while self._files_bytes > FILES_LIMIT_BYTES or len(self.files) > FILES_LIMIT:
            _, oldest = self.files.popitem(last=False)
            self._files_bytes -= len(oldest.content)

    def forget(self, name: bytes) -> None:
        """A file may have been deleted or replaced."""
        transfer = self.files.pop(name, None)
        if transfer:
            self._files_bytes -= len(transfer.content)
