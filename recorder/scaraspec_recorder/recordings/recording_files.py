"""The files of one recording: MCAP file, optional .rrd file and index entry.

Belongs here: creation and names of these files. `rotation` decides when they start and end.
"""

from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.marks import SOURCE
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.recording_stats import (
    RERUN_SUFFIX,
    RecordingStats,
    RecordingSummary,
)
from scaraspec_recorder.sinks.batches import BatchedOutput
from scaraspec_recorder.sinks.decoder import Item, Output
from scaraspec_recorder.sinks.file_names import file_stem
from scaraspec_recorder.sinks.mcap.mcap_sink import LINK, MASKED, PASSWORDS, SERIAL, McapSink
from scaraspec_recorder.sinks.rerun.optimizer import optimize_later
from scaraspec_recorder.sinks.sink import OutputFolder, SinkFailed
from scaraspec_recorder.sinks.text import LogLine

_HEAD_BYTES: Final = 1 << 16
"""Buffer for the head of a file: a killed process leaves an empty file or one with a whole head."""


@dataclass(slots=True)
class RecordingFolder:
    """The folder that recordings are written into.

    Attributes:
        folder: The folder.
        index: Its index.
        robot: The robot's name, part of the file names.
        session: Metadata of the session, such as the addresses.
        draw: Whether to write .rrd files too.
        open_files: Recordings that are being written.
        completed: Complete recordings that are not in the index yet, in order.
    """

    folder: OutputFolder
    index: RecordingIndex
    robot: str
    session: Mapping[str, str] = field(default_factory=dict)
    draw: bool = True
    open_files: list["RecordingFiles"] = field(default_factory=list)
    completed: list["RecordingFiles"] = field(default_factory=list)

    @property
    def unlisted_bytes(self) -> int:
        """Size of the files that are not in the index yet."""
        return sum(files.size_bytes for files in (*self.open_files, *self.completed))

    @property
    def unlisted_marks(self) -> list[tuple[int, int]]:
        """Times of the first and last mark of each file that is not in the index yet."""
        return [files.mark_times_ns for files in (*self.open_files, *self.completed)]

    def list_completed(self, *, wait: bool = False) -> None:
        """Add files that have their final size to the index.

        Args:
            wait: Whether to wait for the optimization of all complete files.

        Raises:
            OSError: The index cannot be written.
        """
        while self.completed and (wait or self.completed[0].optimized.done()):
            self.completed[0].optimized.result()
            self.index.add(self.completed[0].summary)
            del self.completed[0]

    def create(self, time_ns: int) -> "RecordingFiles":
        """Create the files of a new recording.

        Args:
            time_ns: Start time, part of the file names.

        Raises:
            OSError: A file cannot be created.
            ImportError: The extra for Rerun is not installed.
        """
        session = {**self.session, **self.folder.take_metadata()}
        return RecordingFiles(self, file_stem(time_ns, self.robot), session)


def session_metadata(
    session: Mapping[str, str], *, needs_login: bool, redact: bool
) -> dict[str, str]:
    """Return the session metadata that all files of a recording share.

    Args:
        session: Metadata of the session, such as the addresses.
        needs_login: False for a serial link (L83).
        redact: Whether passwords are masked in the raw bytes, too.
    """
    passwords = MASKED if redact else "masked but in raw bytes"
    return {**session, LINK: "tcp" if needs_login else SERIAL, PASSWORDS: passwords}


def make_files(
    folder: OutputFolder, name: str, session: Mapping[str, str], *, draw: bool, optimized: bool
) -> tuple[tuple[Path, ...], tuple[Output, ...]]:
    """Create an MCAP file and, if requested, a .rrd file; both or none.

    Args:
        folder: Output folder.
        name: File name without suffix.
        session: Session metadata.
        draw: Whether to write a .rrd file, too.
        optimized: Whether the .rrd file is optimized when it is complete. The optimizer writes its
            footer; a footer in memory could grow for weeks.

    Returns:
        The paths and the outputs.

    Raises:
        OSError: A file cannot be created; also `SinkFailed`.
        ImportError: The extra for Rerun is not installed.
    """
    path = folder.new(f"{name}.mcap", beside=RERUN_SUFFIX if draw else "")
    created = [path]

    def discard() -> None:
        for each in created:
            each.unlink(missing_ok=True)

    file = path.open("wb", _HEAD_BYTES)
    capture = BatchedOutput(McapSink(file, session, discard))
    if not draw:
        return (path,), (capture,)
    try:
        from scaraspec_recorder.sinks.rerun.rerun_sink import RerunSink  # noqa: PLC0415 - an optional extra

        drawn = folder.new(f"{path.stem}{RERUN_SUFFIX}")
        created.append(drawn)
        drawing = RerunSink.to_file(drawn, session, optimized=optimized, footer=not optimized)
    except BaseException as error:
        file.close()
        discard()
        if isinstance(error, RuntimeError):  # of rerun, which has no memory or no file
            raise SinkFailed(str(error)) from error
        raise
    return (path, drawn), (capture, BatchedOutput(drawing))


class RecordingFiles:
    """An output that writes the files of one recording.

    Exceptions of `McapSink` and `RerunSink` are not caught.

    Args:
        recording_folder: The folder.
        name: File name without suffix.
        session: Session metadata.
    """

    def __init__(
        self, recording_folder: RecordingFolder, name: str, session: Mapping[str, str]
    ) -> None:
        self._folder = recording_folder
        self._stats = RecordingStats()
        self._paths, self._outputs = make_files(
            recording_folder.folder, name, session, draw=recording_folder.draw, optimized=False
        )
        self.optimized = Future[bool]()
        """Done when the files have their final size."""
        recording_folder.open_files.append(self)

    @property
    def path(self) -> Path:
        """The capture file."""
        return self._paths[0]

    @property
    def summary(self) -> RecordingSummary:
        """The index entry."""
        return self._stats.build_summary(self._paths)

    @property
    def mark_times_ns(self) -> tuple[int, int]:
        """Times of the first and the last mark; 0 for none."""
        return self._stats.first_mark_ns, self._stats.last_mark_ns

    @property
    def size_bytes(self) -> int:
        """Size of the flushed data. A removed file counts nothing until `tick` reports it."""
        total_bytes = 0
        for path in self._paths:
            with suppress(FileNotFoundError):
                total_bytes += path.stat().st_size
        return total_bytes

    def write(self, event: WireEvent) -> None:
        """Write a raw event."""
        self._stats.add_event(event)
        for output in self._outputs:
            output.write(event)

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Write an item derived from an event."""
        self._stats.add_item(item)
        for output in self._outputs:
            output.take(item, number, line)

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log."""
        if line.source == SOURCE:
            self._stats.add_mark(time_ns)
        for output in self._outputs:
            output.mark(time_ns, line)

    def tick(self, now_ns: int) -> None:
        """Make all data durable."""
        for output in self._outputs:
            output.tick(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:
        """Close the files, and add them to the index: now, or after the .rrd file is optimized.

        Args:
            summary: Summary of the whole recording; the counts of this file are added.
        """
        for output in self._outputs:
            output.close({**summary, **self._stats.summary_text})
        self._outputs = ()  # release them: optimizing may take long
        if self._folder.draw:
            self.optimized = optimize_later(self._paths[-1])
        else:
            self.optimized.set_result(False)
        self._folder.open_files.remove(self)
        self._folder.completed.append(self)
        self._folder.list_completed()
