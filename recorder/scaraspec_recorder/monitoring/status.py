"""Status of a recording for displays and metrics.

The status is read from files only; no process of the recording is contacted.
"""

import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from scaraspec_recorder.recording import Recording
from scaraspec_recorder.recordings.upload_log import UploadState
from scaraspec_recorder.sinks.sink_runner import Progress
from scaraspec_recorder.spool.spool import WriteStall, checkpoint_time_s, unread_bytes

STALL_S: Final = 5.0
"""Time without acknowledgment after which writing counts as stalled; normal are four per second."""

CONNECTING_S: Final = 1.0
"""Time after which a pending connection to the robot is shown."""

START_S: Final = 30.0
"""The same time before the first acknowledgment: on a busy machine a process starts slowly."""


@dataclass(frozen=True, slots=True)
class Status:
    """State of a recording at one time.

    Attributes:
        name: The robot's name.
        listen: Hosts and ports that clients connect to.
        out_dir: Output folder.
        time_s: Time of the state, in seconds.
        progress: Progress of the writer process.
        waiting_bytes: Unwritten bytes in the spool.
        silent_s: Seconds since the last acknowledgment.
        free_bytes: Free disk space.
        stall: Why writing is stalled, if known.
        starting: Whether nothing was acknowledged since the start.
        uploads: State of the uploads; None if files are not uploaded.
    """

    name: str
    listen: tuple[tuple[str, int], ...]
    out_dir: Path
    time_s: float
    progress: Progress
    waiting_bytes: int
    silent_s: float
    free_bytes: int
    stall: WriteStall | None = None
    starting: bool = False
    uploads: UploadState | None = None

    @property
    def upload_problem(self) -> str:
        """Why finished files are not uploaded; empty if they are."""
        return self.uploads.problem(int(self.time_s * 1e9)) if self.uploads else ""

    @property
    def stalled(self) -> bool:
        """Whether writing is interrupted or slow."""
        waits = bool(self.stall) or self.silent_s > (START_S if self.starting else STALL_S)
        return waits and not self.progress.finished

    @property
    def connecting_s(self) -> float:
        """How long a client has been waiting for the connection to the robot; 0 if not for long."""
        since_ns = self.progress.connecting_since_ns
        waited_s = self.time_s - since_ns / 1e9 if since_ns else 0
        return waited_s if waited_s > CONNECTING_S else 0

    @property
    def gaps(self) -> int:
        """Number of gaps in both directions."""
        return self.progress.a2c.gaps + self.progress.c2a.gaps

    @property
    def lost_bytes(self) -> int:
        """Missing bytes in both directions, without gaps of unknown length."""
        return self.progress.a2c.gap_bytes + self.progress.c2a.gap_bytes


class StatusReader:
    """Reads the status of a recording.

    Args:
        name: The robot's name.
        recording: The recording.
        out_dir: Output folder.
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
        """Return the current status."""
        recording, now_s = self._recording, self._now_s()
        stall = recording.stall
        acknowledged_s = self._last_acknowledged_s()
        last_s = stall.since_ns / 1e9 if stall else acknowledged_s
        free_bytes = 0
        with suppress(OSError):  # the writer process creates the folder; the disk may be missing
            free_bytes = shutil.disk_usage(self._out_dir).free
        return Status(
            self.name,
            recording.addresses,
            self._out_dir,
            now_s,
            recording.progress,
            unread_bytes(recording.spool),
            max(now_s - last_s, 0),
            free_bytes,
            stall,
            acknowledged_s == self._started_s,
            recording.upload_state,
        )

    def _last_acknowledged_s(self) -> float:
        """Return the time of the last acknowledgment."""
        if written_s := checkpoint_time_s(self._recording.spool):  # deleted at the end
            self._acknowledged_s = max(self._started_s, written_s)
        return self._acknowledged_s
