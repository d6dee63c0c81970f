"""Finds the connections of this protocol among all connections of a packet capture.

A connection is of this protocol if it has a login, or frames with known opcodes in both directions,
or in one if nothing of the other was captured.
Nothing is judged here: a frame may be wrong in any other respect.
"""

from collections import Counter
from typing import Final

from scaraspec.protocol.commands import BY_NAME, is_known_opcode
from scaraspec.protocol.direction import A2C, Direction
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.tcp_segment import Endpoint

_LOGIN: Final = BY_NAME["login"]
_EXAMINED_BYTES: Final = 1 << 16  # of each connection
_SEVERAL: Final = 2
_MAX_CONNECTIONS: Final = 1 << 16  # without bytes so far


class _Candidate:
    """A connection with bytes."""

    def __init__(self, *, begins_mid_stream: bool) -> None:
        resync = is_known_opcode if begins_mid_stream else None
        self._framers = {direction: Framer(direction, resync) for direction in Direction}
        self._frames: Counter[Direction] = Counter()
        self._sent: set[Direction] = set()
        self._skipped = 0
        self._left_bytes = _EXAMINED_BYTES
        self._login = False

    def add(self, direction: Direction, data: bytes) -> None:
        if self._left_bytes <= 0:
            return
        self._left_bytes -= len(data)
        if data:
            self._sent.add(direction)
        for item in self._framers[direction].feed(data):
            if isinstance(item, Frame) and is_known_opcode(item.opcode, item.tagged):
                first = not (self._frames or self._skipped)
                self._login |= first and direction is A2C and item.opcode == _LOGIN.opcode
                self._frames[direction] += 1
            else:
                self._skipped += 1

    @property
    def is_of_this_protocol(self) -> bool:
        fewest = min(self._frames[direction] for direction in self._sent or Direction)
        clear = self._skipped < self._frames.total() and fewest >= _SEVERAL
        both = len(self._sent) > 1
        return self._login or clear or (both and fewest > 0 and not self._skipped)


class ProtocolSurvey:
    """Takes the events of a reassembler that follows all connections.

    Attributes:
        found: Both ends of each connection of this protocol, client first.
        other_ports: Number of other connections by port of the controller.
    """

    def __init__(self) -> None:
        self.found: set[tuple[Endpoint, Endpoint]] = set()
        self.other_ports: Counter[int] = Counter()
        self._ends: dict[str, tuple[Endpoint, Endpoint]] = {}
        self._candidates: dict[str, _Candidate] = {}

    def set_ends(self, connection: str, client: Endpoint, controller: Endpoint) -> None:
        """State the ends of a connection, before its first event."""
        if len(self._ends) >= _MAX_CONNECTIONS:
            self._conclude(next(iter(self._ends)))
        self._ends[connection] = client, controller

    def take(self, event: WireEvent) -> None:
        """Process the next event."""
        name = event.connection
        if event.kind in (Kind.CLOSED, Kind.RESET):
            self._conclude(name)
        elif event.kind in (Kind.BYTES, Kind.GAP) and name in self._ends:
            candidate = self._candidates.get(name)
            if candidate is None:
                mid_stream = event.kind is Kind.GAP
                candidate = self._candidates[name] = _Candidate(begins_mid_stream=mid_stream)
            candidate.add(event.direction, event.data)

    def finish(self) -> None:
        """Conclude the connections that did not end."""
        for name in list(self._ends):
            self._conclude(name)

    @property
    def found_ports(self) -> list[int]:
        """The ports of the controllers that were found, in ascending order."""
        return sorted({controller.port for _, controller in self.found})

    def _conclude(self, name: str) -> None:
        ends, candidate = self._ends.pop(name, None), self._candidates.pop(name, None)
        if ends is None or candidate is None:
            return
        if candidate.is_of_this_protocol:
            self.found.add(ends)
        else:
            self.other_ports[ends[1].port] += 1
