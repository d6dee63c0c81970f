"""Unrequested connections: connections that a client opens by itself after a lost link.

A client may reconnect, log in and poll. Which requests it must not send is decided by the case.
"""

from collections.abc import Collection
from typing import TYPE_CHECKING, Final

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.traffic.events import FrameSeen

if TYPE_CHECKING:
    from scaraspec.suite.client.harness.incoming_connection import IncomingConnection

_ACCEPTED: Final = b"1"
_SERVED_S: Final = 3.0
"""How long such a connection is served at least."""


def serve_unrequested(
    subject: ClientUnderTest, within_s: float, commands: Collection[str]
) -> list[FrameSeen]:
    """Serve the login and the polls on every connection that the client opens by itself.

    Args:
        subject: The client.
        within_s: How long to wait for such connections, in seconds.
        commands: The commands whose requests end the wait.

    Returns:
        The requests of these commands, which are not answered.
    """
    deadline_s = end_s = subject.access.now_s + within_s
    lines: list[IncomingConnection] = []
    while subject.access.now_s < end_s:
        line = subject.accept_unrequested(end_s)
        if line is not None:
            line.auto_responder.replies["login"] = _ACCEPTED
            lines.append(line)
            if subject.access.now_s < deadline_s:
                end_s = max(end_s, subject.access.now_s + _SERVED_S)
        if sent := [seen for line in lines for seen in line.inbox if seen.name in commands]:
            return sent
    return []
