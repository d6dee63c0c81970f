"""Serial lines as sides of the tap, on ptys: unchanged bytes, hang-up, one client at a time."""

import asyncio
import os
import random
import select
import socket
import struct
import sys
import tty
from asyncio import StreamReader, StreamWriter, open_connection, to_thread
from collections.abc import Awaitable, Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import pytest

from journal import Journal, lines
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind
from scaraspec.transports.url import Rfcomm, Serial
from scaraspec_recorder.recording import record
from scaraspec_recorder.spool.records import Record
from scaraspec_recorder.tap import serial_relay, tcp
from scaraspec_recorder.tap.serial_relay import (
    SerialRoute,
    relay_serial_client,
)
from scaraspec_recorder.tap.tap import Tap

pytest.importorskip("serial")

TIMEOUT_S = 20
EVERY_BYTE = bytes(range(256))  # raw mode: a terminal would drop, echo or translate some bytes


class Pty:
    """One end of a serial cable; the other end is a device with a symbolic link `name`."""

    def __init__(self, name: Path) -> None:
        self.descriptor, self._device = os.openpty()
        tty.setraw(self._device)  # raw from the beginning, like a cable
        name.unlink(missing_ok=True)
        name.symlink_to(os.ttyname(self._device))
        self.address = Serial(str(name), 115_200)

    def close(self) -> None:
        """Disconnect the cable."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            os.close(self._device)
            self.descriptor = -1

    def send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.descriptor, data) :]

    def receive(self, size_bytes: int) -> bytes:
        data = bytearray()
        while len(data) < size_bytes:
            assert select.select([self.descriptor], [], [], TIMEOUT_S)[0], "nothing comes"
            data += os.read(self.descriptor, size_bytes - len(data))
        return bytes(data)


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Callable[[str], Pty]]:
    """Create cables by name; a new cable replaces an earlier one of the same name."""
    cables: list[Pty] = []

    def lay(name: str) -> Pty:
        cables.append(Pty(tmp_path / name))
        return cables[-1]

    yield lay
    for each in cables:
        each.close()


class Bench:
    """A tap with a route to a serial line, and its records."""

    def __init__(self, route: Any) -> None:
        self.records: list[Record] = []
        self._received = asyncio.Event()
        self._listener = route.listen("127.0.0.1", 0)
        self._writers: list[StreamWriter] = []
        self._tap = Tap(route, self._take)

    async def __aenter__(self) -> Self:
        await self._tap.start(self._listener)
        return self

    async def __aexit__(self, *_: object) -> None:
        for writer in self._writers:
            writer.close()
            with suppress(ConnectionError):  # a test or the tap has closed it
                await writer.wait_closed()
        await self._tap.stop()

    def _take(self, *fields: Any) -> None:
        self.records.append(Record(*fields))
        self._received.set()

    async def connect(self) -> tuple[StreamReader, StreamWriter]:
        reader, writer = await open_connection(*self._listener.getsockname())
        self._writers.append(writer)
        return reader, writer

    async def wait_until(self, kind: Kind) -> Record:
        """Wait for the first record of this kind."""
        while True:
            for each in self.records:
                if each.kind is kind:
                    return each
            self._received.clear()
            await self._received.wait()

    def stream(self, direction: Direction) -> bytes:
        pieces = [
            r.payload for r in self.records if (r.kind, r.direction) == (Kind.BYTES, direction)
        ]
        return b"".join(pieces)


def run(test: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(test(), TIMEOUT_S))


async def wait_until(condition: Callable[[], Any]) -> None:
    """Wait for another process; the timeout of the test applies."""
    while not condition():
        await to_thread(select.select, [], [], [], 0.01)


async def write(writer: StreamWriter, data: bytes) -> None:
    writer.write(data)
    await writer.drain()


def reset(writer: StreamWriter) -> None:
    """Reset a connection."""
    sock = writer.get_extra_info("socket")
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


@pytest.mark.parametrize("seed", range(3))
def test_bytes_pass_unchanged_and_are_all_recorded(cable: Any, seed: int) -> None:
    """Both directions carry every byte value at the same time, in random pieces."""
    dice = random.Random(seed)
    up, down = EVERY_BYTE + dice.randbytes(60_000), EVERY_BYTE[::-1] + dice.randbytes(60_000)

    def pieces(data: bytes) -> Iterator[bytes]:
        while data:
            size = dice.choice((1, 4, 212, 5000))
            yield data[:size]
            data = data[size:]

    async def test() -> None:
        controller = cable("controller")
        async with Bench(SerialRoute(controller.address)) as bench:
            reader, writer = await bench.connect()

            await write(writer, up[:1])  # bytes before the device is open are lost
            first = await to_thread(controller.receive, 1)

            async def send_up() -> None:
                for piece in pieces(up[1:]):
                    await write(writer, piece)

            def send_down() -> None:
                for piece in pieces(down):
                    controller.send(piece)

            _, _, arrived_up, arrived_down = await asyncio.gather(
                send_up(),
                to_thread(send_down),
                to_thread(controller.receive, len(up) - 1),
                reader.readexactly(len(down)),
            )
            assert (first + arrived_up, arrived_down) == (up, down)
            assert bench.records[0].note.endswith(f" > {controller.address}")
        assert (bench.stream(A2C), bench.stream(C2A)) == (up, down)

    run(test)


def test_the_client_sees_a_hang_up_as_a_reset(cable: Any) -> None:
    """Bytes that the controller sent before still arrive."""

    async def test() -> None:
        controller = cable("controller")
        async with Bench(SerialRoute(controller.address)) as bench:
            reader, writer = await bench.connect()
            await write(writer, b"hello")
            assert await to_thread(controller.receive, 5) == b"hello"
            controller.send(EVERY_BYTE)
            assert await reader.readexactly(256) == EVERY_BYTE
            controller.close()
            with pytest.raises(ConnectionResetError):
                await reader.read(1)
            assert (await bench.wait_until(Kind.RESET)).direction is C2A

    run(test)


def test_a_missing_device(tmp_path: Path) -> None:
    """The client is reset, and the record contains the reason."""

    async def test() -> None:
        async with Bench(SerialRoute(Serial(str(tmp_path / "nothing"), 9600))) as bench:
            reader, _ = await bench.connect()
            with pytest.raises(ConnectionResetError):
                await reader.read(1)
            note = (await bench.wait_until(Kind.RESET)).note
            assert note == "no connection: No such file or directory"

    run(test)


def test_a_reset_client_releases_the_line(cable: Any) -> None:
    """The next client can use the line."""

    async def test() -> None:
        controller = cable("controller")
        async with Bench(SerialRoute(controller.address)) as bench:
            for _ in range(3):
                _, writer = await bench.connect()
                await write(writer, b"hello")
                assert await to_thread(controller.receive, 5) == b"hello"
                reset(writer)

    run(test)


def test_a_half_closed_client_receives_until_the_next_client(cable: Any) -> None:
    """The next client takes the line; then the first connection is closed in order."""

    async def test() -> None:
        controller = cable("controller")
        async with Bench(SerialRoute(controller.address)) as bench:
            first, first_writer = await bench.connect()
            await write(first_writer, b"last")
            first_writer.write_eof()
            assert await to_thread(controller.receive, 4) == b"last"
            controller.send(b"answer")
            assert await first.readexactly(6) == b"answer"
            second, second_writer = await bench.connect()
            await write(second_writer, b"next")
            assert await to_thread(controller.receive, 4) == b"next"
            assert await first.read() == b""
            controller.send(b"yours")
            assert await second.readexactly(5) == b"yours"
            assert (await bench.wait_until(Kind.CLOSED)).direction is C2A

    run(test)


def test_a_second_client_does_not_disturb_the_first(
    cable: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second client is refused until the first one has finished."""
    monkeypatch.setattr(serial_relay, "LINE_WAIT_S", 0.0)

    async def test() -> None:
        controller = cable("controller")
        async with Bench(SerialRoute(controller.address)) as bench:
            first, first_writer = await bench.connect()
            await write(first_writer, b"mine")
            assert await to_thread(controller.receive, 4) == b"mine"
            host, port = first_writer.get_extra_info("sockname")
            second, _ = await bench.connect()
            with pytest.raises(ConnectionResetError):
                await second.read(1)
            note = (await bench.wait_until(Kind.RESET)).note
            assert note == f"no connection: the client {host}:{port} uses the line"
            controller.send(b"yours")
            assert await first.readexactly(5) == b"yours"

    run(test)


def test_back_pressure(cable: Any) -> None:
    """A controller that does not read blocks the client; no bytes are lost."""

    async def test() -> None:
        controller = cable("controller")
        block, sent = random.Random(4).randbytes(1 << 16), bytearray()

        async def send_much(writer: StreamWriter) -> None:
            while len(sent) < 64 << 20:
                sent.extend(block)
                await write(writer, block)

        async with Bench(SerialRoute(controller.address)) as bench:
            _, writer = await bench.connect()
            with pytest.raises(TimeoutError):
                # No progress for that long means blocked.
                await asyncio.wait_for(send_much(writer), 0.3)
            assert await to_thread(controller.receive, len(sent)) == sent

    run(test)


def test_a_client_on_a_serial_line(cable: Any, tmp_path: Path) -> None:
    """Unchanged bytes between two lines; a hang-up ends the session, and another one begins."""

    def exchange(client: Pty, controller: Pty) -> None:
        client.send(EVERY_BYTE)
        assert controller.receive(256) == EVERY_BYTE
        controller.send(EVERY_BYTE)
        assert client.receive(256) == EVERY_BYTE

    async def test() -> None:
        controller = cable("controller")
        way, inside = SerialRoute(controller.address), [("127.0.0.1", 0)]
        async with record(way, inside, tmp_path / "out", [Journal]) as recording:
            client = cable("client")
            async with relay_serial_client(client.address, recording.address):
                await wait_until(lambda: recording.progress.connections == 1)
                await to_thread(exchange, client, controller)
                client.close()
                client = cable("client")
                await wait_until(lambda: recording.progress.connections == 2)
                await to_thread(exchange, client, controller)
        assert recording.progress.finished
        assert recording.progress.a2c.recorded_bytes == 512
        assert recording.progress.c2a.recorded_bytes == 512

    run(test)
    kinds = {(name, kind) for name, _, kind, *_ in lines(tmp_path / "out")}
    assert {("1", "opened"), ("1", "reset"), ("2", "opened"), ("2", "closed")} <= kinds


def test_the_client_line_is_closed_after_the_controller_ends(cable: Any) -> None:
    """All received bytes are written first; then the line is opened and connected again."""

    def talk(client: Pty, server: socket.socket) -> None:
        with server.accept()[0] as controller:
            client.send(EVERY_BYTE)
            assert controller.recv(256, socket.MSG_WAITALL) == EVERY_BYTE
            controller.sendall(EVERY_BYTE)
        assert client.receive(256) == EVERY_BYTE

    async def test() -> None:
        client = cable("client")
        with tcp.listen("127.0.0.1", 0) as server:
            async with relay_serial_client(client.address, server.getsockname()):
                for _ in range(2):
                    await to_thread(talk, client, server)

    run(test)


def test_an_rfcomm_channel_is_a_device() -> None:
    """It reads, writes, hangs up and is cancelled like a port."""
    near, far = socket.socketpair()
    with far:
        device = serial_relay._Channel(near)
        device.write(EVERY_BYTE)
        assert far.recv(1000) == EVERY_BYTE
        far.sendall(EVERY_BYTE)
        assert device.read() == EVERY_BYTE
        far.close()
        with pytest.raises(OSError, match="hung up"):
            device.read()
        device.cancel()
        device.close()


def test_a_system_without_such_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error is raised before the recording, in one sentence with the alternative."""
    monkeypatch.delattr(socket, "AF_BLUETOOTH", raising=False)
    with pytest.raises(OSError, match="rfcomm bind"):
        SerialRoute(Rfcomm("AA:BB:CC:DD:EE:FF", 1)).listen("127.0.0.1", 0)
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(OSError, match=r"pip install 'scaraspec\[serial\]'"):
        SerialRoute(Serial("COM3", 9600)).listen("127.0.0.1", 0)
