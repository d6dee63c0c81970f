"""The tap: a transparent TCP relay that reports traffic to the spool. Forward first.

Belongs here: connections and their events, forwarded unchanged: bytes, half-close, reset and
back-pressure. The path of a byte has one write to the other socket and one append to the spool; no
decoding and no waiting. Does not belong here: frames and capture formats.
"""

import asyncio
import errno
import gc
import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, cast

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.child_process import ignore_signals
from scaraspec_recorder.spool.records import (
    UNREACHABLE,
    ControlRecord,
    stream_number,
    unforwarded_record,
)
from scaraspec_recorder.spool.spool import SpoolWriter
from scaraspec_recorder.tap import kernel_timestamps, tcp
from scaraspec_recorder.tap.routes import Route

BUFFER_BYTES: Final = 256 << 10
"""Bytes queued for a blocked socket, plus one read, before reading from its peer is paused."""

STOP_S: Final = 2.0
"""Time limit to forward queued bytes when the tap stops."""

PEER_CHECK_S: Final = 10.0
"""Interval at which lost peers are looked for."""

_READ_SIZE: Final = "max_size"  # attribute of asyncio's transports; uvloop's do not have it
_DESCRIPTORS: Final = os.name == "posix"  # on Windows, a socket is not a file descriptor

_write: Final = os.write  # these two are used for every chunk
_BYTES: Final = Kind.BYTES

Append = Callable[..., None]
"""Receives the fields of a `records.Record`; never raises and never waits."""

Connect = Callable[["Tap", int], "Connection"]
"""Factory of the tap's connections; numbers count from 1."""


class Tap:
    """Relays all connections that a listening socket accepts.

    Args:
        route: Target of the connections.
        append: Receives the records.
        connect: Factory of connections that change the traffic; None to forward it unchanged.
        kernel_time: Whether to use kernel timestamps, see `kernel_timestamps`.
        now_ns: The clock.
    """

    def __init__(
        self,
        route: Route,
        append: Append,
        connect: Connect | None = None,
        *,
        kernel_time: bool = False,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.route = route
        self.append = append
        self.kernel_time = kernel_time
        self.now_ns = now_ns
        self.resets = tcp.ResetWatch()
        self._connect = connect or Connection
        self._connections: set[Connection] = set()
        self._accepted = 0
        self._servers: list[asyncio.Server] = []
        self._connection_removed = asyncio.Event()
        self._peer_check = asyncio.get_running_loop().call_later(PEER_CHECK_S, self._check_peers)

    async def start(self, listener: socket.socket) -> None:
        """Start to accept connections, also of further listeners; `stop` closes `listener`."""
        self.kernel_time = self.kernel_time and kernel_timestamps.enable_timestamps(listener)
        loop = asyncio.get_running_loop()
        server = await loop.create_server(self._accept, sock=listener, backlog=tcp.BACKLOG)
        self._servers.append(server)

    async def stop(self) -> None:
        """Stop accepting and close all connections: orderly within `STOP_S`, then by reset."""
        self._peer_check.cancel()
        for server in self._servers:
            server.close()
        for connection in tuple(self._connections):
            connection.close("the recorder stopped")
        try:
            await asyncio.wait_for(self._wait_until_empty(), STOP_S)
        except TimeoutError:
            for connection in self._connections:
                connection.reset()
            await self._wait_until_empty()
        self.resets.close()

    def drop_urgent(self) -> None:
        """Record the urgent data of all connections. Must be called at SIGURG."""
        for connection in tuple(self._connections):
            connection.drop_urgent()

    def remove(self, connection: "Connection") -> None:
        """Remove a connection. Both of its sockets are closed."""
        self._connections.discard(connection)
        self._connection_removed.set()

    async def _wait_until_empty(self) -> None:
        while self._connections:
            self._connection_removed.clear()
            await self._connection_removed.wait()

    def _check_peers(self) -> None:
        """Reset the sockets whose peer is lost."""
        for connection in tuple(self._connections):
            connection.check_peers()
        self._peer_check = asyncio.get_running_loop().call_later(PEER_CHECK_S, self._check_peers)

    def _accept(self) -> "SocketEnd":
        self._accepted += 1
        connection = self._connect(self, self._accepted)
        self._connections.add(connection)
        return connection.client


def new_event_loop() -> asyncio.AbstractEventLoop:
    """Return an event loop of uvloop, which is faster; on Windows, one of asyncio.

    The usual event loop of Windows binds a listening socket to its process, so that a restarted
    process could not use it.
    """
    if sys.platform == "win32":
        return asyncio.SelectorEventLoop()
    import uvloop  # noqa: PLC0415 - absent on Windows

    return uvloop.new_event_loop()


def run(  # noqa: PLR0913, PLR0917 - the arguments of a process
    listeners: Sequence[socket.socket],
    route: Route,
    spool: Path,
    limit_bytes: int,
    connect: Connect | None,
    kernel_time: bool,  # noqa: FBT001 - as above
    _writer_line: socket.socket,
    line: socket.socket,
) -> None:
    """Main function of the tap process: relay until the line is closed.

    The process holds the line of the writer process without using it: it closes when the tap
    process ends, and the writer process reads the spool until then.
    """
    ignore_signals()
    tcp.allow_many_sockets()

    async def relay() -> None:
        loop = asyncio.get_running_loop()
        writer = SpoolWriter(spool, loop.call_later, limit_bytes=limit_bytes)
        tap = Tap(route, writer.append, connect, kernel_time=kernel_time)
        if sys.platform == "linux":
            loop.add_signal_handler(signal.SIGURG, tap.drop_urgent)
        for listener in listeners:
            await tap.start(listener)
        gc.freeze()  # imported objects stay alive: exclude them from collections
        line.settimeout(0)
        await loop.sock_recv(line, 1)
        await tap.stop()
        writer.close()

    with asyncio.Runner(loop_factory=new_event_loop) as runner:
        runner.run(relay())


class SocketEnd(asyncio.Protocol):
    """One socket of a connection. Bytes read here are written to the peer socket, then recorded."""

    peer: "SocketEnd"

    def __init__(self, connection: "Connection", number: int, direction: Direction) -> None:
        self.connection = connection
        self.stream = stream_number(number, direction)
        self.received_bytes = 0
        self.half_closed = False  # its sender sends no more bytes
        self.closed = False
        self.lost = False  # the other side does not acknowledge
        self.transport: asyncio.Transport | None = None
        self.descriptor = -1
        self.early_data: list[tuple[bytes, int, bool]] = []  # read before the peer was connected
        self._reader: asyncio.Transport | kernel_timestamps.TimestampedReader | None = None
        self._append = connection.tap.append
        self._now_ns = connection.tap.now_ns

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The socket is connected."""
        transport = cast(
            "asyncio.Transport", transport
        )  # uvloop's transport does not inherit from it
        sock = transport.get_extra_info("socket")
        tcp.tune(sock)
        transport.set_write_buffer_limits(high=BUFFER_BYTES)
        if hasattr(transport, _READ_SIZE):  # 256 KiB, which glibc maps and unmaps for every read
            setattr(transport, _READ_SIZE, kernel_timestamps.READ_BYTES)
        self.descriptor = sock.fileno()
        self.transport = self._reader = transport
        if self.connection.tap.kernel_time and kernel_timestamps.enable_timestamps(sock):
            # Not now: the event loop starts to read when this method returns.
            asyncio.get_running_loop().call_soon(self._read_stamped, transport)
        self.connection.connected(self)

    def data_received(self, data: bytes, time_ns: int = 0, kernel_time: bool = False) -> None:  # noqa: FBT001, FBT002 - an event loop gives the data alone
        """Forward bytes, then record them.

        Args:
            data: The bytes.
            time_ns: Time of reception; 0 for now.
            kernel_time: Whether `time_ns` is a kernel timestamp.
        """
        time_ns = time_ns or self._now_ns()
        peer = self.peer
        transport = peer.transport
        if transport is None:
            self.early_data.append((data, time_ns, kernel_time))
            self.pause()
            return
        if transport.get_write_buffer_size() or not _DESCRIPTORS:
            transport.write(data)
        elif not transport.is_closing():
            # Directly: uvloop's write would wait until the end of the loop iteration.
            try:
                sent = _write(peer.descriptor, data)
            except OSError:
                sent = 0  # the socket is full or closed; the transport handles both
            if sent < len(data):
                transport.write(memoryview(data)[sent:])
        offset_bytes, forwarded_ns = self.received_bytes, self._now_ns()
        self._append(_BYTES, self.stream, time_ns, offset_bytes, data, forwarded_ns, kernel_time)
        self.received_bytes += len(data)

    def eof_received(self) -> bool:
        """The sender half-closed the connection."""
        self.half_closed = True
        if self.peer.transport:
            self.connection.half_closed(self)
        return True  # keep the other direction open

    def connection_lost(self, exc: Exception | None) -> None:
        """The socket is closed."""
        if isinstance(self._reader, kernel_timestamps.TimestampedReader):
            self._reader.close()
            exc = exc or self._reader.failure
        why = _reason(exc) if exc else "reset"
        self.connection.socket_closed(self, os.strerror(errno.ETIMEDOUT) if self.lost else why)

    def pause_writing(self) -> None:
        """The socket's write buffer is full: pause the peer."""
        self.peer.pause()

    def resume_writing(self) -> None:
        """The socket accepts data again: resume the peer."""
        self.peer.resume()

    def pause(self) -> None:
        """Pause reading: the peer socket is blocked."""
        if self._reader and not self._reader.is_closing():
            self._reader.pause_reading()

    def resume(self) -> None:
        """Resume reading."""
        if self._reader and not self._reader.is_closing() and not self.half_closed:
            self._reader.resume_reading()

    def _read_stamped(self, transport: asyncio.Transport) -> None:
        """Switch to reading with kernel timestamps."""
        if transport.is_closing() or self.half_closed:
            return
        try:
            reader = kernel_timestamps.TimestampedReader(
                transport, self.data_received, self.eof_received
            )
        except OSError:  # too many open files: continue without timestamps
            return
        reading = transport.is_reading()
        transport.pause_reading()
        self._reader = reader
        if reading:
            reader.resume_reading()


class Connection:
    """A client's connection and its upstream connection."""

    end_type: type[SocketEnd] = SocketEnd

    def __init__(self, tap: Tap, number: int) -> None:
        self.tap = tap
        self.client = self.end_type(self, number, A2C)
        self.upstream = self.end_type(self, number, C2A)
        self.client.peer, self.upstream.peer = self.upstream, self.client
        self._ends = (self.client, self.upstream)
        self._finished = 0  # number of half-closed directions
        self._ended = False
        self._connect_task: asyncio.Task[None] | None = None

    def connected(self, end: SocketEnd) -> None:
        """A socket is connected: first the client's, then the upstream's."""
        assert end.transport
        if self._ended:
            end.transport.abort()
        elif end is self.client:
            self._record(Kind.OPENED, end, self._route_text(end.transport))
            self._connect_task = asyncio.get_running_loop().create_task(
                self._connect_upstream(end.transport)
            )
        else:
            self._record(ControlRecord.CONNECTED, end)
            self.client.resume()
            for early in self.client.early_data:
                self.client.data_received(*early)
            self.client.early_data.clear()
            if self.client.half_closed:
                self.half_closed(self.client)

    def half_closed(self, end: SocketEnd) -> None:
        """Forward a half-close. After the second one, close the connection."""
        transport, peer_transport = end.transport, end.peer.transport
        assert transport
        assert peer_transport
        self._record(Kind.HALF_CLOSED, end)
        if not peer_transport.is_closing():
            peer_transport.write_eof()
        self._finished += 1
        if self._finished == len(self._ends):
            self._close(end)
        else:
            self.tap.resets.add(end.descriptor, transport.abort)

    def socket_closed(self, end: SocketEnd, why: str) -> None:
        """A socket is closed. If the tap did not close it, reset the peer socket."""
        end.closed = True
        self.tap.resets.discard(end.descriptor)
        if not self._ended:
            self._end(Kind.RESET, end, why)
            if end.peer.transport:
                tcp.reset_when_flushed(end.peer.transport)
            else:
                self._cancel_connect()
        if end.peer.closed:
            self.tap.remove(self)

    def close(self, note: str) -> None:
        """Close in order, after queued bytes are sent."""
        if not self._ended:
            self._close(self.client, note)

    def check_peers(self) -> None:
        """Reset a socket whose peer is lost; the peer socket is reset then, too."""
        for end in self._ends:
            transport = end.transport
            if transport and not transport.is_closing():
                end.lost = tcp.is_lost(transport.get_extra_info("socket"))
                if end.lost:
                    tcp.reset(transport)

    def reset(self) -> None:
        """Reset both sockets now. Queued bytes are lost."""
        for end in self._ends:
            if end.transport and not end.closed:
                tcp.reset(end.transport)

    def _route_text(self, client: asyncio.Transport) -> str:
        """Return the addresses of client and target as text."""
        address = client.get_extra_info("peername")  # None if the client is already disconnected
        target = self.tap.route.target(client.get_extra_info("socket"))
        return f"{tcp.address_text(address) if address else 'unknown'} > {target}"

    def _close(self, last: SocketEnd, note: str = "") -> None:
        self._end(Kind.CLOSED, last, note)
        for end in self._ends:
            if end.transport:
                end.transport.close()
        self._cancel_connect()

    async def _connect_upstream(self, client: asyncio.Transport) -> None:
        """Connect the upstream socket. If this fails, reset the client."""
        sock = client.get_extra_info("socket")
        loop = asyncio.get_running_loop()
        try:
            connected = await self.tap.route.connect_upstream(sock)
            await loop.create_connection(lambda: self.upstream, sock=connected)
            if self.upstream.closed:
                connected.detach()  # uvloop closed its descriptor, which may be reused by now
        except OSError as error:
            self.socket_closed(self.upstream, f"{UNREACHABLE}{_reason(error)}")

    def _cancel_connect(self) -> None:
        """Cancel a pending upstream connection."""
        if self._connect_task and not self.upstream.transport:
            self._connect_task.cancel()
            self.upstream.closed = True

    def _end(self, kind: Kind, end: SocketEnd, note: str) -> None:
        self._ended = True
        for each in self._ends:
            each.pause()
            self._record(ControlRecord.TOTAL, each)
        if dropped_bytes := self._unforwarded_bytes():
            self._record_dropped(self.client, dropped_bytes, "the robot was not connected")
        self._record(kind, end, note)

    def _record_dropped(self, end: SocketEnd, size_bytes: int, reason: str) -> None:
        """Record bytes that were not forwarded."""
        self.tap.append(*unforwarded_record(end.stream, self.tap.now_ns(), size_bytes, reason))

    def drop_urgent(self) -> None:
        """Record urgent data, which is not in the stream."""
        for end in self._ends:
            if end.transport and not end.transport.is_closing() and tcp.drop_urgent(end.descriptor):
                self._record_dropped(end, 1, "sent as urgent data (TCP)")

    def _unforwarded_bytes(self) -> int:
        """Count the bytes that the client sent before the upstream socket was connected."""
        client = self.client
        unread_bytes = 0
        if not self.upstream.transport and client.transport and not client.closed:
            unread_bytes = tcp.unread_bytes(client.transport.get_extra_info("socket"))
        return sum(len(data) for data, *_ in client.early_data) + unread_bytes

    def _record(self, kind: Kind | ControlRecord, end: SocketEnd, note: str = "") -> None:
        now_ns = self.tap.now_ns()
        self.tap.append(kind, end.stream, now_ns, end.received_bytes, note.encode())


def _reason(error: Exception) -> str:
    """Return the system's error text instead of the event loop's."""
    number = getattr(error, "errno", None) or 0
    return os.strerror(number) if number > 0 else str(error)
