"""Status: what a recording is doing, for whoever shows it.

Law: looking disturbs nobody. All of it is read from what lies on the disk; no process is asked.
"""

import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from scaraspec_recorder.recording import Recording
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool.spool import WriteStall, unread_bytes

STALL_S: Final = 5.0
"""How long the scribe may be silent before that is told: it acknowledges four times a second."""


@dataclass(frozen=True, slots=True)
class Status:
    """A recording at one instant.

    Attributes:
        name: The robot.
        listen: Where clients connect: host and port.
        out_dir: Where its files are.
        time_s: When, in seconds on any clock.
        progress: How far the writing has come.
        waiting_bytes: What waits in the spool to be written.
        silent_s: For how long the scribe has acknowledged nothing.
        free_bytes: How much of the disk is free.
        stall: Why nothing is written, where that is known.
    """

    name: str
    listen: tuple[str, int]
    out_dir: Path
    time_s: float
    progress: Progress
    waiting_bytes: int
    silent_s: float
    free_bytes: int
    stall: WriteStall | None = None

    @property
    def stalled(self) -> bool:
        """Whether the writing is interrupted, or busy with something that takes long."""
        waits = bool(self.stall) or self.silent_s > STALL_S
        return waits and not self.progress.finished

    @property
    def gaps(self) -> int:
        """How often something is missing, of both directions."""
        return self.progress.a2c.gaps + self.progress.c2a.gaps

    @property
    def lost_bytes(self) -> int:
        """How much is, where that is known."""
        return self.progress.a2c.gap_bytes + self.progress.c2a.gap_bytes


class StatusReader:
    """Looks at a recording.

    Args:
        name: The robot.
        recording: The recording.
        out_dir: Where its files are.
        now_s: The clock, in seconds since the Unix epoch.
    """

    def __init__(
        self,
        name: str,
        recording: Recording,
        out_dir: Path,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self.name = name
        self._recording = recording
        self._out_dir = out_dir
        self._now_s = now_s
        self._started_s = self._acknowledged_s = now_s()

    def read_status(self) -> Status:
        """Return what it is doing now."""
        recording, now_s = self._recording, self._now_s()
        stall = recording.stall
        heard_s = stall.since_ns / 1e9 if stall else self._last_acknowledged_s()
        free_bytes = 0
        with suppress(OSError):  # the scribe makes the folder, and the disk may have gone
            free_bytes = shutil.disk_usage(self._out_dir).free
        return Status(
            self.name,
            recording.address,
            self._out_dir,
            now_s,
            recording.progress,
            unread_bytes(recording.spool),
            max(now_s - heard_s, 0),
            free_bytes,
            stall,
        )

    def _last_acknowledged_s(self) -> float:
        """When the scribe acknowledged last, as far as that was seen."""
        with suppress(FileNotFoundError):  # no longer
            for acknowledged in self._recording.spool.glob("*.json"):
                self._acknowledged_s = max(self._started_s, acknowledged.stat().st_mtime)
        return self._acknowledged_s
