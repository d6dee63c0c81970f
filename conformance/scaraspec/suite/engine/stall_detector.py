"""Stall detector: measures when this machine did not run, because time is part of what is judged.

If a process is stopped, the machine sleeps or gets no processor time, a subject looks late. What
follows from a stall is decided in `attempts` and `observer`.
"""

import threading
from types import TracebackType
from typing import Final, NamedTuple, Self

from scaraspec.transports.clock import now_ns

POLL_S: Final = 0.02
MAX_THRESHOLD_S: Final = 0.5
MIN_THRESHOLD_S: Final = 0.1
"""Shorter pauses are usual on a busy machine."""
_SHARE: Final = 4
_NS: Final = 1e9


class Stall(NamedTuple):
    """A time during which this machine did not run, in nanoseconds since the Unix epoch."""

    begin_ns: int
    end_ns: int

    @property
    def duration_s(self) -> float:
        """Its duration in seconds."""
        return (self.end_ns - self.begin_ns) / _NS


def threshold_s(time_scale: float, shortest_timeout_s: float) -> float:
    """Return the duration from which a stall can change a result.

    Args:
        time_scale: How many seconds of the subject pass in one second of ours.
        shortest_timeout_s: The shortest timeout of the subject, in seconds of ours.
    """
    longest_s = min(MAX_THRESHOLD_S / max(time_scale, 1.0), shortest_timeout_s / _SHARE)
    return max(longest_s, MIN_THRESHOLD_S)


class StallDetector:
    """Measures stalls while it is used as a context manager.

    Args:
        threshold_s: The shortest stall that counts, in seconds.
    """

    def __init__(self, threshold_s: float = MAX_THRESHOLD_S) -> None:
        self._threshold_s = threshold_s
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._poll, name="stall detector", daemon=True)
        self._lock = threading.Lock()
        self._last_ns, self._stalls = now_ns(), list[Stall]()

    def stalls(self) -> list[Stall]:
        """Return the stalls since the last call."""
        with self._lock:
            self._measure()
            stalls, self._stalls = self._stalls, []
        return stalls

    def _poll(self) -> None:
        while not self._stopped.wait(POLL_S):
            with self._lock:
                self._measure()

    def _measure(self) -> None:
        stall = Stall(self._last_ns, now_ns())
        self._last_ns = stall.end_ns
        if stall.duration_s >= self._threshold_s:
            self._stalls.append(stall)

    def __enter__(self) -> Self:
        """Start measuring."""
        self._last_ns = now_ns()
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop measuring."""
        self._stopped.set()
        self._thread.join()
