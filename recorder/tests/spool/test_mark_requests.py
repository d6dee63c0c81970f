"""Mark requests of the user and of triggers survive the death of any process."""

from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from mcap.reader import make_reader

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.recordings.marks import SOURCE
from scaraspec_recorder.sinks.sink import TICK_NS, OutputFolder, SinkFactory, SinkFailed
from scaraspec_recorder.sinks.sink_runner import SinkRunner
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.spool.mark_requests import mark_request_count, request_mark
from scaraspec_recorder.spool.records import stream_number
from scaraspec_recorder.spool.spool import SpoolReader, SpoolWriter

STREAMS = {A2C: stream_number(1, A2C), C2A: stream_number(1, C2A)}


class RequestCounter:
    """A sink that counts mark requests, and may fail at a tick."""

    def __init__(self) -> None:
        self.times = 0
        self.fails = False

    def make(self, folder: OutputFolder) -> "RequestCounter":
        folder.on_mark_request(self.press)
        return self

    def press(self) -> None:
        self.times += 1

    def write(self, event: WireEvent) -> None:
        pass

    def tick(self, now_ns: int) -> None:  # noqa: ARG002 - a sink's
        if self.fails:
            raise SinkFailed("full")

    def close(self) -> None:
        pass


class Bench:
    """A spool with the events of a shift, and writers one after the other."""

    def __init__(self, folder: Path, now_ns: int) -> None:
        self.spool, self.out = folder / "spool", folder / "out"
        self.out.mkdir()
        self.now_ns = now_ns
        self._writer = SpoolWriter(self.spool, lambda _s, _do: None, now_ns=lambda: self.now_ns)
        self._writer.flush()
        self._reader: SpoolReader | None = None

    def close(self) -> None:
        self._writer.close()
        if self._reader:
            self._reader.close()

    def put(self, events: Iterable[WireEvent]) -> None:
        for event in events:
            stream, payload = STREAMS[event.direction], event.data or event.note.encode()
            self._writer.append(event.kind, stream, event.time_ns, event.offset_bytes, payload)
            self.now_ns = event.time_ns
        self._writer.flush()

    def runner(self, make: SinkFactory) -> SinkRunner:
        """Return a new writer; the one before is dead."""
        if self._reader:
            self._reader.close()
        self._reader = SpoolReader(self.spool)
        return SinkRunner(self._reader, self.out, [make], now_ns=lambda: self.now_ns)

    def tick(self, runner: SinkRunner) -> None:
        self.now_ns += TICK_NS
        while runner.step():
            pass

    @property
    def marks(self) -> list[str]:
        """Return the triggers that marked the finished files."""
        found = []
        for path in sorted(self.out.glob("*.mcap")):
            with path.open("rb") as file:
                for _, _, message in make_reader(file).iter_messages(topics=["/log"]):
                    log = Log.FromString(message.data)
                    if log.name == SOURCE:
                        found.append(log.message.partition(":")[0])
        return found

    @property
    def capture(self) -> SinkFactory:
        return partial(capture_sink, draw=False, triggers=("signal", "refusal"))


@pytest.fixture
def bench(tmp_path: Path, shift: list[WireEvent]) -> Iterator[Bench]:
    made = Bench(tmp_path, shift[0].time_ns)
    yield made
    made.close()


def test_a_request_without_a_writer_is_marked_by_the_next_writer(
    bench: Bench, shift: list[WireEvent]
) -> None:
    """The mark is in the file with the traffic of that time, which the spool has kept."""
    bench.runner(RequestCounter().make)  # and it dies
    bench.put(shift[:20])
    request_mark(bench.spool)
    runner = bench.runner(bench.capture)
    bench.tick(runner)
    runner.finish()
    assert bench.marks == ["signal"]
    kept = b"".join(event.data for event in read_mcap(bench.out / "capture.mcap"))
    assert kept == b"".join(event.data for event in shift[:20])


def test_a_trigger_without_a_writer_is_marked_by_the_next_writer(
    bench: Bench, shift: list[WireEvent]
) -> None:
    """The conditions are checked on the events of the spool."""
    bench.runner(RequestCounter().make)
    bench.put(shift)
    runner = bench.runner(bench.capture)
    bench.tick(runner)
    runner.finish()
    assert bench.marks == ["refusal"]


@pytest.mark.parametrize("when", ["asked first", "dies before its tick", "dies in its tick"])
def test_a_dead_writer_leaves_the_request_to_the_next(bench: Bench, when: str) -> None:
    """Only acknowledged requests are done."""
    dying, next_one = RequestCounter(), RequestCounter()
    runner = bench.runner(dying.make)
    request_mark(bench.spool)
    if when != "asked first":
        assert runner.step()
    if when == "dies in its tick":
        dying.fails = True
        with pytest.raises(SinkFailed):
            bench.tick(runner)
    bench.tick(bench.runner(next_one.make))
    assert next_one.times == 1


def test_each_request_is_handled_once(bench: Bench) -> None:
    """Two requests between two ticks are one; later writers know which requests are done."""
    sink = RequestCounter()
    runner = bench.runner(sink.make)
    for times in (1, 1, 2, 2):
        if times > sink.times:
            request_mark(bench.spool)
            request_mark(bench.spool)
        bench.tick(runner)
        assert sink.times == times
    bench.tick(bench.runner(sink.make))
    assert sink.times == 2


@pytest.mark.parametrize("late", [False, True])
def test_a_request_just_before_the_end(bench: Bench, *, late: bool) -> None:
    """A request after the last tick gets a mark."""
    runner = bench.runner(bench.capture)
    bench.tick(runner)
    if late:
        request_mark(bench.spool)
    runner.finish()
    assert bench.marks == ["signal"] * late


@pytest.mark.parametrize("damage", ["", "many", "-"])
def test_a_damaged_request_count(bench: Bench, damage: str) -> None:
    """After a loss of power only earlier requests are lost."""
    (bench.spool / "asked").write_text(damage)
    assert mark_request_count(bench.spool) == 0
    request_mark(bench.spool)
    assert mark_request_count(bench.spool) == 1


def test_a_spool_that_cannot_be_written(tmp_path: Path) -> None:
    """The user gets an error."""
    with pytest.raises(OSError, match="No such file"):
        request_mark(tmp_path / "gone")
