"""Clock: the time of day as it was when the process began, and what has passed since.

What is stamped with it is in order and at its right distance, also where somebody sets this
machine's clock meanwhile, or lets the machine sleep.
"""

import time
from typing import Final

_SINCE_BOOT: Final[int | None] = getattr(time, "CLOCK_BOOTTIME", None)
"""One that goes on while the machine sleeps; not every system has it."""


def monotonic_ns() -> int:
    """Nanoseconds from an instant that never changes."""
    return time.monotonic_ns() if _SINCE_BOOT is None else time.clock_gettime_ns(_SINCE_BOOT)


_BOOT_NS: Final = time.time_ns() - monotonic_ns()


def now_ns() -> int:
    """Nanoseconds since the Unix epoch."""
    return _BOOT_NS + monotonic_ns()
