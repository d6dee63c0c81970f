"""The ways of standing between, on machines of the tests' own."""

import socket
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.tap.routes import Mode

pytestmark = pytest.mark.network

Receive = Callable[[socket.socket, int], bytes]
LED = pytest.mark.parametrize("mode", [Mode.REDIRECT, Mode.TPROXY])


def exchange(client: socket.socket, server: socket.socket, receive: Receive) -> None:
    for one, other in ((client, server), (server, client)):
        one.sendall(b"\xaa\x08\x00\xcc")
        assert receive(other, 4) == b"\xaa\x08\x00\xcc"


@pytest.mark.parametrize(
    ("mode", "seen"),
    [(Mode.EXPLICIT, "10.77.2.1"), (Mode.REDIRECT, "10.77.2.1"), (Mode.TPROXY, "10.77.1.2")],
)
def test_who_is_seen_by_whom(lab: Any, receive: Receive, mode: Mode, seen: str) -> None:
    """The client sees the controller; only TPROXY lets the controller see the client, port and all.

    The recording names the two that meant each other.
    """
    server = lab.serve()
    tap = lab.tap(mode)
    lab.install(mode)
    client = lab.connect(lab.address(mode))
    controller = lab.accept(server)
    exchange(client, controller, receive)
    host, port = controller.getpeername()
    assert host == seen
    assert (port == client.getsockname()[1]) or mode is not Mode.TPROXY
    assert tap.notes(Kind.OPENED) == [f"10.77.1.2:{client.getsockname()[1]} > 10.77.2.2:8877"]
    for direction in Direction:
        tap.until_received(direction, b"\xaa\x08\x00\xcc")


@LED
def test_rules_leave_a_live_session_alone(lab: Any, receive: Receive, mode: Mode) -> None:
    """What was connected before goes on, unrecorded; who connects after is led through the tap."""
    server = lab.serve()
    live = lab.connect(lab.address(mode))
    controller = lab.accept(server)
    exchange(live, controller, receive)
    tap = lab.tap(mode)
    lab.install(mode)
    exchange(live, controller, receive)
    assert tap.records == []
    new = lab.connect(lab.address(mode))
    exchange(new, lab.accept(server), receive)
    exchange(live, controller, receive)
    assert len(tap.notes(Kind.OPENED)) == 1
    live.shutdown(socket.SHUT_WR)
    assert controller.recv(1) == b""


@LED
def test_rules_can_be_loaded_again(lab: Any, receive: Receive, mode: Mode) -> None:
    """A session that is led through the tap survives it, and no rule is there twice."""
    server = lab.serve()
    lab.tap(mode)
    lab.install(mode)
    client = lab.connect(lab.address(mode))
    controller = lab.accept(server)
    exchange(client, controller, receive)
    ruleset = lab.middle.run("nft list ruleset")
    lab.load_again(mode)
    assert lab.middle.run("nft list ruleset") == ruleset
    exchange(client, controller, receive)


@LED
def test_nothing_is_left_when_the_rules_are_removed(lab: Any, receive: Receive, mode: Mode) -> None:
    """Clients reach the controller without the tap, and the machine is as it was."""
    state = "nft list ruleset; ip rule; ip route show table all"
    before = lab.middle.run(state)
    server = lab.serve()
    tap = lab.tap(mode)
    lab.install(mode)
    assert lab.middle.run(state) != before
    lab.remove(mode)
    assert lab.middle.run(state) == before
    exchange(lab.connect(lab.address(mode)), lab.accept(server), receive)
    assert tap.records == []


@pytest.mark.parametrize("mode", [Mode.EXPLICIT, Mode.REDIRECT])
def test_without_a_recorder_clients_are_refused(lab: Any, mode: Mode) -> None:
    """Explicit and REDIRECT fail closed."""
    lab.serve()
    lab.install(mode)
    with pytest.raises(ConnectionRefusedError):
        lab.connect(lab.address(mode))


def test_without_a_recorder_tproxy_lets_clients_through(lab: Any, receive: Receive) -> None:
    """TPROXY fails open, and such a session is unrecorded to its end."""
    server = lab.serve()
    lab.install(Mode.TPROXY)
    client = lab.connect(lab.address(Mode.TPROXY))
    controller = lab.accept(server)
    assert controller.getpeername() == client.getsockname()
    exchange(client, controller, receive)
    tap = lab.tap(Mode.TPROXY)
    exchange(client, controller, receive)
    assert tap.records == []
    exchange(lab.connect(lab.address(Mode.TPROXY)), lab.accept(server), receive)
    assert len(tap.notes(Kind.OPENED)) == 1


def test_redirect_leads_the_machines_own_clients_but_not_its_recorder(
    lab: Any, receive: Receive
) -> None:
    """A client beside the recorder passes through the tap once: the mark breaks the circle."""
    server = lab.serve()
    tap = lab.tap(Mode.REDIRECT)
    lab.install(Mode.REDIRECT)
    client = lab.connect(lab.address(Mode.REDIRECT), lab.middle)
    exchange(client, lab.accept(server), receive)
    assert tap.notes(Kind.OPENED) == [f"10.77.2.1:{client.getsockname()[1]} > 10.77.2.2:8877"]


@LED
def test_who_comes_by_itself_is_not_led_in_a_circle(lab: Any, mode: Mode) -> None:
    """A client that connects to the recorder's own address is disconnected."""
    tap = lab.tap(mode)
    lab.install(mode)
    with pytest.raises(ConnectionResetError):
        lab.connect(("127.0.0.1", 8878), lab.middle).recv(1)
    assert tap.until(Kind.RESET).note == "no connection: no firewall rule redirected the client"
    assert len(tap.notes(Kind.OPENED)) == 1


@LED
def test_a_dead_controller_looks_dead(lab: Any, mode: Mode) -> None:
    """Nothing listens there: the client is disconnected, and the recording gives the reason."""
    tap = lab.tap(mode)
    lab.install(mode)
    with pytest.raises(ConnectionResetError):
        lab.connect(lab.address(mode)).recv(1)
    assert tap.until(Kind.RESET).note == "no connection: Connection refused"
