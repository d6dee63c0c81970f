"""TCP links, the link that any stream socket gives, and how several sockets are waited for."""

import contextlib
import errno
import os
import selectors
import socket
import struct
import time
from collections.abc import Sequence
from typing import Any

from scaraspec.transports.clock import now_ns
from scaraspec.transports.link import Arrival, Ending, LinkError
from scaraspec.transports.url import Tcp
from scaraspec.user_message import UserMessage

SEND_TIMEOUT_S = 10.0
"""For how long a peer may take no bytes before sending to it fails."""

_READ_BYTES = 65536
_Selector: type[selectors.BaseSelector] = getattr(
    selectors, "PollSelector", selectors.SelectSelector
)
"""One that takes files, too: an operator's lines may come from one, which epoll refuses."""
_LINGER_0 = struct.pack("ii", 1, 0)
_QUICKACK: int | None = getattr(socket, "TCP_QUICKACK", None)  # Linux has it


def wait_readable(deadline_s: float, *sources: Any) -> list[Any]:
    """Wait until one of these can be read, or until then; those that can."""
    with _Selector() as selector:
        for source in sources:
            selector.register(source, selectors.EVENT_READ)
        left_s = max(0.0, deadline_s - time.monotonic())
        return [key.fileobj for key, _ in selector.select(left_s)]


class SocketLink:
    """A link over a connected stream socket, which it then owns.

    The socket never blocks: its time-out would be shared by whoever sends and whoever receives.
    """

    step_s = 1.0

    def __init__(self, connected: socket.socket) -> None:
        connected.settimeout(0.0)
        self._socket = connected
        self._selector = selectors.DefaultSelector()
        self._selector.register(connected, selectors.EVENT_READ)
        self._reset_by_peer = False  # sending showed that the peer has cut the connection
        self._ending: Ending | None = None

    @property
    def now_s(self) -> float:
        """Seconds of the system's monotonic clock."""
        return time.monotonic()

    def send(self, data: bytes) -> int:
        """Send all of `data`; see `Link.send`."""
        self._check_open()
        time_ns = now_ns()
        rest = memoryview(data)
        while rest:
            try:
                rest = rest[self._socket.send(rest) :]
            except BlockingIOError:
                if not self._writable(SEND_TIMEOUT_S):
                    sentence = UserMessage(
                        "the peer has taken no bytes for {send_timeout_s:g} s",
                        send_timeout_s=SEND_TIMEOUT_S,
                    )
                    raise LinkError(sentence) from None
            except OSError as error:
                self._reset_by_peer = True
                raise LinkError(
                    UserMessage(
                        "the peer has ended the connection: {strerror}", strerror=error.strerror
                    )
                ) from None
        return time_ns

    def fileno(self) -> int:
        """The number of its socket, for whoever waits for several."""
        return self._socket.fileno()

    def receive(self, deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
        """Wait for bytes or the end; see `Link.receive`."""
        self._check_open()
        while self._ending is None:
            try:
                data = self._socket.recv(_READ_BYTES)
            except BlockingIOError:
                left_s = deadline_s - self.now_s
                if left_s <= 0 or not self._readable(left_s, others):
                    return None
            except OSError:
                self._ending = Ending.RESET
            else:
                if data:
                    return Arrival(now_ns(), data)
                self._ending = Ending.RESET if self._reset_by_peer else Ending.CLOSED
        return Arrival(now_ns(), self._ending)

    def half_close(self) -> None:
        """Send FIN; see `Link.half_close`."""
        self._check_open()
        try:
            self._socket.shutdown(socket.SHUT_WR)
        except OSError as error:
            raise LinkError(
                UserMessage(
                    "the peer has ended the connection: {strerror}", strerror=error.strerror
                )
            ) from None

    def close(self) -> None:
        """Close the socket."""
        self._selector.close()
        self._socket.close()

    def reset(self) -> None:
        """Close the socket with a linger time of 0, which sends RST and drops what is queued."""
        if self._socket.fileno() < 0:
            return
        with contextlib.suppress(OSError):  # a socket that the peer has cut may refuse options
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_0)
        self.close()

    def _readable(self, timeout_s: float, others: Sequence[Any]) -> bool:
        """Wait until something has come; False when the time is up, or it came elsewhere."""
        if others:
            return self in wait_readable(self.now_s + timeout_s, self, *others)
        return bool(self._selector.select(timeout_s))

    def _writable(self, timeout_s: float) -> bool:
        """Wait until the peer takes bytes again; False when the time is up."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_WRITE)
            return bool(selector.select(timeout_s))

    def _check_open(self) -> None:
        if self._socket.fileno() < 0:
            raise LinkError("this link has been closed")


class TcpLink(SocketLink):
    """A link over TCP that makes nobody wait: it sends small segments and acknowledges at once.

    A peer that writes a frame in pieces, without TCP_NODELAY, is held back by its own system until
    the first of them is acknowledged, and ours may take 40 ms for that: a long run by the hour.
    """

    def __init__(self, connected: socket.socket) -> None:
        super().__init__(connected)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
        """Wait for bytes or the end; see `Link.receive`."""
        arrival = super().receive(deadline_s, others)
        if _QUICKACK is not None and arrival is not None:
            with contextlib.suppress(OSError):  # the peer may have cut it
                self._socket.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)  # it does not last
        return arrival


def connect_tcp(address: Tcp, timeout_s: float) -> TcpLink:
    """Connect.

    Raises:
        LinkError: Nothing listens there, the name is unknown, or the time is up.
    """
    try:
        connected = socket.create_connection(address, timeout_s)
    except TimeoutError:
        raise LinkError(
            UserMessage(
                "cannot connect to {address}: no answer in {timeout_s:g} s",
                address=address,
                timeout_s=timeout_s,
            )
        ) from None
    except (OSError, UnicodeError) as error:  # a name that IDNA cannot encode is a UnicodeError
        reason = error.strerror if isinstance(error, OSError) else "the host name is malformed"
        raise LinkError(
            UserMessage("cannot connect to {address}: {reason}", address=address, reason=reason)
        ) from None
    if _is_to_itself(connected):
        connected.close()
        raise LinkError(
            UserMessage(
                "cannot connect to {address}: {strerror}",
                address=address,
                strerror=os.strerror(errno.ECONNREFUSED),
            )
        )
    return TcpLink(connected)


def _is_to_itself(connected: socket.socket) -> bool:
    """Whether the system took the free port that was to be reached for this end of it, too."""
    try:
        return bool(connected.getsockname() == connected.getpeername())
    except OSError:  # the peer has cut it already
        return False
