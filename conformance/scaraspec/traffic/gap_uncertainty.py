"""Gap uncertainty: how long after a capture gap events may depend on missing bytes.

A gap may hide requests and their replies. It ends with the next bytes of its direction; after the
reply timeout everything that it hid has been answered. The other connections, which share the
robot, are uncertain until this time. The connection of the gap is uncertain until a request that
was sent after this time has its reply. An injected fault counts as a gap that ends at once.
"""

from typing import Final

from scaraspec.protocol.direction import Direction

_FOREVER_NS: Final = 1 << 63


class GapUncertainty:
    """The uncertainty of all connections of a robot."""

    def __init__(self) -> None:
        self._gaps: set[tuple[str, Direction]] = set()  # gaps that may not have ended
        self._until_ns: dict[str, int] = {}
        self._closed_until_ns = -1  # for connections that have ended

    def begin(self, connection: str, direction: Direction, until_ns: int, *, ended: bool) -> None:
        """Begin a gap.

        Args:
            connection: The connection with the gap.
            direction: The direction of the missing bytes.
            until_ns: When every request sent until now has been answered or has timed out.
            ended: Whether the gap has already ended.
        """
        self._gaps.add((connection, direction))
        self._until_ns[connection] = _FOREVER_NS
        if ended:
            self.end_gap(connection, direction, until_ns)

    def end_gap(self, connection: str, direction: Direction, until_ns: int) -> None:
        """End a gap: bytes of this direction are captured again."""
        if (connection, direction) in self._gaps:
            self._gaps.discard((connection, direction))
            if (connection, direction.opposite) not in self._gaps:
                self._until_ns[connection] = until_ns

    def settle(self, connection: str, request_ns: int) -> None:
        """Process an answered request; request and reply are certainly frames."""
        if request_ns > self._until_ns.get(connection, _FOREVER_NS):
            del self._until_ns[connection]

    def close(self, connection: str, until_ns: int) -> None:
        """End a connection; the effects of its requests may come later, until `until_ns`."""
        if self._until_ns.pop(connection, None):
            self._closed_until_ns = max(self._closed_until_ns, until_ns)
        for direction in Direction:
            self._gaps.discard((connection, direction))

    def covers(self, connection: str, time_ns: int) -> bool:
        """Whether an event of this connection and time may depend on missing bytes."""
        if time_ns <= self._closed_until_ns or connection in self._until_ns:
            return True
        return bool(self._until_ns) and time_ns <= max(self._until_ns.values())
