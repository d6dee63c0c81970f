"""Rotation: writes a recording into one file after another.

Rotation is an output, so decoding and judging continue across files: an exchange that spans two
files is judged normally and is written to the file in which it ends. A reader of a single file
cannot do that; therefore a file ends after a reply if one comes soon. The next file starts with its
first event or mark, so no file is empty. With a file for each connection, one without bytes, such
as a health check, gets no file. A file lasts at least one tick, because creating files
takes time and thousands of short connections must not delay writing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final

from scaraspec.protocol.direction import C2A
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks.decoder import Item, judge_summary
from scaraspec_recorder.sinks.open_connections import OpenConnections
from scaraspec_recorder.sinks.sink import TICK_NS
from scaraspec_recorder.sinks.text import LogLine
from scaraspec_recorder.spool.records import UNREACHABLE
from scaraspec_recorder.units import SECOND_NS, Limits, QuantityError, parse_limits

if TYPE_CHECKING:
    from scaraspec.judge.judge import Judge
    from scaraspec_recorder.recordings.recording_files import RecordingFiles, RecordingFolder

MAX_WAIT_TICKS: Final = 4
"""Maximum number of ticks to wait for a reply before a file ends."""

_LEAST: Final = Limits(SECOND_NS, 1_000_000)
_CONNECTION: Final = "connection"


@dataclass(frozen=True, slots=True)
class RotationPolicy:
    """When a file ends: after a duration, at a size, or when no connection is open."""

    limits: Limits = field(default_factory=Limits)
    each_connection: bool = False


def parse_rotation(text: str) -> RotationPolicy:
    """Parse ``1h``, ``512MB``, ``1h,512MB`` or ``connection``.

    Raises:
        QuantityError: The text is none of these, or the limit is too small.
    """
    if text.strip() == _CONNECTION:
        return RotationPolicy(each_connection=True)
    try:
        limits = parse_limits(text)
    except QuantityError as error:
        raise QuantityError(
            UserMessage("{error}, nor {connection}", error=error, connection=_CONNECTION)
        ) from None
    for value, least in (
        (limits.duration_ns, _LEAST.duration_ns),
        (limits.size_bytes, _LEAST.size_bytes),
    ):
        if value is not None and least is not None and value < least:
            raise QuantityError(
                UserMessage("{text} is too small for a file: use at least 1s or 1MB", text=text)
            )
    return RotationPolicy(limits)


class Rotation:
    """An output that writes one recording file after another.

    Args:
        shelf: The folder of the files.
        judge: The judge of the recording. Its tallies are cleared at each file change, so that a
            summary covers one file.
        rotate: When a file ends.
    """

    def __init__(
        self, recording_folder: "RecordingFolder", judge: "Judge", rotation: RotationPolicy
    ) -> None:
        self._folder = recording_folder
        self._judge = judge
        self._rotate = rotation
        self._links = OpenConnections()
        self._now_ns = 0
        self._files: RecordingFiles | None = None
        self._first_ns = 0  # time of its first event
        self._began_ns: int | None = None  # clock of the ticks
        self._due_ticks = 0  # ticks since the file must end
        self._quiet = True  # the last item was a complete frame of the controller
        self._held: dict[str, list[Callable[[], None]]] = {}  # connections without bytes so far
        self._holding: list[Callable[[], None]] | None = None  # that of the last event

    def write(self, event: WireEvent) -> None:
        """Write a raw event, into a new file if the current one must end."""
        if not self._rotate.each_connection or not self._hold(event):
            self._write(event)

    def _hold(self, event: WireEvent) -> bool:
        """Hold the events of a connection until it has bytes; drop them if it ends without."""
        name = event.connection
        if event.kind is Kind.OPENED:
            self._held[name] = []
        self._holding = held = self._held.get(name)
        if held is None:
            return False
        ended = event.kind in (Kind.CLOSED, Kind.RESET)
        if event.kind in (Kind.OPENED, Kind.HALF_CLOSED) or (
            ended and not event.note.startswith(UNREACHABLE)
        ):
            held.append(partial(self._write, event))
            if ended:
                del self._held[name]
            return True
        del self._held[name]
        self._holding = None
        for write in held:
            write()
        return False

    def _write(self, event: WireEvent) -> None:
        if self._due_ticks and self._quiet:
            self._end()
        self._now_ns = event.time_ns
        self._current(event.time_ns).write(event)
        self._links.update(event)
        self._quiet = event.kind is not Kind.BYTES
        if self._idle and not 0 <= event.time_ns - self._first_ns < TICK_NS:
            self._due_ticks = 1

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Write an item derived from the last event."""
        if self._holding is None:
            self._take(item, number, line)
        else:
            self._holding.append(partial(self._take, item, number, line))

    def _take(self, item: Item, number: int, line: LogLine | None) -> None:
        if isinstance(item, FrameSeen):
            self._quiet = item.frame.direction is C2A
        self._current(self._now_ns).take(item, number, line)

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Write a line of the log; if no file is open, into a new one."""
        self._current(time_ns).mark(time_ns, line)

    def tick(self, now_ns: int) -> None:
        """Make all data durable, and end the file if it is time."""
        if not self._files:
            return
        self._files.tick(now_ns)
        if self._began_ns is None:
            self._began_ns = now_ns
        limits, age_ns = self._rotate.limits, now_ns - self._began_ns
        # A negative age: the clock was set back, and the file's age is unknown.
        old = limits.duration_ns is not None and not 0 <= age_ns < limits.duration_ns
        large = limits.size_bytes is not None and self._files.size_bytes >= limits.size_bytes
        if old or large or self._idle or self._due_ticks:
            self._due_ticks += 1
            if self._quiet or self._due_ticks > MAX_WAIT_TICKS:
                self._end()

    def close(self, summary: Mapping[str, str]) -> None:
        """End the last file."""
        if self._files:
            self._files.close(summary)

    @property
    def _idle(self) -> bool:
        """Whether files end with connections and no connection is open."""
        return self._rotate.each_connection and not self._links

    def _current(self, time_ns: int) -> "RecordingFiles":
        """Return the current file; create one with this time if there is none."""
        if not self._files:
            self._files, self._first_ns = self._folder.create(time_ns), time_ns
            for opened in self._links.reopening_events(time_ns):
                self._files.write(opened)
        return self._files

    def _end(self) -> None:
        files, self._files, self._began_ns, self._due_ticks = self._files, None, None, 0
        if files:
            files.close(judge_summary(self._judge))
            self._judge.tallies.clear()
