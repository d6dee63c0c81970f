"""Retention: removes old recordings to free disk space.

The oldest complete recordings are removed first. Files that are being written are never removed.
Each removal is logged and recorded in the index.

Recordings near a mark of a trigger can be protected. Limits of age and size do not remove them. If
the disk is full, they are removed after all others: otherwise nothing more could be recorded. The
same applies to recordings that must be uploaded first.
"""

import logging
from collections.abc import Callable, Collection, Sequence
from typing import Final

from scaraspec.user_message import UserMessage
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.recording_stats import RecordingSummary
from scaraspec_recorder.sinks.clock_watch import ClockWatch
from scaraspec_recorder.units import SECOND_NS, Limits, show_duration, show_size

PERIOD_NS: Final = 10 * SECOND_NS
"""Interval of the retention checks."""

_CLOCK_UNSET_NS: Final = 1_577_836_800 * SECOND_NS
"""The year 2020. Recordings that end before it were made with a clock that was not set yet."""

_log = logging.getLogger(__name__)


class Retention:
    """Removes recordings beyond the limits.

    Args:
        index: Index of the complete recordings.
        keep: Limits of age and total size.
        min_free_bytes: Disk space that must stay free; 0 for no limit.
        free_bytes: Returns the free disk space.
        clock: Detects steps of the clock. After a step the ages are unknown, and only sizes count.
        protect_ns: How long before and after a mark recordings are protected; 0 for no protection.
        archived: Returns the names of the uploaded recordings; others are protected. None for no
            protection.

    Attributes:
        clock: The same.
    """

    def __init__(  # noqa: PLR0913 - independent options
        self,
        index: RecordingIndex,
        keep: Limits,
        min_free_bytes: int,
        free_bytes: Callable[[], int],
        clock: ClockWatch | None = None,
        *,
        protect_ns: int = 0,
        archived: Callable[[], Collection[str]] | None = None,
    ) -> None:
        self._index = index
        self._keep = keep
        self._min_free_bytes = min_free_bytes
        self._free_bytes = free_bytes
        self.clock = clock or ClockWatch()
        self._protect_ns = protect_ns
        self._archived = archived
        self._open_marks: Sequence[tuple[int, int]] = ()
        self._locked: set[str] = set()  # recordings whose removal was refused, which was logged

    def enforce(
        self, now_ns: int, written_bytes: int = 0, open_marks: Sequence[tuple[int, int]] = ()
    ) -> bool:
        """Remove recordings beyond the limits.

        Args:
            now_ns: Current time, in nanoseconds since the Unix epoch.
            written_bytes: Size of the recording that is being written.
            open_marks: Times of the first and the last mark of each recording that is being
                written; 0 for none.

        Returns:
            Whether the required disk space is free.

        Raises:
            OSError: The index cannot be written, or the names of the uploaded recordings cannot be
                read.
        """
        self.clock.step_ns()
        self._open_marks = open_marks
        not_archived = self._not_archived()
        protected = self._protected() | not_archived
        oldest_first = self._oldest_first()
        total_bytes = written_bytes + sum(entry.size_bytes for entry in oldest_first)
        for entry in oldest_first:
            if entry.name in protected:
                continue
            age_known = not self.clock.was_set and entry.end_ns >= _CLOCK_UNSET_NS
            age_ns = now_ns - entry.end_ns if age_known else 0
            reason = _too_much(self._keep, total_bytes, age_ns)
            if reason and self._remove(entry, now_ns, reason):
                total_bytes -= entry.size_bytes
        return self._make_room(now_ns, not_archived)

    def _make_room(self, now_ns: int, not_archived: Collection[str]) -> bool:
        if not self._min_free_bytes:
            return True
        # Count removed files as free immediately. The file system may free them later, and then
        # too many files would be removed.
        free_bytes = self._free_bytes()
        protected = self._protected()
        for entry in sorted(
            self._oldest_first(),
            key=lambda entry: (entry.name in not_archived, entry.name in protected),
        ):
            if free_bytes >= self._min_free_bytes:
                break
            least = show_size(self._min_free_bytes)
            template = (
                "less than {least} free on the disk, although not archived"
                if entry.name in not_archived
                else "less than {least} free on the disk"
            )
            if self._remove(entry, now_ns, UserMessage(template, least=least)):
                free_bytes += entry.size_bytes
        return free_bytes >= self._min_free_bytes

    def _not_archived(self) -> set[str]:
        """Return the names of the recordings that must be uploaded before they are removed."""
        return self._index.entries.keys() - self._archived() if self._archived else set()

    def _protected(self) -> set[str]:
        """Return the names of the recordings near a mark."""
        if not self._protect_ns:
            return set()
        entries = self._index.entries.values()
        marks = [(entry.first_mark_ns, entry.last_mark_ns) for entry in entries]
        spans = [
            (first_ns - self._protect_ns, last_ns + self._protect_ns)
            for first_ns, last_ns in (*marks, *self._open_marks)
            if first_ns
        ]
        return {
            entry.name
            for entry in entries
            if any(
                entry.end_ns >= begin_ns and entry.begin_ns <= end_ns for begin_ns, end_ns in spans
            )
        }

    def _oldest_first(self) -> list[RecordingSummary]:
        entries = self._index.entries.values()
        return sorted(entries, key=lambda entry: (entry.begin_ns, entry.name))

    def _remove(self, entry: RecordingSummary, now_ns: int, reason: str) -> bool:
        """Remove a recording; return whether it is removed.

        On Windows a file cannot be removed while another program has it open. It stays until a
        later check.
        """
        for path in (self._index.folder / name for name in entry.files):
            if path.is_symlink():
                _log.warning("%s is not removed: it is a symbolic link", path)
            elif path.exists():
                try:
                    path.unlink(missing_ok=True)
                except PermissionError as error:
                    if entry.name not in self._locked:
                        self._locked.add(entry.name)
                        _log.warning("%s cannot be removed now: %s", path, error.strerror)
                    return False
                _log.warning("removed %s: %s", path, reason)
        self._index.remove(entry.name, now_ns, reason)
        return True


def _too_much(limits: Limits, size_bytes: int, age_ns: int) -> str:
    """Return why the oldest recording must be removed; empty if it is kept."""
    if limits.size_bytes is not None and size_bytes > limits.size_bytes:
        return UserMessage("more than {size}", size=show_size(limits.size_bytes))
    if limits.duration_ns is not None and age_ns > limits.duration_ns:
        return UserMessage("older than {duration}", duration=show_duration(limits.duration_ns))
    return ""
