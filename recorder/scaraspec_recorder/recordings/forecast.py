"""Forecast: how much disk space a recording needs, and when a limit is reached."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from scaraspec_recorder.recordings.recording_stats import RERUN_SUFFIX
from scaraspec_recorder.sinks.clock_watch import elapsed_ns
from scaraspec_recorder.sinks.file_names import is_recording_name
from scaraspec_recorder.units import SECOND_NS, Limits, show_size

AFTER_NS: Final = 600 * SECOND_NS
"""Time from the start to the forecast."""

_DAY_NS: Final = 86_400 * SECOND_NS
_MOST_DAYS: Final = 3650


class Forecast:
    """Measures how fast the files of a folder grow.

    Args:
        folder: The folder.
        keep: Limits of age and total size.
        free_bytes: Returns the free disk space.
        elapsed: Clock that is not set, in nanoseconds.
    """

    def __init__(
        self,
        folder: Path,
        keep: Limits,
        free_bytes: Callable[[], int],
        elapsed: Callable[[], int] = elapsed_ns,
    ) -> None:
        self._folder = folder
        self._keep = keep
        self._free_bytes = free_bytes
        self._elapsed = elapsed
        self._started_ns = elapsed()
        self._earlier = {path.name for path, _ in self._files()}
        self._made = False

    def text(self, now_ns: int) -> str:
        """Return the forecast, once, when the rate is known; empty at other times.

        Args:
            now_ns: Current time, in nanoseconds since the Unix epoch.
        """
        took_ns = self._elapsed() - self._started_ns
        if self._made or took_ns < AFTER_NS:
            return ""
        self._made = True
        files = self._files()
        new = [(path, size) for path, size in files if path.name not in self._earlier]
        drawn_bytes = sum(size for path, size in new if path.suffix == RERUN_SUFFIX)
        new_bytes = sum(size for _, size in new)
        a_day = _DAY_NS / took_ns
        text = f"{_rounded(new_bytes * a_day)} a day"
        if drawn_bytes:
            text = f"{text}, {_rounded((new_bytes - drawn_bytes) * a_day)} with --no-rrd"
        total_bytes = sum(size for _, size in files)
        room_bytes, limit = self._free_bytes(), "the disk is full"
        if self._keep.size_bytes is not None and self._keep.size_bytes - total_bytes < room_bytes:
            room_bytes = self._keep.size_bytes - total_bytes
            limit = f"{show_size(self._keep.size_bytes)} of --keep are reached"
        days = max(room_bytes, 0) / (new_bytes * a_day) if new_bytes else _MOST_DAYS
        kept_ns = self._keep.duration_ns
        if days >= _MOST_DAYS or (kept_ns is not None and days * _DAY_NS > kept_ns):
            return text
        when = datetime.fromtimestamp((now_ns + int(days * _DAY_NS)) // SECOND_NS, UTC)
        return f"{text}; {limit} on {when:%A, %Y-%m-%d}"

    def _files(self) -> list[tuple[Path, int]]:
        """Return the recordings in the folder, each with its size in bytes."""
        found = []
        for path in self._folder.iterdir():
            if is_recording_name(path.with_suffix(".mcap").name):
                try:
                    found.append((path, path.stat().st_size))
                except OSError:  # it was just removed
                    continue
        return found


def _rounded(size_bytes: float) -> str:
    """Return a size in two digits."""
    return show_size(int(float(f"{size_bytes:.2g}")))
