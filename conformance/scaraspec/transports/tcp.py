"""TCP links, links over any stream socket, and a wait for several sockets."""

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
"""Timeout of `send` if the peer reads no bytes."""

_READ_BYTES = 65536
_Selector: type[selectors.BaseSelector] = getattr(
    selectors, "PollSelector", selectors.SelectSelector
)
"""A selector that also accepts files, from which operator input may come; epoll rejects files."""
_LINGER_0 = struct.pack("ii", 1, 0)
_QUICKACK: int | None = getattr(socket, "TCP_QUICKACK", None)  # Linux has it


def wait_readable(deadline_s: float, *sources: Any) -> list[Any]:
    """Wait until a source is readable or the deadline has passed; return the readable sources.

    Args:
        deadline_s: The deadline, a time of `time.monotonic`.
        sources: Sockets, files or other objects with a file descriptor.
    """
    with _Selector() as selector:
        for source in sources:
            selector.register(source, selectors.EVENT_READ)
        timeout_s = max(0.0, deadline_s - time.monotonic())
        return [key.fileobj for key, _ in selector.select(timeout_s)]


class SocketLink:
    """A link over a connected stream socket; the link owns the socket.

    The socket is non-blocking, because sending and receiving threads would share its timeout.
    """

    step_s = 1.0

    def __init__(self, connected: socket.socket) -> None:
        connected.settimeout(0.0)
        self._socket = connected
        self._selector = selectors.DefaultSelector()
        self._selector.register(connected, selectors.EVENT_READ)
        self._reset_by_peer = False  # a send has failed because the peer reset the connection
        self._ending: Ending | None = None

    @property
    def now_s(self) -> float:
        """The current time of the system's monotonic clock."""
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
                if not self._wait_writable(SEND_TIMEOUT_S):
                    raise LinkError(
                        UserMessage(
                            "the peer has read no bytes for {timeout_s:g} s",
                            timeout_s=SEND_TIMEOUT_S,
                        )
                    ) from None
            except OSError as error:
                self._reset_by_peer = True
                raise LinkError(
                    UserMessage(
                        "the peer has ended the connection: {reason}", reason=error.strerror
                    )
                ) from None
        return time_ns

    def fileno(self) -> int:
        """Return the file descriptor of the socket, for selectors."""
        return self._socket.fileno()

    def receive(self, deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
        """Wait for bytes or the end; see `Link.receive`."""
        self._check_open()
        while self._ending is None:
            try:
                data = self._socket.recv(_READ_BYTES)
            except BlockingIOError:
                timeout_s = deadline_s - self.now_s
                if timeout_s <= 0 or not self._wait_readable(timeout_s, others):
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
                UserMessage("the peer has ended the connection: {reason}", reason=error.strerror)
            ) from None

    def close(self) -> None:
        """Close the socket."""
        self._selector.close()
        self._socket.close()

    def reset(self) -> None:
        """Close the socket with a linger time of 0: sends RST and drops queued bytes."""
        if self._socket.fileno() < 0:
            return
        with contextlib.suppress(OSError):  # the peer may have reset the connection
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_0)
        self.close()

    def _wait_readable(self, timeout_s: float, others: Sequence[Any]) -> bool:
        """Wait until this socket is readable; False on timeout or if another link is readable."""
        if others:
            return self in wait_readable(self.now_s + timeout_s, self, *others)
        return bool(self._selector.select(timeout_s))

    def _wait_writable(self, timeout_s: float) -> bool:
        """Wait until the socket is writable; False on timeout."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_WRITE)
            return bool(selector.select(timeout_s))

    def _check_open(self) -> None:
        if self._socket.fileno() < 0:
            raise LinkError("this link has been closed")


class TcpLink(SocketLink):
    """A link over TCP without delays: it sends small segments and acknowledges immediately.

    If a peer writes a frame in parts without TCP_NODELAY, its system delays the next part until the
    first one is acknowledged. A delayed acknowledgement may take 40 ms, which adds up to hours in a
    long run.
    """

    def __init__(self, connected: socket.socket) -> None:
        super().__init__(connected)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, deadline_s: float, others: Sequence[Any] = (), /) -> Arrival | None:
        """Wait for bytes or the end; see `Link.receive`."""
        arrival = super().receive(deadline_s, others)
        if _QUICKACK is not None and arrival is not None:
            with contextlib.suppress(OSError):  # the peer may have reset the connection
                self._socket.setsockopt(
                    socket.IPPROTO_TCP, _QUICKACK, 1
                )  # the option is not permanent
        return arrival


def connect_tcp(address: Tcp, timeout_s: float) -> TcpLink:
    """Connect to a TCP port.

    Args:
        address: Host and port.
        timeout_s: Timeout in seconds.

    Raises:
        LinkError: The connection is refused, the host is unknown, or the timeout expires.
    """
    try:
        connected = socket.create_connection(address, timeout_s)
    except TimeoutError:
        raise LinkError(
            UserMessage(
                "cannot connect to {address}: no response within {timeout_s:g} s",
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
                "cannot connect to {address}: {reason}",
                address=address,
                reason=os.strerror(errno.ECONNREFUSED),
            )
        )
    return TcpLink(connected)


def _is_to_itself(connected: socket.socket) -> bool:
    """Return whether the socket is connected to itself.

    This happens if nothing listens and the system chooses the target port as the local port.
    """
    try:
        return bool(connected.getsockname() == connected.getpeername())
    except OSError:  # the peer has already reset the connection
        return False
