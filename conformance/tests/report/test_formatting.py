"""Formatting of durations, times and numbers."""

import pytest

from scaraspec.report.formatting import count, duration, instant


@pytest.mark.parametrize(
    ("duration_ms", "written"),
    [
        (0, "0 µs"),
        (0.0578, "57.8 µs"),
        (0.9999, "1000 µs"),
        (1.2345, "1.23 ms"),
        (565.4, "565 ms"),
        (999.9, "1000 ms"),
        (4080, "4.08 s"),
        (119_999, "120 s"),
        (185_400, "3 min 5 s"),
    ],
)
def test_duration(duration_ms: float, written: str) -> None:
    """Three digits, from microseconds to minutes."""
    assert duration(duration_ms) == written


def test_instant() -> None:
    """UTC with microseconds, rounded down."""
    assert instant(1_419_258_600_000_001_999) == "2014-12-22 14:30:00.000001 UTC"


@pytest.mark.parametrize("time_ns", [-(2**63), 0, 2**63 - 1])
def test_any_time(time_ns: int) -> None:
    """Every 64-bit time can be formatted."""
    assert instant(time_ns).endswith(" UTC")


def test_count() -> None:
    """Long numbers have thousands separators."""
    assert count(1234567) == "1,234,567"
