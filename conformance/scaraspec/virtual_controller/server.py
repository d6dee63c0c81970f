"""The server: TCP connections and the clock around a core, in one asyncio loop.

What a client may cost lives here: how many there are, how much they may leave unread, and how much
of what they send is served at a time. What is answered does not.
"""

import asyncio
import contextlib
import logging
import socket
from typing import Final, Protocol

from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Carrier

MAX_CLIENTS: Final = 64
SLICE_BYTES: Final = 64
"""Bytes given to the core at once: at most 16 requests, so that answers cannot pile up."""
SLICES_PER_TURN: Final = 64
"""How many slices of one client are served before the others have their turn."""
UNREAD_BYTES: Final = 64 * 1024
"""Unread answers beyond which a client is not served any further."""
STALL_S: Final = 10.0
"""For how long a client may not read its answers before it is cut off."""
GRACE_S: Final = 2.0
"""For how long the end of the server waits until the last answers are read."""

# Seconds of silence, seconds between probes, probes: a peer that vanished is noticed in a minute,
# which ends its jog (A-2-8).
_KEEP_ALIVE: Final = (("TCP_KEEPIDLE", 30), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 3))
_SOONEST_S: Final = 0.001  # between two events, so that no program keeps the loop to itself

log = logging.getLogger("scaraspec.virtual_controller")


class Endpoint(Protocol):
    """The server's end of one connection."""

    def send(self, data: bytes) -> None:
        """Send these bytes when the peer takes them."""

    def finish(self) -> None:
        """Close once everything is sent."""

    def abort(self) -> None:
        """Close at once."""


class Server:
    """Serves a core; to be made and used inside a running loop.

    Args:
        core: The controller; its instant 0 is now.
        time_scale: How many of its seconds pass in one of ours.
    """

    def __init__(self, core: ControllerCore, time_scale: float = 1.0) -> None:
        self.core = core
        self.stopped = asyncio.Event()
        """Set once the robot was shut down, or `stop` was called."""
        self._loop = asyncio.get_running_loop()
        self._began_s = self._loop.time()
        self._time_scale = time_scale
        self._endpoints: dict[int, Endpoint] = {}
        self._connections = 0
        self._timer: asyncio.TimerHandle | None = None
        self._listener: asyncio.Server | None = None
        self._empty = asyncio.Event()

    @property
    def now_s(self) -> float:
        """The core's present instant."""
        return (self._loop.time() - self._began_s) * self._time_scale

    async def listen(self, host: str, port: int) -> tuple[str, int]:
        """Accept clients from now on.

        Returns:
            Address and port in use.

        Raises:
            OSError: The address does not exist here, is in use, or may not be used.
            UnicodeError: The host is no name.
        """
        found = await self._loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        address = found[0][4]
        self._listener = await self._loop.create_server(
            lambda: _Client(self), str(address[0]), int(address[1])
        )
        used = self._listener.sockets[0].getsockname()
        return used[0], used[1]

    def stop(self) -> None:
        """End serving; `close` does the rest."""
        self.stopped.set()

    async def close(self) -> None:
        """Close every connection, and wait a little until the last answers are read."""
        if self._listener is not None:
            self._listener.close()
        if self._timer is not None:
            self._timer.cancel()
        if self._endpoints:
            self._empty.clear()
            for endpoint in list(self._endpoints.values()):
                endpoint.finish()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._empty.wait(), GRACE_S)
        for endpoint in list(self._endpoints.values()):
            endpoint.abort()

    # ------------------------------------------------------------------ what ends tell

    def add_connection(self, endpoint: Endpoint, carrier: Carrier) -> int | None:
        """Give a new connection its number; None if there is no room.

        Where the server is full, the oldest client that has not logged in makes way.
        """
        if len(self._endpoints) >= MAX_CLIENTS:
            idle = next((n for n, s in self.core.sessions.items() if not s.logged_in), None)
            if idle is None:
                return None
            self._endpoints[idle].abort()
            self.remove_connection(idle)
        self._connections += 1
        self._endpoints[self._connections] = endpoint
        log.info("#%d opened over %s", self._connections, carrier)
        self._perform(self.core.open(self._connections, self.now_s, carrier))
        return self._connections

    def receive(self, connection: int, data: bytes) -> None:
        """Bytes have come from a client."""
        self._perform(self.core.receive(connection, data, self.now_s))

    def remove_connection(self, connection: int) -> None:
        """A connection has ended."""
        if self._endpoints.pop(connection, None) is not None:
            log.info("#%d closed", connection)
            self._perform(self.core.close(connection, self.now_s))
            if not self._endpoints:
                self._empty.set()

    def advance(self) -> None:
        """Let the core do what is due, or see what was done to its plant."""
        self._perform(self.core.advance(self.now_s))

    def _perform(self, actions: list[Action]) -> None:
        if not self.core.powered:
            self.stop()
        for action in actions:
            endpoint = self._endpoints.get(action.connection)
            if endpoint is None:
                continue
            if action.data is None:
                endpoint.finish()
            else:
                endpoint.send(action.data)
        if self._timer is not None:
            self._timer.cancel()
        event_s = self.core.next_event_s
        if event_s is not None:
            delay_s = (event_s - self.now_s) / self._time_scale
            self._timer = self._loop.call_later(max(delay_s, _SOONEST_S), self.advance)


class _Client(asyncio.Protocol):
    """One TCP client: what it sends is served slice by slice, as far as it reads the answers."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._loop = asyncio.get_running_loop()
        self._connection: int | None = None
        self._unserved, self._at = b"", 0
        self._blocked = False
        self._stall: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.set_write_buffer_limits(high=UNREAD_BYTES)
        connected = transport.get_extra_info("socket")
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in _KEEP_ALIVE:
            with contextlib.suppress(AttributeError, OSError):  # not every system has all three
                connected.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
        self._connection = self._server.add_connection(self, "tcp")
        if self._connection is None:
            transport.abort()

    def data_received(self, data: bytes) -> None:
        self._transport.pause_reading()
        self._unserved, self._at = data, 0
        self._serve()

    def eof_received(self) -> None:
        self._expect_progress(due=True)
        self._end()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        self._unserved = b""
        self._expect_progress(due=False)
        self._end()

    def pause_writing(self) -> None:
        self._blocked = True
        self._expect_progress(due=True)

    def resume_writing(self) -> None:
        self._blocked = False
        self._expect_progress(due=self._transport.is_closing())
        self._serve()

    def send(self, data: bytes) -> None:
        if not self._transport.is_closing():  # asyncio warns of every write to whom has gone
            self._transport.write(data)

    def finish(self) -> None:
        self._transport.close()
        self._expect_progress(due=True)

    def abort(self) -> None:
        self._transport.abort()

    def _end(self) -> None:
        if self._connection is not None:
            self._server.remove_connection(self._connection)

    def _serve(self) -> None:
        for _ in range(SLICES_PER_TURN):
            if self._blocked or self._at >= len(self._unserved):
                break
            piece = self._unserved[self._at : self._at + SLICE_BYTES]
            self._at += SLICE_BYTES
            if self._connection is not None:
                self._server.receive(self._connection, piece)
        if self._blocked or self._transport.is_closing():
            return
        if self._at < len(self._unserved):
            self._loop.call_soon(self._serve)
        else:
            self._transport.resume_reading()

    def _expect_progress(self, *, due: bool) -> None:
        """Cut the client off in `STALL_S`, unless it has made progress by then."""
        if self._stall is not None:
            self._stall.cancel()
        self._stall = self._loop.call_later(STALL_S, self.abort) if due else None
