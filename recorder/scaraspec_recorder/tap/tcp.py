"""TCP as a transparent relay needs it: what the event loops neither set nor tell.

Lives here: addresses, socket options, passing resets on, and hearing of them. Nothing in this file
knows what is relayed, or that anything is recorded.
"""

import asyncio
import contextlib
import ipaddress
import select
import socket
import struct
import sys
from collections.abc import Callable
from typing import Final

if sys.platform == "linux":  # ahead of all, for a process without a free file imports nothing
    import fcntl
    import termios

RESET_FLUSH_S: Final = 5.0
"""How long a reset waits for queued data to leave before it is passed on."""

BACKLOG: Final = 1024
"""How many clients may wait to be accepted."""

_POLL_S: Final = 0.005
_LINGER_NOT: Final = struct.pack("ii", 1, 0)  # close() then sends RST


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens; port 0 takes a free one.

    Raises:
        OSError: The address is unknown, taken or not permitted.
    """
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    return socket.create_server(address[:2], family=family, backlog=BACKLOG)


def address_text(address: tuple[object, ...]) -> str:
    """Return a socket address as ``host:port``, an IPv6 host in brackets."""
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in str(host) else f"{host}:{port}"


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a socket that listens on this host."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    return all(ipaddress.ip_address(address[0]).is_loopback for *_, address in found)


def allow_many_sockets() -> None:
    """Raise this process's limit of open files as far as it may: a connection takes two."""
    if sys.platform != "win32":
        import resource  # noqa: PLC0415 - absent on Windows

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def tune(sock: socket.socket) -> None:
    """Pass small frames on at once, and notice a peer that has vanished (in the system's time)."""
    with contextlib.suppress(OSError):  # some systems refuse where the peer has gone already
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)


def unsent_bytes(sock: socket.socket) -> int:
    """Return how much the peer has not acknowledged yet; 0 where the system does not tell."""
    if sys.platform != "linux":
        return 0
    answer = fcntl.ioctl(sock.fileno(), termios.TIOCOUTQ, b"\0\0\0\0")  # SIOCOUTQ, by its old name
    return int.from_bytes(answer, sys.byteorder)


def reset(transport: asyncio.Transport) -> None:
    """Cut the connection: the peer is told by RST, and what is queued is lost."""
    sock: socket.socket = transport.get_extra_info("socket")
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)
    transport.abort()


def reset_when_flushed(transport: asyncio.Transport) -> None:
    """Read no more; when all that is queued has left, or after `RESET_FLUSH_S`, reset."""
    loop = asyncio.get_running_loop()
    deadline_s = loop.time() + RESET_FLUSH_S
    sock: socket.socket = transport.get_extra_info("socket")

    def poll() -> None:
        if transport.is_closing():
            return
        queued = transport.get_write_buffer_size() or unsent_bytes(sock)
        if queued and loop.time() < deadline_s:
            loop.call_later(_POLL_S, poll)
            return
        reset(transport)

    if not transport.is_closing():
        transport.pause_reading()
    poll()


class ResetWatch:
    """Tells of resets on sockets whose end of stream was read already.

    The event loops stop looking at such a socket and would hear of a reset only from the next write
    to it. Where the system has no epoll, that is how it stays.
    """

    def __init__(self) -> None:
        self._callbacks: dict[int, Callable[[], None]] = {}
        if sys.platform == "linux":
            self._epoll = select.epoll()
            asyncio.get_running_loop().add_reader(self._epoll.fileno(), self._on_ready)

    def add(self, descriptor: int, callback: Callable[[], None]) -> None:
        """Call back when this socket is reset."""
        if sys.platform == "linux":
            self._callbacks[descriptor] = callback
            self._epoll.register(descriptor, select.EPOLLET)  # errors are told unasked

    def discard(self, descriptor: int) -> None:
        """Watch this socket no longer; to be called before it is closed."""
        if self._callbacks.pop(descriptor, None) and sys.platform == "linux":
            with contextlib.suppress(OSError):
                self._epoll.unregister(descriptor)

    def close(self) -> None:
        """Watch nothing any longer."""
        if sys.platform == "linux":
            asyncio.get_running_loop().remove_reader(self._epoll.fileno())
            self._epoll.close()

    def _on_ready(self) -> None:
        for descriptor, events in self._epoll.poll(0):
            if events & select.EPOLLERR and (callback := self._callbacks.get(descriptor)):
                callback()
