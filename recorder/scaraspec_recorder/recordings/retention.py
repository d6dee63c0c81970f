"""Retention: what is removed, so that the disk holds what comes next.

Law: the oldest complete recordings go first. What is being written is not listed yet and never
goes. Nothing goes unsaid: each removal is logged and noted in the table of contents.
"""

import logging
from collections.abc import Callable
from typing import Final

from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.recording_stats import RecordingSummary
from scaraspec_recorder.units import SECOND_NS, Limits, show_size

PERIOD_NS: Final = 10 * SECOND_NS
"""How often it is looked whether something is to be removed."""

_DAY_NS: Final = 86_400 * SECOND_NS

_log = logging.getLogger(__name__)


class Retention:
    """Removes recordings.

    Args:
        contents: Those that are complete.
        keep: For how long, and how much of them, recordings are kept.
        min_free_bytes: How much of the disk is to stay free; 0 for no such limit.
        free_bytes: How much of it is.
    """

    def __init__(
        self,
        index: RecordingIndex,
        keep: Limits,
        min_free_bytes: int,
        free_bytes: Callable[[], int],
    ) -> None:
        self._index = index
        self._keep = keep
        self._min_free_bytes = min_free_bytes
        self._free_bytes = free_bytes

    def enforce(self, now_ns: int, written_bytes: int = 0) -> bool:
        """Remove what is to go.

        Args:
            now_ns: The time, since the Unix epoch.
            written_bytes: Size of the recording that is being written.

        Returns:
            Whether as much of the disk is free as must be.

        Raises:
            OSError: A file cannot be removed, or the table of contents not be written.
        """
        oldest_first = self._oldest_first()
        total_bytes = written_bytes + sum(entry.size_bytes for entry in oldest_first)
        for entry in oldest_first:
            if reason := _too_much(self._keep, total_bytes, now_ns - entry.end_ns):
                total_bytes -= entry.size_bytes
                self._remove(entry, now_ns, reason)
        return self._make_room(now_ns)

    def _make_room(self, now_ns: int) -> bool:
        if not self._min_free_bytes:
            return True
        # What was removed counts as free at once, whenever the file system gets round to it: else
        # everything would go while it does.
        free_bytes = self._free_bytes()
        for entry in self._oldest_first():
            if free_bytes >= self._min_free_bytes:
                break
            free_bytes += entry.size_bytes
            least = show_size(self._min_free_bytes)
            self._remove(entry, now_ns, f"less than {least} free on the disk")
        return free_bytes >= self._min_free_bytes

    def _oldest_first(self) -> list[RecordingSummary]:
        entries = self._index.entries.values()
        return sorted(entries, key=lambda entry: (entry.begin_ns, entry.name))

    def _remove(self, entry: RecordingSummary, now_ns: int, reason: str) -> None:
        for name in entry.files:
            (self._index.folder / name).unlink(missing_ok=True)
        self._index.remove(entry.name, now_ns, reason)
        _log.info("removed %s: %s", entry.name, reason)


def _too_much(limits: Limits, size_bytes: int, age_ns: int) -> str:
    """Why the oldest recording must go, with all that are younger of this size; or nothing."""
    if limits.size_bytes is not None and size_bytes > limits.size_bytes:
        return f"more than {show_size(limits.size_bytes)}"
    if limits.duration_ns is not None and age_ns > limits.duration_ns:
        return f"older than {limits.duration_ns / _DAY_NS:g} days"
    return ""
