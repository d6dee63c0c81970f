"""Memory links: clients and a machine in one process, on a simulated clock.

A wait advances the clock to the next event of the machine. So a wait of 30 s takes no real time
and every run is deterministic. The machine is any object with the methods of `Machine`, such as
the core of the virtual controller.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, Literal, Protocol

from scaraspec.transports.link import Arrival, Ending, LinkError

_STEP_S = 1e-3  # how far time advances past an event that the machine does not remove


class Action(Protocol):
    """An action of a machine on a connection: send data, or close it if the data is None."""

    @property
    def connection(self) -> int:
        """The number of the connection."""

    @property
    def data(self) -> bytes | None:
        """The bytes to send; None to close the connection."""


class Machine(Protocol):
    """The peer of the links: it receives events with their times and returns actions."""

    @property
    def next_event_s(self) -> float | None:
        """The time of the next event that needs no input; None if there is none."""

    def open(
        self, connection: int, now_s: float, link: Literal["tcp", "serial"]
    ) -> Sequence[Action]:
        """Process the connection of a client."""

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        """Process bytes that a client has sent."""

    def close(self, connection: int, now_s: float) -> Sequence[Action]:
        """Process that a client has closed its sending direction."""

    def advance(self, now_s: float) -> Sequence[Action]:
        """Process the events up to this time."""


class MemoryNetwork:
    """A machine, the clock, and the links to the machine.

    Args:
        machine: The peer of every link.
        now_s: The initial time of the clock.
        epoch_ns: The Unix time at time 0 of the clock, for time stamps.
    """

    def __init__(self, machine: Machine, now_s: float = 0.0, epoch_ns: int = 0) -> None:
        self.now_s = now_s
        self._machine = machine
        self._epoch_ns = epoch_ns
        self._links: dict[int, MemoryLink] = {}
        self._opened = 0
        self._serial_connection = 0  # the connection of the serial line

    @property
    def time_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""
        return self._epoch_ns + round(self.now_s * 1e9)

    def connect(self, link: Literal["tcp", "serial"] = "tcp") -> "MemoryLink":
        """Open a link; a machine that refuses the connection closes it immediately.

        There is one serial line. The machine does not notice that the line is opened again.
        """
        link_end: MemoryLink
        if link == "serial" and self._serial_connection:
            link_end = self._links[self._serial_connection] = _SerialMemoryLink(
                self, self._serial_connection
            )
            return link_end
        self._opened += 1
        if link == "serial":
            self._serial_connection = self._opened
        link_end = (_SerialMemoryLink if link == "serial" else MemoryLink)(self, self._opened)
        self._links[self._opened] = link_end
        self.apply(self._machine.open(self._opened, self.now_s, link))
        return link_end

    def run_until(self, time_s: float) -> None:
        """Advance the clock to `time_s` and process all events up to then."""
        while self.now_s < time_s:
            self.step(time_s)

    def step(self, limit_s: float) -> None:
        """Advance the clock to the next event, or to `limit_s` if that is earlier."""
        event_s = self._machine.next_event_s
        if event_s is not None and event_s <= self.now_s:
            event_s = self.now_s + _STEP_S
        self.now_s = limit_s if event_s is None else min(event_s, limit_s)
        self.apply(self._machine.advance(self.now_s))

    def deliver(self, connection: int, data: bytes) -> None:
        """Deliver bytes to the machine."""
        self.apply(self._machine.receive(connection, data, self.now_s))

    def hang_up(self, connection: int) -> None:
        """Report to the machine that a client has ended; this ends the connection."""
        self.apply(self._machine.close(connection, self.now_s))
        link_end = self._links.pop(connection, None)
        if link_end is not None:
            link_end.enqueue(None)

    def disconnect(self, connection: int) -> None:
        """Deliver nothing more to the link of this connection."""
        self._links.pop(connection, None)

    def apply(self, actions: Sequence[Action]) -> None:
        """Carry out the actions of the machine."""
        for action in actions:
            link_end = self._links.get(action.connection)
            if link_end is not None:
                link_end.enqueue(action.data)
            if action.data is None:
                self.disconnect(action.connection)
                if action.connection == self._serial_connection:
                    self._serial_connection = 0


class MemoryLink:
    """A link to the machine; created by `MemoryNetwork.connect`."""

    step_s = math.inf  # a wait takes no real time

    def __init__(self, network: MemoryNetwork, connection: int) -> None:
        self._network = network
        self._connection = connection
        self._arrivals: deque[Arrival] = deque()
        self._can_send = True
        self._can_receive = True

    @property
    def now_s(self) -> float:
        """The current time of the network's clock."""
        return self._network.now_s

    def enqueue(self, data: bytes | None) -> None:
        """Queue bytes, or the end for None, for `receive`."""
        content = Ending.CLOSED if data is None else data
        if content:
            self._arrivals.append(Arrival(self._network.time_ns, content))

    def send(self, data: bytes) -> int:
        """Send all of `data`; see `Link.send`."""
        if not self._can_send:
            raise LinkError("this link has been closed")
        if self._arrivals and self._arrivals[-1].content is Ending.CLOSED:
            raise LinkError("the peer has ended the connection")
        time_ns = self._network.time_ns
        self._network.deliver(self._connection, data)
        return time_ns

    @property
    def has_arrivals(self) -> bool:
        """Whether data or the end can be received."""
        return bool(self._arrivals)

    def receive(self, deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
        """Advance the clock until bytes or the end arrive; see `Link.receive`."""
        if not self._can_receive:
            raise LinkError("this link has been closed")
        while not self._arrivals:
            if self.now_s >= deadline_s or (others and any(other.has_arrivals for other in others)):
                break
            self._network.step(deadline_s)
        if not self._arrivals:
            return None
        if isinstance(self._arrivals[0].content, Ending):
            return self._arrivals[0]
        return self._arrivals.popleft()

    def half_close(self) -> None:
        """End the sending direction; see `Link.half_close`."""
        if self._can_send:
            self._can_send = False
            self._network.hang_up(self._connection)

    def close(self) -> None:
        """Close the link; see `Link.close`."""
        self.half_close()
        self._can_receive = False

    def reset(self) -> None:
        """Close the link; the machine cannot distinguish a reset from a close."""
        self.close()


class _SerialMemoryLink(MemoryLink):
    """A link over the serial line; the machine does not notice that it is closed."""

    def half_close(self) -> None:
        """Raise `LinkError`: a serial line has no half-close."""
        raise LinkError("a serial line cannot be half closed")

    def close(self) -> None:
        """Close the device."""
        self._can_send = self._can_receive = False
        self._network.disconnect(self._connection)
