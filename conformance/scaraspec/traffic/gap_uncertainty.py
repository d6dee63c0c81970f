"""Gap uncertainty: how long after a capture gap events may depend on missing requests.

The gap may hide requests. It ends with the next bytes of its direction. Replies come in the order
of the requests, so the traffic settles it: when a request that was sent after the gap has its
reply, and no other request is pending, the hidden ones have been answered. After the reply timeout
they have been answered in any case. Until then the connection and the others, which share the
robot, are uncertain.

A client may have sent a hidden request that is answered later than others. Until the reply timeout
its reply is not unexpected, and shows that the gap is not settled. An injected fault counts as a
gap that ends at once.
"""

from typing import Final

from scaraspec.protocol.direction import Direction

_FOREVER_NS: Final = 1 << 63


class GapUncertainty:
    """The uncertainty of all connections of a robot."""

    def __init__(self) -> None:
        self._gaps: set[tuple[str, Direction]] = set()  # gaps that may not have ended
        self._until_ns: dict[str, int] = {}  # when every request is answered, if not settled
        self._ended_ns: dict[str, int] = {}  # when the last gap of the connection ended
        self._owed_until_ns: dict[str, int] = {}  # until when a hidden request may be answered
        self._closed_until_ns = -1  # for connections that have ended

    def begin(
        self, connection: str, direction: Direction, now_ns: int, until_ns: int, *, ended: bool
    ) -> None:
        """Begin a gap.

        Args:
            connection: The connection with the gap.
            direction: The direction of the missing bytes.
            now_ns: The current time.
            until_ns: When every request sent until now has been answered or has timed out.
            ended: Whether the gap has already ended.
        """
        self._gaps.add((connection, direction))
        self._until_ns[connection] = self._owed_until_ns[connection] = _FOREVER_NS
        if ended:
            self.end_gap(connection, direction, now_ns, until_ns)

    def end_gap(self, connection: str, direction: Direction, now_ns: int, until_ns: int) -> None:
        """End a gap: bytes of this direction are captured again."""
        if (connection, direction) in self._gaps:
            self._gaps.discard((connection, direction))
            if (connection, direction.opposite) not in self._gaps:
                self.reopen(connection, now_ns - 1, until_ns)  # a request may end the gap
                self._owed_until_ns[connection] = until_ns

    def reopen(self, connection: str, now_ns: int, until_ns: int) -> None:
        """Process the reply to a hidden request: others may be pending."""
        self._ended_ns[connection], self._until_ns[connection] = now_ns, until_ns

    def settle(self, connection: str, request_ns: int, *, alone: bool) -> None:
        """Process an answered request; request and reply are certainly frames.

        Args:
            connection: Its connection.
            request_ns: When it was sent.
            alone: Whether no other request of its sender is pending.
        """
        until_ns = self._until_ns.get(connection, _FOREVER_NS)
        if until_ns < _FOREVER_NS and alone:
            until_ns = self._ended_ns[connection]
        if request_ns > until_ns:
            self._until_ns.pop(connection, None)

    def resolve(self, connection: str) -> None:
        """Process the reply to the only request that the gap hides."""
        self._until_ns.pop(connection, None)
        self._owed_until_ns.pop(connection, None)
        for direction in Direction:
            self._gaps.discard((connection, direction))

    def may_owe_reply(self, connection: str, time_ns: int) -> bool:
        """Whether a reply at this time may answer a hidden request."""
        return time_ns <= self._owed_until_ns.get(connection, -1)

    def close(self, connection: str, until_ns: int) -> None:
        """End a connection; the effects of its requests may come later, until `until_ns`."""
        if connection in self._until_ns:
            self._closed_until_ns = max(self._closed_until_ns, until_ns)
        self.resolve(connection)

    def is_over(self, time_ns: int) -> bool:
        """Whether no event at or after this time may depend on missing bytes seen so far."""
        return not (self._gaps or self._until_ns) and time_ns > self._closed_until_ns

    def covers(self, connection: str, time_ns: int) -> bool:
        """Whether an event of this connection and time may depend on missing bytes."""
        if time_ns <= self._closed_until_ns or connection in self._until_ns:
            return True
        return bool(self._until_ns) and time_ns <= max(self._until_ns.values())
