"""Simulated: an asyncio program and its tester on a clock that jumps."""

import asyncio
from collections.abc import Callable, Iterator

import pytest

from scaraspec.transports.link import Ending, LinkError
from scaraspec.transports.simulated import SimulatedLink, SimulatedLoop

PORT = 8877
Dialled = Callable[[], tuple["SimulatedLink", "Peer"]]


class Peer(asyncio.Protocol):
    """Keeps what reaches it."""

    transport: asyncio.Transport

    def __init__(self) -> None:
        self.heard: list[bytes | str] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """It is connected."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        """Bytes."""
        self.heard.append(data)

    def connection_lost(self, error: Exception | None) -> None:
        """The end."""
        self.heard.append("reset" if error else "closed")


@pytest.fixture
def loop() -> Iterator[SimulatedLoop]:
    """A loop on which one port is listened to."""
    loop = SimulatedLoop(epoch_ns=1_000_000_000)
    loop.ports.add(PORT)
    yield loop
    loop.close()


@pytest.fixture
def dialled(loop: SimulatedLoop) -> Dialled:
    """Makes connections."""

    def dial() -> tuple[SimulatedLink, Peer]:
        task = loop.create_task(loop.create_connection(Peer, "127.0.0.1", PORT))
        link = loop.accept(1.0)
        assert link
        return link, task.result()[1]

    return dial


def test_time_passes_only_while_somebody_waits(loop: SimulatedLoop) -> None:
    """A program's sleep of an hour is over as soon as the tester waits so long."""
    task = loop.create_task(asyncio.sleep(3600, "awake"))
    loop.run_until(3599.0)
    assert (loop.time(), task.done()) == (3599.0, False)
    loop.run_until(3601.0)
    assert task.result() == "awake"
    assert loop.time_ns == 3602 * 10**9


def test_bytes_both_ways(loop: SimulatedLoop, dialled: Dialled) -> None:
    """Each arrives, with its time; what has not come yet is waited for."""
    link, peer = dialled()
    link.send(b"down")
    loop.call_later(2.0, peer.transport.write, b"up")
    arrival = link.receive(10.0)
    assert peer.heard == [b"down"]
    assert arrival
    assert (arrival.content, arrival.time_ns) == (b"up", 3 * 10**9)
    assert link.receive(5.0) is None
    assert loop.time() == 5.0


@pytest.mark.parametrize(("end", "told"), [("close", Ending.CLOSED), ("abort", Ending.RESET)])
def test_the_program_ends_it(dialled: Dialled, end: str, told: Ending) -> None:
    """What it had sent is there before the end, which is told again and again."""
    link, peer = dialled()
    peer.transport.write(b"bye")
    getattr(peer.transport, end)()
    assert [getattr(link.receive(1.0), "content", None) for _ in range(3)] == [b"bye", told, told]
    assert peer.transport.is_closing()
    with pytest.raises(LinkError, match="has ended"):
        link.send(b"too late")


@pytest.mark.parametrize(
    ("end", "heard"), [("close", "closed"), ("reset", "reset"), ("half_close", "closed")]
)
def test_the_tester_ends_it(
    loop: SimulatedLoop,
    dialled: Dialled,
    end: str,
    heard: str,
) -> None:
    """The program is told, once, behind what was sent."""
    link, peer = dialled()
    link.send(b"last")
    getattr(link, end)()
    getattr(link, end)()
    while loop.time() < 1:  # the end wakes whoever waits
        loop.run_until(1.0)
    assert peer.heard == [b"last", heard]


def test_nobody_listens(loop: SimulatedLoop) -> None:
    """The program is refused, as on a real network."""
    task = loop.create_task(loop.create_connection(Peer, "127.0.0.1", PORT + 1))
    assert loop.accept(1.0) is None
    with pytest.raises(ConnectionRefusedError):
        task.result()
