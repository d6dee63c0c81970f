"""Rounding: how far a number that is read may be from the one that was set (A-T-5)."""

from typing import Final

_ROUNDED: Final = 0.051
"""By how much a controller may be off that keeps one decimal of several."""
_SINGLE: Final = 0.0005
"""By how much one may be off that keeps 32 bits and tells them to the last digit."""


def reads_back(got: float, value: float) -> bool:
    """Whether a number that was set is read: exactly where it has one decimal or none."""
    return abs(got - value) <= (_SINGLE if round(value, 1) == value else _ROUNDED)
