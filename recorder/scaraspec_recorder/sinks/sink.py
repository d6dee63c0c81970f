"""Sinks: what takes the events of a recording, in the process of the scribe.

Law: the protocol between the scribe and whatever it feeds stands here, and no sink. A sink may be
slow, may fail, and dies with its process; the link never knows.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from scaraspec.traffic.wire import WireEvent

TICK_NS = 250_000_000
"""How often the scribe calls `Sink.tick`: what a crash can cost a file at most."""


class SinkFailed(Exception):  # noqa: N818 - it names what happened, and is often no error in Python
    """The sink cannot go on: disk full, read-only, I/O error.

    The scribe gives up all its sinks and starts again with new ones from the last tick that all of
    them survived: what came since then is still in the spool and comes again.
    """


class Sink(Protocol):
    """Takes the events of a recording, in order.

    Per connection and direction, offsets leave no hole: what is missing is a gap. A connection that
    was open before this sink was made begins here with ``OPENED`` again, and its first offset is
    then not 0.

    Any method may raise `SinkFailed` or `OSError` where its surroundings fail it. Any other error
    is a defect: the sink is given up, its fellows go on.
    """

    def write(self, event: WireEvent) -> None:
        """Take the next event."""

    def tick(self, now_ns: int) -> None:
        """Make everything taken so far durable; called every `TICK_NS`, also when nothing came.

        What was taken before a tick that returned is not given again after a crash; what came
        after it is.
        """

    def close(self) -> None:
        """End in order: nothing more will come. It is not called after a failure."""


class OutputFolder:
    """The folder that a recording is written into. Nothing in it is overwritten.

    Args:
        path: Where it is; it is there.
        files: Names of the files made so far; `new` adds to them.
        news: What the next file is to say of itself, see `take_metadata`.
    """

    def __init__(self, path: Path, files: list[str], news: Mapping[str, str] | None = None) -> None:
        self.path = path
        self._files = files
        self._metadata = dict(news or {})
        self._mark_callbacks: list[Callable[[], None]] = []

    def on_mark_request(self, do: Callable[[], None]) -> None:
        """Call `do` just before a tick if the user has asked for a mark since the last one."""
        self._mark_callbacks.append(do)

    def notify_mark_request(self) -> None:
        """The user asks for a mark: call what `on_mark_request` was given."""
        for do in self._mark_callbacks:
            do()

    def take_metadata(self) -> dict[str, str]:
        """Return what a new file is to say besides what it always says; once, then nothing."""
        news, self._metadata = self._metadata, {}
        return news

    def new(self, name: str) -> Path:
        """Create an empty file, ``name.ext`` or else ``name-2.ext``, ``name-3.ext`` …; return it.

        Raises:
            OSError: It cannot be created.
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
"""Makes a sink that writes new files into a folder. It must be picklable (a function of a module,
or a `functools.partial` of one), for it is called in the process of the scribe, and again after
each death of that. A file that holds nothing when a sink fails is best removed by it."""
