"""File sets: a capture, what is drawn of it, and its line in the table of contents, as one output.

Law: what one file of a recording consists of, and how it is called, stands here; when one begins
and ends is the affair of others.
"""

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.recording_stats import (
    RERUN_SUFFIX,
    RecordingStats,
    RecordingSummary,
)
from scaraspec_recorder.sinks.decoder import Item, Output
from scaraspec_recorder.sinks.file_names import file_stem
from scaraspec_recorder.sinks.mcap.mcap_sink import LINK, SERIAL, McapSink
from scaraspec_recorder.sinks.rerun.optimizer import optimize_later
from scaraspec_recorder.sinks.sink import OutputFolder
from scaraspec_recorder.sinks.text import LogLine


@dataclass(slots=True)
class RecordingFolder:
    """Where file sets are put.

    Attributes:
        folder: The folder.
        index: Its table of contents.
        robot: What the files are called by.
        session: What is known beforehand, such as the addresses.
        draw: Whether to write .rrd files too.
        open_files: The file sets that are being written.
        completed: Those that are complete, and not listed yet, in their order.
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
        """Size of what is not in the table of contents yet."""
        return sum(files.size_bytes for files in (*self.open_files, *self.completed))

    def list_completed(self, *, wait: bool = False) -> None:
        """List what has come to its final size.

        Args:
            wait: Whether to wait for all that is complete.

        Raises:
            OSError: The table of contents cannot be written.
        """
        while self.completed and (wait or self.completed[0].optimized.done()):
            self.completed[0].optimized.result()
            self.index.add(self.completed[0].summary)
            del self.completed[0]

    def create(self, time_ns: int) -> "RecordingFiles":
        """Begin a file set.

        Args:
            time_ns: Its time, by which it is called.

        Raises:
            OSError: A file cannot be made.
            ImportError: Drawing needs an extra that is not installed; the text says which.
        """
        session = {**self.session, **self.folder.take_metadata()}
        return RecordingFiles(self, file_stem(time_ns, self.robot), session)


def session_metadata(
    session: Mapping[str, str], *, needs_login: bool, redact: bool
) -> dict[str, str]:
    """Return what each file of a recording says of its session, its own facts aside.

    Args:
        session: What is known beforehand, such as the addresses.
        needs_login: False for a serial link (L83).
        redact: Whether passwords are hidden in the raw layer too.
    """
    passwords = "masked" if redact else "masked but in raw bytes"
    return {**session, LINK: "tcp" if needs_login else SERIAL, "passwords": passwords}


def make_files(
    folder: OutputFolder, name: str, session: Mapping[str, str], *, draw: bool, optimized: bool
) -> tuple[tuple[Path, ...], tuple[Output, ...]]:
    """Make a capture file and, if asked, that of its drawing; all or none.

    Args:
        folder: Where to.
        name: What they are called, without suffixes.
        session: What is known of them.
        draw: Whether to draw.
        optimized: Whether the drawing is made small when it is complete; it may grow for weeks
            till then, so its footer is made only there.

    Returns:
        Their paths, and what writes them.

    Raises:
        OSError: A file cannot be made; as `SinkFailed`.
        ImportError: Drawing needs an extra that is not installed; the text says which.
    """
    path = folder.new(f"{name}.mcap")
    file = path.open("wb")
    capture = McapSink(file, session, discard=path.unlink)
    if not draw:
        return (path,), (capture,)
    drawn: Path | None = None
    try:
        from scaraspec_recorder.sinks.rerun.rerun_sink import RerunSink  # noqa: PLC0415 - an optional extra

        drawn = folder.new(f"{path.stem}{RERUN_SUFFIX}")
        drawing = RerunSink.to_file(drawn, session, optimized=optimized, footer=not optimized)
    except BaseException:
        file.close()
        for made in filter(None, (path, drawn)):
            made.unlink()
        raise
    return (path, drawn), (capture, drawing)


class RecordingFiles:
    """An output that writes one capture.

    What `McapSink` and `RerunSink` raise goes through.

    Args:
        shelf: Where it is put.
        name: What its files are called, without suffixes.
        session: What is known of it.
    """

    def __init__(
        self, recording_folder: RecordingFolder, name: str, session: Mapping[str, str]
    ) -> None:
        self._folder = recording_folder
        self._stats = RecordingStats()
        made = make_files(
            recording_folder.folder, name, session, draw=recording_folder.draw, optimized=False
        )
        self._paths, self._outputs = made
        self.optimized = Future[bool]()
        """Done when its files have come to their final size."""
        recording_folder.open_files.append(self)

    @property
    def path(self) -> Path:
        """The capture file."""
        return self._paths[0]

    @property
    def summary(self) -> RecordingSummary:
        """Its line in the table of contents."""
        return self._stats.build_summary(self._paths)

    @property
    def size_bytes(self) -> int:
        """How large it is, as far as it was flushed."""
        return sum(path.stat().st_size for path in self._paths)

    def write(self, event: WireEvent) -> None:
        """Write a raw event."""
        self._stats.add_event(event)
        for output in self._outputs:
            output.write(event)

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Write what an event brought about."""
        self._stats.add_item(item)
        for output in self._outputs:
            output.take(item, number, line)

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log."""
        for output in self._outputs:
            output.mark(time_ns, line)

    def tick(self, now_ns: int) -> None:
        """Make all of it durable."""
        for output in self._outputs:
            output.tick(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:
        """End the files, and have them listed: at once, or when the drawing is optimized.

        Args:
            summary: What is known of the whole recording; what this file holds is counted here.
        """
        for output in self._outputs:
            output.close({**summary, **self._stats.summary_text})
        self._outputs = ()  # the drawing may wait for long to be optimized
        if self._folder.draw:
            self.optimized = optimize_later(self._paths[-1])
        else:
            self.optimized.set_result(False)
        self._folder.open_files.remove(self)
        self._folder.completed.append(self)
        self._folder.list_completed()
