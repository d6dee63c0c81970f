"""Quantiles have the stated error, in bounded memory."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.report.histogram import Histogram
from scaraspec.report.model import Timing

HOUR_NS = 3_600 * 10**9


def timing_of(durations_ns: list[int]) -> Timing:
    """Return the statistics of these durations."""
    histogram = Histogram()
    for duration_ns in durations_ns:
        histogram.add(duration_ns)
    timing = histogram.timing()
    assert timing
    return timing


@given(st.lists(st.integers(1_000, HOUR_NS), min_size=1, max_size=300))
def test_quantiles_are_within_their_error(durations_ns: list[int]) -> None:
    """Within 2.2 % of the value of a sorted list; minimum and maximum are exact."""
    timing, ordered = timing_of(durations_ns), sorted(durations_ns)
    quantiles = ((0.50, timing.p50_ms), (0.95, timing.p95_ms), (0.99, timing.p99_ms))
    for share, reported_ms in quantiles:
        exact_ms = ordered[math.ceil(share * len(ordered)) - 1] / 1e6
        assert reported_ms == pytest.approx(exact_ms, rel=0.022, abs=1e-6)
    assert timing.min_ms == pytest.approx(ordered[0] / 1e6, abs=1e-6)
    assert timing.max_ms == pytest.approx(ordered[-1] / 1e6, abs=1e-6)


@given(st.lists(st.integers(-10, 10 * HOUR_NS), min_size=1, max_size=300))
def test_every_duration_is_in_one_bin(durations_ns: list[int]) -> None:
    """The counts of the bins add up to the total, in ascending order."""
    timing = timing_of(durations_ns)
    assert sum(count for _, count in timing.bins) == timing.count == len(durations_ns)
    begins = [begin for begin, _ in timing.bins]
    assert begins == sorted(set(begins))


def test_limits_of_a_bin() -> None:
    """1 ms is between the start of its bin and that times the fourth root of two."""
    ((begin_ms, count),) = timing_of([1_000_000]).bins
    assert count == 1
    assert begin_ms <= 1.0 < begin_ms * 2**0.25


def test_memory_is_bounded() -> None:
    """There are at most 512 bins."""
    histogram = Histogram()
    for exponent in range(20_000):
        histogram.add(int(1.003**exponent) if exponent < 15_000 else exponent)
    assert len(histogram._bins) <= 512


def test_negative_durations_count_as_zero() -> None:
    """The clock was set back between request and reply."""
    timing = timing_of([-5_000, 0])
    assert (timing.min_ms, timing.p50_ms, timing.max_ms) == (0, 0, 0)


def test_no_durations() -> None:
    """There are no statistics."""
    assert Histogram().timing() is None
