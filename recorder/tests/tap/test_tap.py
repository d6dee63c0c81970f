"""The tap: what one side does the other side sees, and what passes is told, after it has passed."""

import asyncio
import os
import random
import socket
import struct
import subprocess
import sys
from collections.abc import Awaitable, Callable
from functools import partial
from hashlib import sha256
from typing import Any

import pytest

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool.records import ControlRecord
from scaraspec_recorder.tap import routes, tcp
from scaraspec_recorder.tap import tap as tap_module
from scaraspec_recorder.tap.routes import Upstream
from scaraspec_recorder.tap.tap import BUFFER_BYTES
from tap_bench import Bench, at_end, receive, run_on, send, turn

BULK_BYTES = 3 << 20


@pytest.fixture(params=["uvloop", "asyncio", "uvloop, kernel time", "asyncio, kernel time"])
def run(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Callable[[Callable[[], Awaitable[None]]], None]:
    """Run a test's coroutine on an event loop, for a bounded time."""
    loop, _, clock = request.param.partition(", ")
    monkeypatch.setattr(Bench, "kernel_time", bool(clock))
    if loop == "uvloop":
        pytest.importorskip("uvloop")
    return partial(run_on, loop)


async def send_for_ever(sock: socket.socket) -> None:
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


async def receive_for_ever(sock: socket.socket) -> None:
    while await asyncio.get_running_loop().sock_recv(sock, 1 << 20):
        pass


def cut(sock: socket.socket) -> None:
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
def test_bytes_arrive_unchanged_and_are_all_told(run: Any, seed: int) -> None:
    """Both directions at once, in random pieces: sent = received = told, byte for byte."""
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
    """When the tap tells of bytes, the other side can already read them."""

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


def test_small_frames_are_not_held_back(run: Any) -> None:
    """TCP_NODELAY and keep-alive stand on both sockets."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            await send(client, b"x")
            await receive(server, 1)
            for end in next(iter(bench.tap._connections))._ends:
                sock = end.transport.get_extra_info("socket")
                assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
                assert sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)

    run(test)


@pytest.mark.parametrize("first", [A2C, C2A], ids=str)
def test_half_close_leaves_the_other_direction_open(run: Any, first: Direction) -> None:
    """Who has finished still receives, for as long as the other side likes to send."""

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
def test_a_reset_is_passed_on_as_a_reset_behind_the_data(run: Any, resetter: Direction) -> None:
    """The other side gets all that was sent, then ECONNRESET, never an orderly end."""

    async def test() -> None:
        async with Bench() as bench:
            ends = await bench.pair()
            one, other = ends if resetter is A2C else ends[::-1]
            data = random.Random(1).randbytes(100_000)
            await send(one, data)
            while len(bench.stream(resetter)) < len(data):
                bench.told.clear()
                await bench.told.wait()
            cut(one)
            assert await receive(other, len(data)) == data
            with pytest.raises(ConnectionResetError):
                await at_end(other)
            assert (await bench.until(Kind.RESET)).direction is resetter
            assert bench.stream(resetter) == data

    run(test)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it shows at the next write only")
@pytest.mark.parametrize("resetter", [A2C, C2A], ids=str)
def test_a_reset_after_a_half_close_is_passed_on(run: Any, resetter: Direction) -> None:
    """A client that finished and then died frees the controller, though nobody writes to it."""

    async def test() -> None:
        async with Bench() as bench:
            ends = await bench.pair()
            one, other = ends if resetter is A2C else ends[::-1]
            one.shutdown(socket.SHUT_WR)
            assert await at_end(other)
            cut(one)
            while not other.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):  # EPIPE after an end
                await turn()
            assert (await bench.until(Kind.RESET)).direction is resetter

    run(test)


@pytest.mark.parametrize(
    ("host", "why"),
    [("127.0.0.1", "Connection refused"), ("no..name", "no..name is not a host name")],
)
def test_a_refused_connection_is_reset_and_told(run: Any, host: str, why: str) -> None:
    """Where the controller is down, the client is cut off, not left waiting or closed in order."""

    async def test() -> None:
        with socket.socket() as closed:
            closed.bind(("127.0.0.1", 0))  # held, lest the tap itself gets it
            port = closed.getsockname()[1]
            async with Bench(Upstream(host, port)) as bench:
                client = await bench.client()
                with pytest.raises(ConnectionResetError):
                    await at_end(client)
                assert (await bench.until(Kind.OPENED)).note.endswith(f" > {host}:{port}")
                reset = await bench.until(Kind.RESET)
                assert (reset.direction, reset.note) == (C2A, f"no connection: {why}")

    run(test)


def test_a_client_is_not_led_in_a_circle(run: Any) -> None:
    """Where the robot's address is the recorder's own, the client is cut off and it is told."""

    async def test() -> None:
        async with Bench() as bench:
            bench.tap.route = Upstream(*bench.address)
            with pytest.raises(ConnectionResetError):
                await at_end(await bench.client())
            why = "no connection: the target is the recorder's own address"
            assert [r.note for r in bench.records if r.kind is Kind.RESET] == [why]

    run(test)


def test_a_tap_never_reaches_itself_in_the_place_of_a_robot(run: Any) -> None:
    """The system may give a connection the very port that it is to reach: nobody listens there."""

    async def test() -> None:
        with socket.socket() as sock:
            sock.bind(("127.0.0.1", 0))
            with pytest.raises(ConnectionRefusedError):
                await routes._connect(sock, sock.getsockname())

    run(test)


class Held:
    """A route that connects when it is let."""

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


def test_what_comes_before_the_upstream_is_held_in_order_and_bounded(run: Any) -> None:
    """Early bytes and an early end wait, at most one read of them, and arrive first."""

    async def test() -> None:
        route = Held()
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


def test_an_end_before_the_upstream_arrives_too(run: Any) -> None:
    """A client that connects and finishes at once finishes at the controller."""

    async def test() -> None:
        route = Held()
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


def test_a_client_that_goes_while_dialling_ends_the_dialling(run: Any) -> None:
    """No connection to the controller comes of it, and the reset is told."""

    async def test() -> None:
        route = Held()
        async with Bench(route) as bench:
            client = await bench.client()
            await route.dialled.wait()
            cut(client)
            await route.cancelled.wait()
            assert (await bench.until(Kind.RESET)).direction is A2C

    run(test)


@pytest.mark.parametrize("sender", [A2C, C2A], ids=str)
def test_a_side_that_takes_nothing_slows_the_other_down(run: Any, sender: Direction) -> None:
    """Back-pressure: the tap holds a bounded amount, the sender is blocked, and nothing is lost."""

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
    """What was queued when the sender reset still reaches a side that reads late."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)
            data = random.Random(4).randbytes(400_000)
            await send(client, data)
            while len(bench.stream(A2C)) < len(data):
                bench.told.clear()
                await bench.told.wait()
            cut(client)
            await bench.until(Kind.RESET)
            assert await receive(server, len(data)) == data
            with pytest.raises(ConnectionResetError):
                await at_end(server)

    run(test)


def test_a_reset_does_not_wait_for_ever(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A side that never reads is cut off after a bounded time."""
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
            connection.client.transport.abort()  # what a reset looks like to the tap
            await bench.until(Kind.RESET)
            await bench.tap._wait_until_empty()
            with pytest.raises(ConnectionResetError):
                await receive_for_ever(server)

    run(test)


def test_stopping_ends_both_sides_in_order(run: Any) -> None:
    """Connections that are open when the recorder stops get what is queued, then their end."""

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


def test_stopping_does_not_wait_for_a_side_that_takes_nothing(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After its time the tap cuts, so that nobody takes a torn stream for a whole one."""
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
                await receive_for_ever(server)

    run(test)


def test_errors_of_a_dead_socket_are_the_transports_affair(run: Any) -> None:
    """A write that finds its socket dead ends the connection and raises nothing."""

    async def test() -> None:
        async with Bench() as bench:
            client, server = await bench.pair()
            await send(client, b"x")
            await receive(server, 1)
            cut(server)
            with pytest.raises((ConnectionResetError, BrokenPipeError)):
                await send_for_ever(client)
            assert (await bench.until(Kind.RESET)).direction is C2A

    run(test)


def test_addresses_are_written_as_users_write_them() -> None:
    """An IPv6 host stands in brackets."""
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
def test_what_others_can_reach_is_no_loopback(host: str, loopback: bool) -> None:  # noqa: FBT001 - the expected answer
    """In doubt it is not."""
    assert tcp.is_loopback(host) is loopback


NO_FILE_IS_FREE = """
import resource, socket
from scaraspec_recorder.tap.tcp import unsent_bytes
near, far = socket.socketpair()
resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))
print(unsent_bytes(near))
"""


def test_what_is_unsent_is_told_where_no_file_is_free() -> None:
    """A client for whom there is no further connection is sent away: it needs no module then."""
    done = subprocess.run(
        [sys.executable, "-c", NO_FILE_IS_FREE],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("0\n", "")
