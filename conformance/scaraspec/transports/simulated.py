"""An asyncio event loop with simulated time, and links to the programs that run in it.

A real asyncio program, such as a client, runs on the loop. The tester holds the other side of its
connections as links. When no task is ready, the time jumps to the next timer. So a wait of 30 s
takes no real time and every run is deterministic.
"""

import asyncio
import selectors
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from scaraspec.transports.link import Arrival, Ending, LinkError

if TYPE_CHECKING:
    from collections.abc import Callable


class _Clock(selectors.SelectSelector):
    """A selector that advances the time in place of a sleep, and stops the loop at `until_s`."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0
        self.until_s = 0.0
        self.stop: Callable[[], None] = lambda: None

    def select(self, timeout: float | None = None) -> Any:
        """Advance the time by `timeout`, at most to `until_s`."""
        if timeout != 0:
            if self.now_s >= self.until_s:
                self.stop()
            next_s = self.until_s if timeout is None else self.now_s + timeout
            self.now_s = max(self.now_s, min(next_s, self.until_s))
        return super().select(0)


class SimulatedLoop(asyncio.SelectorEventLoop):
    """The event loop; `accept` returns the connections that its programs open.

    Args:
        epoch_ns: The Unix time at time 0 of the loop, for time stamps.
    """

    def __init__(self, epoch_ns: int = 0) -> None:
        self._clock = _Clock()
        super().__init__(self._clock)
        self._clock.stop = self.stop
        self._epoch_ns = epoch_ns
        self._unaccepted: deque[SimulatedLink] = deque()
        self.ports: set[int] = set()
        """The ports to which programs can connect; other ports refuse."""

    def time(self) -> float:
        """Return the current time in seconds."""
        return self._clock.now_s

    @property
    def time_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""
        return self._epoch_ns + round(self._clock.now_s * 1e9)

    def run_until(self, time_s: float) -> None:
        """Run the loop up to this time; `wake` stops it earlier."""
        self._clock.until_s = time_s
        self.run_forever()

    def wake(self) -> None:
        """Stop `run_until`, because a link has received something."""
        self.stop()

    async def create_connection(self, factory: Any, host: Any = None, port: Any = None) -> Any:  # type: ignore[override] # the subset that our programs use
        """Connect a program of this loop to the tester.

        Raises:
            ConnectionRefusedError: The port is not in `ports`.
        """
        if port not in self.ports:
            raise ConnectionRefusedError(111, f"no listener at {host}:{port}")
        protocol = factory()
        link = SimulatedLink(self, protocol, port)
        protocol.connection_made(link.transport)
        self._unaccepted.append(link)
        self.wake()
        return link.transport, protocol

    def accept(self, deadline_s: float) -> "SimulatedLink | None":
        """Return the next connection; None at the deadline or if the loop is woken."""
        if not self._unaccepted:
            self.run_until(max(deadline_s, self.time()))
        return self._unaccepted.popleft() if self._unaccepted else None


class _Transport(asyncio.Transport):
    """The program's side of a connection."""

    def __init__(self, link: "SimulatedLink") -> None:
        super().__init__()
        self._link = link

    def write(self, data: Any) -> None:
        """Send."""
        if data:
            self._link.enqueue(bytes(data))

    def can_write_eof(self) -> bool:
        """Return True: the sending direction can be closed alone."""
        return True

    def write_eof(self) -> None:
        """End the sending direction; receiving is still possible."""
        self._link.enqueue_end(Ending.CLOSED)

    def is_closing(self) -> bool:
        """Whether the connection has ended."""
        return self._link.ended

    def close(self) -> None:
        """Close the connection."""
        self._link.end(Ending.CLOSED)

    def abort(self) -> None:
        """Abort the connection."""
        self._link.end(Ending.RESET)


class SimulatedLink:
    """The tester's side of a connection; implements `Link`."""

    step_s = 1.0

    def __init__(self, loop: SimulatedLoop, protocol: asyncio.Protocol, port: int) -> None:
        self.transport = _Transport(self)
        self.ended = False
        self.port = port
        self._loop, self._protocol = loop, protocol
        self._arrivals: deque[Arrival] = deque()
        self._closed = False

    @property
    def now_s(self) -> float:
        """The current time of the loop."""
        return self._loop.time()

    def enqueue(self, data: bytes) -> None:
        """Queue bytes that the program has sent."""
        if not self.ended:
            self._arrivals.append(Arrival(self._loop.time_ns, data))
            self._loop.wake()

    def enqueue_end(self, ending: Ending) -> None:
        """Queue the end of the program's sending direction."""
        self._arrivals.append(Arrival(self._loop.time_ns, ending))
        self._loop.wake()

    def end(self, ending: Ending) -> None:
        """End the connection on behalf of the program."""
        if not self.ended:
            self.ended = True
            self.enqueue_end(ending)
            self._loop.call_soon(self._protocol.connection_lost, None)

    def send(self, data: bytes) -> int:
        """Send all of `data`; see `Link.send`."""
        if self._closed:
            raise LinkError("this link has been closed")
        if self.ended:
            raise LinkError("the peer has ended the connection")
        self._loop.call_soon(self._deliver, data)
        return self._loop.time_ns

    def receive(self, deadline_s: float, _others: Sequence[object] = (), /) -> Arrival | None:
        """Advance the time until something arrives; see `Link.receive`.

        Data for another link wakes the loop, so that this call returns.
        """
        if self._closed:
            raise LinkError("this link has been closed")
        if not self._arrivals:
            self._loop.run_until(max(deadline_s, self.now_s))
        if not self._arrivals:
            return None
        if isinstance(self._arrivals[0].content, Ending):
            return self._arrivals[0]
        return self._arrivals.popleft()

    def half_close(self) -> None:
        """End the sending direction; see `Link.half_close`."""
        self._loop.call_soon(self._notify_eof)

    def close(self) -> None:
        """Close the link; see `Link.close`."""
        if not self._closed:
            self._closed = True
            self._loop.call_soon(self._notify_connection_lost, None)

    def reset(self) -> None:
        """Abort the link; see `Link.reset`."""
        if not self._closed:
            self._closed = True
            self._loop.call_soon(self._notify_connection_lost, ConnectionResetError())

    def _deliver(self, data: bytes) -> None:
        if not self.ended:
            self._protocol.data_received(data)

    def _notify_eof(self) -> None:
        if not self.ended and not self._protocol.eof_received():
            self.end(Ending.CLOSED)

    def _notify_connection_lost(self, error: Exception | None) -> None:
        if not self.ended:
            self.ended = True
            self._protocol.connection_lost(error)
