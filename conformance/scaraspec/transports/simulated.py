"""An asyncio loop whose time passes only while somebody waits, and the connections made in it.

What runs on the loop is a real asyncio program, such as a client; whoever tests it holds the other
end of its connections as links. Where nothing is left to be done time jumps to the next alarm, so
that 30 s cost nothing and every run is the same.
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
    """Where the loop would sleep, time jumps; where it may not go on, the loop stops."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0
        self.until_s = 0.0
        self.stop: Callable[[], None] = lambda: None

    def select(self, timeout: float | None = None) -> Any:
        """Nothing is left to be done for this time."""
        if timeout != 0:
            if self.now_s >= self.until_s:
                self.stop()
            next_s = self.until_s if timeout is None else self.now_s + timeout
            self.now_s = max(self.now_s, min(next_s, self.until_s))
        return super().select(0)


class SimulatedLoop(asyncio.SelectorEventLoop):
    """The loop; everything that its programs dial is taken by `accept`.

    Args:
        epoch_ns: Unix time of its instant 0, for time stamps.
    """

    def __init__(self, epoch_ns: int = 0) -> None:
        self._clock = _Clock()
        super().__init__(self._clock)
        self._clock.stop = self.stop
        self._epoch_ns = epoch_ns
        self._unaccepted: deque[SimulatedLink] = deque()
        self.ports: set[int] = set()
        """Where somebody listens."""

    def time(self) -> float:
        """The present instant."""
        return self._clock.now_s

    @property
    def time_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""
        return self._epoch_ns + round(self._clock.now_s * 1e9)

    def run_until(self, time_s: float) -> None:
        """Let everything happen up to this time; `wake` ends it early."""
        self._clock.until_s = time_s
        self.run_forever()

    def wake(self) -> None:
        """Something came for whoever waits."""
        self.stop()

    async def create_connection(self, factory: Any, host: Any = None, port: Any = None) -> Any:  # type: ignore[override] # what our programs use of it
        """Dial, in this loop.

        Raises:
            ConnectionRefusedError: Nobody listens.
        """
        if port not in self.ports:
            raise ConnectionRefusedError(111, f"nobody listens at {host}:{port}")
        protocol = factory()
        link = SimulatedLink(self, protocol, port)
        protocol.connection_made(link.transport)
        self._unaccepted.append(link)
        self.wake()
        return link.transport, protocol

    def accept(self, deadline_s: float) -> "SimulatedLink | None":
        """The next connection; None if none comes by then, or something else woke us."""
        if not self._unaccepted:
            self.run_until(max(deadline_s, self.time()))
        return self._unaccepted.popleft() if self._unaccepted else None


class _Transport(asyncio.Transport):
    """The program's end of a connection."""

    def __init__(self, link: "SimulatedLink") -> None:
        super().__init__()
        self._link = link

    def write(self, data: Any) -> None:
        """Send."""
        if data:
            self._link.enqueue(bytes(data))

    def can_write_eof(self) -> bool:
        """It can."""
        return True

    def write_eof(self) -> None:
        """Send no more, and hear on."""
        self._link.enqueue_end(Ending.CLOSED)

    def is_closing(self) -> bool:
        """Whether it has been ended."""
        return self._link.ended

    def close(self) -> None:
        """End in order."""
        self._link.end(Ending.CLOSED)

    def abort(self) -> None:
        """Cut off."""
        self._link.end(Ending.RESET)


class SimulatedLink:
    """The tester's end of a connection; see `links.link.Link`."""

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
        """The present instant of the loop."""
        return self._loop.time()

    def enqueue(self, data: bytes) -> None:
        """The program has sent something."""
        if not self.ended:
            self._arrivals.append(Arrival(self._loop.time_ns, data))
            self._loop.wake()

    def enqueue_end(self, ending: Ending) -> None:
        """The program sends no more."""
        self._arrivals.append(Arrival(self._loop.time_ns, ending))
        self._loop.wake()

    def end(self, ending: Ending) -> None:
        """The program has ended it."""
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
        """Let time pass until something arrives, or the loop is woken; see `Link.receive`.

        Whatever arrives elsewhere wakes it.
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
        """Send no more; see `Link.half_close`."""
        self._loop.call_soon(self._notify_eof)

    def close(self) -> None:
        """End the link; see `Link.close`."""
        if not self._closed:
            self._closed = True
            self._loop.call_soon(self._notify_connection_lost, None)

    def reset(self) -> None:
        """Cut the link off; see `Link.reset`."""
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
