"""The writer process passes the events of the spool to the sinks completely, also after a crash."""

import errno
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.clock_watch import ClockState
from scaraspec_recorder.sinks.sink import (
    MAX_DELAY_NS,
    MAX_TICK_NS,
    TICK_NS,
    FileRemoved,
    OutputFolder,
    SinkFailed,
)
from scaraspec_recorder.sinks.sink_runner import (
    MAX_LISTED_FILES,
    Progress,
    SinkRunner,
    count_unwritten,
    note_removal,
)
from scaraspec_recorder.spool.event_builder import ByteCounts
from scaraspec_recorder.spool.records import ControlRecord, stream_number, unforwarded_record
from scaraspec_recorder.spool.spool import (
    SpoolReader,
    SpoolWriter,
    note_stall,
    read_checkpoint,
    stall_of,
)

STREAM = stream_number(1, A2C)
OTHER = stream_number(1, C2A)


class RecordingSink:
    """A sink that stores events, and knows which are durable."""

    def __init__(self) -> None:
        self.events: list[WireEvent] = []
        self.durable = 0
        self.closed = False

    def write(self, event: WireEvent) -> None:
        self.events.append(event)

    def tick(self, now_ns: int) -> None:
        """Let the runner process everything, a quarter of a second later."""
        assert now_ns
        self.durable = len(self.events)

    def close(self) -> None:
        self.closed = True

    def stored_events(self) -> list[tuple]:
        return [
            (e.connection, e.direction, e.kind, e.offset_bytes, e.data or e.length_bytes)
            for e in self.events
        ]


class FailingSink(RecordingSink):
    """A sink that raises an error in one of its methods."""

    def __init__(self, method: str, error: Exception) -> None:
        super().__init__()
        self.calls: list[str] = []
        self._method, self._error = method, error

    def write(self, event: WireEvent) -> None:
        self._call("write")
        super().write(event)

    def tick(self, now_ns: int) -> None:
        self._call("tick")
        super().tick(now_ns)

    def close(self) -> None:
        self._call("close")
        super().close()

    def _call(self, method: str) -> None:
        self.calls.append(method)
        if method == self._method:
            raise self._error


class RemovedSink(RecordingSink):
    """A sink whose file is removed after the first tick."""

    def tick(self, now_ns: int) -> None:
        if len(self.events) > 6:
            begins = {("1", A2C): 2, ("1", C2A): 0}
            raise FileRemoved("capture.mcap", begins, {A2C: 10, C2A: 3})
        super().tick(now_ns)


class Bench:
    """A spool with its writer, and runners that read it with a simulated clock."""

    def __init__(self, directory: Path) -> None:
        self.spool = directory / "spool"
        self.out_dir = directory
        self.now_ns = 1_000
        self.writer = self.new_writer()
        self.readers: list[SpoolReader] = []

    def new_writer(self) -> SpoolWriter:
        return SpoolWriter(self.spool, lambda _delay, _callback: None, now_ns=lambda: self.now_ns)

    def put(
        self,
        kind: Kind | ControlRecord,
        stream: int = STREAM,
        offset: int = 0,
        payload: bytes = b"",
    ) -> None:
        self.writer.append(kind, stream, self.now_ns, offset, payload)
        self.writer.flush()

    def runner(self, *sinks: RecordingSink) -> SinkRunner:
        """Return a new runner; the previous one has been killed."""
        for reader in self.readers:
            reader.close()
        self.readers = [SpoolReader(self.spool)]
        makes = [lambda _folder, sink=sink: sink for sink in sinks]
        return SinkRunner(self.readers[0], self.out_dir, makes, now_ns=lambda: self.now_ns)

    def tick(self, runner: SinkRunner) -> None:
        """Let the runner process everything, a quarter of a second later."""
        self.now_ns += TICK_NS
        while runner.step():
            pass


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.writer.close()
    for reader in made.readers:
        reader.close()


def test_all_events_of_a_connection(bench: Bench) -> None:
    """Every field of every event, as recorded by the tap."""
    sink = RecordingSink()
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.put(Kind.BYTES, payload=b"abc")
    bench.put(Kind.BYTES, OTHER, 0, b"de")
    bench.put(Kind.HALF_CLOSED, offset=3)
    bench.put(ControlRecord.TOTAL, offset=3)
    bench.put(ControlRecord.TOTAL, OTHER, 2)
    bench.put(Kind.RESET, OTHER, 2, "断开".encode())
    runner = bench.runner(sink)
    while runner.step():
        pass
    assert sink.events == [
        WireEvent(1_000, "1", A2C, Kind.OPENED, note="a > b"),
        WireEvent(1_000, "1", A2C, Kind.BYTES, b"abc"),
        WireEvent(1_000, "1", C2A, Kind.BYTES, b"de"),
        WireEvent(1_000, "1", A2C, Kind.HALF_CLOSED, offset_bytes=3),
        WireEvent(1_000, "1", C2A, Kind.RESET, offset_bytes=2, note="断开"),
    ]
    assert runner.progress == Progress(1, ByteCounts(3), ByteCounts(2))


def test_a_pending_connection_and_what_it_does_not_forward(bench: Bench) -> None:
    """The time since the client waits is known; the bytes are counted and noted at the end."""
    sink = RecordingSink()
    runner = bench.runner(sink)
    for number in (1, 2):
        bench.put(Kind.OPENED, stream_number(number, A2C), payload=b"a > b")
    runner.step()
    assert runner.progress.connecting_since_ns == 1_000
    bench.put(ControlRecord.CONNECTED, stream_number(1, C2A))
    bench.writer.append(*unforwarded_record(stream_number(2, A2C), 2_000, 5, "too early"))
    bench.put(Kind.RESET, stream_number(2, C2A), payload=b"no connection: timed out")
    runner.step()
    assert runner.progress.connecting_since_ns == 0
    assert runner.progress.a2c.unforwarded_bytes == {"too early": 5}
    assert runner.progress.unreached == "timed out"
    dropped = "not forwarded from the client: 5 bytes, too early"
    assert sink.events[-1].note == f"no connection: timed out; {dropped}"


def test_an_unreachable_robot_is_known_until_it_sends(
    bench: Bench,
) -> None:
    """The next runner also knows it."""
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.put(Kind.RESET, OTHER, payload=b"no connection: No route to host")
    bench.tick(bench.runner(RecordingSink()))
    runner = bench.runner(RecordingSink())
    client, robot = stream_number(2, A2C), stream_number(2, C2A)
    bench.put(Kind.OPENED, client, payload=b"a > b")
    bench.put(Kind.BYTES, client, payload=b"abc")
    bench.tick(runner)
    assert runner.progress.unreached == "No route to host"
    bench.put(Kind.BYTES, robot, payload=b"de")
    bench.tick(runner)
    assert not runner.progress.unreached


def test_ticks(bench: Bench) -> None:
    """Every quarter of a second, with or without traffic; also if the clock was set back."""
    sink = FailingSink("", ValueError())
    runner = bench.runner(sink)
    for step_ns, ticks in ((TICK_NS - 1, 0), (1, 1), (TICK_NS - 1, 1), (1, 2), (-5 * TICK_NS, 3)):
        bench.now_ns += step_ns
        runner.step()
        assert sink.calls == ["tick"] * ticks


def test_events_after_the_last_tick_are_delivered_again(bench: Bench) -> None:
    """A runner that dies between ticks loses nothing; earlier events are not delivered twice."""
    first, second = RecordingSink(), RecordingSink()
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.put(Kind.BYTES, payload=b"abc")
    runner = bench.runner(first)
    bench.tick(runner)
    bench.tick(runner)
    bench.put(Kind.BYTES, offset=3, payload=b"de")
    runner.step()
    assert len(first.events) == first.durable + 1
    bench.put(Kind.BYTES, offset=5, payload=b"f")
    runner = bench.runner(second)
    bench.tick(runner)
    assert second.stored_events() == [
        ("1", A2C, Kind.OPENED, 3, 0),
        ("1", A2C, Kind.BYTES, 3, 0),
        ("1", A2C, Kind.BYTES, 3, b"de"),
        ("1", A2C, Kind.BYTES, 5, b"f"),
    ]
    assert second.events[0].note == first.events[0].note
    assert runner.progress == Progress(1, ByteCounts(6))


@pytest.mark.parametrize("method", ["write", "tick", "close"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "full"), SinkFailed("full")])
def test_a_full_disk_ends_the_runner(bench: Bench, method: str, error: Exception) -> None:
    """All sinks are replaced, and the new sinks get all events again."""
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.put(Kind.BYTES, payload=b"abc")
    runner = bench.runner(RecordingSink(), FailingSink(method, error))

    def work(runner: SinkRunner) -> None:
        bench.now_ns += TICK_NS
        while runner.step():
            pass
        runner.finish()

    with pytest.raises(type(error)):
        work(runner)
    sink = RecordingSink()
    bench.now_ns += TICK_NS
    runner = bench.runner(sink)
    work(runner)
    assert (sink.events[0].kind, sink.events[0].note) == (Kind.OPENED, "a > b")
    assert runner.progress.finished
    assert runner.progress.a2c.recorded_bytes == 3


def test_the_content_of_a_removed_file_becomes_a_gap(bench: Bench) -> None:
    """In the next file for each open connection, and in the counts for all connections."""
    closed, late = stream_number(2, A2C), stream_number(3, A2C)
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.put(Kind.BYTES, payload=b"abcde")
    bench.put(Kind.BYTES, OTHER, payload=b"fgh")
    bench.put(Kind.OPENED, closed)
    bench.put(Kind.BYTES, closed, payload=b"ijklmno")
    bench.put(Kind.CLOSED, closed, offset=7)
    first = RemovedSink()
    runner = bench.runner(first)
    bench.tick(runner)
    bench.put(Kind.BYTES, offset=5, payload=b"pq")
    bench.put(Kind.OPENED, late)
    with pytest.raises(FileRemoved) as raised:
        bench.tick(runner)
    note_removal(bench.spool, raised.value)
    for _ in range(2):  # also if the next runner dies before its first tick
        second = RecordingSink()
        runner = bench.runner(second)
    bench.tick(runner)
    assert second.stored_events() == [
        ("1", A2C, Kind.OPENED, 2, 0),
        ("1", A2C, Kind.BYTES, 2, 0),
        ("1", A2C, Kind.GAP, 2, 3),
        ("1", C2A, Kind.GAP, 0, 3),
        ("1", A2C, Kind.BYTES, 5, b"pq"),
        ("3", A2C, Kind.OPENED, 0, 0),
    ]
    assert second.events[2].note == "capture.mcap was removed"
    progress = runner.progress
    assert (progress.a2c, progress.c2a) == (ByteCounts(4, 10, 1), ByteCounts(0, 3, 1))
    assert progress.problems == [
        "capture.mcap was removed while it was written: 13 recorded bytes are lost"
    ]


def test_sinks_remember_passwords_and_the_clock(bench: Bench) -> None:
    """Another writer process continues with what the last tick saved."""
    runner = bench.runner(RecordingSink())
    state = runner._folder.state
    state.passwords.append(b"open sesame")
    state.clock = ClockState("boot", 5, was_set=True)
    bench.tick(runner)
    state.passwords.append(b"not saved")
    assert bench.runner(RecordingSink())._folder.state.json == {
        "passwords": [b"open sesame".hex()],
        "clock": ("boot", 5, True),
    }


def test_a_tick_waits_for_the_end_of_a_frame(bench: Bench) -> None:
    """For a second at most."""
    sink = RecordingSink()
    runner = bench.runner(sink)
    runner._folder.delay_ticks_while(lambda: ["a frame"])
    bench.put(Kind.OPENED)
    durable = []
    for _ in range(MAX_TICK_NS // TICK_NS):
        bench.tick(runner)
        durable.append(sink.durable)
    assert durable == [0, 0, 0, 1]


def test_a_tick_waits_for_a_frame_after_a_pause_of_the_process(bench: Bench) -> None:
    """The frame may have just begun: masking it now would change the frames of the capture."""
    sink = RecordingSink()
    runner = bench.runner(sink)
    unfinished = ["a frame"]
    runner._folder.delay_ticks_while(lambda: unfinished)
    bench.put(Kind.OPENED)
    bench.now_ns += 3 * MAX_TICK_NS
    bench.tick(runner)
    assert sink.durable == 0
    unfinished.clear()
    bench.tick(runner)
    assert sink.durable == 1


def test_a_tick_waits_for_frames_that_all_arrive_in_parts(bench: Bench) -> None:
    """The limit counts for each frame; for ten seconds at most."""
    sink = RecordingSink()
    runner = bench.runner(sink)
    frames = iter(range(1_000))
    runner._folder.delay_ticks_while(lambda: [next(frames)])
    bench.put(Kind.OPENED)
    durable = []
    for _ in range(MAX_DELAY_NS // TICK_NS):
        bench.tick(runner)
        durable.append(sink.durable)
    assert durable == [0] * (len(durable) - 1) + [1]


def test_unwritten_bytes_are_counted(bench: Bench) -> None:
    """Also if the writer process has never written, or has written the recording before."""
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.put(Kind.BYTES, payload=b"abc")
    runner = bench.runner(RecordingSink())
    bench.tick(runner)
    bench.put(Kind.BYTES, offset=3, payload=b"de")
    bench.readers.pop().close()
    progress = count_unwritten(bench.spool)
    assert progress.a2c == ByteCounts(3, spooled_bytes=2)
    assert (progress.connections, progress.a2c.received_bytes) == (1, 5)
    bench.tick(runner := bench.runner(RecordingSink()))
    runner.finish()
    bench.put(ControlRecord.RESTART, 0)
    bench.put(Kind.OPENED)
    bench.put(Kind.BYTES, OTHER, payload=b"f")
    bench.readers.pop().close()
    assert count_unwritten(bench.spool).c2a == ByteCounts(spooled_bytes=1)


@pytest.mark.parametrize("method", ["write", "tick", "close"])
def test_a_defect_disables_only_its_sink(bench: Bench, method: str) -> None:
    """The other sinks continue, and the defect is reported."""
    good, bad = RecordingSink(), FailingSink(method, ZeroDivisionError("no such axis"))
    runner = bench.runner(bad, good)
    bench.put(Kind.OPENED)
    for offset in range(3):
        bench.put(Kind.BYTES, offset=offset, payload=b"x")
        bench.tick(runner)
    runner.finish()
    assert [e.data for e in good.events if e.kind is Kind.BYTES] == [b"x"] * 3
    assert good.closed
    assert bad.calls.count(method) == 1
    assert bad.calls[-1] == method
    assert runner.progress.problems == ["FailingSink is disabled: no such axis"]


def test_a_sink_that_cannot_be_created(bench: Bench) -> None:
    """It is disabled, and the other sinks continue."""

    def make(_folder: OutputFolder) -> RecordingSink:
        raise ZeroDivisionError("no such axis")

    bench.writer.flush()
    sink = RecordingSink()
    bench.readers = [SpoolReader(bench.spool)]
    runner = SinkRunner(bench.readers[0], bench.out_dir, [make, lambda _: sink])
    bench.put(Kind.OPENED)
    runner.step()
    assert len(sink.events) == 1
    assert runner.progress.problems == ["a sink is disabled: no such axis"]


@pytest.mark.parametrize("error", [MemoryError(), ImportError("no memory"), SystemError()])
def test_a_lack_of_memory_is_no_defect(bench: Bench, error: Exception) -> None:
    """Another writer process continues; until then nothing counts as recorded."""
    runner = bench.runner(FailingSink("write", error))
    bench.put(Kind.OPENED)
    bench.put(Kind.BYTES, payload=b"x")
    with pytest.raises(type(error)):
        bench.tick(runner)
    assert runner.progress.problems == []
    bench.readers.pop().close()
    assert count_unwritten(bench.spool).a2c == ByteCounts(spooled_bytes=1)


def test_a_lack_of_threads_is_no_defect(bench: Bench) -> None:
    """Python raises a RuntimeError then."""
    runner = bench.runner(FailingSink("write", RuntimeError("can't start new thread")))
    bench.put(Kind.OPENED)
    with pytest.raises(SinkFailed):
        bench.tick(runner)


def test_gaps_are_counted(bench: Bench) -> None:
    """received = recorded + gaps; a gap keeps its position, length, time and reason."""
    bench.writer = SpoolWriter(
        bench.spool, lambda _delay, _callback: None, limit_bytes=1_600, now_ns=lambda: 5
    )
    sink = RecordingSink()
    bench.put(Kind.OPENED)
    for offset in range(0, 4_000, 100):
        bench.put(Kind.BYTES, offset=offset, payload=bytes(100))
    bench.put(ControlRecord.TOTAL, offset=4_000)
    bench.put(Kind.CLOSED, offset=4_000)
    bench.writer.close()
    runner = bench.runner(sink)
    bench.tick(runner)
    (gap,) = (e for e in sink.events if e.kind is Kind.GAP)
    count = runner.progress.a2c
    assert gap.length_bytes == count.gap_bytes > 0
    assert gap.note == "the spool has reached its limit of 1600 bytes"
    assert count.received_bytes == 4_000
    assert (count.gaps, count.unknown_gaps) == (1, 0)


@pytest.mark.parametrize("missing", ["in the middle", "at the end"])
def test_missing_records_become_a_gap(bench: Bench, missing: str) -> None:
    """Offsets and the counts of the tap show any loss in the spool."""
    sink = RecordingSink()
    bench.put(Kind.OPENED)
    bench.put(Kind.BYTES, payload=b"abc")
    if missing == "in the middle":
        bench.put(Kind.BYTES, offset=10, payload=b"klm")
    bench.put(ControlRecord.TOTAL, offset=13)
    bench.put(Kind.CLOSED, offset=13)
    bench.tick(runner := bench.runner(sink))
    gap = ("1", A2C, Kind.GAP, 3, 7 if missing == "in the middle" else 10)
    assert gap in sink.stored_events()
    assert runner.progress.a2c.received_bytes == 13


def test_a_restart_ends_open_connections(bench: Bench) -> None:
    """The tap died: open connections are closed after gaps of unknown length; names continue."""
    sink = RecordingSink()
    bench.put(Kind.OPENED)
    bench.put(Kind.BYTES, payload=b"abc")
    bench.writer.close()
    bench.writer = bench.new_writer()
    bench.put(Kind.OPENED)
    bench.put(Kind.BYTES, payload=b"de")
    runner = bench.runner(sink)
    bench.tick(runner)
    assert sink.stored_events() == [
        ("1", A2C, Kind.OPENED, 0, 0),
        ("1", A2C, Kind.BYTES, 0, b"abc"),
        ("1", A2C, Kind.GAP, 3, -1),
        ("1", C2A, Kind.GAP, 0, -1),
        ("1", A2C, Kind.CLOSED, 3, 0),
        ("2", A2C, Kind.OPENED, 0, 0),
        ("2", A2C, Kind.BYTES, 0, b"de"),
    ]
    assert sink.events[4].note == "the forwarding process started"
    assert (runner.progress.a2c.unknown_gaps, runner.progress.connections) == (1, 2)


def test_names_continue_after_a_crash_and_a_restart(bench: Bench) -> None:
    """No two connections of a recording have the same name."""
    names: list[str] = []
    for _ in range(3):
        sink = RecordingSink()
        bench.put(Kind.OPENED)
        bench.tick(bench.runner(sink))
        names += [e.connection for e in sink.events if e.kind is Kind.OPENED]
        bench.put(Kind.CLOSED)
        bench.tick(bench.runner(RecordingSink()))
        bench.writer.close()
        bench.writer = bench.new_writer()
    assert names == ["1", "2", "3"]


def test_a_lost_opening_is_replaced(bench: Bench) -> None:
    """For sinks every connection starts with OPENED."""
    sink = RecordingSink()
    bench.put(Kind.BYTES, offset=50, payload=b"abc")
    bench.tick(bench.runner(sink))
    assert sink.stored_events() == [
        ("1", A2C, Kind.OPENED, 0, 0),
        ("1", A2C, Kind.BYTES, 50, b"abc"),
    ]
    assert sink.events[0].note == "its beginning is not recorded"


def test_the_end_of_the_recording_closes_connections(bench: Bench) -> None:
    """The tap was killed and not restarted: the real end of the connections is unknown."""
    sink = RecordingSink()
    bench.put(Kind.OPENED)
    bench.put(Kind.BYTES, payload=b"abc")
    runner = bench.runner(sink)
    while runner.step():
        pass
    runner.finish()
    assert [kind for _, _, kind, _, _ in sink.stored_events()][2:] == [
        Kind.GAP,
        Kind.GAP,
        Kind.CLOSED,
    ]
    assert sink.closed
    kept = Progress.read(read_checkpoint(bench.spool)["state"])
    assert kept == runner.progress
    assert kept.finished


def test_counts_start_again_after_a_finished_recording(bench: Bench) -> None:
    """The recorder was killed after the end, before the spool was removed."""
    bench.put(Kind.OPENED)
    runner = bench.runner(RecordingSink())
    runner.step()
    runner.finish()
    assert bench.runner(RecordingSink()).progress == Progress()


def test_ended_connections_are_not_kept(bench: Bench) -> None:
    """Weeks of short connections leave no state in memory or in the checkpoint."""
    runner = bench.runner(RecordingSink())
    for number in range(1, 200):
        for kind in (Kind.OPENED, Kind.CLOSED):
            bench.put(kind, stream_number(number, A2C))
    bench.tick(runner)
    bench.tick(runner)
    assert list(runner._event_builder.reopening_events(0, {}, "")) == []
    assert len((bench.spool / "checkpoint.json").read_bytes()) < 1_000


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    """Sinks of later runners get new file names, and all are listed."""
    (tmp_path / "capture.mcap").write_text("earlier")
    files: list[str] = []
    folder = OutputFolder(tmp_path, files)
    make: Callable[[], Path] = lambda: folder.new("capture.mcap")  # noqa: E731 - said once
    assert [make().name, make().name] == files == ["capture-2.mcap", "capture-3.mcap"]
    assert (tmp_path / "capture.mcap").read_text() == "earlier"


def test_reopened_connections_have_the_time_of_the_next_event(bench: Bench) -> None:
    """The time does not depend on when the next runner starts."""
    sink = RecordingSink()
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.tick(bench.runner())
    bench.now_ns += 1
    bench.put(Kind.BYTES, payload=b"abc")
    bench.now_ns += 3600 * 10**9
    runner = bench.runner(sink)
    bench.tick(runner)
    times = [event.time_ns for event in sink.events]
    assert times == sorted(times)


def test_progress_lists_only_the_latest_files(bench: Bench) -> None:
    """Other files are counted: the progress is written four times per second, for weeks."""
    bench.put(Kind.OPENED, payload=b"a > b")
    reader = SpoolReader(bench.spool)
    folders: list[OutputFolder] = []

    def make(folder: OutputFolder) -> RecordingSink:
        folders.append(folder)
        return RecordingSink()

    runner = SinkRunner(reader, bench.out_dir, [make], now_ns=lambda: bench.now_ns)
    for number in range(MAX_LISTED_FILES + 5):
        folders[0].new(f"{number}.mcap")
    bench.tick(runner)
    reader.close()
    progress = Progress.read(read_checkpoint(bench.spool)["state"])
    assert progress.files == [f"{number}.mcap" for number in range(5, MAX_LISTED_FILES + 5)]
    assert progress.earlier_files == 5


def test_a_stall_is_known_until_something_is_written(bench: Bench) -> None:
    """In the progress and in the next file; a continuing stall is logged once."""
    bench.put(Kind.OPENED, payload=b"a > b")
    bench.tick(bench.runner(RecordingSink()))
    assert note_stall(bench.spool, 5_000_000_000, "full")
    assert not note_stall(bench.spool, 6_000_000_000, "full")
    assert note_stall(bench.spool, 7_000_000_000, "broken")
    assert stall_of(read_checkpoint(bench.spool)) == (5_000_000_000, "broken")
    bench.readers.pop().close()
    reader = SpoolReader(bench.spool)
    folders: list[OutputFolder] = []

    def make(folder: OutputFolder) -> RecordingSink:
        folders.append(folder)
        return RecordingSink()

    runner = SinkRunner(reader, bench.out_dir, [make], now_ns=lambda: bench.now_ns)
    since = "nothing was written since 1970-01-01 00:00:05 UTC: broken"
    assert folders[0].take_metadata() == {"interrupted": since}
    assert folders[0].take_metadata() == {}
    assert runner.progress.connections == 1, "what was acknowledged is kept"
    bench.tick(runner)
    reader.close()
    assert stall_of(read_checkpoint(bench.spool)) is None


def test_a_stall_at_the_start(tmp_path: Path) -> None:
    """The folder is read-only from the start; a later runner starts like with a new spool."""
    SpoolReader(tmp_path).close()
    assert note_stall(tmp_path, 1, "read-only")
    reader = SpoolReader(tmp_path)
    assert (reader.state, reader.stall) == ({}, (1, "read-only"))
    reader.close()
