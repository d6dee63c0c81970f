"""Histogram of durations in bounded memory, with bins of equal width on a logarithmic scale.

There are sixteen bins per factor of two, so the geometric mean of a bin is within 2.2 % of all its
values. Minimum and maximum are exact. There are at most 512 bins, from 1 µs to 71 minutes; values
beyond are counted in the first or the last bin.
"""

import math
from collections import Counter
from typing import Final

from scaraspec.report.model import Timing

_PER_OCTAVE: Final = 16
_REPORTED_PER_OCTAVE: Final = 4
_FIRST_NS: Final = 1_000
_BINS: Final = 32 * _PER_OCTAVE


class Histogram:
    """Counts durations in ns; a negative one (the clock was set back) counts as zero."""

    def __init__(self) -> None:
        self._bins: Counter[int] = Counter()
        self._count = 0
        self._min_ns = self._max_ns = 0

    def add(self, duration_ns: int) -> None:
        """Add one duration."""
        duration_ns = max(duration_ns, 0)
        if duration_ns < self._min_ns or not self._count:
            self._min_ns = duration_ns
        self._max_ns = max(self._max_ns, duration_ns)
        self._count += 1
        octaves = math.log2(max(duration_ns, _FIRST_NS) / _FIRST_NS)
        self._bins[min(int(octaves * _PER_OCTAVE), _BINS - 1)] += 1

    def timing(self) -> Timing | None:
        """Return the statistics; None if there are no durations."""
        if not self._count:
            return None
        reported: Counter[int] = Counter()
        for index, count in self._bins.items():
            reported[index * _REPORTED_PER_OCTAVE // _PER_OCTAVE] += count
        return Timing(
            count=self._count,
            min_ms=_ms(self._min_ns),
            p50_ms=_ms(self._quantile_ns(0.50)),
            p95_ms=_ms(self._quantile_ns(0.95)),
            p99_ms=_ms(self._quantile_ns(0.99)),
            max_ms=_ms(self._max_ns),
            bins=tuple(
                (_ms(_FIRST_NS * 2 ** (index / _REPORTED_PER_OCTAVE)), count)
                for index, count in sorted(reported.items())
            ),
        )

    def _quantile_ns(self, share: float) -> float:
        remaining = math.ceil(share * self._count)
        index = -1
        for index, count in sorted(self._bins.items()):  # noqa: B007 - used after the loop
            remaining -= count
            if remaining <= 0:
                break
        middle_ns = _FIRST_NS * 2 ** ((index + 0.5) / _PER_OCTAVE)
        return min(max(middle_ns, self._min_ns), self._max_ns)


def _ms(duration_ns: float) -> float:
    return round(duration_ns / 1e6, 6)
