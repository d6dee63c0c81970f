"""The server over real loopback sockets: limits for clients, and the end of the server."""

import asyncio
import contextlib
import logging
import socket
from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import Any

import pytest

from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller import server as server_module
from scaraspec.virtual_controller.console import Console
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.server import MAX_CLIENTS, Server
from scaraspec.virtual_controller.store import Store

_LOGIN = b"\xaa\x01\x08password\xcc"
_LOGGED_IN = b"\xcc\x01\x011\xaa"
_STATUS = b"\xaa\x09\x00\xcc"
_IDLE = b"\xcc\x09\x0200\xaa"
_LIST = b"\xaa\x0b\x00\xcc"
_SOON_S = 10.0

Streams = tuple[Any, Any]  # StreamReader and StreamWriter, with their transports and buffers


class Stand:
    """A server on a free port, and clients of it."""

    def __init__(self, dialect: Dialect, time_scale: float) -> None:
        self.plant = Plant(datetime(2020, 1, 1), now_s=0.0)  # noqa: DTZ001 - the document names no zone
        self.store = Store()
        self.server = Server(ControllerCore(self.plant, self.store, dialect), time_scale)
        self.address = ("", 0)
        self._writers: list[asyncio.StreamWriter] = []

    async def connect(self) -> Streams:
        """Connect without logging in."""
        streams = await asyncio.open_connection(*self.address)
        self._writers.append(streams[1])
        return streams

    @property
    def endpoints(self) -> list[Any]:
        """The endpoints of the server, with their queued bytes."""
        return list(self.server._endpoints.values())

    async def client(self) -> Streams:
        """Connect and log in."""
        reader, writer = await self.connect()
        writer.write(_LOGIN)
        assert await reader.readexactly(5) == _LOGGED_IN
        return reader, writer

    async def ask(self, streams: Streams, request: bytes, size: int) -> bytes:
        """Send a request and read a reply of this size."""
        streams[1].write(request)
        return await streams[0].readexactly(size)

    async def until(self, holds: Callable[[], bool]) -> None:
        """Run the loop until the condition is true."""
        while not holds():  # noqa: ASYNC110 - no event reports the condition
            await asyncio.sleep(0)

    async def close(self) -> None:
        """End server and clients."""
        for writer in self._writers:
            writer.transport.abort()
        await self.server.close()


def _run(
    test: Callable[[Stand], Awaitable[None]], time_scale: float = 1.0, **readings: str
) -> None:
    async def main() -> None:
        stand = Stand(Dialect.of(**readings), time_scale)
        stand.address = await stand.server.listen("127.0.0.1", 0)
        try:
            async with asyncio.timeout(_SOON_S):
                await test(stand)
        finally:
            await stand.close()

    asyncio.run(main())


def test_several_clients_are_served() -> None:
    """Each uses its own connection, byte by byte or with whole requests."""

    async def test(stand: Stand) -> None:
        first, second = await stand.client(), await stand.client()
        for byte in _STATUS:
            first[1].write(bytes([byte]))
            await asyncio.sleep(0)
        second[1].write(_STATUS * 1000)
        assert await first[0].readexactly(6) == _IDLE
        assert await second[0].readexactly(6000) == _IDLE * 1000

    _run(test)


def test_final_results_in_scaled_time() -> None:
    """A move of seconds takes hundredths if time is a hundred times faster."""

    async def test(stand: Stand) -> None:
        move = b"20|200|300|324|34.6|0|0"
        client = await stand.client()
        began_s = asyncio.get_running_loop().time()
        first = await stand.ask(client, b"\xaa\x39" + bytes([len(move)]) + move + b"\xcc", 5)
        assert first == b"\xcc\x39\x011\xaa"
        assert await client[0].readexactly(7) == b"\xcc\x90\x39\x0211\xaa"
        taken_s = asyncio.get_running_loop().time() - began_s
        assert taken_s < 1.0 < stand.plant.motion_ends_s

    _run(test, time_scale=100.0)


def test_a_half_closed_client_is_answered_and_closed() -> None:
    """The client gets all replies, then the end of the connection; its jog stops."""

    async def test(stand: Stand) -> None:
        reader, writer = await stand.client()
        writer.write(b"\xaa\x3d\x011\xcc" + _STATUS)
        writer.write_eof()
        assert await reader.read() == b"\xcc\x3d\x011\xaa\xcc\x09\x0204\xaa"
        assert await stand.ask(await stand.client(), _STATUS, 6) == _IDLE

    _run(test)


def test_a_client_that_resets_is_removed() -> None:
    """A-2-7, repeatedly."""

    async def test(stand: Stand) -> None:
        for _ in range(100):
            _, writer = await stand.client()
            writer.transport.abort()
        await stand.until(lambda: not stand.server.core.sessions)

    _run(test)


def test_the_server_closes_if_the_dialect_requires_it() -> None:
    """An unknown opcode under the reading "close"."""

    async def test(stand: Stand) -> None:
        reader, writer = await stand.client()
        writer.write(_STATUS + b"\xaa\x02\x00\xcc" + _STATUS)
        assert await reader.read() == _IDLE

    _run(test, on_unknown="close")


def test_a_client_that_does_not_read_is_disconnected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its queued replies are limited, other clients are served, and it is disconnected after a
    timeout."""
    monkeypatch.setattr(server_module, "STALL_S", 0.3)

    async def test(stand: Stand) -> None:
        for number in range(900):
            stand.store.write(b"n" * 20 + b"%03d" % number, b"x")
        sleeper, other = await stand.client(), await stand.client()
        sleeper[1].transport.get_extra_info("socket").setsockopt(
            socket.SOL_SOCKET, socket.SO_RCVBUF, 4096
        )
        sleeper[1].transport.pause_reading()
        sleeper[1].write(_LIST * 5000)
        (end, _) = stand.endpoints
        most = 0
        while len(stand.server._endpoints) == 2:
            most = max(most, end._transport.get_write_buffer_size())
            assert await stand.ask(other, _STATUS, 6) == _IDLE
        assert 64 * 1024 < most < 2 * 2**20

    _run(test)


def test_a_client_that_reads_late_gets_everything() -> None:
    """Its requests are processed when there is space again."""

    async def test(stand: Stand) -> None:
        for number in range(900):
            stand.store.write(b"n" * 20 + b"%03d" % number, b"x")
        reader, writer = await stand.client()
        writer.transport.pause_reading()
        writer.write(_LIST * 300 + _STATUS)
        (end,) = stand.endpoints
        await stand.until(lambda: end._blocked)
        writer.transport.resume_reading()
        received = b""
        while not received.endswith(_IDLE):
            received += await reader.read(2**20)
        assert received.count(b"|nnnn") == 300 * 900

    _run(test)


def test_the_end_has_a_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clients that do not read get a short time for the last replies."""
    monkeypatch.setattr(server_module, "GRACE_S", 0.05)

    async def test(stand: Stand) -> None:
        for number in range(900):
            stand.store.write(b"n" * 20 + b"%03d" % number, b"x")
        _, writer = await stand.client()
        writer.transport.pause_reading()
        writer.write(_LIST * 5000)
        (end,) = stand.endpoints
        await stand.until(lambda: end._blocked)
        await stand.server.close()
        await stand.until(lambda: not stand.server._endpoints)

    _run(test)


def test_a_flooding_client_does_not_delay_others() -> None:
    """Its requests are processed in slices."""

    async def test(stand: Stand) -> None:
        flooder, other = await stand.client(), await stand.client()
        flooder[1].write(_STATUS * 20_000)
        assert await stand.ask(other, _STATUS, 6) == _IDLE
        answered = len(flooder[0]._buffer)
        assert answered < 6 * 20_000
        assert await flooder[0].readexactly(6 * 20_000) == _IDLE * 20_000

    _run(test)


def test_the_number_of_clients_is_bounded() -> None:
    """The oldest without a login is closed first; if all are logged in, the newest is refused."""

    async def test(stand: Stand) -> None:
        first = await stand.client()
        idle = [await stand.connect() for _ in range(MAX_CLIENTS - 1)]
        await stand.until(lambda: len(stand.server._endpoints) == MAX_CLIENTS)
        late = await stand.client()
        with contextlib.suppress(ConnectionResetError):
            assert await idle[0][0].read() == b""
        assert await stand.ask(first, _STATUS, 6) == _IDLE
        assert await stand.ask(late, _STATUS, 6) == _IDLE
        for streams in idle[1:]:
            assert await stand.ask(streams, _LOGIN, 5) == _LOGGED_IN
        refused = await stand.connect()
        with contextlib.suppress(ConnectionResetError):
            assert await refused[0].read() == b""
        assert len(stand.server._endpoints) == MAX_CLIENTS

    _run(test)


def test_shutdown_ends_the_server() -> None:
    """4.35: the reply comes first, then the end of every connection and of serving."""

    async def test(stand: Stand) -> None:
        client, other = await stand.client(), await stand.client()
        client[1].write(b"\xaa\x60\x00\xcc")
        assert await client[0].read() == b"\xcc\x60\x011\xaa"
        assert await other[0].read() == b""
        await stand.server.stopped.wait()
        await stand.server.close()
        with pytest.raises(ConnectionRefusedError):
            await stand.connect()

    _run(test)


def test_connections_are_kept_alive_and_logged(caplog: pytest.LogCaptureFixture) -> None:
    """A lost peer is detected; opening and closing are logged."""
    caplog.set_level(logging.INFO, "scaraspec.virtual_controller")

    async def test(stand: Stand) -> None:
        _, writer = await stand.client()
        (end,) = stand.endpoints
        link = end._transport.get_extra_info("socket")
        assert link.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        assert link.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        writer.close()
        await stand.until(lambda: not stand.server._endpoints)

    _run(test)
    assert caplog.messages == ["#1 opened over tcp", "#1 closed"]


def test_control_lines_act_on_the_running_robot() -> None:
    """A fault fails the jog at once; an invalid line is an error, an endless one is discarded."""

    async def test(stand: Stand) -> None:
        answers: list[str] = []
        source, sink = socket.socketpair()
        with source, sink:
            Console(stand.server, source.fileno(), answers.append)
            client = await stand.client()
            assert await stand.ask(client, b"\xaa\x3d\x011\xcc", 5) == b"\xcc\x3d\x011\xaa"
            sink.sendall(b"motor-fault outer_arm\nexplode\n\ninput 1 1")
            assert await client[0].readexactly(10) == b"\xcc\x90\x3d\x0500|12\xaa"
            assert not stand.plant.digital_inputs[1]
            sink.sendall(b"\n" + b"x" * 5000)
            await stand.until(lambda: len(answers) == 4)
            assert stand.plant.digital_inputs[1]
            sink.shutdown(socket.SHUT_WR)
            assert await stand.ask(client, _STATUS, 6) == b"\xcc\x09\x0212\xaa"
        assert answers[0] == "ok: status 12"
        assert answers[1].startswith("error: there is no command 'explode'")
        assert answers[2:] == ["ok: digital input 1 is 1", "error: a line has at most 4096 bytes"]

    _run(test)
