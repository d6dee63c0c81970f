"""The interface between the writer process and its sinks.

A sink receives the events of a recording. It may be slow or fail without affecting the link.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.spool.durability import sync

TICK_NS = 250_000_000
"""Interval of `Sink.tick`: the maximum that a crash can cost a file."""


class SinkFailed(Exception):  # noqa: N818 - names a state of the sink
    """The sink cannot continue: disk full, read-only, I/O error.

    The writer process restarts with new sinks from the last tick that all sinks completed. The
    events since then are still in the spool and are delivered again.
    """


class FileRemoved(SinkFailed):
    """Another process has removed the file that a sink was writing: its content is lost.

    Args:
        name: Name of the file.
        begins: The offset at which each stream of an open connection began in the file.
        lost_bytes: Recorded bytes in the file at the last tick, by direction.
    """

    def __init__(
        self,
        name: str,
        begins: Mapping[tuple[str, Direction], int],
        lost_bytes: Mapping[Direction, int],
    ) -> None:
        super().__init__(f"{name} was removed while it was written")
        self.name = name
        self.begins = begins
        self.lost_bytes = lost_bytes


class Sink(Protocol):
    """Receives the events of a recording, in order.

    Per connection and direction, offsets have no holes: missing bytes are a gap. A connection that
    was open before this sink was created starts with ``OPENED`` again; its first offset is then
    not 0.

    Any method may raise `SinkFailed` or `OSError` if its environment fails. Any other exception
    counts as a defect: the sink is disabled, the other sinks continue.
    """

    def write(self, event: WireEvent) -> None:
        """Process the next event."""

    def tick(self, now_ns: int) -> None:
        """Make all events so far durable. Called every `TICK_NS`, also without events.

        After a crash, events before a completed tick are not delivered again; later ones are.
        """

    def close(self) -> None:
        """Finish after the last event. Not called after a failure."""


class OutputFolder:
    """The output folder of a recording. Existing files are not overwritten.

    Args:
        path: The folder; it exists.
        files: Names of the files created so far; `new` adds to them.
        news: Extra metadata of the next file, see `take_metadata`.
    """

    def __init__(self, path: Path, files: list[str], news: Mapping[str, str] | None = None) -> None:
        self.path = path
        self._files = files
        self._metadata = dict(news or {})
        self._mark_callbacks: list[Callable[[], None]] = []

    def on_mark_request(self, do: Callable[[], None]) -> None:
        """Register a callback, called before a tick if the user has requested a mark."""
        self._mark_callbacks.append(do)

    def notify_mark_request(self) -> None:
        """Call the callbacks that `on_mark_request` registered."""
        for do in self._mark_callbacks:
            do()

    def take_metadata(self) -> dict[str, str]:
        """Return the extra metadata of the next file, once; later calls return nothing."""
        news, self._metadata = self._metadata, {}
        return news

    def sync(self) -> None:
        """Write the captures that may have changed since the last tick through to the device.

        A file lasts at least one tick, so these are the last two.

        Raises:
            OSError: The device failed.
        """
        captures = [name for name in self._files if name.endswith(".mcap")]
        sync((*(self.path / name for name in captures[-2:]), self.path))

    def new(self, name: str) -> Path:
        """Create an empty file, ``name.ext`` or else ``name-2.ext``, ``name-3.ext`` …; return it.

        Raises:
            OSError: The file cannot be created.
        """
        number, first = 1, self.path / name
        path = first
        while True:
            try:
                path.touch(exist_ok=False)
            except FileExistsError:
                number += 1
                path = first.with_stem(f"{first.stem}-{number}")
            else:
                self._files.append(path.name)
                return path


SinkFactory = Callable[[OutputFolder], Sink]
"""Creates a sink that writes new files into a folder. It must be picklable (a function of a module,
or a `functools.partial` of one): it is called in the writer process, again after each restart. A
sink that fails should remove its empty files."""
