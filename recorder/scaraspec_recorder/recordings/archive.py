"""The sink of a long-running recorder: combines rotation, marks, retention and the index."""

import logging
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.recordings.forecast import Forecast
from scaraspec_recorder.recordings.marks import with_marks
from scaraspec_recorder.recordings.recording_files import RecordingFolder, session_metadata
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.retention import PERIOD_NS, Retention
from scaraspec_recorder.recordings.rotation import Rotation, RotationPolicy
from scaraspec_recorder.recordings.trigger_command import TriggerCommand
from scaraspec_recorder.recordings.upload_log import UploadLog
from scaraspec_recorder.sinks.clock_watch import ClockWatch
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.own_files import remove_temporary_files
from scaraspec_recorder.sinks.redaction import make_redactor
from scaraspec_recorder.sinks.sink import OutputFolder, Sink, SinkFailed
from scaraspec_recorder.units import Limits, show_size

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Archive:
    """Configuration of an archive of recordings.

    Attributes:
        robot: The robot's name, part of the file names.
        session: Metadata of the session, such as the addresses.
        needs_login: False for a serial link (L83).
        draw: Whether to write .rrd files too.
        redact: Whether to mask passwords in the raw bytes, too.
        rotate: When a file ends and the next one starts.
        keep: Limits of age and total size.
        min_free_bytes: Disk space that must stay free; 0 for no limit.
        triggers: Conditions that write a mark into the recording, see `triggers`.
        on_trigger: Command to run when a trigger fires; empty for none.
        protect_ns: How long before and after a mark recordings are protected from retention.
        keep_until_in: The store that must have a recording before the limits `keep` remove it;
            empty for none.
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
    on_trigger: tuple[str, ...] = ()
    protect_ns: int = 0
    keep_until_in: str = ""


def archive_sink(
    folder: OutputFolder,
    *,
    archive: Archive,
    now_ns: Callable[[], int] = time.time_ns,
    free_bytes: Callable[[], int] | None = None,
) -> Sink:
    """Create the sink that writes an archive (a `SinkFactory`).

    Files of an earlier recorder are repaired and indexed first, if there is disk space.

    Args:
        folder: Output folder.
        archive: The configuration.
        now_ns: The clock.
        free_bytes: Returns the free disk space; None asks the system.

    Raises:
        OSError: The folder cannot be used.
        SinkFailed: There is too little disk space, and no recording can be removed.
        ImportError: The extra for Rerun is not installed.
    """
    remove_temporary_files(folder.path)
    index = RecordingIndex(folder.path)
    free_bytes = free_bytes or (lambda: shutil.disk_usage(folder.path).free)
    before, limits = folder.state.clock, (archive.keep, archive.min_free_bytes)
    retention = Retention(
        index,
        *limits,
        free_bytes,
        ClockWatch(before=before),
        protect_ns=archive.protect_ns,
        archived=UploadLog(folder.path, archive.keep_until_in).names
        if archive.keep_until_in
        else None,
    )
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
    command = None
    if archive.on_trigger:
        command = TriggerCommand(
            archive.on_trigger, archive.robot, lambda: recording_folder.open_files[-1].path
        )
    rotation = Rotation(recording_folder, judge, archive.rotate)
    outputs = with_marks([rotation], archive.triggers, folder, command)
    redactor = make_redactor(folder) if archive.redact else None
    decoder = Decoder(outputs, judge, redactor, ClockWatch(before=before))
    forecast = Forecast(folder.path, archive.keep, free_bytes)
    return _Retained(decoder, retention, recording_folder, _too_little(archive), forecast)


def _too_little(archive: Archive) -> str:
    return UserMessage(
        "less than {size} of disk space is free, and no recording can be removed: recording waits "
        "for free space",
        size=show_size(archive.min_free_bytes),
    )


class _Retained:
    """A sink that enforces retention; if the disk stays full, it closes its files."""

    def __init__(
        self,
        sink: Sink,
        retention: Retention,
        recording_folder: RecordingFolder,
        too_little: str,
        forecast: Forecast,
    ) -> None:
        self._sink = sink
        self._retention = retention
        self._folder = recording_folder
        self._too_little = too_little
        self._forecast = forecast
        self._looked_ns = 0
        self._full = False

    def write(self, event: WireEvent) -> None:
        """Write the next event.

        Raises:
            SinkFailed: There is too little disk space.
        """
        if self._full:
            raise SinkFailed(self._too_little)
        self._sink.write(event)

    def tick(self, now_ns: int) -> None:
        """Make all data durable, and enforce retention periodically."""
        if self._full:
            raise SinkFailed(self._too_little)
        self._sink.tick(now_ns)
        self._folder.list_completed()
        if 0 <= now_ns - self._looked_ns < PERIOD_NS:
            return
        self._looked_ns = now_ns
        if text := self._forecast.text(now_ns):
            _log.warning("forecast: %s", text)
        enough = self._retention.enforce(
            now_ns, self._folder.unlisted_bytes, self._folder.unlisted_marks
        )
        self._folder.folder.state.clock = self._retention.clock.state
        if not enough:
            self.close()  # events before this tick are durable and not delivered again
            self._full = True

    def close(self) -> None:
        """Close the files."""
        if not self._full:
            self._sink.close()
            self._folder.list_completed(wait=True)
