"""A tap on the current event loop between two sockets of the test, and its records."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from typing import Any, Self

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool.records import ControlRecord, Record
from scaraspec_recorder.tap import tap as tap_module
from scaraspec_recorder.tap import tcp
from scaraspec_recorder.tap.routes import Upstream
from scaraspec_recorder.tap.tap import Connect, Tap

TIMEOUT_S = 20


class Bench:
    """A tap on the current event loop, its server, and its records."""

    kernel_time = False

    def __init__(self, route: Any = None, connect: Connect | None = None) -> None:
        self.records: list[Record] = []
        self.printed = asyncio.Event()
        self.server = tcp.listen("127.0.0.1", 0)
        self.server.settimeout(0)
        listener = tcp.listen("127.0.0.1", 0)
        self.address = listener.getsockname()
        self._listener = listener
        self.tap = Tap(
            route or Upstream(*self.server.getsockname()),
            self.take,
            connect,
            kernel_time=self.kernel_time,
            now_ns=lambda: 7,
        )
        self._sockets = [self.server]
        self._stopped = False

    async def __aenter__(self) -> Self:
        await self.tap.start(self._listener)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.stop()
        for sock in self._sockets:
            sock.close()

    async def stop(self) -> None:
        if not self._stopped:
            self._stopped = True
            await self.tap.stop()
            self._listener.close()

    def take(self, *fields: Any) -> None:
        self.records.append(Record(*fields))
        self.printed.set()

    async def client(self) -> socket.socket:
        """Return a client that is connected to the tap."""
        sock = socket.socket()
        sock.settimeout(0)
        self._sockets.append(sock)
        await asyncio.get_running_loop().sock_connect(sock, self.address)
        return sock

    async def accept(self) -> socket.socket:
        """Return the server's socket of the tap's connection."""
        sock, _ = await asyncio.get_running_loop().sock_accept(self.server)
        self._sockets.append(sock)
        return sock

    async def pair(self) -> tuple[socket.socket, socket.socket]:
        client = await self.client()
        return client, await self.accept()

    async def until(self, kind: Kind) -> Record:
        """Wait for the first record of this kind."""
        while True:
            for record in self.records:
                if record.kind is kind:
                    return record
            self.printed.clear()
            await self.printed.wait()

    def stream(self, direction: Direction) -> bytes:
        """Return the recorded bytes of a direction; check that they are contiguous."""
        data = b""
        for record in self.records:
            if record.kind is Kind.BYTES and record.direction is direction:
                assert record.offset_bytes == len(data)
                data += record.payload
        return data

    def story(self) -> list[tuple[Kind | ControlRecord, Direction]]:
        """Return kind and direction of the records without bytes."""
        others = (Kind.BYTES, ControlRecord.CONNECTED)
        return [(r.kind, r.direction) for r in self.records if r.kind not in others]


def run_on(loop: str, test: Callable[[], Awaitable[None]]) -> None:
    """Run the coroutine of a test on an event loop of this type, with a timeout."""
    factory = tap_module.new_event_loop if loop == "uvloop" else asyncio.new_event_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        runner.run(asyncio.wait_for(test(), TIMEOUT_S))


async def turn() -> None:
    """Let the tap run: it uses the same event loop."""
    await asyncio.sleep(0)


async def send(sock: socket.socket, data: bytes) -> None:
    await asyncio.get_running_loop().sock_sendall(sock, data)
    await turn()


async def receive(sock: socket.socket, size_bytes: int) -> bytes:
    data = b""
    while len(data) < size_bytes:
        more = await asyncio.get_running_loop().sock_recv(sock, size_bytes - len(data))
        assert more, "the stream ended early"
        data += more
    return data


async def at_end(sock: socket.socket) -> bool:
    return await asyncio.get_running_loop().sock_recv(sock, 1) == b""
