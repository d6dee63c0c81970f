"""Routes: target of a client's connection, and how the tap connects to it.

Belongs here: one route per relay mode and its socket options. docs/transparent-proxy.md has the
firewall rules that redirect clients to the recorder.
"""

import asyncio
import errno
import os
import socket
import struct
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from enum import StrEnum
from ipaddress import ip_address
from typing import Final, Protocol, cast

from scaraspec_recorder.tap import tcp

GUARD_MARK: Final = 0x5CA00000
"""Socket mark of the recorder's own packets, so that the rules do not redirect them again."""

DIAL_TIMEOUT_S: Final = 5.0
"""Time limit to connect to a target, with all its addresses; the system's own is minutes."""

NEXT_ADDRESS_S: Final = 0.25
"""Time after which the next address is tried too (RFC 8305)."""

_SO_ORIGINAL_DST: Final = 80  # linux/netfilter_ipv4.h; the module socket has no name for it
_SOCKADDR_IN: Final = struct.Struct("!2xH4s8x")

_NOT_REDIRECTED: Final = "no firewall rule redirected the client"  # connecting would create a loop
_OWN_ADDRESS: Final = "the target is the recorder's own address"  # as above


class Mode(StrEnum):
    """How client connections reach the recorder."""

    EXPLICIT = "explicit"  # clients connect to the recorder instead of the controller
    REDIRECT = "redirect"  # netfilter REDIRECT; the controller sees the recorder's address
    TPROXY = "tproxy"  # netfilter TPROXY; the controller sees the client's address


class Route(Protocol):
    """Target of client connections. Must be picklable: the tap is a separate process."""

    def listen(self, host: str, port: int) -> socket.socket:
        """Return a socket that listens for clients; for port 0, the system chooses a free port.

        Raises:
            OSError: The address is unknown, in use or not permitted, or the route is not permitted.
        """

    def target(self, client: socket.socket) -> str:
        """Return the target of this client, as ``host:port`` or URL, for the recording."""

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Return a non-blocking socket that is connected to the target.

        Raises:
            OSError: The connection failed.
        """


def route(mode: Mode, host: str, port: int) -> Route:
    """Return the route of a mode. Only the mode EXPLICIT uses `host` and `port`."""
    if mode is Mode.EXPLICIT:
        return Upstream(host, port)
    return Redirect() if mode is Mode.REDIRECT else Tproxy()


@dataclass(frozen=True, slots=True)
class Upstream:
    """The route to one controller, for all clients."""

    host: str
    port: int

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen on a TCP port that is not the target; see `Route.listen`."""
        sock = tcp.listen(host, port)
        if self._reaches(sock):
            sock.close()
            raise OSError(_OWN_ADDRESS)
        return sock

    def target(self, client: socket.socket) -> str:  # noqa: ARG002 - the same for all clients
        """Return the controller's address."""
        return tcp.address_text((self.host, self.port))

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Connect to the first address of the host that accepts.

        Raises:
            OSError: No address accepts, or the target is the recorder itself.
        """
        async with _dialing():
            try:
                found = await asyncio.get_running_loop().getaddrinfo(
                    self.host, self.port, type=socket.SOCK_STREAM
                )
            except UnicodeError:
                raise OSError(f"{self.host} is not a host name") from None
            own = client.getsockname()
            addresses = [(family, address) for family, *_, address in found if address != own]
            if not addresses:
                raise OSError(_OWN_ADDRESS if found else f"{self.host} has no address")
            return await _connect_any(addresses)

    def _reaches(self, listener: socket.socket) -> bool:
        """Whether connections to the target arrive at this listener."""
        listening, port = listener.getsockname()[:2]
        if port != self.port:
            return False
        try:
            found = socket.getaddrinfo(self.host, port, listener.family, socket.SOCK_STREAM)
        except (OSError, UnicodeError):  # not known now; checked again for each client
            return False
        hosts = {str(address[0]) for *_, address in found}
        every = ip_address(listening).is_unspecified
        return any(
            host == listening or ((every or ip_address(host).is_unspecified) and _is_own(host))
            for host in hosts
        )


@dataclass(frozen=True, slots=True)
class Redirect:
    """The route to the original destination of a connection changed by REDIRECT (IPv4)."""

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen, and mark sent packets; see `Route.listen`."""
        return _guarded(tcp.listen(host, port))

    def target(self, client: socket.socket) -> str:
        """Return the address that the client connected to."""
        try:
            return tcp.address_text(_redirected_from(client))
        except OSError:
            return "unknown"

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Connect to the original destination with a marked socket, which the rules ignore.

        Raises:
            OSError: It cannot be reached, or the client was not redirected.
        """
        destination = _redirected_from(client)
        async with _dialing():
            return await _connect(_guarded(socket.socket()), destination)


@dataclass(frozen=True, slots=True)
class Tproxy:
    """The route to the original destination of a connection intercepted by TPROXY (IPv4).

    The controller sees the client's address and port.
    """

    def listen(self, host: str, port: int) -> socket.socket:
        """Listen for connections to any address; see `Route.listen`."""
        return _transparent(tcp.listen(host, port))

    def target(self, client: socket.socket) -> str:
        """Return the address that the client connected to: the local address of the socket."""
        return tcp.address_text(client.getsockname())

    async def connect_upstream(self, client: socket.socket) -> socket.socket:
        """Connect to the original destination from the client's address and port.

        Raises:
            OSError: It cannot be reached, or the client was not redirected or has disconnected.
        """
        destination = client.getsockname()
        if _is_own(destination[0]):
            raise OSError(_NOT_REDIRECTED)
        sock = _transparent(socket.socket())
        sock.setsockopt(
            socket.SOL_SOCKET, socket.SO_REUSEADDR, 1
        )  # the client may reconnect immediately
        try:
            sock.bind(client.getpeername())
        except OSError:
            sock.close()
            raise
        async with _dialing():
            return await _connect(sock, destination)


@asynccontextmanager
async def _dialing() -> AsyncIterator[None]:
    """Limit the time to connect.

    Raises:
        TimeoutError: With the text of the system.
    """
    try:
        async with asyncio.timeout(DIAL_TIMEOUT_S):
            yield
    except TimeoutError:
        raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT)) from None


async def _connect_any(addresses: Sequence[tuple[int, tuple[object, ...]]]) -> socket.socket:
    """Connect to the first of several addresses that accepts.

    The next address is tried when an earlier one fails or has not accepted for `NEXT_ADDRESS_S`.

    Raises:
        OSError: No address accepts; the last error.
    """
    untried = list(addresses)
    failure = OSError()
    attempts: set[asyncio.Task[socket.socket]] = set()
    try:
        while untried or attempts:
            if untried:
                family, address = untried.pop(0)
                attempts.add(asyncio.create_task(_connect(socket.socket(family), address)))
            done, attempts = await asyncio.wait(
                attempts,
                timeout=NEXT_ADDRESS_S if untried else None,
                return_when=asyncio.FIRST_COMPLETED,
            )
            connected = [attempt.result() for attempt in done if not attempt.exception()]
            for spare in connected[1:]:
                spare.close()
            if connected:
                return connected[0]
            for attempt in done:
                failure = cast("OSError", attempt.exception())
    finally:
        for attempt in attempts:
            attempt.cancel()
        for late in await asyncio.gather(*attempts, return_exceptions=True):
            if isinstance(late, socket.socket):
                late.close()
    raise failure


async def _connect(sock: socket.socket, address: tuple[object, ...]) -> socket.socket:
    """Connect the socket. Close it on failure."""
    sock.settimeout(0)
    try:
        await asyncio.get_running_loop().sock_connect(sock, address)
    except BaseException:  # including cancellation when the client disconnects
        sock.close()
        raise
    if sock.getsockname() == address:  # self-connection: the free port was also the target
        sock.close()
        raise ConnectionRefusedError(errno.ECONNREFUSED, os.strerror(errno.ECONNREFUSED))
    return sock


def _guarded(sock: socket.socket) -> socket.socket:
    """Mark the packets of this socket. Close it on failure."""
    return _with_option(sock, "SOL_SOCKET", "SO_MARK", GUARD_MARK)


def _transparent(sock: socket.socket) -> socket.socket:
    """Allow foreign addresses on this socket. Close it on failure."""
    return _with_option(sock, "SOL_IP", "IP_TRANSPARENT", 1)


def _with_option(sock: socket.socket, level: str, name: str, value: int) -> socket.socket:
    """Set an option that exists only on Linux. Close the socket on failure."""
    try:
        sock.setsockopt(getattr(socket, level), getattr(socket, name), value)
    except (AttributeError, OSError) as error:
        sock.close()
        if isinstance(error, AttributeError):
            raise OSError("redirected connections are supported only on Linux") from None
        raise PermissionError("redirected connections need root or CAP_NET_ADMIN") from None
    return sock


def _redirected_from(client: socket.socket) -> tuple[str, int]:
    """Return the destination address of this client before REDIRECT changed it."""
    try:
        answer = client.getsockopt(socket.SOL_IP, _SO_ORIGINAL_DST, _SOCKADDR_IN.size)
    except OSError:  # no connection tracking, so no such rules
        raise OSError(_NOT_REDIRECTED) from None
    port, host = _SOCKADDR_IN.unpack(answer)
    address = socket.inet_ntoa(host), port
    if address == client.getsockname():
        raise OSError(_NOT_REDIRECTED)
    return address


def _is_own(host: str) -> bool:
    """Whether this is an address of this machine: others cannot be bound."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
    return True
