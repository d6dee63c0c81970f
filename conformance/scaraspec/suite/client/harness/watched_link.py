"""Waiting for several things at once: a connection, and whoever works the client behind it."""

import socket
from collections.abc import Sequence
from typing import Any

from scaraspec.transports.tcp import TcpLink, wait_readable


class WatchedLink(TcpLink):
    """A link whose waiting ends early when something else can be read, too."""

    def __init__(self, connected: socket.socket, other: Any) -> None:
        super().__init__(connected)
        self._other = other

    def _readable(self, timeout_s: float, others: Sequence[Any]) -> bool:
        return self in wait_readable(self.now_s + timeout_s, self._other, self, *others)
