"""Numbers are written as a reader takes them in."""

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
def test_a_duration_has_three_digits_and_the_unit_that_suits_it(
    duration_ms: float, written: str
) -> None:
    """Microseconds to minutes are all readable at a glance."""
    assert duration(duration_ms) == written


def test_a_time_is_told_in_utc_to_the_microsecond() -> None:
    """Rounding never moves a time into the future."""
    assert instant(1_419_258_600_000_001_999) == "2014-12-22 14:30:00.000001 UTC"


@pytest.mark.parametrize("time_ns", [-(2**63), 0, 2**63 - 1])
def test_every_time_that_results_can_hold_is_told(time_ns: int) -> None:
    """A hostile number costs no page."""
    assert instant(time_ns).endswith(" UTC")


def test_thousands_stand_apart() -> None:
    """Long numbers are read without counting digits."""
    assert count(1234567) == "1,234,567"
