"""Sampling profiler: the time of this process by label.

This module has the sampler and the table that it prints. The caller defines the labels. Unlike a
tracer, it does not slow down functions that are called often.
"""

import signal
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import FrameType
from typing import Final

ELSE: Final = "else"
LEFT_OUT: Final = ""
"""Label of code whose time is not counted."""

_EVERY_S: Final = 0.005
_CLOCKS: Final[Mapping[str, tuple[int, int, Callable[[], float]]]] = {
    "processor": (signal.ITIMER_PROF, signal.SIGPROF, time.process_time),
    "wall": (signal.ITIMER_REAL, signal.SIGALRM, time.perf_counter),
}


class Samples:
    """Seconds by place.

    Args:
        places: The label of each prefix of a dotted name, such as `scaraspec.suite` or
            `scaraspec.suite.engine.connection.Connection.wait`. The longest prefix counts.
        clock: Returns the seconds that are shared among the labels.

    Attributes:
        innermost_s: By the innermost frame that has a place.
        inclusive_s: By every place on the stack.
    """

    def __init__(self, places: Mapping[str, str], clock: Callable[[], float]) -> None:
        self.innermost_s: dict[str, float] = defaultdict(float)
        self.inclusive_s: dict[str, float] = defaultdict(float)
        self._clock = clock
        self._last_s = clock()

        @cache
        def place(module: str, function: str) -> str | None:
            name = f"{module}.{function}"
            found = [start for start in places if name.startswith(start)]
            return places[max(found, key=len)] if found else None

        self._place = place

    def take(self, _signal: int, frame: FrameType | None) -> None:
        """Count all the time since the last sample: a long call into C delays the signals."""
        passed_s = self._clock() - self._last_s
        found: dict[str, None] = {}
        while frame:
            here = self._place(frame.f_globals.get("__name__", ""), frame.f_code.co_qualname)
            if here is not None:
                found[here] = None
            frame = frame.f_back
        innermost, *_ = places = tuple(found) or (ELSE,)
        if innermost != LEFT_OUT:
            self.innermost_s[innermost] += passed_s
            for name in places:
                self.inclusive_s[name] += passed_s
        self._last_s = self._clock()

    def print_table(self, what: str) -> None:
        """Print a table, the largest first."""
        total_s = sum(self.innermost_s.values())
        print(f"{what}: {total_s:.1f} s")
        print(f"  {'':32}{'innermost':>12}{'':8}{'inclusive':>12}")
        for name in sorted(self.innermost_s, key=self.innermost_s.__getitem__, reverse=True):
            cells = (self.innermost_s[name], self.inclusive_s[name])
            print(f"  {name:32}" + "".join(f"{s:10.1f} s{s / total_s:8.0%}" for s in cells))


@contextmanager
def sampled(places: Mapping[str, str], clock: str = "processor") -> Iterator[Samples]:
    """Sample the main thread for as long as the context lasts, see `Samples`.

    Args:
        places: The labels by prefix of a dotted name.
        clock: Whose seconds: those of the `processor` that this process uses, or of the `wall`.
    """
    timer, number, now = _CLOCKS[clock]
    samples = Samples(places, now)
    signal.signal(number, samples.take)
    signal.setitimer(timer, _EVERY_S, _EVERY_S)
    try:
        yield samples
    finally:
        signal.setitimer(timer, 0)
        signal.signal(number, signal.SIG_IGN)  # a last signal may be pending
