"""Injected faults on real sockets, in the tap."""

import asyncio
import gc
import socket
import struct
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest

import tap_bench
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.fault_injection import connection as connection_module
from scaraspec_recorder.fault_injection.connection import InjectedConnection
from scaraspec_recorder.fault_injection.rules import Injection
from scaraspec_recorder.spool.event_builder import ByteCounts, EventBuilder
from scaraspec_recorder.tap import tap as tap_module
from scaraspec_recorder.tap.tap import Connection
from tap_bench import at_end, receive, run_on, send, turn

ASK = Frame(A2C, 0x09).encode()  # get_status
IDLE = Frame(C2A, 0x09, b"00").encode()
STOP = Frame(A2C, 0x32).encode()

Load = Callable[[str], Injection]


class Bench(tap_bench.Bench):
    """A tap with injected faults."""

    def __init__(self, injection: Injection | None) -> None:
        super().__init__(connect=partial(InjectedConnection, injection) if injection else None)

    def events(self) -> list[WireEvent]:
        """Return the events that a recording makes of the records."""
        return EventBuilder({direction: ByteCounts() for direction in Direction}, {}).take(
            self.records
        )


@pytest.fixture(params=["uvloop", "asyncio"])
def run(request: pytest.FixtureRequest) -> Callable[[Callable[[], Awaitable[None]]], None]:
    """Run the coroutine of a test on an event loop, with a timeout."""
    return partial(run_on, request.param)


HOLD = """
[[rule]]
fault = "hold-back"
part = "reply"
until_command = "emergency_stop"
at_most_ms = 3_600_000
"""


def test_no_rules_no_injection(run: Any) -> None:
    """Without a file the tap uses its plain connections."""

    async def test() -> None:
        async with Bench(None) as bench:
            client, server = await bench.pair()
            await send(client, ASK)
            assert await receive(server, len(ASK)) == ASK
            (connection,) = bench.tap._connections
            assert type(connection) is Connection
            assert type(connection.client) is tap_module.SocketEnd

    run(test)


def test_the_original_bytes_and_the_fault_are_recorded(run: Any, load: Load) -> None:
    """The fault is recorded after the bytes, and no byte counts as lost."""
    injection = load(
        '[[rule]]\nfault = "drop"\ncommand = "get_status"\npart = "request"\nnth = 2\n'
    )

    async def test() -> None:
        async with Bench(injection) as bench:
            client, server = await bench.pair()
            await send(client, ASK + ASK + STOP)
            assert await receive(server, 8) == ASK + STOP
            await send(server, IDLE)
            assert await receive(client, len(IDLE)) == IDLE
            for sock in (client, server):
                sock.shutdown(socket.SHUT_WR)
            await bench.until(Kind.CLOSED)
            events = bench.events()
            assert b"".join(e.data for e in events if e.direction is A2C) == ASK + ASK + STOP
            assert Kind.GAP not in {event.kind for event in events}
            (fault,) = (event for event in events if event.kind is Kind.INJECTED)
            assert (fault.connection, fault.direction, fault.offset_bytes) == ("1", A2C, 12)
            assert fault.note == "get_status request at bytes 4-7: rule 1: not passed on"

    run(test)


def test_delayed_frames_keep_their_order(run: Any, load: Load) -> None:
    """Order and bytes are unchanged in both directions; delays are timers of the event loop."""
    injection = load(
        '[[rule]]\nfault = "jitter"\njitter_ms = 3\n[[rule]]\nfault = "fragment"\nsize_bytes = 2\n'
    )

    async def test() -> None:
        async with Bench(injection) as bench:
            client, server = await bench.pair()
            asked = [Frame(A2C, 0x0C, b"%d" % n).encode() for n in range(20)]
            for frame in asked:
                await send(client, frame)
                await send(server, IDLE)
            complete = b"".join(asked)
            assert await receive(server, len(complete)) == complete
            assert await receive(client, 20 * len(IDLE)) == 20 * IDLE

    run(test)


def test_a_frame_is_held_until_a_command_of_the_other_side(run: Any, load: Load) -> None:
    """No time passes: only the condition releases the frame."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(client, ASK)
            await receive(server, len(ASK))
            await send(server, IDLE)
            await bench.until(Kind.INJECTED)
            with pytest.raises(BlockingIOError):
                client.recv(1)
            await send(client, STOP)
            assert await receive(client, len(IDLE)) == IDLE
            assert await receive(server, len(STOP)) == STOP

    run(test)


def test_an_end_waits_for_delayed_frames(run: Any, load: Load) -> None:
    """The other side has also ended; the connection is open until all bytes are forwarded."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(server, IDLE)
            server.shutdown(socket.SHUT_WR)
            await bench.until(Kind.INJECTED)
            await send(client, STOP)
            client.shutdown(socket.SHUT_WR)
            assert await receive(client, len(IDLE)) == IDLE
            assert await at_end(client)
            assert await receive(server, len(STOP)) == STOP
            assert await at_end(server)
            assert (await bench.until(Kind.CLOSED)).connection == 1

    run(test)


def test_stopping_forwards_delayed_bytes(run: Any, load: Load) -> None:
    """A recorder that stops forwards them early and records this."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(server, IDLE)
            await bench.until(Kind.INJECTED)
            await bench.stop()
            assert await receive(client, len(IDLE)) == IDLE
            assert await at_end(client)
            printed = [r.note for r in bench.records if r.kind is Kind.INJECTED]
            assert printed[-1] == "the connection ends: 6 bytes that waited are passed on at once"

    run(test)


def test_a_reset_is_forwarded_after_delayed_bytes(run: Any, load: Load) -> None:
    """Delayed bytes are forwarded before the reset."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(server, IDLE)
            await bench.until(Kind.INJECTED)
            server.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            server.close()
            assert await receive(client, len(IDLE)) == IDLE
            with pytest.raises(ConnectionResetError):
                await at_end(client)
            assert (await bench.until(Kind.RESET)).direction is C2A

    run(test)


def test_an_injected_reset_reaches_both_sides(run: Any, load: Load) -> None:
    """Neither side sees an orderly end; the capture names the injected fault."""

    async def test() -> None:
        async with Bench(load('[[rule]]\nfault = "reset"\ncommand = "emergency_stop"\n')) as bench:
            client, server = await bench.pair()
            await send(client, ASK + STOP)
            assert await receive(server, len(ASK)) == ASK
            for sock in (client, server):
                with pytest.raises(ConnectionResetError):
                    await at_end(sock)
            await bench.tap._wait_until_empty()
            gc.collect()  # a ResourceWarning reports sockets that were not closed
            kinds = [event.kind for event in bench.events()]
            assert kinds == [Kind.OPENED, Kind.BYTES, Kind.INJECTED, Kind.RESET]
            assert (await bench.until(Kind.RESET)).note == "cut by an injected fault"

    run(test)


def test_a_sender_is_paused_if_too_much_is_delayed(
    run: Any, load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory is bounded, and no bytes are missing afterwards."""
    monkeypatch.setattr(connection_module, "HELD_BYTES", 1000)
    data = IDLE + Frame(C2A, 0x0D, b"a.rob").encode() * 20_000

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            sending = asyncio.create_task(send(server, data))
            await bench.until(Kind.INJECTED)
            (connection,) = bench.tap._connections
            while connection.upstream.transport.is_reading():
                await turn()
            assert isinstance(connection, InjectedConnection)
            assert connection._injector.queued_bytes(C2A) <= 1000 + (256 << 10)
            receiving = asyncio.create_task(receive(client, len(data)))
            while not receiving.done():
                await send(client, STOP)
                await receive(server, len(STOP))
            assert receiving.result() == data
            await sending

    run(test)
