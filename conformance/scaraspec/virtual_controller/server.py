"""The server: connects a controller core to TCP and to a clock, in one asyncio loop.

It limits the resources of a client: number of connections, unread bytes, and requests per turn.
The core decides about the replies.
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
"""Bytes per call of the core: at most 16 requests, which limits the replies in the buffer."""
SLICES_PER_TURN: Final = 64
"""Maximum number of slices of one client per turn of the event loop."""
UNREAD_BYTES: Final = 64 * 1024
"""Limit of unread reply bytes; above it, the server stops reading from the client."""
STALL_S: Final = 10.0
"""How long a client may leave replies unread before it is disconnected, in seconds."""
GRACE_S: Final = 2.0
"""How long `Server.close` waits until the clients have read the last replies, in seconds."""

# Seconds of silence, seconds between probes, probes: a lost peer is detected within a minute, which
# stops its jog (A-2-8).
_KEEP_ALIVE: Final = (("TCP_KEEPIDLE", 30), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 3))
_MIN_DELAY_S: Final = 0.001  # between two timer events, so that no program blocks the loop

log = logging.getLogger("scaraspec.virtual_controller")


class Endpoint(Protocol):
    """The server's endpoint of one connection."""

    def send(self, data: bytes) -> None:
        """Send bytes, buffered until the peer reads them."""

    def finish(self) -> None:
        """Close after everything is sent."""

    def abort(self) -> None:
        """Close at once."""


class Server:
    """Serves a controller core. Create and use it inside a running event loop.

    Args:
        core: The controller core; its time starts at 0.
        time_scale: Simulated seconds per real second.
    """

    def __init__(self, core: ControllerCore, time_scale: float = 1.0) -> None:
        self.core = core
        self.stopped = asyncio.Event()
        """Set after the robot was shut down or `stop` was called."""
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
        """The current time of the core in seconds."""
        return (self._loop.time() - self._began_s) * self._time_scale

    async def listen(self, host: str, port: int) -> tuple[str, int]:
        """Start to accept clients.

        Returns:
            The address and port in use.

        Raises:
            OSError: The address does not exist on this machine, is in use, or is not permitted.
            UnicodeError: The host name is not valid.
        """
        addresses = await self._loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        address = addresses[0][4]
        self._listener = await self._loop.create_server(
            lambda: _Client(self), str(address[0]), int(address[1])
        )
        used = self._listener.sockets[0].getsockname()
        return used[0], used[1]

    def stop(self) -> None:
        """Set `stopped`, so that the owner ends the server with `close`."""
        self.stopped.set()

    async def close(self) -> None:
        """Close every connection; wait up to `GRACE_S` until the last replies are read."""
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

    # ------------------------------------------------------------------ called by endpoints

    def add_connection(self, endpoint: Endpoint, carrier: Carrier) -> int | None:
        """Add a connection and return its number; None if the server is full.

        A full server disconnects the oldest client that has not logged in.
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
        """Pass received bytes to the core."""
        self._perform(self.core.receive(connection, data, self.now_s))

    def remove_connection(self, connection: int) -> None:
        """Remove a connection that has ended."""
        if self._endpoints.pop(connection, None) is not None:
            log.info("#%d closed", connection)
            self._perform(self.core.close(connection, self.now_s))
            if not self._endpoints:
                self._empty.set()

    def advance(self) -> None:
        """Advance the core to the current time, also after a change of the plant."""
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
            self._timer = self._loop.call_later(max(delay_s, _MIN_DELAY_S), self.advance)


class _Client(asyncio.Protocol):
    """One TCP client. Its requests are processed in slices, while it reads the replies."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._loop = asyncio.get_running_loop()
        self._connection: int | None = None
        self._unprocessed, self._offset = b"", 0
        self._blocked = False
        self._stall_timer: asyncio.TimerHandle | None = None

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
        self._unprocessed, self._offset = data, 0
        self._serve()

    def eof_received(self) -> None:
        self._set_stall_timer(active=True)
        self._end()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        self._unprocessed = b""
        self._set_stall_timer(active=False)
        self._end()

    def pause_writing(self) -> None:
        self._blocked = True
        self._set_stall_timer(active=True)

    def resume_writing(self) -> None:
        self._blocked = False
        self._set_stall_timer(active=self._transport.is_closing())
        self._serve()

    def send(self, data: bytes) -> None:
        if not self._transport.is_closing():  # asyncio warns about writes after a disconnect
            self._transport.write(data)

    def finish(self) -> None:
        self._transport.close()
        self._set_stall_timer(active=True)

    def abort(self) -> None:
        self._transport.abort()

    def _end(self) -> None:
        if self._connection is not None:
            self._server.remove_connection(self._connection)

    def _serve(self) -> None:
        for _ in range(SLICES_PER_TURN):
            if self._blocked or self._offset >= len(self._unprocessed):
                break
            slice_ = self._unprocessed[self._offset : self._offset + SLICE_BYTES]
            self._offset += SLICE_BYTES
            if self._connection is not None:
                self._server.receive(self._connection, slice_)
        if self._blocked or self._transport.is_closing():
            return
        if self._offset < len(self._unprocessed):
            self._loop.call_soon(self._serve)
        else:
            self._transport.resume_reading()

    def _set_stall_timer(self, *, active: bool) -> None:
        """Start the timer that disconnects the client after `STALL_S`, or cancel it."""
        if self._stall_timer is not None:
            self._stall_timer.cancel()
        self._stall_timer = self._loop.call_later(STALL_S, self.abort) if active else None
