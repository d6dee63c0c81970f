"""The interface between the writer process and its sinks.

A sink receives the events of a recording. It may be slow or fail without affecting the link.
"""

import os
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.clock_watch import ClockState
from scaraspec_recorder.spool.durability import sync

TICK_NS = 250_000_000
"""Interval of `Sink.tick`: the maximum that a crash can cost a file."""


MAX_TICK_NS = 1_000_000_000
"""The same for a sink that waits for the end of a frame, see `OutputFolder.delay_ticks_while`."""

MAX_DELAY_NS = 10_000_000_000
"""The same for a sink that waits for one frame after the other."""

MAX_PASSWORDS: Final = 64
"""How many passwords are remembered."""


class SinkFailed(Exception):  # noqa: N818 - names a state of the sink
    """The sink cannot continue: disk full, read-only, I/O error.

    The writer process restarts with new sinks from the last tick that all sinks completed. The
    events since then are still in the spool and are delivered again.
    """


ENVIRONMENT_FAILURES: Final = (OSError, SinkFailed, MemoryError, ImportError, SystemError)
"""Exceptions after which new sinks may succeed. Without memory, imports fail in several ways."""


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

    Any method may raise one of `ENVIRONMENT_FAILURES`. Any other exception counts as a defect: the
    sink is disabled, the other sinks continue.
    """

    def write(self, event: WireEvent) -> None:
        """Process the next event."""

    def tick(self, now_ns: int) -> None:
        """Make all events so far durable. Called every `TICK_NS`, also without events.

        After a crash, events before a completed tick are not delivered again; later ones are.
        """

    def close(self) -> None:
        """Finish after the last event. Not called after a failure."""


@dataclass(slots=True)
class SinkState:
    """What the sinks of the next writer process must know. It is saved with each acknowledgment.

    Attributes:
        passwords: The latest passwords seen on the link. Set by `redaction`.
        clock: What was observed of the clock. Set by `archive`.
    """

    passwords: deque[bytes] = field(default_factory=lambda: deque(maxlen=MAX_PASSWORDS))
    clock: ClockState | None = None

    @classmethod
    def read(cls, saved: Mapping[str, Any]) -> "SinkState":
        """Return a saved state; without one, an empty state."""
        state = cls()
        state.passwords.extend(bytes.fromhex(each) for each in saved.get("passwords", ()))
        if clock := saved.get("clock"):
            state.clock = ClockState(*clock)
        return state

    @property
    def json(self) -> dict[str, Any]:
        """The state to save."""
        return {"passwords": [each.hex() for each in self.passwords], "clock": self.clock}


class OutputFolder:
    """The output folder of a recording. Existing files are not overwritten.

    Args:
        path: The folder; it exists.
        files: Names of the files created so far; `new` adds to them.
        news: Extra metadata of the next file, see `take_metadata`.
        state: State of earlier sinks; None for an empty one.
    """

    def __init__(
        self,
        path: Path,
        files: list[str],
        news: Mapping[str, str] | None = None,
        state: SinkState | None = None,
    ) -> None:
        self.path = path
        self.state = state or SinkState()
        self._files = files
        self._metadata = dict(news or {})
        self._mark_callbacks: list[Callable[[], None]] = []
        self._delays: list[Callable[[], Iterable[Hashable]]] = []

    def delay_ticks_while(self, unfinished: Callable[[], Iterable[Hashable]]) -> None:
        """Register what names the unfinished frames, each of which may delay a tick.

        Args:
            unfinished: Returns a name for each; the names of different frames differ.
        """
        self._delays.append(unfinished)

    def unfinished_frames(self) -> set[Hashable]:
        """Return the names of the frames whose end a tick should wait for."""
        return {name for unfinished in self._delays for name in unfinished()}

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

    def new(self, name: str, *, beside: str = "") -> Path:
        """Create an empty file, ``name.ext`` or else ``name-2.ext``, ``name-3.ext`` …; return it.

        Args:
            name: The name.
            beside: Another suffix, with which the name must be free, too.

        Raises:
            OSError: The file cannot be created.
        """
        number, path = 1, self.path / name
        first = path
        while not self._create(path, beside):
            number += 1
            path = first.with_stem(f"{first.stem}-{number}")
        self._files.append(path.name)
        return path

    @staticmethod
    def _create(path: Path, beside: str) -> bool:
        """Create an empty file; return whether the name was free."""
        if beside and os.path.lexists(path.with_suffix(beside)):
            return False
        try:
            path.touch(exist_ok=False)
        except FileExistsError:
            return False
        return True


SinkFactory = Callable[[OutputFolder], Sink]
"""Creates a sink that writes new files into a folder. It must be picklable (a function of a module,
or a `functools.partial` of one): it is called in the writer process, again after each restart. A
sink that fails should remove its empty files."""
