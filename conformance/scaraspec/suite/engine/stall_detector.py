"""Pulse: whether this machine was there all the time, for time is part of what is judged.

A process that was stopped, and a machine that slept or was given no processor, make a subject look
late. What is to come of it is not known here.
"""

import threading
from types import TracebackType
from typing import Final, Self

from scaraspec.transports.clock import monotonic_ns

BEAT_S: Final = 0.05
STOOD_S: Final = 0.5
"""For how long nothing may happen here until it may matter."""


class StallDetector:
    """Beats as long as it is used as a context."""

    def __init__(self) -> None:
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="pulse", daemon=True)
        self._lock = threading.Lock()
        self._last_ns, self._longest_s = monotonic_ns(), 0.0

    def take_longest_stall_s(self) -> float:
        """How long at most nothing happened here since this was asked last; 0 for what is usual."""
        with self._lock:
            self._look()
            longest_s, self._longest_s = self._longest_s, 0.0
        return longest_s

    def _beat(self) -> None:
        while not self._over.wait(BEAT_S):
            with self._lock:
                self._look()

    def _look(self) -> None:
        before_ns, self._last_ns = self._last_ns, monotonic_ns()
        still_s = (self._last_ns - before_ns) / 1e9
        if still_s >= STOOD_S:
            self._longest_s = max(self._longest_s, still_s)

    def __enter__(self) -> Self:
        """Let it beat."""
        self._last_ns = monotonic_ns()
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Let it stop."""
        self._over.set()
        self._thread.join()
