"""The scribe: reads the spool and gives its sinks the events of the recording.

Lives here: when sinks are made, fed, ticked and given up, and what is acknowledged when. Runs in a
process of its own, which may be slow, fail and start again. What records mean stands in `unspool`;
what a sink makes of the events is its affair.
"""

import gc
import logging
import socket
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.child_process import REPORTED_EXIT_STATUS, ignore_signals
from scaraspec_recorder.sinks.file_names import utc_time
from scaraspec_recorder.sinks.sink import TICK_NS, OutputFolder, Sink, SinkFactory, SinkFailed
from scaraspec_recorder.spool.event_builder import ByteCounts, EventBuilder
from scaraspec_recorder.spool.records import UNREACHABLE
from scaraspec_recorder.spool.spool import SpoolReader, WriteStall, note_stall

POLL_S: Final = 0.05
"""How long the scribe waits before it looks again into a spool that held nothing new."""

MAX_LISTED_FILES: Final = 100
"""How many files a progress names: a recorder that goes on for weeks may make thousands a day."""

_COLLECT_AFTER: Final = 20_000  # new objects: hardly any is in a cycle

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class Progress:
    """How far a recording has come.

    Attributes:
        connections: How many were opened.
        a2c: What came from clients.
        c2a: What came from controllers.
        files: Names of the latest files made, in the folder of the recording.
        problems: Sinks that were given up, each with its reason.
        finished: Whether the scribe has taken everything and closed its sinks.
        earlier_files: How many files were made before those in `files`.
        unreached: Why the robot cannot be reached, as long as nothing comes from it.
    """

    connections: int = 0
    a2c: ByteCounts = field(default_factory=ByteCounts)
    c2a: ByteCounts = field(default_factory=ByteCounts)
    files: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    finished: bool = False
    earlier_files: int = 0
    unreached: str = ""

    @classmethod
    def read(cls, state: Mapping[str, Any]) -> "Progress":
        """Return what a scribe acknowledged last, see `SpoolReader.state`."""
        if not (kept := state.get("progress")):
            return cls()
        return cls(**{**kept, "a2c": ByteCounts(**kept["a2c"]), "c2a": ByteCounts(**kept["c2a"])})


class _Guarded:
    """A sink whose defects cost the others nothing: it is given up, and that is told."""

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
        except (OSError, SinkFailed):
            raise
        except Exception as error:  # noqa: BLE001 - a sink's defect, whatever it is, is its own
            name = type(self._sink).__name__ if self._sink else "a sink"
            _log.exception("%s has a defect and is given up", name)
            problem = f"{name} is given up: {error}"
            if problem not in self._problems:  # it comes again with each scribe, for weeks perhaps
                self._problems.append(problem)
            self._sink = None


class SinkRunner:
    """Feeds the sinks from the spool.

    Args:
        reader: The spool.
        out_dir: Where the sinks write.
        sinks: Make the sinks; called at once.
        now_ns: The clock.

    Raises:
        OSError: From every method, as `SinkFailed`: the surroundings failed. This scribe is to be
            given up, sinks and all; the next one goes on from the last tick.
    """

    def __init__(
        self,
        reader: SpoolReader,
        out_dir: Path,
        sinks: Sequence[SinkFactory],
        *,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._reader = reader
        self._mark_requests: int = reader.state.get("asked", 0)
        self._now_ns = now_ns
        self._ticked_ns = now_ns()
        self.progress = Progress.read(reader.state)
        state = reader.state
        if self.progress.finished:  # that recording is over, only its spool is still there
            self.progress, state = Progress(), {}
        counts = {A2C: self.progress.a2c, C2A: self.progress.c2a}
        self._event_builder = EventBuilder(counts, state.get("unspooler", {}))
        stall = reader.stall
        news = {"interrupted": _words(stall)} if stall else None
        self._folder = folder = OutputFolder(out_dir, self.progress.files, news)
        self._sinks = [_Guarded(partial(make, folder), self.progress.problems) for make in sinks]
        begin_ns = self._event_builder.time_ns  # what comes next is as old as that
        reopened = list(
            self._event_builder.reopening_events(now_ns() if begin_ns is None else begin_ns)
        )
        for sink in self._sinks:
            sink.write(reopened)

    def step(self) -> bool:
        """Hand over what one read of the spool gets, and tick where it is time.

        Returns:
            Whether the spool held anything new.
        """
        records = self._reader.read()
        self._write_events(self._event_builder.take(records))
        now_ns = self._now_ns()
        if not 0 <= now_ns - self._ticked_ns < TICK_NS:  # the clock may have been set back
            self._forward_mark_request()
            self._tick(now_ns)
            self._acknowledge()
        return bool(records)

    def finish(self) -> None:
        """Nothing more will come: end what is open, and close the sinks."""
        now_ns = self._now_ns()
        self._write_events(self._event_builder.end_all(now_ns, "the recording ended"))
        if self._forward_mark_request():
            self._tick(now_ns)
        for sink in self._sinks:
            sink.close()
        self.progress.finished = True
        self._acknowledge()

    def _forward_mark_request(self) -> bool:
        """Pass on that the user asks for a mark, if so; return whether."""
        asked = self._reader.mark_request_count()
        news = asked > self._mark_requests
        if news:
            self._folder.notify_mark_request()
        self._mark_requests = asked
        return news

    def _tick(self, now_ns: int) -> None:
        self._ticked_ns = now_ns
        for sink in self._sinks:
            sink.tick(now_ns)

    def _write_events(self, events: Sequence[WireEvent]) -> None:
        self.progress.connections = self._event_builder.connections
        for event in events:
            if event.kind is Kind.RESET and event.note.startswith(UNREACHABLE):
                self.progress.unreached = event.note.removeprefix(UNREACHABLE)
            elif event.kind is Kind.BYTES and event.direction is C2A:
                self.progress.unreached = ""
        for sink in self._sinks:
            sink.write(events)

    def _acknowledge(self) -> None:
        if stall := self._reader.stall:
            _log.warning("the recording goes on: %s", _words(stall))
        forgotten = self.progress.files[:-MAX_LISTED_FILES]
        self.progress.earlier_files += len(forgotten)
        del self.progress.files[: len(forgotten)]
        progress = asdict(self.progress)
        state = {
            "progress": progress,
            "unspooler": self._event_builder.state,
            "asked": self._mark_requests,
        }
        self._reader.acknowledge(state)


def run_writer(
    spool: Path, out_dir: Path, sinks: Sequence[SinkFactory], line: socket.socket
) -> None:
    """Be the scribe's process: follow the spool until the line is closed and all is written.

    Exits with status `REPORTED_EXIT_STATUS` where the surroundings fail, to be started again.
    """
    ignore_signals()

    def ended(timeout_s: float) -> bool:
        line.settimeout(timeout_s)
        try:
            return not line.recv(1)
        except (BlockingIOError, TimeoutError):
            return False

    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        runner = SinkRunner(SpoolReader(spool), out_dir, sinks)
        collect_rarely()
        complete = False
        while True:
            complete = complete or ended(0)  # asked first: what the tap wrote before is then there
            if runner.step():
                continue
            if complete:
                break
            complete = ended(POLL_S)
        runner.finish()
    except (OSError, SinkFailed) as error:
        reason = getattr(error, "strerror", None) or str(error)
        if note_stall(spool, time.time_ns(), reason):  # else it was said before
            _log.error("the recording is interrupted: %s", error)
        sys.exit(REPORTED_EXIT_STATUS)


def collect_rarely() -> None:
    """Have this process look for cycles as seldom as a scribe does."""
    gc.freeze()  # what was imported lives on: no collection need look at it
    gc.set_threshold(_COLLECT_AFTER)


def _words(stall: WriteStall) -> str:
    since = f"{utc_time(stall.since_ns):%Y-%m-%d %H:%M:%S} UTC"
    return f"nothing was written since {since}: {stall.reason}"
