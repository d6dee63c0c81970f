"""The archive: what a recorder that is left running for weeks writes into its folder.

Law: it only joins the rooms that do the work: rotation, marks, retention, the contents.
"""

import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.marks import with_marks
from scaraspec_recorder.recordings.recording_files import RecordingFolder, session_metadata
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.repair import remove_temporary_files
from scaraspec_recorder.recordings.retention import PERIOD_NS, Retention
from scaraspec_recorder.recordings.rotation import Rotation, RotationPolicy
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.sinks.sink import OutputFolder, Sink, SinkFailed
from scaraspec_recorder.units import Limits, show_size


@dataclass(frozen=True, slots=True)
class Archive:
    """What is written, and what of it is kept.

    Attributes:
        robot: What the files are called by.
        session: What is known beforehand, such as the addresses.
        needs_login: False for a serial link (L83).
        draw: Whether to write .rrd files too.
        redact: Whether to hide passwords in the raw layer too.
        rotate: When a file ends and the next begins.
        keep: For how long, and how much of it, is kept.
        min_free_bytes: How much of the disk is to stay free; 0 for no such limit.
        triggers: The conditions at which the recording is marked, see `triggers`.
    """

    robot: str
    session: Mapping[str, str] = field(default_factory=dict)
    needs_login: bool = True
    draw: bool = True
    redact: bool = False
    rotate: RotationPolicy = field(default_factory=RotationPolicy)
    keep: Limits = field(default_factory=Limits)
    min_free_bytes: int = 0
    triggers: tuple[str, ...] = ()


def archive_sink(
    folder: OutputFolder,
    *,
    archive: Archive,
    now_ns: Callable[[], int] = time.time_ns,
    free_bytes: Callable[[], int] | None = None,
) -> Sink:
    """Make the sink that writes an archive (a `SinkFactory`).

    What an earlier one left in the folder is repaired and listed first, where there is room.

    Args:
        folder: Where to.
        archive: What.
        now_ns: The clock.
        free_bytes: How much of the disk is free; asked of the system where it is not given.

    Raises:
        OSError: The folder cannot be used.
        SinkFailed: Less of the disk is free than must be, and there is nothing to remove.
        ImportError: Drawing needs an extra that is not installed; the text says which.
    """
    remove_temporary_files(folder.path)
    index = RecordingIndex(folder.path)
    free_bytes = free_bytes or (lambda: shutil.disk_usage(folder.path).free)
    retention = Retention(index, archive.keep, archive.min_free_bytes, free_bytes)
    enough = retention.enforce(now_ns())
    if enough:
        index.repair()
    index.save()
    if not enough:
        raise SinkFailed(_too_little(archive))
    known = {"robot": archive.robot, **archive.session}
    session = session_metadata(known, needs_login=archive.needs_login, redact=archive.redact)
    recording_folder = RecordingFolder(folder, index, archive.robot, session, archive.draw)
    judge = Judge(needs_login=archive.needs_login)
    outputs = with_marks(
        [Rotation(recording_folder, judge, archive.rotate)], archive.triggers, folder
    )
    decoder = Decoder(outputs, judge, Redactor() if archive.redact else None)
    return _Retained(decoder, retention, recording_folder, _too_little(archive))


def _too_little(archive: Archive) -> str:
    return (
        f"less than {show_size(archive.min_free_bytes)} is free on the disk, and no recording is "
        "left that may be removed: recording waits for room"
    )


class _Retained:
    """A sink that makes room as it writes; where there is none to make, it ends its files."""

    def __init__(
        self, sink: Sink, retention: Retention, recording_folder: RecordingFolder, too_little: str
    ) -> None:
        self._sink = sink
        self._retention = retention
        self._folder = recording_folder
        self._too_little = too_little
        self._looked_ns = 0
        self._full = False

    def write(self, event: WireEvent) -> None:
        """Take the next event.

        Raises:
            SinkFailed: The disk has no room that may be used.
        """
        if self._full:
            raise SinkFailed(self._too_little)
        self._sink.write(event)

    def tick(self, now_ns: int) -> None:
        """Make all durable, and see to the room on the disk now and then."""
        if self._full:
            raise SinkFailed(self._too_little)
        self._sink.tick(now_ns)
        self._folder.list_completed()
        if 0 <= now_ns - self._looked_ns < PERIOD_NS:
            return
        self._looked_ns = now_ns
        if not self._retention.enforce(now_ns, self._folder.unlisted_bytes):
            self.close()  # what was taken is safe: after this tick it does not come again
            self._full = True

    def close(self) -> None:
        """End the files."""
        if not self._full:
            self._sink.close()
            self._folder.list_completed(wait=True)
