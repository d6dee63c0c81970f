"""Access: how the suite connects to the controller, and its clock.

A real controller has a URL and runs in real time. A controller in memory has a simulated clock. No
other module of the suite knows which of the two it is.
"""

import math
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Protocol

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.transports.clock import now_ns
from scaraspec.transports.connect import connect
from scaraspec.transports.link import Link, LinkError
from scaraspec.transports.memory import MemoryNetwork
from scaraspec.transports.url import Tcp, parse

_RETRY_S: Final = 0.2
_LOCAL: Final = ("127.0.0.1", "::1", "localhost")


class Access(Protocol):
    """The access to a controller."""

    @property
    def needs_login(self) -> bool:
        """Whether a login is needed; a serial link needs none (L83)."""

    @property
    def real_time(self) -> bool:
        """Whether its clock is not simulated."""

    @property
    def multiple_connections(self) -> bool:
        """Whether several connections can be open at once."""

    @property
    def detects_close(self) -> bool:
        """Whether the controller notices the end of a connection; not on a serial line."""

    @property
    def port(self) -> int | None:
        """The TCP port of the controller; None for a serial link."""

    @property
    def wait_limit_s(self) -> float:
        """How long a case may wait for a point in time, in seconds; for example the next hour."""

    @property
    def survives_address_change(self) -> bool:
        """Whether the controller is reachable after its IP address has changed."""

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""

    def connect(self) -> Link:
        """Open a connection.

        Raises:
            LinkError: The connection cannot be opened.
        """

    def pause(self, for_s: float) -> None:
        """Wait for a time, in seconds, without receiving."""


class UrlAccess:
    """A real controller at a URL.

    Args:
        url: The URL.
        wait_limit_s: See `Access.wait_limit_s`.

    Raises:
        UrlError: The URL is invalid.
    """

    real_time = True

    def __init__(self, url: str, wait_limit_s: float = 10.0) -> None:
        self.url = url
        self.wait_limit_s = wait_limit_s
        self._where = parse(url)

    @property
    def needs_login(self) -> bool:
        """See `Tcp.needs_login`."""
        return self._where.needs_login

    @property
    def multiple_connections(self) -> bool:
        """True for TCP."""
        return self.needs_login

    @property
    def detects_close(self) -> bool:
        """See `Tcp.detects_close`."""
        return self._where.detects_close

    @property
    def port(self) -> int | None:
        """The port of the URL."""
        return self._where.port if isinstance(self._where, Tcp) else None

    @property
    def survives_address_change(self) -> bool:
        """True on this machine, and for a serial link, which has no address."""
        return not isinstance(self._where, Tcp) or self._where.host in _LOCAL

    @property
    def now_ns(self) -> int:
        """See `transports.clock`."""
        return now_ns()

    def connect(self) -> Link:
        """Open a connection; see `Access.connect`."""
        return connect(self.url)

    def pause(self, for_s: float) -> None:
        """Sleep for a time, in seconds."""
        time.sleep(for_s)

    def wait_until_reachable(self, for_s: float) -> None:
        """Try to connect until the controller accepts a connection, or until a time has passed.

        Args:
            for_s: The longest wait, in seconds.
        """
        end_s = time.monotonic() + for_s
        while time.monotonic() < end_s:
            with suppress(LinkError):
                self.connect().close()
                return
            self.pause(_RETRY_S)


@dataclass(frozen=True)
class MemoryAccess:
    """A controller in this process."""

    network: MemoryNetwork
    needs_login: bool = True
    multiple_connections: bool = True
    real_time: bool = False
    port: int | None = DEFAULT_PORT
    wait_limit_s: float = math.inf
    survives_address_change: bool = True

    @property
    def detects_close(self) -> bool:
        """False for a serial line."""
        return self.needs_login

    @property
    def now_ns(self) -> int:
        """The simulated clock."""
        return self.network.time_ns

    def connect(self) -> Link:
        """Open a connection; see `Access.connect`."""
        return self.network.connect("tcp" if self.needs_login else "serial")

    def pause(self, for_s: float) -> None:
        """Advance the simulated clock by a time, in seconds."""
        self.network.run_until(self.network.now_s + for_s)
