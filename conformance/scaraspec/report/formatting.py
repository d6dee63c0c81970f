"""Figures: numbers, times and durations written as a reader takes them in."""

from datetime import UTC, datetime, timedelta
from typing import Final

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_MINUTE_MS: Final = 60_000


def duration(duration_ms: float) -> str:
    """A duration to three digits, in the unit that suits it: ``58 µs``, ``1.24 ms``, ``2 min``."""
    if duration_ms < 1:
        return f"{_three(duration_ms * 1e3)} µs"
    if duration_ms < 1e3:  # noqa: PLR2004 - a second
        return f"{_three(duration_ms)} ms"
    if duration_ms < 2 * _MINUTE_MS:
        return f"{_three(duration_ms / 1e3)} s"
    minutes, rest_ms = divmod(duration_ms, _MINUTE_MS)
    return f"{minutes:.0f} min {rest_ms / 1e3:.0f} s"


def _three(number: float) -> str:
    """The number to three digits, or to the unit where that is more."""
    return f"{number:.3g}" if number < 999.5 else f"{number:.0f}"  # noqa: PLR2004 - rounds to 1000


def instant(time_ns: int) -> str:
    """A time as date and time of day to the microsecond, in UTC."""
    return f"{_EPOCH + timedelta(microseconds=time_ns // 1000):%Y-%m-%d %H:%M:%S.%f} UTC"


def count(number: int) -> str:
    """A whole number with its thousands apart."""
    return f"{number:,}"
