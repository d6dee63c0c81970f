"""Clock: time stamps that are not affected by changes of the system clock.

A time stamp is the time of day at the start of the process plus the time since then. So order and
distance of time stamps are correct even if the system clock is set or the machine is suspended.
"""

import time
from typing import Final

_SINCE_BOOT: Final[int | None] = getattr(time, "CLOCK_BOOTTIME", None)
"""A clock that continues while the machine is suspended; not every system has it."""


def monotonic_ns() -> int:
    """Return nanoseconds since a fixed but unspecified instant."""
    return time.monotonic_ns() if _SINCE_BOOT is None else time.clock_gettime_ns(_SINCE_BOOT)


_OFFSET_NS: Final = time.time_ns() - monotonic_ns()


def now_ns() -> int:
    """Return the current time in nanoseconds since the Unix epoch."""
    return _OFFSET_NS + monotonic_ns()
