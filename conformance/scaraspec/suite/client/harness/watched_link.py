"""A link that also watches the driver or the operator while it waits."""

import socket
from collections.abc import Sequence
from typing import Any

from scaraspec.transports.tcp import TcpLink, wait_readable


class WatchedLink(TcpLink):
    """A link whose wait ends early when another source becomes readable."""

    def __init__(self, connected: socket.socket, other: Any) -> None:
        super().__init__(connected)
        self._other = other

    def _readable(self, timeout_s: float, others: Sequence[Any]) -> bool:
        return self in wait_readable(self.now_s + timeout_s, self._other, self, *others)
