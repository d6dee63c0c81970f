"""Routes: where the tap leads a client's connection, and how it gets there.

Lives here: one route per mode of standing in the way, and the socket options that belong to it. The
rules of the system that redirect clients to the recorder are in docs/transparent-proxy.md.
"""

import asyncio
import errno
import os
import socket
import struct
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

from scaraspec_recorder.tap import tcp

GUARD_MARK: Final = 0x5CA00000
"""Marks what the recorder sends itself, lest the rules lead it back to the recorder."""

_SO_ORIGINAL_DST: Final = 80  # linux/netfilter_ipv4.h; the module socket has no name for it
_SOCKADDR_IN: Final = struct.Struct("!2xH4s8x")

_BY_ITSELF: Final = "the client was not led here by rules"  # it would be led in a circle
_BACK: Final = "that is where the recorder itself listens"  # as above


class Mode(StrEnum):
    """How clients come to the recorder."""

    EXPLICIT = "explicit"  # they connect to it, instead of to the controller
    REDIRECT = "redirect"  # REDIRECT leads them here; the controller sees the recorder's address
    TPROXY = "tproxy"  # TPROXY leads them here; the controller sees the client's address


class Route(Protocol):
    """Where a client's connection leads. Picklable, for the tap is a process of its own."""

    def listen(self, host: str, port: int) -> socket.socket:
        """Return a socket that listens for clients of this route; port 0 takes a free one.

        Raises:
            OSError: The address is unknown, taken or not permitted, or the route is not.
        """

    def target(self, client: socket.socket) -> str:
        """Return where this client is led to, as ``host:port`` or URL, for the recording."""

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Return a non-blocking socket that is connected to there.

        Raises:
            OSError: There is no connection to be had.
        """


def route(mode: Mode, host: str, port: int) -> Route:
    """Return the route of a mode, to a controller or to whatever its clients meant."""
    if mode is Mode.EXPLICIT:
        return Upstream(host, port)
    return Redirect() if mode is Mode.REDIRECT else Tproxy()


@dataclass(frozen=True, slots=True)
class Upstream:
    """The route to one controller, whoever the client is."""

    host: str
    port: int

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen as anybody does; see `Route.listen`."""
        return tcp.listen(host, port)

    def target(self, client: socket.socket) -> str:  # noqa: ARG002 - all are led to one
        """Return the controller's address."""
        return tcp.address_text((self.host, self.port))

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Connect to the first of the host's addresses that answers.

        Raises:
            OSError: None does, or the client was led here by one; the last one's reason.
        """
        try:
            found = await asyncio.get_running_loop().getaddrinfo(
                self.host, self.port, type=socket.SOCK_STREAM
            )
        except UnicodeError:
            raise OSError(f"{self.host} is no host name") from None
        failure = OSError(f"{self.host} has no address")
        for family, kind, protocol, _, address in found:
            if address == client.getsockname():
                failure = OSError(_BACK)
                continue
            try:
                return await _connect(socket.socket(family, kind, protocol), address)
            except OSError as error:
                failure = error
        raise failure


@dataclass(frozen=True, slots=True)
class Redirect:
    """The route to where a client meant to go before REDIRECT led it here (IPv4)."""

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen, and mark what is sent; see `Route.listen`."""
        return _guarded(tcp.listen(host, port))

    def target(self, client: socket.socket) -> str:
        """Return the address that the client connected to."""
        try:
            return tcp.address_text(_redirected_from(client))
        except OSError:
            return "unknown"

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Connect to where the client meant to go, by a socket that the rules leave alone.

        Raises:
            OSError: It cannot be reached, or the client came here by itself.
        """
        destination = _redirected_from(client)
        return await _connect(_guarded(socket.socket()), destination)


@dataclass(frozen=True, slots=True)
class Tproxy:
    """The route to where a client meant to go before TPROXY led it here (IPv4).

    The controller sees the client's address and port, as if nobody stood between.
    """

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen for connections to foreign addresses too; see `Route.listen`."""
        return _transparent(tcp.listen(host, port))

    def target(self, client: socket.socket) -> str:
        """Return the address that the client connected to: the socket's own, though foreign."""
        return tcp.address_text(client.getsockname())

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Connect to where the client meant to go, from the client's own address and port.

        Raises:
            OSError: It cannot be reached, or the client came here by itself or has gone.
        """
        destination = client.getsockname()
        if _is_own(destination[0]):
            raise OSError(_BY_ITSELF)
        sock = _transparent(socket.socket())
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # it may come back at once
        try:
            sock.bind(client.getpeername())
        except OSError:
            sock.close()
            raise
        return await _connect(sock, destination)


async def _connect(sock: socket.socket, address: tuple[object, ...]) -> socket.socket:
    """Connect, or close the socket."""
    sock.settimeout(0)
    try:
        await asyncio.get_running_loop().sock_connect(sock, address)
    except BaseException:  # also where the client has gone meanwhile
        sock.close()
        raise
    if sock.getsockname() == address:  # from the free port that it was to reach
        sock.close()
        raise ConnectionRefusedError(errno.ECONNREFUSED, os.strerror(errno.ECONNREFUSED))
    return sock


def _guarded(sock: socket.socket) -> socket.socket:
    """Mark what this socket sends, or close it."""
    return _with_option(sock, "SOL_SOCKET", "SO_MARK", GUARD_MARK)


def _transparent(sock: socket.socket) -> socket.socket:
    """Let this socket have foreign addresses, or close it."""
    return _with_option(sock, "SOL_IP", "IP_TRANSPARENT", 1)


def _with_option(sock: socket.socket, level: str, name: str, value: int) -> socket.socket:
    """Set an option that only Linux has, by its name in the module socket."""
    try:
        sock.setsockopt(getattr(socket, level), getattr(socket, name), value)
    except (AttributeError, OSError) as error:
        sock.close()
        if isinstance(error, AttributeError):
            raise OSError("only Linux leads connections aside") from None
        raise PermissionError("leading connections aside needs root or CAP_NET_ADMIN") from None
    return sock


def _redirected_from(client: socket.socket) -> tuple[str, int]:
    """The address that this client connected to before REDIRECT changed it."""
    try:
        answer = client.getsockopt(socket.SOL_IP, _SO_ORIGINAL_DST, _SOCKADDR_IN.size)
    except OSError:  # nobody tracks connections here, so there are no such rules
        raise OSError(_BY_ITSELF) from None
    port, host = _SOCKADDR_IN.unpack(answer)
    address = socket.inet_ntoa(host), port
    if address == client.getsockname():
        raise OSError(_BY_ITSELF)
    return address


def _is_own(host: str) -> bool:
    """Whether this is an address of this machine: any other cannot be bound."""
    with socket.socket() as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
    return True
