"""Pulse: whether this machine was there all the time, for time is part of what is judged.

A process that was stopped, a machine that slept or was given no processor, and a clock that was set
make a subject look late, or too early. What is to come of it is not known here.
"""

import threading
import time
from types import TracebackType
from typing import Final, Self

BEAT_S: Final = 0.05
STOOD_S: Final = 0.5
"""For how long nothing may happen here until it may matter."""

_SINCE_BOOT: Final[int | None] = getattr(time, "CLOCK_BOOTTIME", None)


class Pulse:
    """Beats as long as it is used as a context."""

    def __init__(self) -> None:
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="pulse", daemon=True)
        self._lock = threading.Lock()
        self._last, self._longest_s = _now(), 0.0

    def stood_still_s(self) -> float:
        """How long at most nothing happened here, since this was asked last; 0 for no time to mind.

        A clock that was set counts by how far it was.
        """
        with self._lock:
            self._look()
            longest_s, self._longest_s = self._longest_s, 0.0
        return longest_s

    def _beat(self) -> None:
        while not self._over.wait(BEAT_S):
            with self._lock:
                self._look()

    def _look(self) -> None:
        before, self._last = self._last, _now()
        passed_s, shown_s = (now - then for now, then in zip(self._last, before, strict=True))
        still_s = max(passed_s, abs(shown_s - passed_s))
        if still_s >= STOOD_S:
            self._longest_s = max(self._longest_s, still_s)

    def __enter__(self) -> Self:
        """Let it beat."""
        self._last = _now()
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


def _now() -> tuple[float, float]:
    """Seconds that pass while the machine sleeps, too, and those that its clock shows."""
    passed_s = time.monotonic() if _SINCE_BOOT is None else time.clock_gettime(_SINCE_BOOT)
    return passed_s, time.time()
