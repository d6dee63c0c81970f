"""Kernel timestamps of received bytes, and the fallback to the recorder's clock."""

import asyncio
import errno
import os
import socket
import sys
import time
from collections.abc import Awaitable, Callable

import pytest

from scaraspec.protocol.direction import A2C, Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool.records import Record
from scaraspec_recorder.tap import kernel_timestamps, tcp
from scaraspec_recorder.tap import tap as tap_module
from scaraspec_recorder.tap.kernel_timestamps import TimestampedReader
from scaraspec_recorder.tap.routes import Upstream
from scaraspec_recorder.tap.tap import Tap

TIMEOUT_S = 10
MOST_EXCHANGES = 10_000

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems stamp nothing")


def run(test: Callable[[], Awaitable[None]]) -> None:
    """Run on the event loop of the tap, with a timeout."""
    with asyncio.Runner(loop_factory=tap_module.new_event_loop) as runner:
        runner.run(asyncio.wait_for(test(), TIMEOUT_S))


async def exchanged(enough: Callable[[list[Record]], bool]) -> list[Record]:
    """Send bytes in both directions through a tap until `enough` records exist, or far too many."""
    records: list[Record] = []
    loop = asyncio.get_running_loop()
    server, listener = tcp.listen("127.0.0.1", 0), tcp.listen("127.0.0.1", 0)
    server.settimeout(0)
    with server, socket.socket() as client:
        client.settimeout(0)
        tap = Tap(
            Upstream(*server.getsockname()),
            lambda *fields: records.append(Record(*fields)),
            kernel_time=True,
        )
        address = listener.getsockname()
        await tap.start(listener)
        await loop.sock_connect(client, address)
        answerer, _ = await loop.sock_accept(server)
        with answerer:
            for _ in range(MOST_EXCHANGES):
                await loop.sock_sendall(client, b"ask")
                await loop.sock_sendall(answerer, await loop.sock_recv(answerer, 9))
                await loop.sock_recv(client, 9)
                if enough(records):
                    break
            await tap.stop()
    return [record for record in records if record.kind is Kind.BYTES]


def test_reception_is_before_forwarding() -> None:
    """The order is sent, received by the system, forwarded; on one clock, in both directions."""
    begun_ns = time.time_ns()

    async def test() -> None:
        def enough(records: list[Record]) -> bool:
            return len({r.direction for r in records if r.kernel_time}) == len({*Direction})

        records = await exchanged(enough)
        stamped = [record for record in records if record.kernel_time]
        assert {record.direction for record in stamped} == {*Direction}
        for record in stamped:
            assert begun_ns <= record.time_ns <= record.forwarded_ns <= time.time_ns()

    run(test)


def test_system_without_timestamps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The recorder uses its own clock; nothing else changes."""
    monkeypatch.setattr(kernel_timestamps, "_SO_TIMESTAMPNS", 0x7FFF)

    async def test() -> None:
        begun_ns = time.time_ns()
        records = await exchanged(lambda records: len(records) > 9)
        assert not [record for record in records if record.kernel_time]
        for record in records:
            assert begun_ns <= record.time_ns <= record.forwarded_ns <= time.time_ns()

    run(test)


def test_no_free_file_descriptor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The connection continues without kernel timestamps."""

    def refuse(_number: int) -> int:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr("scaraspec_recorder.tap.kernel_timestamps.os.dup", refuse)

    async def test() -> None:
        records = await exchanged(lambda records: len(records) > 9)
        assert b"".join(r.payload for r in records if r.direction is A2C).startswith(b"askask")
        assert not [record for record in records if record.kernel_time]

    run(test)


def test_bytes_before_timestamps_were_enabled() -> None:
    """They have no kernel timestamp; the recorder uses its own clock."""

    async def test() -> None:
        taken: list[tuple[bytes, int, bool]] = []
        loop = asyncio.get_running_loop()
        with socket.create_server(("127.0.0.1", 0)) as server:
            sender = socket.create_connection(server.getsockname())
            receiver, _ = server.accept()
        transport, _ = await loop.connect_accepted_socket(asyncio.Protocol, receiver)
        transport.pause_reading()
        ended = asyncio.Event()
        reader = TimestampedReader(transport, lambda *taking: taken.append(taking), ended.set)
        reader.resume_reading()
        sender.sendall(b"early")
        sender.close()
        await ended.wait()
        assert taken == [(b"early", 0, False)]
        assert not reader.is_reading()
        reader.close()
        assert reader.is_closing()
        transport.abort()

    run(test)
