"""Tolerances: when two reported poses, numbers or replies count as equal."""

from collections.abc import Sequence
from typing import Any, Final

STANDSTILL: Final = 0.2
"""Largest difference, in mm or degrees, between two reported values of an arm at rest."""

_MAX_TEMPERATURE_DIFFERENCE: Final = 5.0
"""In °C: two motors that report this are about as warm."""

_POSES: Final = ("get_tool_coordinates", "get_joint_angles")
_FULL_TURN_DEG: Final = 360.0
_FIRST_ANGLE: Final = 3
"""Index of the first angle of a pose; the values before it are x, y and z."""
_SIGNIFICANT: Final = 4
"""Of the six values of a pose, only x, y, z and thetaX define the position of the arm (L1006)."""
_ONE_DECIMAL: Final = 0.051
"""Deviation of a controller that keeps one decimal only."""
_SINGLE_PRECISION: Final = 0.0005
"""Deviation of a controller that stores 32-bit floats and prints all their digits."""


def angle_difference(a: float, b: float) -> float:
    """Return the signed difference a - b in degrees, between -180 and 180 (A-7-2)."""
    return (a - b + _FULL_TURN_DEG / 2) % _FULL_TURN_DEG - _FULL_TURN_DEG / 2


def differences(a: Sequence[float], b: Sequence[float]) -> list[float]:
    """Return a - b, value by value, in mm or degrees.

    The values from the fourth on are angles without a limit, which a controller may report modulo
    360 degrees: for these the result is the shorter rotation.
    """
    numbered = enumerate(zip(a, b, strict=True))
    return [p - q if at < _FIRST_ANGLE else angle_difference(p, q) for at, (p, q) in numbered]


def max_deviation(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the largest absolute difference between two poses, in mm or degrees."""
    return max(map(abs, differences(a[:_SIGNIFICANT], b[:_SIGNIFICANT])))


def read_back(reported: Sequence[float], values: Sequence[float]) -> bool:
    """Return whether the reported numbers are the values that were set (A-T-5).

    A value with at most one decimal must be reported exactly; another one may be rounded.
    """
    return all(
        abs(number - value) <= (_SINGLE_PRECISION if round(value, 1) == value else _ONE_DECIMAL)
        for number, value in zip(reported, values, strict=True)
    )


def same_meaning(command: str, a: Any, b: Any) -> bool:
    """Return whether two decoded replies to a command report the same.

    Times may differ. Temperatures are equal within 5 °C, poses within `STANDSTILL`.

    Args:
        command: The name of the command.
        a: A value; None if it could not be decoded.
        b: Another value.
    """
    if a is None or b is None:
        return a is b
    if command == "get_time":
        return True
    if command == "get_running_program":
        return bool(getattr(a, "name", a) == getattr(b, "name", b))
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        if command == "get_motor_temperatures":
            pairs = zip(a, b, strict=True)
            return all(abs(x - y) <= _MAX_TEMPERATURE_DIFFERENCE for x, y in pairs)
        if command in _POSES:
            return max_deviation(a, b) <= STANDSTILL
    return bool(a == b)
