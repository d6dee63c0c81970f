"""TCP functions for a transparent relay that event loops do not provide.

Belongs here: addresses, socket options, sending and detecting resets. Does not belong here: what is
relayed or recorded.
"""

import asyncio
import contextlib
import ipaddress
import os
import select
import socket
import struct
import sys
from collections.abc import Callable
from typing import Final

if sys.platform == "linux":  # imported early: without a free file descriptor, imports fail
    import fcntl
    import termios

RESET_FLUSH_S: Final = 5.0
"""Maximum time that a reset waits until queued data is sent."""

BACKLOG: Final = 1024
"""Maximum number of clients that wait for accept."""

LOST_S: Final = 60.0
"""Time without an acknowledgment after which a peer to which data is sent counts as lost."""

_POLL_S: Final = 0.005
_UNANSWERED: Final = 3
"""Retransmissions or window probes without an answer; a peer that answers has 1 at most."""

_TCP_INFO: Final = struct.Struct("=2xBB4x12xI28xI")
"""Of Linux: retransmissions, probes, unacknowledged segments, ms since the last acknowledgment."""

_KEEPALIVE: Final = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3}  # s, s, probes
_LINGER_NOT: Final = struct.pack("ii", 1, 0)  # close() then sends RST


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket; for port 0, the system chooses a free port.

    Raises:
        OSError: The address is unknown, in use or not permitted.
    """
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    return socket.create_server(address[:2], family=family, backlog=BACKLOG)


def listening_hosts(host: str) -> list[str]:
    """Return the addresses of a host to listen on, IPv4 first; `*` and `::` are all of both.

    Raises:
        OSError: The host is unknown.
    """
    passive = None if host in ("*", "::") else host
    found = socket.getaddrinfo(passive, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    ipv4_first = sorted(found, key=lambda each: each[0] != socket.AF_INET)
    return list(dict.fromkeys(str(address[0]) for *_, address in ipv4_first))


def address_text(address: tuple[object, ...]) -> str:
    """Return a socket address as ``host:port``, an IPv6 host in brackets."""
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in str(host) else f"{host}:{port}"


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a socket that listens on this host."""
    try:
        found = listening_hosts(host)
    except (OSError, UnicodeError):
        return False
    return all(ipaddress.ip_address(address).is_loopback for address in found)


def allow_many_sockets() -> None:
    """Raise this process's limit of open files to the maximum: a connection needs two."""
    if sys.platform != "win32":
        import resource  # noqa: PLC0415 - absent on Windows

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def tune(sock: socket.socket) -> None:
    """Set TCP_NODELAY and SO_KEEPALIVE: no send delay, detection of lost peers within a minute.

    On Linux, urgent data is reported by SIGURG. To poll for it would cost a call for every chunk.
    TCP_USER_TIMEOUT is not set: it would also close a connection whose peer does not read. Without
    keep-alive probes, during a transmission, `is_lost` detects a lost peer.
    """
    with contextlib.suppress(OSError):  # some systems refuse after the peer disconnected
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEPALIVE.items():
            if option := getattr(socket, name, 0):  # some systems lack some of them
                sock.setsockopt(socket.IPPROTO_TCP, option, value)
        if sys.platform == "linux":
            fcntl.fcntl(sock.fileno(), fcntl.F_SETOWN, os.getpid())


def unsent_bytes(sock: socket.socket) -> int:
    """Return the number of unacknowledged bytes; 0 if the system does not report it."""
    if sys.platform != "linux":
        return 0
    answer = fcntl.ioctl(sock.fileno(), termios.TIOCOUTQ, b"\0\0\0\0")  # SIOCOUTQ, by its old name
    return int.from_bytes(answer, sys.byteorder)


def unread_bytes(sock: socket.socket) -> int:
    """Return the number of received bytes that were not read; 0 if it is unknown."""
    if sys.platform != "linux":
        return 0
    answer = fcntl.ioctl(sock.fileno(), termios.FIONREAD, b"\0\0\0\0")
    return int.from_bytes(answer, sys.byteorder)


def drop_urgent(descriptor: int) -> bool:
    """Drop urgent data, of which the system keeps a byte. Return whether there was any."""
    try:
        with socket.socket(fileno=os.dup(descriptor)) as sock:
            return bool(sock.recv(1, socket.MSG_OOB | socket.MSG_DONTWAIT))
    except OSError:
        return False


def is_lost(sock: socket.socket) -> bool:
    """Whether the peer has not acknowledged sent data for `LOST_S`; on Linux only.

    A peer that does not read still answers window probes, so it is not lost.
    """
    if sys.platform != "linux":
        return False
    info = sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO.size)
    retransmissions, probes, unacknowledged, silent_ms = _TCP_INFO.unpack(info)
    unanswered = retransmissions if unacknowledged else probes
    return bool(unanswered >= _UNANSWERED and silent_ms >= LOST_S * 1000)


def reset(transport: asyncio.Transport) -> None:
    """Reset the connection with RST. Queued bytes are lost."""
    sock: socket.socket = transport.get_extra_info("socket")
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)
    transport.abort()


def reset_when_flushed(transport: asyncio.Transport) -> None:
    """Stop reading, and reset after queued bytes are sent or after `RESET_FLUSH_S`."""
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
    """Reports resets of half-closed sockets.

    Event loops do not watch such a socket and would detect a reset only at the next write. Without
    epoll, resets are not reported.
    """

    def __init__(self) -> None:
        self._callbacks: dict[int, Callable[[], None]] = {}
        if sys.platform == "linux":
            self._epoll = select.epoll()
            asyncio.get_running_loop().add_reader(self._epoll.fileno(), self._on_ready)

    def add(self, descriptor: int, callback: Callable[[], None]) -> None:
        """Call `callback` when this socket is reset."""
        if sys.platform == "linux":
            self._callbacks[descriptor] = callback
            self._epoll.register(descriptor, select.EPOLLET)  # errors are always reported

    def discard(self, descriptor: int) -> None:
        """Stop watching this socket. Must be called before it is closed."""
        if self._callbacks.pop(descriptor, None) and sys.platform == "linux":
            with contextlib.suppress(OSError):
                self._epoll.unregister(descriptor)

    def close(self) -> None:
        """Stop watching all sockets."""
        if sys.platform == "linux":
            asyncio.get_running_loop().remove_reader(self._epoll.fileno())
            self._epoll.close()

    def _on_ready(self) -> None:
        for descriptor, events in self._epoll.poll(0):
            if events & select.EPOLLERR and (callback := self._callbacks.get(descriptor)):
                callback()
