"""Detects steps of the system clock, such as by NTP or by an operator, and suspends of the machine.

The wall clock is compared with a clock that only counts the elapsed time, also while the machine is
suspended. That clock is compared with one that stops then.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from scaraspec_recorder.units import SECOND_NS

MIN_STEP_NS: Final = SECOND_NS
"""Smaller differences are corrections or inaccuracies."""

LOG_SOURCE: Final = "clock"
"""Source of the lines about the clock in the log of a recording."""

_MAX_READ_NS: Final = SECOND_NS // 10


def elapsed_ns() -> int:
    """Return the nanoseconds since an unknown time."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    return time.monotonic_ns()


def boot_id() -> str:
    """Return the identification of the current boot of the machine; empty if unknown."""
    with suppress(OSError):  # only Linux has this file
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
    return ""


class ClockState(NamedTuple):
    """What a process has observed of the clock, for the next process.

    Attributes:
        boot: The boot in which it was observed.
        offset_ns: Difference of the clocks at the last comparison.
        was_set: Whether the clock was set.
    """

    boot: str
    offset_ns: int
    was_set: bool


class ClockWatch:
    """Compares two clocks.

    Args:
        wall_ns: The clock that may be set.
        elapsed_ns: The clock that counts the elapsed time.
        awake_ns: The same without the time for which the machine was suspended.
        before: Observations of an earlier process; those of an earlier boot are not used.

    Attributes:
        was_set: Whether the clock was set, now or earlier.
    """

    def __init__(
        self,
        wall_ns: Callable[[], int] = time.time_ns,
        elapsed_ns: Callable[[], int] = elapsed_ns,
        awake_ns: Callable[[], int] = time.monotonic_ns,
        *,
        before: ClockState | None = None,
    ) -> None:
        self.was_set = False
        self.elapsed_ns = elapsed_ns
        self._wall_ns = wall_ns
        self._awake_ns = awake_ns
        self._offset_ns: int | None = None
        self._asleep_ns: int | None = None
        self._boot = boot_id()
        if before and before.boot == self._boot:
            self._offset_ns, self.was_set = before.offset_ns, before.was_set
        else:
            self.step_ns()
        self.suspended_ns()

    @property
    def state(self) -> ClockState | None:
        """The observations so far, for the next process."""
        if self._offset_ns is None:
            return None
        return ClockState(self._boot, self._offset_ns, self.was_set)

    def step_ns(self) -> int:
        """Return by how much the wall clock was set since the last call; 0 if it was not set."""
        before_ns, wall_ns, after_ns = self.elapsed_ns(), self._wall_ns(), self.elapsed_ns()
        if after_ns - before_ns > _MAX_READ_NS:  # the process was interrupted: not comparable
            return 0
        offset_ns = wall_ns - after_ns
        step_ns = 0 if self._offset_ns is None else offset_ns - self._offset_ns
        self._offset_ns = offset_ns
        if abs(step_ns) < MIN_STEP_NS:
            return 0
        self.was_set = True
        return step_ns

    def suspended_ns(self) -> int:
        """Return for how long the machine was suspended since the last call; 0 if it was not.

        Linux only: other systems have no clock that counts this time.
        """
        awake_ns, elapsed_ns = self._awake_ns(), self.elapsed_ns()
        if self._awake_ns() - awake_ns > _MAX_READ_NS:  # as above
            return 0
        before_ns, self._asleep_ns = self._asleep_ns, elapsed_ns - awake_ns
        slept_ns = 0 if before_ns is None else self._asleep_ns - before_ns
        return slept_ns if slept_ns >= MIN_STEP_NS else 0
