"""Doubt: for how long after a gap nothing that depends on unseen bytes is sure.

A gap may hide requests and what answers them. It ends with the next bytes of its direction; some
time after that everything it hid has been answered. On its own connection the doubt lasts until a
request that was asked after that has its answer; on the others, which share the robot, till then.
A fault that was injected on purpose is like a gap that has ended at once.
"""

from typing import Final

from scaraspec.protocol.direction import Direction

_FOREVER_NS: Final = 1 << 63


class GapUncertainty:
    """The doubts of all connections."""

    def __init__(self) -> None:
        self._gaps: set[tuple[str, Direction]] = set()  # those that may still go on
        self._until_ns: dict[str, int] = {}
        self._closed_until_ns = -1  # the doubts of connections that have ended

    def begin(self, connection: str, direction: Direction, until_ns: int, *, ended: bool) -> None:
        """There is a gap.

        Args:
            connection: Where.
            direction: Of whose bytes.
            until_ns: When all that was asked by now has been answered.
            ended: Nothing passes unseen from now on.
        """
        self._gaps.add((connection, direction))
        self._until_ns[connection] = _FOREVER_NS
        if ended:
            self.end_gap(connection, direction, until_ns)

    def end_gap(self, connection: str, direction: Direction, until_ns: int) -> None:
        """Bytes of this direction are seen again, or would be."""
        if (connection, direction) in self._gaps:
            self._gaps.discard((connection, direction))
            if (connection, direction.opposite) not in self._gaps:
                self._until_ns[connection] = until_ns

    def settle(self, connection: str, asked_ns: int) -> None:
        """A request of that time has been answered, and both are certain to be frames."""
        if asked_ns > self._until_ns.get(connection, _FOREVER_NS):
            del self._until_ns[connection]

    def close(self, connection: str, until_ns: int) -> None:
        """The connection has ended; what it asked may not yet have come about."""
        if self._until_ns.pop(connection, None):
            self._closed_until_ns = max(self._closed_until_ns, until_ns)
        for direction in Direction:
            self._gaps.discard((connection, direction))

    def covers(self, connection: str, time_ns: int) -> bool:
        """Whether what passes now on this connection may depend on bytes that a gap hid."""
        if time_ns <= self._closed_until_ns or connection in self._until_ns:
            return True
        return bool(self._until_ns) and time_ns <= max(self._until_ns.values())
