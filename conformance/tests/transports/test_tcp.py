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
    """Accepts connections on a free port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(_SOON_S)
        yield server


@pytest.fixture
def pair(listener: socket.socket) -> Iterator[tuple[SocketLink, socket.socket]]:
    """A link, and the peer's socket."""
    link = connect_tcp(Tcp(*listener.getsockname()), _SOON_S)
    peer, _ = listener.accept()
    peer.settimeout(_SOON_S)
    with peer:
        yield link, peer
    link.close()


def test_a_port_where_nobody_listens_is_never_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even from itself, as happens when the system gives the connection that very port."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = free.getsockname()
    to_itself = partial(socket.create_connection, source_address=address)
    monkeypatch.setattr(socket, "create_connection", to_itself)
    with pytest.raises(LinkError, match=r"cannot connect to .*: Connection refused"):
        connect_tcp(Tcp(*address), _SOON_S)


def test_bytes_go_both_ways_with_their_times(pair: tuple[SocketLink, socket.socket]) -> None:
    """What arrives is stamped after what was sent before it."""
    link, peer = pair
    sent_ns = link.send(b"ask")
    assert peer.recv(10) == b"ask"
    peer.sendall(b"answer")
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert arrival.content == b"answer"
    assert arrival.time_ns >= sent_ns > 1.5e18


def test_small_segments_are_sent_at_once(pair: tuple[SocketLink, socket.socket]) -> None:
    """TCP_NODELAY: a request does not wait for the acknowledgement of the one before."""
    link, _ = pair
    assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.skipif(tcp._QUICKACK is None, reason="only Linux can be asked to acknowledge at once")
def test_what_arrives_is_acknowledged_at_once(pair: tuple[SocketLink, socket.socket]) -> None:
    """TCP_QUICKACK, anew each time: a peer that writes in pieces waits for the acknowledgement."""
    link, peer = pair
    for _ in range(20):
        link.send(b"ask")
        peer.recv(10)
        peer.sendall(b"answer")
        link.receive(link.now_s + _SOON_S)
        assert link._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK)


@pytest.mark.parametrize("wait_s", [-1.0, 0.0, 0.02])
def test_silence_is_none_at_the_deadline(
    pair: tuple[SocketLink, socket.socket], wait_s: float
) -> None:
    """A deadline in the past takes what is there, and waits for nothing."""
    link, peer = pair
    began_s = link.now_s
    assert link.receive(began_s + wait_s) is None
    assert link.now_s - began_s >= wait_s - 0.005
    peer.sendall(b"x")
    link.receive(link.now_s + _SOON_S)


def test_what_comes_elsewhere_ends_the_waiting(
    pair: tuple[SocketLink, socket.socket], listener: socket.socket
) -> None:
    """It stays there for whoever receives there; what comes here is received all the same."""
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


def test_the_end_is_told_after_what_came_before_it(pair: tuple[SocketLink, socket.socket]) -> None:
    """A peer that closes has its last bytes received, then its end, again and again."""
    link, peer = pair
    peer.sendall(b"last")
    peer.close()
    arrivals = [link.receive(link.now_s + _SOON_S) for _ in range(3)]
    assert [arrival and arrival.content for arrival in arrivals] == [b"last", *[Ending.CLOSED] * 2]


def test_a_reset_is_told_as_such(pair: tuple[SocketLink, socket.socket]) -> None:
    """RST is another end than FIN."""
    link, peer = pair
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    arrivals = [link.receive(link.now_s + _SOON_S) for _ in range(2)]
    assert [arrival and arrival.content for arrival in arrivals] == [Ending.RESET] * 2


def test_a_link_that_is_half_closed_still_receives(pair: tuple[SocketLink, socket.socket]) -> None:
    """FIN ends one direction only."""
    link, peer = pair
    link.half_close()
    assert peer.recv(10) == b""
    peer.sendall(b"answer")
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert arrival.content == b"answer"


def test_a_link_that_is_closed_cannot_be_used(pair: tuple[SocketLink, socket.socket]) -> None:
    """Closing sends FIN, and may be repeated; resetting a closed link does nothing."""
    link, peer = pair
    link.close()
    assert peer.recv(10) == b""
    link.close()
    link.reset()
    for use in (lambda: link.send(b"x"), lambda: link.receive(0.0), link.half_close):
        with pytest.raises(LinkError, match="has been closed"):
            use()


def test_a_link_can_be_reset(pair: tuple[SocketLink, socket.socket]) -> None:
    """SO_LINGER 0: the peer sees a reset."""
    link, peer = pair
    link.reset()
    with pytest.raises(ConnectionResetError):
        peer.recv(10)


def test_sending_to_a_peer_that_has_cut_the_link_fails(
    pair: tuple[SocketLink, socket.socket],
) -> None:
    """It is told in one sentence, and the end that follows is a reset."""
    link, peer = pair
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    with pytest.raises(LinkError, match="the peer has ended the connection"):
        link.send(b"x")
    arrival = link.receive(link.now_s + _SOON_S)
    assert arrival is not None
    assert arrival.content is Ending.RESET


def test_a_link_that_the_peer_has_cut_cannot_be_half_closed(
    pair: tuple[SocketLink, socket.socket],
) -> None:
    """There is nothing left to close."""
    link, peer = pair
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()
    link.receive(link.now_s + _SOON_S)
    with pytest.raises(LinkError, match="the peer has ended the connection"):
        link.half_close()


def test_sending_to_a_peer_that_does_not_read_fails_in_time(
    pair: tuple[SocketLink, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No send lasts for ever."""
    link, _ = pair
    monkeypatch.setattr(tcp, "SEND_TIMEOUT_S", 0.05)
    with pytest.raises(LinkError, match=r"has taken no bytes for 0\.05 s"):
        link.send(bytes(64 * 2**20))


def test_one_thread_may_send_while_another_receives(
    pair: tuple[SocketLink, socket.socket],
) -> None:
    """A send that waits for the peer is not cut short by a receive that does not wait at all."""
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


def test_a_send_does_not_lengthen_a_receive() -> None:
    """Wherever the one thread is when the other one comes, each keeps its own time."""
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
def test_where_nothing_listens_there_is_no_link(listener: socket.socket, host: str) -> None:
    """One sentence, which names the address."""
    port = listener.getsockname()[1]
    listener.close()
    with pytest.raises(LinkError, match=f"cannot connect to tcp://{host}:{port}: ") as told:
        connect(f"tcp://{host}:{port}", timeout_s=_SOON_S)
    assert "None" not in str(told.value)


def test_a_host_that_does_not_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A router may drop what is sent to it."""

    def drop(_address: object, _timeout_s: float) -> socket.socket:
        raise TimeoutError

    monkeypatch.setattr(socket, "create_connection", drop)
    with pytest.raises(LinkError, match=r"cannot connect to tcp://robot:8877: no answer in 5 s"):
        connect("tcp://robot")


def test_a_url_opens_a_link_over_ipv6() -> None:
    """`connect` knows TCP, and brackets."""
    with socket.create_server(("::1", 0), family=socket.AF_INET6) as server:
        link = connect(f"tcp://[::1]:{server.getsockname()[1]}")
        link.send(b"x")
        peer, _ = server.accept()
        with peer:
            assert peer.recv(10) == b"x"
        link.close()


def test_a_clock_that_is_set_moves_no_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is stamped stays at its distance from what was stamped before."""
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
