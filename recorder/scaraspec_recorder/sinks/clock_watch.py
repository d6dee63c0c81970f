"""Detects steps of the system clock, such as by NTP or by an operator.

The wall clock is compared with a clock that only counts the elapsed time, also while the machine is
suspended.
"""

import time
from collections.abc import Callable
from typing import Final

from scaraspec_recorder.units import SECOND_NS

MIN_STEP_NS: Final = SECOND_NS
"""Smaller differences are corrections or inaccuracies."""

_MAX_READ_NS: Final = SECOND_NS // 10


def elapsed_ns() -> int:
    """Return the nanoseconds since an unknown time."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    return time.monotonic_ns()


class ClockWatch:
    """Compares two clocks.

    Args:
        wall_ns: The clock that may be set.
        elapsed_ns: The clock that counts the elapsed time.
    """

    def __init__(
        self,
        wall_ns: Callable[[], int] = time.time_ns,
        elapsed_ns: Callable[[], int] = elapsed_ns,
    ) -> None:
        self.elapsed_ns = elapsed_ns
        self._wall_ns = wall_ns
        self._offset_ns: int | None = None
        self.step_ns()

    def step_ns(self) -> int:
        """Return by how much the wall clock was set since the last call; 0 if it was not set."""
        before_ns, wall_ns, after_ns = self.elapsed_ns(), self._wall_ns(), self.elapsed_ns()
        if after_ns - before_ns > _MAX_READ_NS:  # the process was interrupted: not comparable
            return 0
        offset_ns = wall_ns - after_ns
        step_ns = 0 if self._offset_ns is None else offset_ns - self._offset_ns
        self._offset_ns = offset_ns
        return step_ns if abs(step_ns) >= MIN_STEP_NS else 0
