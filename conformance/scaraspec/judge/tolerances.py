"""Places: how far two poses, or the joints twice, are apart, and from when on that is a motion."""

from collections.abc import Sequence
from typing import Final

STANDSTILL: Final = 0.2
"""mm or degrees by which two readings differ at most where nothing has moved."""

_TURN_DEG: Final = 360.0
_TURNS_FROM: Final = 3
_SIGNIFICANT: Final = 4
"""Of the six values of a pose only x, y, z and thetaX say where the arm is (L1006)."""


def turned(a: float, b: float) -> float:
    """By how many degrees, and which way, a is turned from b; a whole turn is none (A-7-2)."""
    return (a - b + _TURN_DEG / 2) % _TURN_DEG - _TURN_DEG / 2


def ways(a: Sequence[float], b: Sequence[float]) -> list[float]:
    """What leads from b to a, value by value, in mm or degrees.

    What stands behind the third value turns without end, and may be told within half a turn of 0:
    it goes the shorter way round.
    """
    numbered = enumerate(zip(a, b, strict=True))
    return [p - q if at < _TURNS_FROM else turned(p, q) for at, (p, q) in numbered]


def farthest(a: Sequence[float], b: Sequence[float]) -> float:
    """By how much the two differ where they differ most."""
    return max(map(abs, ways(a[:_SIGNIFICANT], b[:_SIGNIFICANT])))
