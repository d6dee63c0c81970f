"""Robot state: what all connections of one robot have shown so far, in bounded memory.

Dialogues store here what rules need later: the last exchange of each command, the executing
two-stage commands, and the transferred files. A gap on one connection may hide a change that
concerns all connections, so it clears the state.
"""

from collections import OrderedDict
from typing import Final

from scaraspec.protocol.direction import C2A, Direction
from scaraspec.traffic.events import Exchange, TrafficEvent, Transfer
from scaraspec.traffic.exchange_history import ExchangeHistory
from scaraspec.traffic.gap_uncertainty import GapUncertainty

STATE_LAG_NS: Final = 100_000_000
"""How old a reported status, pose or input may be (A-4.8-3)."""
SETTLES: Final = ("emergency_stop", "reset")
SETTLE_NS: Final = 1_000_000_000
"""For how long a robot may report after these commands that it still executes (A-4-9)."""
RESULT_LAG_NS: Final = 500_000_000
"""How much later than a status 00 a final result may come if it was measured (A-4-9)."""
COPY_NS: Final = 100_000_000
"""How much later than a final result others may receive a copy of it (A-2-9)."""
FILES_LIMIT_BYTES: Final = 64 * 2**20
FILES_LIMIT: Final = 4096

LONGEST_PAUSE_NS: Final = 1_000_000_000
"""The longest pause inside a request that a controller must survive (A-3-11)."""


class RobotState:
    """The state of one robot, as far as the wire shows it.

    Args:
        longest_pause_ns: The longest pause inside a request that the controller must survive.

    Attributes:
        longest_pause_ns: The same.
    """

    def __init__(self, longest_pause_ns: int = LONGEST_PAUSE_NS) -> None:
        self.longest_pause_ns = longest_pause_ns
        self.last: dict[str, Exchange] = {}
        """The last answered exchange of each command, over all connections; only certain ones."""
        self.executing: list[Exchange] = []
        """Two-stage commands whose first reply was "1" and whose end was not observed."""
        self.version = 0
        """Rises with each change of `executing`: equal numbers mean no change."""
        self.files: OrderedDict[bytes, Transfer] = OrderedDict()
        """The last complete upload of each name, until the file may be gone; limited in size."""
        self.history = ExchangeHistory()
        """Earlier exchanges, for rules that compare two values."""
        self.connected: set[str] = set()
        """Connections that have not ended."""
        self.sessions: set[str] = set()
        """Connections that have logged in and have not ended."""
        self.gaps = GapUncertainty()
        """Which events a capture gap may have affected."""
        self.transferring: set[str] = set()
        """Connections with an active file transfer."""
        self.status_lag_ns = STATE_LAG_NS
        """How old a status may be; 0 if it was measured that it is never old."""
        self.result_lag_ns = 0
        """How much later than a status 00 a final result may come; 0 if this was not measured."""
        self.bytes_missing = False
        """Whether there was a gap in the recording; set by `Dialogue`."""
        self.fault_injected = False
        """Whether a fault was injected; set by `Dialogue`."""
        self.results_doubtful = False
        """Whether a two-stage command that was accepted in a gap may be executing."""
        self._doubtful_since_ns = 0
        self._files_bytes = 0
        self._ended_ns: dict[str, int] = {}  # by command: its last final result
        self._accepted: dict[str, tuple[str, int]] = {}  # by command: last connection and time
        self._accepted_before: dict[str, tuple[str, int]] = {}  # the last on another connection

    @property
    def executing_uncertain(self) -> bool:
        """Whether some of `executing` may not execute any more."""
        return bool(self.executing) and any(
            x.stop_requested or not x.certain for x in self.executing
        )

    @property
    def busy(self) -> bool:
        """Whether a two-stage command executes and no stop has interrupted it."""
        return bool(self.executing) and any(not x.interrupted_by for x in self.executing)

    def remember(self, traffic_event: TrafficEvent) -> None:
        """Store a traffic event after it has been judged."""
        if isinstance(traffic_event, Exchange) and traffic_event.reply:
            if traffic_event.certain:
                self.last[traffic_event.name] = traffic_event
            else:
                self.last.pop(traffic_event.name, None)
        self.history.add(traffic_event, busy=self.busy)

    def begin(self, exchange: Exchange) -> None:
        """Add an accepted two-stage command."""
        self.executing.append(exchange)
        self.history.begun(exchange)
        self.version += 1
        connection = exchange.request.place.connection
        before = self._accepted.get(exchange.name)
        if before and before[0] != connection:
            self._accepted_before[exchange.name] = before
        self._accepted[exchange.name] = connection, exchange.time_ns

    def _may_have_result(self, name: str, time_ns: int) -> bool:
        """Whether a command of this name has no final result yet, or has just got it.

        Other connections may receive this result, too (A-2-9).
        """
        if name not in self._accepted:
            return False
        ended_ns = self._ended_ns.get(name)
        if ended_ns is None or ended_ns < self._accepted[name][1]:
            return True
        return time_ns - ended_ns < COPY_NS

    def end(self, exchange: Exchange) -> None:
        """Remove a two-stage command that ended or may have ended."""
        if exchange.result:
            self._ended_ns[exchange.name] = exchange.result.place.time_ns
        if exchange in self.executing:
            self.executing.remove(exchange)
        self.history.ended(exchange, busy=self.busy)
        self.version += 1

    def connection_closed(self, time_ns: int, closed_by: Direction) -> None:
        """Process the end of a connection; `closed_by` is the side that closed it first."""
        if closed_by is C2A and not self.connected:
            self.history.all_connections_closed(time_ns)
            self.last.pop("login", None)

    def was_accepted_elsewhere(
        self, name: str, connection: str, time_ns: int, since_ns: int = -1
    ) -> bool:
        """Whether a final result may be that of a command that another connection requested.

        Args:
            name: The command.
            connection: The connection of the result.
            time_ns: The time of the result.
            since_ns: Commands that were requested earlier do not count.
        """
        last = self._accepted.get(name)
        if last and last[0] == connection:
            last = self._accepted_before.get(name)
        requested = last is not None and last[1] >= since_ns
        return requested and self._may_have_result(name, time_ns)

    def seen_idle(self, status_ns: int) -> None:
        """Process a status 00 that was requested at this time, if it cannot be old (A-4.8-3)."""
        if status_ns - self._doubtful_since_ns >= self.status_lag_ns:
            self.results_doubtful = False

    def hides_command(self, after: Exchange | None) -> bool:
        """Whether a final result may be that of a command that a gap hides.

        Args:
            after: The last answered exchange with the name of the result. A command that was
                accepted after the gap cannot execute at the same time as a hidden one of its name.
        """
        known = after and after.result and after.certain and after.time_ns > self._doubtful_since_ns
        return self.results_doubtful and not known

    def forget_after_gap(self, now_ns: int) -> None:
        """Clear the state after a gap: nothing in it is certain any more."""
        self.results_doubtful, self._doubtful_since_ns = True, now_ns
        self.history = ExchangeHistory()
        self.last.clear()
        self.files.clear()
        self._files_bytes = 0
        for exchange in self.executing:
            exchange.certain = False

    def stored(self, transfer: Transfer) -> None:
        """Store a complete upload."""
        self.forget(transfer.name)
        self.files[transfer.name] = transfer
        self._files_bytes += len(transfer.content)
        while self._files_bytes > FILES_LIMIT_BYTES or len(self.files) > FILES_LIMIT:
            _, oldest = self.files.popitem(last=False)
            self._files_bytes -= len(oldest.content)

    def forget(self, name: bytes) -> None:
        """Remove a file that may have been deleted or replaced."""
        transfer = self.files.pop(name, None)
        if transfer:
            self._files_bytes -= len(transfer.content)
