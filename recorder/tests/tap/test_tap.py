"""The tap forwards everything that one side does to the other side, and records it afterwards."""

import asyncio
import os
import random
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Awaitable, Callable
from functools import partial
from hashlib import sha256
from typing import Any
from unittest.mock import MagicMock

import pytest

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool.records import ControlRecord
from scaraspec_recorder.tap import routes, tcp
from scaraspec_recorder.tap import tap as tap_module
from scaraspec_recorder.tap.routes import Upstream
from scaraspec_recorder.tap.tap import BUFFER_BYTES, Connection
from tap_bench import Bench, at_end, receive, run_on, send, turn

BULK_BYTES = 3 << 20


@pytest.fixture(params=["uvloop", "asyncio", "uvloop, kernel time", "asyncio, kernel time"])
def run(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Callable[[Callable[[], Awaitable[None]]], None]:
    """Run the coroutine of a test on an event loop, with a timeout."""
    loop, _, clock = request.param.partition(", ")
    monkeypatch.setattr(Bench, "kernel_time", bool(clock))
    if loop == "uvloop":
        pytest.importorskip("uvloop")
    return partial(run_on, loop)


async def send_forever(sock: socket.socket) -> None:
    while True:
        await send(sock, b"more")


async def send_until_blocked(sock: socket.socket) -> bytes:
    block, sent = random.Random(2).randbytes(1 << 16), bytearray()
    for _ in range(1_000):
        try:
            sent += block[: sock.send(block)]
        except BlockingIOError:
            return bytes(sent)
        await turn()
    raise AssertionError("somebody takes it all")


async def receive_forever(sock: socket.socket) -> None:
    while await asyncio.get_running_loop().sock_recv(sock, 1 << 20):
        pass


def reset(sock: socket.socket) -> None:
    """Close with RST."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    sock.close()


async def send_in_pieces(sock: socket.socket, data: bytes, seed: int) -> None:
    dice = random.Random(seed)
    at = 0
    while at < len(data):
        size = dice.choice((1, 3, 4, 212, 1460, 70_000, 300_000))
        await send(sock, data[at : at + size])
        at += size


@pytest.mark.parametrize("seed", range(3))
def test_bytes_arrive_unchanged_and_are_all_recorded(run: Any, seed: int) -> None:
    """Both directions at once in random pieces: sent, received and recorded bytes are equal."""
    dice = random.Random(seed)
    up, down = dice.randbytes(BULK_BYTES), dice.randbytes(BULK_BYTES)

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            _, _, arrived_up, arrived_down = await asyncio.gather(
                send_in_pieces(client, up, seed),
                send_in_pieces(server, down, seed + 1),
                receive(server, len(up)),
                receive(client, len(down)),
            )
            assert (arrived_up, arrived_down) == (up, down)
        for direction, data in ((A2C, up), (C2A, down)):
            assert sha256(bench.stream(direction)).digest() == sha256(data).digest()

    run(test)


def test_many_connections_do_not_mix(run: Any) -> None:
    """Each of fifty connections gets its own bytes back."""

    async def talk(bench: Bench) -> None:
        client = await bench.client()
        name = b"%s" % str(client.getsockname()).encode()
        await send(client, name)
        assert await receive(client, len(name)) == name

    async def echo(server: socket.socket) -> None:
        while data := await asyncio.get_running_loop().sock_recv(server, 1000):
            await send(server, data)

    async def serve(bench: Bench) -> None:
        await asyncio.gather(*[asyncio.create_task(echo(await bench.accept())) for _ in range(50)])

    async def test() -> None:
        async with Bench() as bench:
            serving = asyncio.create_task(serve(bench))
            await asyncio.gather(*(talk(bench) for _ in range(50)))
            await bench.stop()
            await serving
        assert len({record.connection for record in bench.records}) == 50

    run(test)


def test_forward_first(run: Any) -> None:
    """When the tap records bytes, the other side can already read them."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            there: list[bytes] = []

            def take(kind: Kind | ControlRecord, *fields: Any) -> None:
                if kind is Kind.BYTES:
                    there.append(server.recv(100, socket.MSG_PEEK))
                bench.take(kind, *fields)

            for end in next(iter(bench.tap._connections))._ends:
                end._append = take
            await send(client, b"\xaa\x08\x00\xcc")
            await bench.until(Kind.BYTES)
            assert there == [b"\xaa\x08\x00\xcc"]

    run(test)


def test_small_frames_are_not_delayed(run: Any) -> None:
    """TCP_NODELAY and keep-alive within a minute are set on both sockets."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            await send(client, b"x")
            await receive(server, 1)
            for end in next(iter(bench.tap._connections))._ends:
                sock = end.transport.get_extra_info("socket")
                assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
                assert sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
                assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) <= 60

    run(test)


@pytest.mark.parametrize("first", [A2C, C2A], ids=str)
def test_half_close_leaves_the_other_direction_open(run: Any, first: Direction) -> None:
    """The side that has ended still receives."""

    async def test() -> None:
        async with Bench() as bench:
            ends = await bench.pair()
            one, other = ends if first is A2C else ends[::-1]
            await send(one, b"last")
            one.shutdown(socket.SHUT_WR)
            assert await receive(other, 4) == b"last"
            assert await at_end(other)
            await send(other, b"answer" * 1000)
            assert await receive(one, 6000) == b"answer" * 1000
            other.shutdown(socket.SHUT_WR)
            assert await at_end(one)
            await bench.until(Kind.CLOSED)
            assert bench.story() == [
                (Kind.OPENED, A2C),
                (Kind.HALF_CLOSED, first),
                (Kind.HALF_CLOSED, first.opposite),
                (ControlRecord.TOTAL, A2C),
                (ControlRecord.TOTAL, C2A),
                (Kind.CLOSED, first.opposite),
            ]
            totals = {
                r.direction: r.offset_bytes for r in bench.records if r.kind is ControlRecord.TOTAL
            }
            assert totals == {first: 4, first.opposite: 6000}

    run(test)


@pytest.mark.parametrize("resetter", [A2C, C2A], ids=str)
def test_a_reset_is_forwarded_after_the_data(run: Any, resetter: Direction) -> None:
    """The other side gets all sent bytes, then ECONNRESET instead of an orderly end."""

    async def test() -> None:
        async with Bench() as bench:
            ends = await bench.pair()
            one, other = ends if resetter is A2C else ends[::-1]
            data = random.Random(1).randbytes(100_000)
            await send(one, data)
            while len(bench.stream(resetter)) < len(data):
                bench.printed.clear()
                await bench.printed.wait()
            reset(one)
            assert await receive(other, len(data)) == data
            with pytest.raises(ConnectionResetError):
                await at_end(other)
            assert (await bench.until(Kind.RESET)).direction is resetter
            assert bench.stream(resetter) == data

    run(test)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it shows at the next write only")
@pytest.mark.parametrize("resetter", [A2C, C2A], ids=str)
def test_a_reset_after_a_half_close_is_forwarded(run: Any, resetter: Direction) -> None:
    """The connection to the controller is released although no bytes are written to it."""

    async def test() -> None:
        async with Bench() as bench:
            ends = await bench.pair()
            one, other = ends if resetter is A2C else ends[::-1]
            one.shutdown(socket.SHUT_WR)
            assert await at_end(other)
            reset(one)
            while not other.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):  # EPIPE after an end
                await turn()
            assert (await bench.until(Kind.RESET)).direction is resetter

    run(test)


@pytest.mark.parametrize(
    ("host", "why"),
    [("127.0.0.1", "Connection refused"), ("no..name", "no..name is not a host name")],
)
def test_a_refused_connection_is_reset_and_recorded(run: Any, host: str, why: str) -> None:
    """If the controller is down, the client is reset; it is not closed in order."""

    async def test() -> None:
        with socket.socket() as closed:
            closed.bind(("127.0.0.1", 0))  # bound, so that the tap cannot use it
            port = closed.getsockname()[1]
            async with Bench(Upstream(host, port)) as bench:
                client = await bench.client()
                with pytest.raises(ConnectionResetError):
                    await at_end(client)
                assert (await bench.until(Kind.OPENED)).note.endswith(f" > {host}:{port}")
                reset = await bench.until(Kind.RESET)
                assert (reset.direction, reset.note) == (C2A, f"no connection: {why}")

    run(test)


def test_the_recorder_as_its_own_target(run: Any) -> None:
    """If the robot has the recorder's address, the client is reset and the reason is recorded."""

    async def test() -> None:
        async with Bench() as bench:
            bench.tap.route = Upstream(*bench.address)
            with pytest.raises(ConnectionResetError):
                await at_end(await bench.client())
            why = "no connection: the target is the recorder's own address"
            assert [r.note for r in bench.records if r.kind is Kind.RESET] == [why]

    run(test)


def test_no_self_connection(run: Any) -> None:
    """The system may choose the target port as the local port if no program listens there."""

    async def test() -> None:
        with socket.socket() as sock:
            sock.bind(("127.0.0.1", 0))
            with pytest.raises(ConnectionRefusedError):
                await routes._connect(sock, sock.getsockname())

    run(test)


class DelayedRoute:
    """A route that connects when the test permits it."""

    def __init__(self) -> None:
        self.go = asyncio.Event()
        self.dialled = asyncio.Event()
        self.cancelled = asyncio.Event()
        self.upstream: Upstream | None = None

    def target(self, _client: socket.socket) -> str:
        return "held"

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        self.dialled.set()
        try:
            await self.go.wait()
        except asyncio.CancelledError:
            self.cancelled.set()
            raise
        assert self.upstream
        return await self.upstream.connect_upstream(client)


def test_early_bytes_are_buffered(run: Any) -> None:
    """Early bytes and an early end arrive first; at most one read is buffered."""

    async def test() -> None:
        route = DelayedRoute()
        async with Bench(route) as bench:
            route.upstream = Upstream(*bench.server.getsockname())
            client = await bench.client()
            await route.dialled.wait()
            (connection,) = bench.tap._connections
            sent = await send_until_blocked(client)
            assert len(connection.client.early_data) == 1
            assert bench.stream(A2C) == b""
            route.go.set()
            server = await bench.accept()
            client.shutdown(socket.SHUT_WR)
            assert await receive(server, len(sent)) == sent
            assert await at_end(server)
            assert bench.stream(A2C) == sent

    run(test)


@pytest.mark.parametrize("ending", ["recorder", "robot"])
def test_early_bytes_that_are_not_forwarded_are_counted(run: Any, ending: str) -> None:
    """Those that the tap has read, and those in the client's socket."""

    async def test() -> None:
        route = DelayedRoute()
        async with Bench(route) as bench:
            with socket.socket() as closed:
                closed.bind(("127.0.0.1", 0))
                route.upstream = Upstream(*closed.getsockname())
                client = await bench.client()
                (connection,) = await connections(bench)
                await send(client, b"first")
                while not connection.client.early_data:
                    await turn()
                await send(client, b"more")
                if ending == "robot":
                    route.go.set()
                    await bench.until(Kind.RESET)
                else:
                    await bench.stop()
            kinds = [record.kind for record in bench.records]
            assert ControlRecord.CONNECTED not in kinds
            dropped = bench.records[kinds.index(ControlRecord.UNFORWARDED)]
            expected_bytes = 9 if sys.platform == "linux" else 5
            assert (dropped.direction, dropped.length_bytes) == (A2C, expected_bytes)

    async def connections(bench: Bench) -> set[Connection]:
        while not bench.tap._connections:
            await turn()
        return bench.tap._connections

    run(test)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not report it")
@pytest.mark.parametrize("sender", [A2C, C2A], ids=str)
def test_urgent_data_is_counted(run: Any, sender: Direction) -> None:
    """It is not in the stream, so it cannot be forwarded; the stream itself is."""

    async def test() -> None:
        async with Bench() as bench:
            loop = asyncio.get_running_loop()
            loop.add_signal_handler(signal.SIGURG, bench.tap.drop_urgent)
            ends = await bench.pair()
            one, other = ends if sender is A2C else ends[::-1]
            await send(one, b"before")
            assert await receive(other, 6) == b"before"
            one.send(b"!", socket.MSG_OOB)
            while not (
                dropped := [r for r in bench.records if r.kind is ControlRecord.UNFORWARDED]
            ):
                await turn()
            assert [(r.direction, r.length_bytes) for r in dropped] == [(sender, 1)]
            assert dropped[0].note == "sent as urgent data (TCP)"
            await send(one, b"after")
            assert await receive(other, 5) == b"after"
            assert bench.stream(sender) == b"beforeafter"

    run(test)


def test_an_early_end_is_forwarded(run: Any) -> None:
    """A client that connects and ends immediately also ends at the controller."""

    async def test() -> None:
        route = DelayedRoute()
        async with Bench(route) as bench:
            route.upstream = Upstream(*bench.server.getsockname())
            client = await bench.client()
            client.shutdown(socket.SHUT_WR)
            await route.dialled.wait()
            route.go.set()
            server = await bench.accept()
            assert await at_end(server)
            await send(server, b"late")
            assert await receive(client, 4) == b"late"

    run(test)


def test_a_client_that_disconnects_cancels_the_upstream_connection(run: Any) -> None:
    """There is no connection to the controller, and the reset is recorded."""

    async def test() -> None:
        route = DelayedRoute()
        async with Bench(route) as bench:
            client = await bench.client()
            await route.dialled.wait()
            reset(client)
            await route.cancelled.wait()
            assert (await bench.until(Kind.RESET)).direction is A2C

    run(test)


@pytest.mark.parametrize("sender", [A2C, C2A], ids=str)
def test_back_pressure(run: Any, sender: Direction) -> None:
    """The tap buffers a bounded number of bytes, the sender is blocked, and no bytes are lost."""

    async def test() -> None:
        async with Bench() as bench:
            ends = await bench.pair()
            one, other = ends if sender is A2C else ends[::-1]
            while not (connection := next(iter(bench.tap._connections))).upstream.transport:
                await turn()
            reading, writing = connection._ends if sender is A2C else connection._ends[::-1]
            block, sent = random.Random(3).randbytes(1 << 16), bytearray()
            blocked = False
            while reading.transport.is_reading() or not blocked:
                try:
                    sent += block[: one.send(block)]
                    blocked = False
                except BlockingIOError:
                    blocked = True
                    await turn()
                assert writing.transport.get_write_buffer_size() <= BUFFER_BYTES + (256 << 10)
            one.shutdown(socket.SHUT_WR)
            assert await receive(other, len(sent)) == sent
            assert await at_end(other)
            assert bench.stream(sender) == sent

    run(test)


def test_a_reset_waits_for_a_slow_reader(run: Any) -> None:
    """Bytes that were queued at the reset still reach a slow reader."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)
            data = random.Random(4).randbytes(400_000)
            await send(client, data)
            while len(bench.stream(A2C)) < len(data):
                bench.printed.clear()
                await bench.printed.wait()
            reset(client)
            await bench.until(Kind.RESET)
            assert await receive(server, len(data)) == data
            with pytest.raises(ConnectionResetError):
                await at_end(server)

    run(test)


def test_a_reset_has_a_timeout(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A side that never reads is reset after a bounded time."""
    monkeypatch.setattr(tcp, "RESET_FLUSH_S", 0.0)

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            (connection,) = bench.tap._connections
            block = bytes(1 << 16)
            while not connection.upstream.transport or connection.client._reader.is_reading():
                try:
                    client.send(block)
                except BlockingIOError:
                    await turn()
            connection.client.transport.abort()  # the tap sees a reset in this way
            await bench.until(Kind.RESET)
            await bench.tap._wait_until_empty()
            with pytest.raises(ConnectionResetError):
                await receive_forever(server)

    run(test)


def test_stopping_ends_both_sides_in_order(run: Any) -> None:
    """When the recorder stops, open connections get the queued bytes and then their end."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            await send(client, b"bye")
            await bench.until(Kind.BYTES)
            await bench.stop()
            assert await receive(server, 3) == b"bye"
            assert await at_end(server)
            assert await at_end(client)
            assert (await bench.until(Kind.CLOSED)).note == "the recorder stopped"
            with pytest.raises(ConnectionRefusedError):
                await bench.client()

    run(test)


def test_stopping_has_a_timeout(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the timeout the tap resets, so that a truncated stream does not look complete."""
    monkeypatch.setattr(tap_module, "STOP_S", 0.01)

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            (connection,) = bench.tap._connections
            block = bytes(1 << 16)
            while not connection.upstream.transport or connection.client._reader.is_reading():
                try:
                    client.send(block)
                except BlockingIOError:
                    await turn()
            await bench.stop()
            with pytest.raises(ConnectionResetError):
                await receive_forever(server)

    run(test)


def test_a_write_error_ends_the_connection(run: Any) -> None:
    """A write to a dead socket raises no exception."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            await send(client, b"x")
            await receive(server, 1)
            reset(server)
            with pytest.raises((ConnectionResetError, BrokenPipeError)):
                await send_forever(client)
            assert (await bench.until(Kind.RESET)).direction is C2A

    run(test)


@pytest.mark.skipif(sys.platform != "linux", reason="reads the state of TCP of Linux")
@pytest.mark.parametrize(
    ("retransmissions", "probes", "unacknowledged", "silent_ms", "lost"),
    [
        (8, 0, 1, 60_000, True),  # data is in flight
        (8, 0, 1, 59_000, False),
        (2, 0, 1, 600_000, False),  # idle for long, then sent
        (0, 5, 0, 90_000, True),  # it did not read, then vanished
        (0, 1, 0, 119_000, False),  # it does not read; probes are two minutes apart
        (0, 0, 0, 10**6, False),  # nothing is sent
    ],
)
def test_a_lost_peer(
    retransmissions: int, probes: int, unacknowledged: int, silent_ms: int, *, lost: bool
) -> None:
    """By the state of the system's TCP."""
    info = tcp._TCP_INFO.pack(retransmissions, probes, unacknowledged, silent_ms)
    sock = MagicMock(**{"getsockopt.return_value": info})
    assert tcp.is_lost(sock) is lost
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert not tcp.is_lost(server)


def test_address_text() -> None:
    """An IPv6 host is in brackets."""
    assert tcp.address_text(("127.0.0.1", 8877)) == "127.0.0.1:8877"
    assert tcp.address_text(("::1", 8877, 0, 0)) == "[::1]:8877"
    assert os.name == "posix" or tcp.unsent_bytes(socket.socket()) == 0


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True),
        ("127.3.2.1", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.2", False),
        ("", False),
        ("no..name", False),
    ],
)
def test_loopback_addresses(host: str, loopback: bool) -> None:  # noqa: FBT001 - the expected answer
    """A name that cannot be resolved is not a loopback address."""
    assert tcp.is_loopback(host) is loopback


NO_FILE_IS_FREE = """
import resource, socket
from scaraspec_recorder.tap.tcp import unsent_bytes
near, far = socket.socketpair()
resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))
print(unsent_bytes(near))
"""


def test_unsent_bytes_without_a_free_file_descriptor() -> None:
    """The function works without a free file descriptor, as it then imports no module."""
    done = subprocess.run(
        [sys.executable, "-c", NO_FILE_IS_FREE],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("0\n", "")
