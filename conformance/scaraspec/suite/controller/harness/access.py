"""Access: how the suite gets to its subject, and the clock that goes with it.

A real subject is reached by a URL and runs in real time; a machine in memory has a clock that
jumps. Which of the two it is, nothing else in the suite knows.
"""

import math
import time
from dataclasses import dataclass
from typing import Final, Protocol

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.transports.clock import now_ns
from scaraspec.transports.connect import connect
from scaraspec.transports.link import Link
from scaraspec.transports.memory import MemoryNetwork
from scaraspec.transports.url import Serial, Tcp, parse

_LOCAL: Final = ("127.0.0.1", "::1", "localhost")


class Access(Protocol):
    """A way to a subject."""

    @property
    def needs_login(self) -> bool:
        """Whether a login comes first; a serial link needs none (L83)."""

    @property
    def real_time(self) -> bool:
        """Whether its clock is not simulated."""

    @property
    def multiple_connections(self) -> bool:
        """Whether it can carry more than one connection at once."""

    @property
    def detects_close(self) -> bool:
        """Whether the subject notices that a connection ends: a serial line only falls silent."""

    @property
    def port(self) -> int | None:
        """The TCP port that it leads to; None for a serial link."""

    @property
    def wait_limit_s(self) -> float:
        """For how long one case may wait for what only time brings, such as a clock's next hour."""

    @property
    def survives_address_change(self) -> bool:
        """Whether we still reach it once it has been given another IP address."""

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""

    def connect(self) -> Link:
        """Open a connection.

        Raises:
            LinkError: It cannot be opened.
        """

    def pause(self, for_s: float) -> None:
        """Let time pass while no connection is listened to."""


class UrlAccess:
    """A real subject at a URL.

    Raises:
        UrlError: It is none.
    """

    real_time = True

    def __init__(self, url: str, wait_limit_s: float = 10.0) -> None:
        self.url = url
        self.wait_limit_s = wait_limit_s
        self._where = parse(url)

    @property
    def needs_login(self) -> bool:
        """TCP links do."""
        return isinstance(self._where, Tcp)

    @property
    def multiple_connections(self) -> bool:
        """TCP links do."""
        return self.needs_login

    @property
    def detects_close(self) -> bool:
        """All links do but a serial line."""
        return not isinstance(self._where, Serial)

    @property
    def port(self) -> int | None:
        """That of the URL."""
        return self._where.port if isinstance(self._where, Tcp) else None

    @property
    def survives_address_change(self) -> bool:
        """A subject on this machine stays where it is, and a serial link has no address."""
        return not isinstance(self._where, Tcp) or self._where.host in _LOCAL

    @property
    def now_ns(self) -> int:
        """See `links.clock`."""
        return now_ns()

    def connect(self) -> Link:
        """Open a connection; see `Access.connect`."""
        return connect(self.url)

    def pause(self, for_s: float) -> None:
        """Sleep."""
        time.sleep(for_s)


@dataclass(frozen=True)
class MemoryAccess:
    """A machine in this process."""

    network: MemoryNetwork
    needs_login: bool = True
    multiple_connections: bool = True
    real_time: bool = False
    port: int | None = DEFAULT_PORT
    wait_limit_s: float = math.inf
    survives_address_change: bool = True

    @property
    def detects_close(self) -> bool:
        """A serial line does not."""
        return self.needs_login

    @property
    def now_ns(self) -> int:
        """The machine's clock."""
        return self.network.time_ns

    def connect(self) -> Link:
        """Open a connection; see `Access.connect`."""
        return self.network.connect("tcp" if self.needs_login else "serial")

    def pause(self, for_s: float) -> None:
        """Let the machine's time pass."""
        self.network.run_until(self.network.now_s + for_s)
