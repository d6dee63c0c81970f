"""TCP between machines, in every mode: the tap forwards each event of one side to the other."""

import random
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.tap import tap, tcp
from scaraspec_recorder.tap.routes import Mode
from scaraspec_recorder.tap.tap import Connection

pytestmark = [pytest.mark.network, pytest.mark.parametrize("mode", Mode)]

Receive = Callable[[socket.socket, int], bytes]
Cut = Callable[[socket.socket], None]
FROM = pytest.mark.parametrize("direction", Direction, ids=str)

SLOW_BYTES = 65_536
"""The size of the socket buffer of a side that reads late; other data waits in the tap."""


class Link:
    """A connection through a tap."""

    def __init__(self, lab: Any, mode: Mode, receive_bytes: int = 0) -> None:
        server = lab.serve()
        if receive_bytes:
            server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        self.tap = lab.tap(mode)
        lab.install(mode)
        client = lab.connect(lab.address(mode), receive_bytes=receive_bytes)
        self._ends = {A2C: client, C2A: lab.accept(server)}

    def ends(self, direction: Direction) -> tuple[socket.socket, socket.socket]:
        """Return the sockets that send and receive in this direction."""
        return self._ends[direction], self._ends[direction.opposite]


@FROM
def test_half_close(lab: Any, receive: Receive, mode: Mode, direction: Direction) -> None:
    """The side that has ended still receives all later data."""
    link = Link(lab, mode)
    one, other = link.ends(direction)
    one.sendall(b"last")
    one.shutdown(socket.SHUT_WR)
    assert receive(other, 4) == b"last"
    assert other.recv(1) == b""
    for _ in range(3):
        other.sendall(b"answer" * 1000)
        assert receive(one, 6000) == b"answer" * 1000
    other.shutdown(socket.SHUT_WR)
    assert one.recv(1) == b""
    assert link.tap.until(Kind.CLOSED).direction is direction.opposite
    link.tap.until_received(direction, b"last")
    link.tap.until_received(direction.opposite, b"answer" * 3000)


@FROM
def test_a_reset_is_forwarded_after_the_data(
    lab: Any, receive: Receive, cut: Cut, mode: Mode, direction: Direction
) -> None:
    """A side that reads late gets all queued data, then ECONNRESET instead of an orderly end."""
    link = Link(lab, mode, SLOW_BYTES)
    one, other = link.ends(direction)
    data = random.Random(1).randbytes(6 * SLOW_BYTES)
    one.sendall(data)
    link.tap.until_received(direction, data)
    cut(one)
    assert link.tap.until(Kind.RESET).direction is direction
    assert receive(other, len(data)) == data
    with pytest.raises(ConnectionResetError):
        other.recv(1)


@FROM
def test_a_reset_after_a_half_close_is_forwarded(
    lab: Any, cut: Cut, mode: Mode, direction: Direction
) -> None:
    """If a side half-closes and then crashes, the other one is closed without a write."""
    link = Link(lab, mode)
    one, other = link.ends(direction)
    one.shutdown(socket.SHUT_WR)
    assert other.recv(1) == b""
    cut(one)
    assert link.tap.until(Kind.RESET).direction is direction
    with pytest.raises((ConnectionResetError, BrokenPipeError)):
        send_for_ever(other)


@FROM
def test_back_pressure(lab: Any, receive: Receive, mode: Mode, direction: Direction) -> None:
    """Back-pressure passes through the tap, and no data is lost."""
    link = Link(lab, mode, SLOW_BYTES)
    one, other = link.ends(direction)
    one.settimeout(0.3)  # no progress for that long means blocked
    block, sent = random.Random(2).randbytes(SLOW_BYTES), bytearray()

    def send_much() -> None:
        while len(sent) < 64 << 20:
            sent.extend(block[: one.send(block)])

    with pytest.raises(TimeoutError):
        send_much()
    one.shutdown(socket.SHUT_WR)
    assert receive(other, len(sent)) == sent
    assert other.recv(1) == b""


@FROM
def test_a_lost_receiver(
    lab: Any, mode: Mode, direction: Direction, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While data is sent to it, there are no keep-alive probes. The sender is disconnected."""
    quick_checks(monkeypatch)
    link = Link(lab, mode)
    one, other = link.ends(direction)
    one.sendall(b"arrives")
    assert other.recv(7, socket.MSG_WAITALL) == b"arrives"
    (lab.controller if direction is A2C else lab.client).run("ip link set eth0 down")
    one.sendall(b"does not arrive")
    reset = link.tap.until(Kind.RESET)
    assert (reset.direction, reset.note) == (direction.opposite, "Connection timed out")
    with pytest.raises(ConnectionResetError):
        one.recv(1)


@FROM
def test_a_receiver_that_does_not_read_is_not_lost(
    lab: Any, receive: Receive, mode: Mode, direction: Direction, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It answers, so the connection stays, although nothing is acknowledged for a long time."""
    checks = quick_checks(monkeypatch)
    link = Link(lab, mode, SLOW_BYTES)
    one, other = link.ends(direction)
    data = random.Random(3).randbytes(6 * SLOW_BYTES)
    one.sendall(data)
    link.tap.until_received(direction, data)
    first = checks()
    while checks() < first + 20:
        time.sleep(0.1)
    one.shutdown(socket.SHUT_WR)
    assert receive(other, len(data)) == data
    assert other.recv(1) == b""


def quick_checks(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Look for lost peers more often, after a shorter time; return how often it was done."""
    monkeypatch.setattr(tcp, "LOST_S", 1.0)
    monkeypatch.setattr(tap, "PEER_CHECK_S", 0.1)
    done: list[Connection] = []
    check = Connection.check_peers

    def counted(connection: Connection) -> None:
        done.append(connection)
        check(connection)

    monkeypatch.setattr(Connection, "check_peers", counted)
    return lambda: len(done)


def send_for_ever(sock: socket.socket) -> None:
    while True:
        sock.sendall(b"more")
