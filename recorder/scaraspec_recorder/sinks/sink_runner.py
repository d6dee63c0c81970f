"""The writer process: reads the spool and passes the events to the sinks.

Belongs here: creation, ticks and failures of sinks, and acknowledgment of the spool. The process
may be slow, fail and restart. `event_builder` converts records to events.
"""

import gc
import logging
import os
import socket
import sys
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.child_process import REPORTED_EXIT_STATUS, ignore_signals
from scaraspec_recorder.sinks.file_names import utc_time
from scaraspec_recorder.sinks.own_files import umask_of
from scaraspec_recorder.sinks.sink import (
    ENVIRONMENT_FAILURES,
    MAX_DELAY_NS,
    MAX_TICK_NS,
    TICK_NS,
    FileRemoved,
    OutputFolder,
    Sink,
    SinkFactory,
    SinkFailed,
    SinkState,
)
from scaraspec_recorder.spool.event_builder import ByteCounts, EventBuilder
from scaraspec_recorder.spool.records import UNREACHABLE
from scaraspec_recorder.spool.spool import (
    SpoolReader,
    WriteStall,
    note_stall,
    read_checkpoint,
    replace_state,
)

POLL_S: Final = 0.05
"""Interval at which an empty spool is polled."""

MAX_LISTED_FILES: Final = 100
"""Maximum number of files named in `Progress.files`: there may be thousands per day."""

_NO_THREAD: Final = "can't start new thread"  # a RuntimeError of Python without memory

_COLLECT_AFTER: Final = 20_000  # new objects; reference cycles are rare

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class Progress:
    """Progress of a recording.

    Attributes:
        connections: Number of connections so far.
        a2c: Counts of bytes from clients.
        c2a: Counts of bytes from controllers.
        files: Names of the latest files in the output folder.
        problems: Disabled sinks, each with the reason.
        finished: Whether all events are written and the sinks are closed.
        earlier_files: Number of files created before those in `files`.
        unreached: Why the robot cannot be reached; empty after it has sent bytes.
        connecting_since_ns: Time of the oldest client that waits for the connection to the robot.
    """

    connections: int = 0
    a2c: ByteCounts = field(default_factory=ByteCounts)
    c2a: ByteCounts = field(default_factory=ByteCounts)
    files: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    finished: bool = False
    earlier_files: int = 0
    unreached: str = ""
    connecting_since_ns: int = 0

    @classmethod
    def read(cls, state: Mapping[str, Any]) -> "Progress":
        """Return the last acknowledged progress, see `SpoolReader.state`."""
        if not (kept := state.get("progress")):
            return cls()
        return cls(**{**kept, "a2c": ByteCounts(**kept["a2c"]), "c2a": ByteCounts(**kept["c2a"])})


class _Guarded:
    """A sink that is disabled and reported after a defect, without affecting the others."""

    def __init__(self, make: Callable[[], Sink], problems: list[str]) -> None:
        self._problems = problems
        self._sink: Sink | None = None
        with self._guard():
            self._sink = make()

    def write(self, events: Iterable[WireEvent]) -> None:
        if self._sink:
            with self._guard():
                for event in events:
                    self._sink.write(event)

    def tick(self, now_ns: int) -> None:
        if self._sink:
            with self._guard():
                self._sink.tick(now_ns)

    def close(self) -> None:
        if self._sink:
            with self._guard():
                self._sink.close()

    @contextmanager
    def _guard(self) -> Iterator[None]:
        try:
            yield
        except ENVIRONMENT_FAILURES:
            raise
        except Exception as error:  # noqa: BLE001 - a defect must not affect the other sinks
            if str(error) == _NO_THREAD:
                raise SinkFailed(_NO_THREAD) from None
            name = type(self._sink).__name__ if self._sink else "a sink"
            _log.exception("%s has a defect and is disabled", name)
            problem = f"{name} is disabled: {error}"
            if problem not in self._problems:  # repeated with each restart
                self._problems.append(problem)
            self._sink = None


class SinkRunner:
    """Passes the events of the spool to the sinks.

    Args:
        reader: The spool.
        out_dir: Output folder of the sinks.
        sinks: Factories of the sinks.
        now_ns: The clock.
        durable: Whether captures are on the device before their events are acknowledged.

    Raises:
        OSError: From every method, like `SinkFailed`: the environment failed. Discard this runner
            and its sinks; the next one continues from the last tick.
    """

    def __init__(
        self,
        reader: SpoolReader,
        out_dir: Path,
        sinks: Sequence[SinkFactory],
        *,
        now_ns: Callable[[], int] = time.time_ns,
        durable: bool = False,
    ) -> None:
        self._reader = reader
        self._durable = durable
        self._mark_requests: int = reader.state.get("asked", 0)
        self._now_ns = now_ns
        self._ticked_ns = now_ns()
        self._delayed_since_ns: dict[Hashable, int] = {}
        self.progress = Progress.read(reader.state)
        state = reader.state
        if self.progress.finished:  # that recording is complete; only its spool remains
            self.progress, state = Progress(), {}
        counts = {A2C: self.progress.a2c, C2A: self.progress.c2a}
        self._event_builder = EventBuilder(counts, state.get("unspooler", {}))
        stall = reader.stall
        news = {"interrupted": _stall_text(stall)} if stall else None
        self._folder = folder = OutputFolder(
            out_dir, self.progress.files, news, SinkState.read(state.get("sinks", {}))
        )
        self._sinks = [_Guarded(partial(make, folder), self.progress.problems) for make in sinks]
        begin_ns = self._event_builder.time_ns  # the next records follow this time
        removed = state.get("removed", {"name": "", "begins": ()})
        reopened = list(
            self._event_builder.reopening_events(
                now_ns() if begin_ns is None else begin_ns,
                {(name, Direction(way)): begin for name, way, begin in removed["begins"]},
                f"{removed['name']} was removed",
            )
        )
        for sink in self._sinks:
            sink.write(reopened)

    def step(self) -> bool:
        """Process one read of the spool, and tick if it is time.

        Returns:
            Whether the spool had new records.
        """
        records = self._reader.read()
        self._write_events(self._event_builder.take(records))
        now_ns = self._now_ns()
        since_ns = now_ns - self._ticked_ns  # negative if the clock was set back
        if not 0 <= since_ns < TICK_NS and not self._delays_tick(now_ns):
            self._forward_mark_request()
            self._tick(now_ns)
            self._acknowledge()
        return bool(records)

    def _delays_tick(self, now_ns: int) -> bool:
        """Whether a tick that is due waits for the end of a frame.

        The limit counts for each frame, and not from the last tick: if frames arrive in parts, or
        if this process has not run for a second, the frame may have just begun.
        """
        since_ns = self._delayed_since_ns
        unfinished = self._folder.unfinished_frames()
        self._delayed_since_ns = {name: since_ns.get(name, now_ns) for name in unfinished}
        begun_ns = self._delayed_since_ns.values()
        fresh = all(0 <= now_ns - begin_ns < MAX_TICK_NS - TICK_NS for begin_ns in begun_ns)
        return bool(unfinished) and fresh and 0 <= now_ns - self._ticked_ns < MAX_DELAY_NS

    def finish(self) -> None:
        """Close open connections and the sinks. No more records follow."""
        now_ns = self._now_ns()
        self._write_events(self._event_builder.end_all(now_ns, "the recording ended"))
        if self._forward_mark_request():
            self._tick(now_ns)
        for sink in self._sinks:
            sink.close()
        self.progress.finished = True
        self._acknowledge()

    def _forward_mark_request(self) -> bool:
        """Forward a new mark request of the user. Return whether there was one."""
        count = self._reader.mark_request_count()
        is_new = count > self._mark_requests
        if is_new:
            self._folder.notify_mark_request()
        self._mark_requests = count
        return is_new

    def _tick(self, now_ns: int) -> None:
        self._ticked_ns = now_ns
        self._delayed_since_ns = {}
        for sink in self._sinks:
            sink.tick(now_ns)

    def _write_events(self, events: Sequence[WireEvent]) -> None:
        self.progress.connections = self._event_builder.connections
        self.progress.connecting_since_ns = self._event_builder.connecting_since_ns
        for event in events:
            if event.kind is Kind.RESET and event.note.startswith(UNREACHABLE):
                why = event.note.removeprefix(UNREACHABLE)
                self.progress.unreached = why.partition("; ")[0]
            elif event.kind is Kind.BYTES and event.direction is C2A:
                self.progress.unreached = ""
        for sink in self._sinks:
            sink.write(events)

    def _acknowledge(self) -> None:
        if stall := self._reader.stall:
            _log.warning("writing continues: %s", _stall_text(stall))
        if self._durable:
            self._folder.sync()
        forgotten = self.progress.files[:-MAX_LISTED_FILES]
        self.progress.earlier_files += len(forgotten)
        del self.progress.files[: len(forgotten)]
        progress = asdict(self.progress)
        state = {
            "progress": progress,
            "unspooler": self._event_builder.state,
            "asked": self._mark_requests,
            "sinks": self._folder.state.json,
        }
        self._reader.acknowledge(state)


def run_writer(  # noqa: PLR0913, PLR0917 - the arguments of a process
    spool: Path,
    out_dir: Path,
    sinks: Sequence[SinkFactory],
    file_mode: int,
    durable: bool,  # noqa: FBT001 - as above
    line: socket.socket,
) -> None:
    """Main function of the writer process: write until the line is closed and the spool is empty.

    Its files get the access rights `file_mode`. If the environment fails, it exits with
    `REPORTED_EXIT_STATUS` and is restarted.
    """
    ignore_signals()
    os.umask(umask_of(file_mode))

    def ended(timeout_s: float) -> bool:
        line.settimeout(timeout_s)
        try:
            return not line.recv(1)
        except (BlockingIOError, TimeoutError):
            return False

    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        with closing(SpoolReader(spool, durable=durable)) as reader:
            try:
                runner = SinkRunner(reader, out_dir, sinks, durable=durable)
                collect_rarely()
                complete = False
                while True:
                    complete = complete or ended(0)  # checked before the spool is read to its end
                    if runner.step():
                        continue
                    if complete:
                        break
                    complete = ended(POLL_S)
                runner.finish()
            except FileRemoved:
                reader.restore()  # perhaps with the spool
                raise
    except ENVIRONMENT_FAILURES as error:
        if isinstance(error, FileRemoved):
            note_removal(spool, error)
        *_, text = str(error).splitlines() or (type(error).__name__,)  # MemoryError has no text
        reason = getattr(error, "strerror", None) or text
        if note_stall(spool, time.time_ns(), reason):  # otherwise it was logged before
            _log.error("writing is interrupted: %s", text)
        sys.exit(REPORTED_EXIT_STATUS)


def note_removal(spool: Path, removed: FileRemoved) -> None:
    """Count the content of a removed file as lost in the acknowledged state of a spool.

    The next writer process records a gap for each open connection.

    Raises:
        OSError: The checkpoint cannot be written.
    """
    state = read_checkpoint(spool).get("state")
    if not state:  # nothing was acknowledged: all events are delivered again
        return
    progress = Progress.read(state)
    for direction, count in ((A2C, progress.a2c), (C2A, progress.c2a)):
        if lost_bytes := removed.lost_bytes.get(direction, 0):
            count.recorded_bytes -= lost_bytes
            count.gap_bytes += lost_bytes
            count.gaps += 1
    total_bytes = sum(removed.lost_bytes.values())
    progress.problems.append(f"{removed}: {total_bytes} recorded bytes are lost")
    progress.files = [name for name in progress.files if name != removed.name]
    begins = [(name, way.value, begin) for (name, way), begin in removed.begins.items()]
    noted = {"progress": asdict(progress), "removed": {"name": removed.name, "begins": begins}}
    replace_state(spool, {**state, **noted})


def count_unwritten(spool: Path) -> Progress:
    """Return the progress of a recording whose writer process has ended, with the spooled bytes.

    Raises:
        OSError: The spool cannot be read.
    """
    with closing(SpoolReader(spool)) as reader:
        progress, state = Progress.read(reader.state), reader.state
        if progress.finished:  # of an earlier recording
            progress, state = Progress(), {}
        counts = {A2C: progress.a2c, C2A: progress.c2a}
        written_bytes = {direction: count.recorded_bytes for direction, count in counts.items()}
        builder = EventBuilder(counts, state.get("unspooler", {}))
        while records := reader.read():
            builder.take(records)
    for direction, count in counts.items():
        count.spooled_bytes = count.recorded_bytes - written_bytes[direction]
        count.recorded_bytes = written_bytes[direction]
    progress.connections = builder.connections
    return progress


def collect_rarely() -> None:
    """Run the cyclic garbage collector rarely in this process."""
    gc.freeze()  # imported objects stay alive: exclude them from collections
    gc.set_threshold(_COLLECT_AFTER)


def _stall_text(stall: WriteStall) -> str:
    since = f"{utc_time(stall.since_ns):%Y-%m-%d %H:%M:%S} UTC"
    return f"nothing was written since {since}: {stall.reason}"
