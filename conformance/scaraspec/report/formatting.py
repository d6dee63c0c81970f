"""Formatting of numbers, times and durations for users."""

from datetime import UTC, datetime, timedelta
from typing import Final

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_MINUTE_MS: Final = 60_000


def duration(duration_ms: float) -> str:
    """Format a duration with three digits in a suitable unit: ``58 µs``, ``1.24 ms``, ``2 min``."""
    if duration_ms < 1:
        return f"{_three(duration_ms * 1e3)} µs"
    if duration_ms < 1e3:  # noqa: PLR2004 - a second
        return f"{_three(duration_ms)} ms"
    if duration_ms < 2 * _MINUTE_MS:
        return f"{_three(duration_ms / 1e3)} s"
    minutes, rest_ms = divmod(duration_ms, _MINUTE_MS)
    return f"{minutes:.0f} min {rest_ms / 1e3:.0f} s"


def _three(number: float) -> str:
    """Format a number with three digits, or as an integer if it has more."""
    return f"{number:.3g}" if number < 999.5 else f"{number:.0f}"  # noqa: PLR2004 - rounds to 1000


def instant(time_ns: int) -> str:
    """Format a time as UTC date and time with microseconds."""
    return f"{_EPOCH + timedelta(microseconds=time_ns // 1000):%Y-%m-%d %H:%M:%S.%f} UTC"


def second(time_ns: int) -> str:
    """Format a time as UTC date and time with seconds."""
    return f"{_EPOCH + timedelta(seconds=time_ns // 10**9):%Y-%m-%d %H:%M:%S} UTC"


def count(number: int) -> str:
    """Format an integer with thousands separators."""
    return f"{number:,}"
