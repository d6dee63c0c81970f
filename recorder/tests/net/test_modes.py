"""The modes of the recorder in the network, on simulated machines."""

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
def test_addresses_that_each_side_sees(lab: Any, receive: Receive, mode: Mode, seen: str) -> None:
    """The client sees the address of the controller; only TPROXY shows the controller that of the
    client.

    The recording has the addresses of client and controller in each mode.
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
def test_rules_do_not_affect_an_open_session(lab: Any, receive: Receive, mode: Mode) -> None:
    """A connection from before continues without a recording; a new one passes through the tap."""
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
    """A session through the tap continues, and no rule is duplicated."""
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
def test_removal_of_the_rules_is_complete(lab: Any, receive: Receive, mode: Mode) -> None:
    """Clients reach the controller without the tap, and no rule remains on the machine."""
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
    """Explicit mode and REDIRECT fail closed."""
    lab.serve()
    lab.install(mode)
    with pytest.raises(ConnectionRefusedError):
        lab.connect(lab.address(mode))


def test_without_a_recorder_tproxy_lets_clients_through(lab: Any, receive: Receive) -> None:
    """TPROXY fails open, and such a session is not recorded until its end."""
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


def test_redirect_affects_local_clients_but_not_the_recorder(lab: Any, receive: Receive) -> None:
    """A client on the recorder's machine passes through the tap once: the mark prevents a loop."""
    server = lab.serve()
    tap = lab.tap(Mode.REDIRECT)
    lab.install(Mode.REDIRECT)
    client = lab.connect(lab.address(Mode.REDIRECT), lab.middle)
    exchange(client, lab.accept(server), receive)
    assert tap.notes(Kind.OPENED) == [f"10.77.2.1:{client.getsockname()[1]} > 10.77.2.2:8877"]


@LED
def test_a_direct_connection_causes_no_loop(lab: Any, mode: Mode) -> None:
    """A client that connects directly to the port of the recorder is disconnected."""
    tap = lab.tap(mode)
    lab.install(mode)
    with pytest.raises(ConnectionResetError):
        lab.connect(("127.0.0.1", 8878), lab.middle).recv(1)
    assert tap.until(Kind.RESET).note == "no connection: no firewall rule redirected the client"
    assert len(tap.notes(Kind.OPENED)) == 1


@LED
def test_a_dead_controller_resets_the_client(lab: Any, mode: Mode) -> None:
    """If the controller does not listen, the client is reset and the recording has the reason."""
    tap = lab.tap(mode)
    lab.install(mode)
    with pytest.raises(ConnectionResetError):
        lab.connect(lab.address(mode)).recv(1)
    assert tap.until(Kind.RESET).note == "no connection: Connection refused"
