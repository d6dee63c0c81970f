"""Simulated links: an asyncio program and its tester on a simulated clock."""

import asyncio
from collections.abc import Callable, Iterator

import pytest

from scaraspec.transports.link import Ending, LinkError
from scaraspec.transports.simulated import SimulatedLink, SimulatedLoop

PORT = 8877
Connect = Callable[[], tuple["SimulatedLink", "Peer"]]


class Peer(asyncio.Protocol):
    """Records its events."""

    transport: asyncio.Transport

    def __init__(self) -> None:
        self.received: list[bytes | str] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        """Record bytes."""
        self.received.append(data)

    def connection_lost(self, error: Exception | None) -> None:
        """Record the end."""
        self.received.append("reset" if error else "closed")


@pytest.fixture
def loop() -> Iterator[SimulatedLoop]:
    """Return a loop with one open port."""
    loop = SimulatedLoop(epoch_ns=1_000_000_000)
    loop.ports.add(PORT)
    yield loop
    loop.close()


@pytest.fixture
def connect(loop: SimulatedLoop) -> Connect:
    """Return a function that opens a connection."""

    def connect() -> tuple[SimulatedLink, Peer]:
        task = loop.create_task(loop.create_connection(Peer, "127.0.0.1", PORT))
        link = loop.accept(1.0)
        assert link
        return link, task.result()[1]

    return connect


def test_time_advances_only_in_a_wait(loop: SimulatedLoop) -> None:
    """A sleep of one hour ends when the tester waits for one hour of simulated time."""
    task = loop.create_task(asyncio.sleep(3600, "awake"))
    loop.run_until(3599.0)
    assert (loop.time(), task.done()) == (3599.0, False)
    loop.run_until(3601.0)
    assert task.result() == "awake"
    assert loop.time_ns == 3602 * 10**9


def test_send_and_receive(loop: SimulatedLoop, connect: Connect) -> None:
    """Bytes arrive in both directions with their times; `receive` waits for them."""
    link, peer = connect()
    link.send(b"down")
    loop.call_later(2.0, peer.transport.write, b"up")
    arrival = link.receive(10.0)
    assert peer.received == [b"down"]
    assert arrival
    assert (arrival.content, arrival.time_ns) == (b"up", 3 * 10**9)
    assert link.receive(5.0) is None
    assert loop.time() == 5.0


@pytest.mark.parametrize(("end", "ending"), [("close", Ending.CLOSED), ("abort", Ending.RESET)])
def test_program_ends_the_connection(connect: Connect, end: str, ending: Ending) -> None:
    """After the last bytes, every `receive` returns the end."""
    link, peer = connect()
    peer.transport.write(b"bye")
    getattr(peer.transport, end)()
    assert [getattr(link.receive(1.0), "content", None) for _ in range(3)] == [
        b"bye",
        ending,
        ending,
    ]
    assert peer.transport.is_closing()
    with pytest.raises(LinkError, match="has ended"):
        link.send(b"too late")


@pytest.mark.parametrize(
    ("end", "received"), [("close", "closed"), ("reset", "reset"), ("half_close", "closed")]
)
def test_tester_ends_the_connection(
    loop: SimulatedLoop,
    connect: Connect,
    end: str,
    received: str,
) -> None:
    """The program receives the end once, after the sent bytes."""
    link, peer = connect()
    link.send(b"last")
    getattr(link, end)()
    getattr(link, end)()
    while loop.time() < 1:  # the end wakes the loop
        loop.run_until(1.0)
    assert peer.received == [b"last", received]


def test_connection_refused(loop: SimulatedLoop) -> None:
    """The connection is refused, as on a real network."""
    task = loop.create_task(loop.create_connection(Peer, "127.0.0.1", PORT + 1))
    assert loop.accept(1.0) is None
    with pytest.raises(ConnectionRefusedError):
        task.result()
