"""Links without a carrier: client ends and a machine in one process, on a clock that jumps.

Whoever waits makes time pass: it goes from event to event of the machine, so that 30 s cost
nothing and every run is the same. What the machine is, is not known here: anything with the
methods of `Machine`, such as the virtual controller's core.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, Literal, Protocol

from scaraspec.transports.link import Arrival, Ending, LinkError

_STEP_S = 1e-3  # how far time goes past an event that the machine does not leave behind


class Action(Protocol):
    """Something a machine does on a connection: it sends data or, where that is None, ends it."""

    @property
    def connection(self) -> int:
        """Which connection."""

    @property
    def data(self) -> bytes | None:
        """What to send."""


class Machine(Protocol):
    """The other end: it is told what happens and when, and says what to do about it."""

    @property
    def next_event_s(self) -> float | None:
        """When something happens by itself; None if nothing will."""

    def open(
        self, connection: int, now_s: float, link: Literal["tcp", "serial"]
    ) -> Sequence[Action]:
        """A client has connected."""

    def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
        """Bytes have arrived."""

    def close(self, connection: int, now_s: float) -> Sequence[Action]:
        """A client sends no more."""

    def advance(self, now_s: float) -> Sequence[Action]:
        """Time has passed."""


class MemoryNetwork:
    """A machine, its clock, and the links to it.

    Args:
        machine: The other end of every link.
        now_s: The machine's present instant.
        epoch_ns: Unix time of the machine's instant 0, for time stamps.
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
        """The present instant in nanoseconds since the Unix epoch."""
        return self._epoch_ns + round(self.now_s * 1e9)

    def connect(self, link: Literal["tcp", "serial"] = "tcp") -> "MemoryLink":
        """Open a link, which a machine that refuses it closes at once.

        There is one serial line; that it is opened again the machine does not notice.
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
        """Let time pass, and everything happen in it."""
        while self.now_s < time_s:
            self.step(time_s)

    def step(self, limit_s: float) -> None:
        """Go to the next event, or to `limit_s` if that comes first."""
        event_s = self._machine.next_event_s
        if event_s is not None and event_s <= self.now_s:
            event_s = self.now_s + _STEP_S
        self.now_s = limit_s if event_s is None else min(event_s, limit_s)
        self.apply(self._machine.advance(self.now_s))

    def deliver(self, connection: int, data: bytes) -> None:
        """Bring bytes to the machine."""
        self.apply(self._machine.receive(connection, data, self.now_s))

    def hang_up(self, connection: int) -> None:
        """Tell the machine that a client sends no more; for it, that ends the connection."""
        self.apply(self._machine.close(connection, self.now_s))
        link_end = self._links.pop(connection, None)
        if link_end is not None:
            link_end.enqueue(None)

    def disconnect(self, connection: int) -> None:
        """Bring nothing more to the client's end."""
        self._links.pop(connection, None)

    def apply(self, actions: Sequence[Action]) -> None:
        """Bring about what the machine does."""
        for action in actions:
            link_end = self._links.get(action.connection)
            if link_end is not None:
                link_end.enqueue(action.data)
            if action.data is None:
                self.disconnect(action.connection)
                if action.connection == self._serial_connection:
                    self._serial_connection = 0


class MemoryLink:
    """A client's end; made by `MemoryNetwork.connect`."""

    step_s = math.inf  # however much time passes, it takes none

    def __init__(self, network: MemoryNetwork, connection: int) -> None:
        self._network = network
        self._connection = connection
        self._arrivals: deque[Arrival] = deque()
        self._can_send = True
        self._can_receive = True

    @property
    def now_s(self) -> float:
        """The present instant of the network's clock."""
        return self._network.now_s

    def enqueue(self, data: bytes | None) -> None:
        """Keep what the machine did for `receive`."""
        what = Ending.CLOSED if data is None else data
        if what:
            self._arrivals.append(Arrival(self._network.time_ns, what))

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
        """Whether anything is there to be received."""
        return bool(self._arrivals)

    def receive(self, deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
        """Let time pass until bytes or the end arrive; see `Link.receive`."""
        if not self._can_receive:
            raise LinkError("this link has been closed")
        while not (self._arrivals or any(other.has_arrivals for other in others)):
            if self.now_s >= deadline_s:
                break
            self._network.step(deadline_s)
        if not self._arrivals:
            return None
        if isinstance(self._arrivals[0].content, Ending):
            return self._arrivals[0]
        return self._arrivals.popleft()

    def half_close(self) -> None:
        """Send no more; see `Link.half_close`."""
        if self._can_send:
            self._can_send = False
            self._network.hang_up(self._connection)

    def close(self) -> None:
        """End the link; see `Link.close`."""
        self.half_close()
        self._can_receive = False

    def reset(self) -> None:
        """Cut the link off, which the machine cannot tell from closing."""
        self.close()


class _SerialMemoryLink(MemoryLink):
    """The end of the serial line, which is closed without the machine's notice."""

    def half_close(self) -> None:
        """Refuse: a serial line has no ends of its own; see `Link.half_close`."""
        raise LinkError("a serial line cannot be half closed")

    def close(self) -> None:
        """Close the device."""
        self._can_send = self._can_receive = False
        self._network.disconnect(self._connection)
