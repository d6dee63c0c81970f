"""Waiting for several things at once: a connection, and whoever works the client behind it."""

import selectors
import socket
import time
from typing import Any

from scaraspec.links.tcp import TcpLink

_Selector: type[selectors.BaseSelector] = getattr(
    selectors, "PollSelector", selectors.SelectSelector
)
"""One that takes files, too: an operator's lines may come from one, which epoll refuses."""


def ready_of(deadline_s: float, *sources: Any) -> list[Any]:
    """Wait until one of these can be read, or until then; those that can."""
    with _Selector() as selector:
        for source in sources:
            selector.register(source, selectors.EVENT_READ)
        left_s = max(0.0, deadline_s - time.monotonic())
        return [key.fileobj for key, _ in selector.select(left_s)]


class WatchedLink(TcpLink):
    """A link whose waiting ends early when something else can be read, too."""

    def __init__(self, connected: socket.socket, other: Any) -> None:
        super().__init__(connected)
        self._connected, self._other = connected, other

    def _readable(self, timeout_s: float) -> bool:
        ready = ready_of(time.monotonic() + timeout_s, self._other, self._connected)
        return self._connected in ready
