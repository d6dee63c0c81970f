"""File sets: a capture, what is drawn of it, and its line in the table of contents, as one output.

Law: what one file of a recording consists of, and how it is called, stands here; when one begins
and ends is the affair of others.
"""

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.recording_index import Contents
from scaraspec_recorder.recordings.recording_stats import DRAWN, RecordingSummary, Tally
from scaraspec_recorder.sinks.decoder import Item, Output
from scaraspec_recorder.sinks.mcap.mcap_file import LINK, SERIAL, McapSink
from scaraspec_recorder.sinks.rerun.optimizing import optimize_later
from scaraspec_recorder.sinks.restarts import stem
from scaraspec_recorder.sinks.sinks import Folder
from scaraspec_recorder.sinks.text import Line


@dataclass(slots=True)
class RecordingFolder:
    """Where file sets are put.

    Attributes:
        folder: The folder.
        contents: Its table of contents.
        robot: What the files are called by.
        session: What is known beforehand, such as the addresses.
        draw: Whether to write .rrd files too.
        written: The file sets that are being written.
        ending: Those that are complete, and not listed yet, in their order.
    """

    folder: Folder
    contents: Contents
    robot: str
    session: Mapping[str, str] = field(default_factory=dict)
    draw: bool = True
    written: list["FileSet"] = field(default_factory=list)
    ending: list["FileSet"] = field(default_factory=list)

    @property
    def unlisted_bytes(self) -> int:
        """Size of what is not in the table of contents yet."""
        return sum(files.size_bytes for files in (*self.written, *self.ending))

    def settle(self, *, wait: bool = False) -> None:
        """List what has come to its final size.

        Args:
            wait: Whether to wait for all that is complete.

        Raises:
            OSError: The table of contents cannot be written.
        """
        while self.ending and (wait or self.ending[0].optimized.done()):
            self.ending[0].optimized.result()
            self.contents.add(self.ending[0].entry)
            del self.ending[0]

    def begin(self, time_ns: int) -> "FileSet":
        """Begin a file set.

        Args:
            time_ns: Its time, by which it is called.

        Raises:
            OSError: A file cannot be made.
            ImportError: Drawing needs an extra that is not installed; the text says which.
        """
        session = {**self.session, **self.folder.take_news()}
        return FileSet(self, stem(time_ns, self.robot), session)


def facts(session: Mapping[str, str], *, needs_login: bool, redact: bool) -> dict[str, str]:
    """Return what each file of a recording says of its session, its own facts aside.

    Args:
        session: What is known beforehand, such as the addresses.
        needs_login: False for a serial link (L83).
        redact: Whether passwords are hidden in the raw layer too.
    """
    passwords = "masked" if redact else "masked but in raw bytes"
    return {**session, LINK: "tcp" if needs_login else SERIAL, "passwords": passwords}


def make_files(
    folder: Folder, name: str, session: Mapping[str, str], *, draw: bool, optimized: bool
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
        from scaraspec_recorder.sinks.rerun.rerun_view import RerunSink  # noqa: PLC0415 - an optional extra

        drawn = folder.new(f"{path.stem}{DRAWN}")
        drawing = RerunSink.to_file(drawn, session, optimized=optimized, footer=not optimized)
    except BaseException:
        file.close()
        for made in filter(None, (path, drawn)):
            made.unlink()
        raise
    return (path, drawn), (capture, drawing)


class FileSet:
    """An output that writes one capture.

    What `McapSink` and `RerunSink` raise goes through.

    Args:
        shelf: Where it is put.
        name: What its files are called, without suffixes.
        session: What is known of it.
    """

    def __init__(self, shelf: RecordingFolder, name: str, session: Mapping[str, str]) -> None:
        self._shelf = shelf
        self._tally = Tally()
        made = make_files(shelf.folder, name, session, draw=shelf.draw, optimized=False)
        self._paths, self._outputs = made
        self.optimized = Future[bool]()
        """Done when its files have come to their final size."""
        shelf.written.append(self)

    @property
    def path(self) -> Path:
        """The capture file."""
        return self._paths[0]

    @property
    def entry(self) -> RecordingSummary:
        """Its line in the table of contents."""
        return self._tally.entry(self._paths)

    @property
    def size_bytes(self) -> int:
        """How large it is, as far as it was flushed."""
        return sum(path.stat().st_size for path in self._paths)

    def write(self, event: WireEvent) -> None:
        """Write a raw event."""
        self._tally.count(event)
        for output in self._outputs:
            output.write(event)

    def take(self, item: Item, number: int, line: Line | None) -> None:
        """Write what an event brought about."""
        self._tally.take(item)
        for output in self._outputs:
            output.take(item, number, line)

    def mark(self, time_ns: int, line: Line) -> None:
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
            output.close({**summary, **self._tally.words})
        self._outputs = ()  # the drawing may wait for long to be optimized
        if self._shelf.draw:
            self.optimized = optimize_later(self._paths[-1])
        else:
            self.optimized.set_result(False)
        self._shelf.written.remove(self)
        self._shelf.ending.append(self)
        self._shelf.settle()
