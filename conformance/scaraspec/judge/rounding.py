"""Rounding: how far a number that is read may be from the one that was set (A-T-5)."""

from collections.abc import Sequence
from typing import Final

_ROUNDED: Final = 0.051
"""By how much a controller may be off that keeps one decimal of several."""
_SINGLE: Final = 0.0005
"""By how much one may be off that keeps 32 bits and tells them to the last digit."""


def read_back(got: Sequence[float], values: Sequence[float]) -> bool:
    """Whether numbers that were set are read: exactly where they have one decimal or none."""
    return all(
        abs(told - value) <= (_SINGLE if round(value, 1) == value else _ROUNDED)
        for told, value in zip(got, values, strict=True)
    )
