"""File sets: a capture, what is drawn of it, and its line in the table of contents, as one output.

Law: what one file of a recording consists of, and how it is called, stands here; when one begins
and ends is the affair of others.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from scaraspec.judgement.wire import WireEvent
from scaraspec_recorder.contents import TRIGGER, Contents
from scaraspec_recorder.deriver import Item, Output
from scaraspec_recorder.mcap_file import McapSink
from scaraspec_recorder.seams import stem
from scaraspec_recorder.sinks import Folder
from scaraspec_recorder.tally import DRAWN, Tally
from scaraspec_recorder.wording import Line


@dataclass(slots=True)
class Shelf:
    """Where file sets are put.

    Attributes:
        folder: The folder.
        contents: Its table of contents.
        robot: What the files are called by.
        session: What is known beforehand, such as the addresses.
        draw: Whether to write .rrd files too.
        written: The file sets that are being written.
    """

    folder: Folder
    contents: Contents
    robot: str
    session: Mapping[str, str] = field(default_factory=dict)
    draw: bool = True
    written: list["FileSet"] = field(default_factory=list)

    @property
    def written_bytes(self) -> int:
        """Size of what is being written."""
        return sum(files.size_bytes for files in self.written)

    def begin(
        self, time_ns: int, label: str = "", facts: Mapping[str, str] | None = None
    ) -> "FileSet":
        """Begin a file set.

        Args:
            time_ns: Its time, by which it is called.
            label: The end of its name.
            facts: What is known of it alone.

        Raises:
            OSError: A file cannot be made.
            ImportError: Drawing needs an extra that is not installed; the text says which.
        """
        return FileSet(self, stem(time_ns, self.robot, label), {**self.session, **(facts or {})})


class FileSet:
    """An output that writes one capture.

    What `McapSink` and `RerunSink` raise goes through.

    Args:
        shelf: Where it is put.
        name: What its files are called, without suffixes.
        session: What is known of it.
    """

    def __init__(self, shelf: Shelf, name: str, session: Mapping[str, str]) -> None:
        self._shelf = shelf
        self._session = session
        self._tally = Tally()
        path = shelf.folder.new(f"{name}.mcap")
        self._paths: tuple[Path, ...] = (path,)
        self._outputs: tuple[Output, ...] = (
            McapSink(path.open("wb"), session, discard=path.unlink),
        )
        if shelf.draw:
            from scaraspec_recorder.rerun_view import RerunSink  # noqa: PLC0415 - an optional extra

            drawn = shelf.folder.new(f"{path.stem}{DRAWN}")
            self._paths = (path, drawn)
            self._outputs += (RerunSink.to_file(drawn, session),)
        shelf.written.append(self)

    @property
    def path(self) -> Path:
        """The capture file."""
        return self._paths[0]

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

    def tick(self, now_ns: int) -> None:
        """Make all of it durable."""
        for output in self._outputs:
            output.tick(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:
        """End the files, and list them.

        Args:
            summary: What is known of the whole recording; what this file holds is counted here.
        """
        for output in self._outputs:
            output.close({**summary, **self._tally.words})
        self._shelf.written.remove(self)
        entry = self._tally.entry(self._paths, self._session.get(TRIGGER, ""))
        self._shelf.contents.add(entry)
