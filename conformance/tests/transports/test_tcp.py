"""TCP links over real loopback sockets."""

import socket
import struct
import threading
import time
from collections.abc import Iterator
from functools import partial

import pytest

from scaraspec.transports import tcp
from scaraspec.transports.connect import connect
from scaraspec.transports.link import Ending, LinkError
from scaraspec.transports.tcp import SocketLink, connect_tcp
from scaraspec.transports.url import Tcp

_SOON_S = 5.0


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    """Return a server socket on a free port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(_SOON_S)
        yield server


@pytest.fixture
def pair(listener: socket.socket) -> Iterator[tuple[SocketLink, socket.socket]]:
    """Return a link and the socket of its peer."""
    link = connect_tcp(Tcp(*listener.getsockname()), _SOON_S)
    peer, _ = listener.accept()
    peer.settimeout(_SOON_S)
    with peer:
        yield link, peer
    link.close()


def test_connection_to_itself_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system may choose the target port as the local port if nothing listens there."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = free.getsockname()
    to_itself = partial(socket.create_connection, source_address=address)
    monkeypatch.setattr(socket, "create_connection", to_itself)
    with pytest.raises(LinkError, match=r"cannot connect to .*: Connection refused"):
        connect_tcp(Tcp(*address), _SOON_S)


def test_send_and_receive_with_time_stamps(pair: tuple[SocketLink, socket.socket]) -> None:
    """The time stamp of a reply is not before that of the request."""
    link, peer = pair
    sent_ns = link.send(b"ask")
    assert peer.recv(10) == b"ask"
    peer.sendall(b"answer")
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert arrival.content == b"answer"
    assert arrival.time_ns >= sent_ns > 1.5e18


def test_small_segments_are_sent_immediately(pair: tuple[SocketLink, socket.socket]) -> None:
    """TCP_NODELAY: a request does not wait for the acknowledgement of the previous one."""
    link, _ = pair
    assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.skipif(tcp._QUICKACK is None, reason="only Linux can be asked to acknowledge at once")
def test_received_data_is_acknowledged_immediately(pair: tuple[SocketLink, socket.socket]) -> None:
    """TCP_QUICKACK is set after each receive: a peer that writes in parts waits for the ACK."""
    link, peer = pair
    for _ in range(20):
        link.send(b"ask")
        peer.recv(10)
        peer.sendall(b"answer")
        link.receive(link.now_s + _SOON_S)
        assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK)


@pytest.mark.parametrize("wait_s", [-1.0, 0.0, 0.02])
def test_receive_returns_none_at_the_deadline(
    pair: tuple[SocketLink, socket.socket], wait_s: float
) -> None:
    """With a deadline in the past, `receive` returns available data and does not wait."""
    link, peer = pair
    began_s = link.now_s
    assert link.receive(began_s + wait_s) is None
    assert link.now_s - began_s >= wait_s - 0.005
    peer.sendall(b"x")
    link.receive(link.now_s + _SOON_S)


def test_data_on_another_link_ends_the_wait(
    pair: tuple[SocketLink, socket.socket], listener: socket.socket
) -> None:
    """The other link keeps its data; data on this link is still received."""
    link, peer = pair
    other = connect_tcp(Tcp(*listener.getsockname()), _SOON_S)
    with listener.accept()[0] as elsewhere:
        elsewhere.sendall(b"a")
        never_s = link.now_s + 1000
        assert link.receive(never_s, [other]) is None
        peer.sendall(b"b")
        arrivals = [each.receive(never_s, [other]) for each in (link, other)]
    assert [arrival and arrival.content for arrival in arrivals] == [b"b", b"a"]
    other.close()


def test_end_is_received_after_the_last_bytes(pair: tuple[SocketLink, socket.socket]) -> None:
    """After the last bytes of a closing peer, every `receive` returns the end."""
    link, peer = pair
    peer.sendall(b"last")
    peer.close()
    arrivals = [link.receive(link.now_s + _SOON_S) for _ in range(3)]
    assert [arrival and arrival.content for arrival in arrivals] == [b"last", *[Ending.CLOSED] * 2]


def test_reset_is_received(pair: tuple[SocketLink, socket.socket]) -> None:
    """RST and FIN are different endings."""
    link, peer = pair
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    arrivals = [link.receive(link.now_s + _SOON_S) for _ in range(2)]
    assert [arrival and arrival.content for arrival in arrivals] == [Ending.RESET] * 2


def test_half_closed_link_still_receives(pair: tuple[SocketLink, socket.socket]) -> None:
    """FIN ends only one direction."""
    link, peer = pair
    link.half_close()
    assert peer.recv(10) == b""
    peer.sendall(b"answer")
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert arrival.content == b"answer"


def test_closed_link_cannot_be_used(pair: tuple[SocketLink, socket.socket]) -> None:
    """`close` sends FIN and may be repeated; `reset` of a closed link has no effect."""
    link, peer = pair
    link.close()
    assert peer.recv(10) == b""
    link.close()
    link.reset()
    for use in (lambda: link.send(b"x"), lambda: link.receive(0.0), link.half_close):
        with pytest.raises(LinkError, match="has been closed"):
            use()


def test_reset(pair: tuple[SocketLink, socket.socket]) -> None:
    """With SO_LINGER 0, the peer receives RST."""
    link, peer = pair
    link.reset()
    with pytest.raises(ConnectionResetError):
        peer.recv(10)


def test_send_after_a_reset_by_the_peer_fails(
    pair: tuple[SocketLink, socket.socket],
) -> None:
    """`send` raises an error, and the received ending is a reset."""
    link, peer = pair
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    with pytest.raises(LinkError, match="the peer has ended the connection"):
        link.send(b"x")
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert arrival.content is Ending.RESET


def test_half_close_after_a_reset_by_the_peer_fails(
    pair: tuple[SocketLink, socket.socket],
) -> None:
    """`half_close` raises an error after a reset."""
    link, peer = pair
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    link.receive(link.now_s + _SOON_S)
    with pytest.raises(LinkError, match="the peer has ended the connection"):
        link.half_close()


def test_send_to_a_peer_that_does_not_read_times_out(
    pair: tuple[SocketLink, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`send` has a timeout."""
    link, _ = pair
    monkeypatch.setattr(tcp, "SEND_TIMEOUT_S", 0.05)
    with pytest.raises(LinkError, match=r"has read no bytes for 0\.05 s"):
        link.send(bytes(64 * 2**20))


def test_send_and_receive_in_two_threads(
    pair: tuple[SocketLink, socket.socket],
) -> None:
    """A receive without a wait does not interrupt a send that waits for the peer."""
    link, peer = pair
    peer.settimeout(None)
    data = bytes(range(256)) * 2**16  # more than any socket takes unread
    sender = threading.Thread(target=link.send, args=(data,))
    sender.start()
    taken = peer.recv(1)
    while len(taken) < len(data):
        assert link.receive(0.0) is None
        taken += peer.recv(2**20)
    sender.join(_SOON_S)
    assert not sender.is_alive()
    assert taken == data


def test_send_does_not_delay_a_receive() -> None:
    """Each thread keeps its own timeout, at any interleaving."""
    near, far = socket.socketpair()

    class Interrupted(socket.socket):
        def recv(self, *arguments: int) -> bytes:
            link.send(b"from another thread")
            return super().recv(*arguments)

    link = SocketLink(Interrupted(fileno=near.detach()))
    with far:
        began_s = link.now_s
        assert link.receive(began_s) is None
        assert link.now_s - began_s < tcp.SEND_TIMEOUT_S / 2
        link.close()


@pytest.mark.parametrize("host", ["127.0.0.1", "a" * 70, "."])
def test_connection_refused(listener: socket.socket, host: str) -> None:
    """The error message contains the address."""
    port = listener.getsockname()[1]
    listener.close()
    with pytest.raises(LinkError, match=f"cannot connect to tcp://{host}:{port}: ") as raised:
        connect(f"tcp://{host}:{port}", timeout_s=_SOON_S)
    assert "None" not in str(raised.value)


def test_connect_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """A router may drop the packets."""

    def drop(_address: object, _timeout_s: float) -> socket.socket:
        raise TimeoutError

    monkeypatch.setattr(socket, "create_connection", drop)
    with pytest.raises(
        LinkError, match=r"cannot connect to tcp://robot:8877: no response within 5 s"
    ):
        connect("tcp://robot")


def test_connect_over_ipv6() -> None:
    """`connect` accepts an IPv6 address in brackets."""
    with socket.create_server(("::1", 0), family=socket.AF_INET6) as server:
        link = connect(f"tcp://[::1]:{server.getsockname()[1]}")
        link.send(b"x")
        peer, _ = server.accept()
        with peer:
            assert peer.recv(10) == b"x"
        link.close()


def test_setting_the_clock_does_not_change_time_stamps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The distance of time stamps is correct after the system clock is set."""
    near, far = socket.socketpair()
    link = SocketLink(near)
    before_ns = link.send(b"a")
    monkeypatch.setattr(time, "time_ns", lambda: before_ns - 3_600_000_000_000)
    far.sendall(b"b")
    arrival = link.receive(link.now_s + 5)
    link.close()
    far.close()
    assert arrival
    assert 0 <= arrival.time_ns - before_ns < 5_000_000_000
