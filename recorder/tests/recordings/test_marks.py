"""A trigger adds a mark to the log of the recording."""

import logging
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from mcap.reader import make_reader

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.payloads import Acceptance
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings.archive import Archive, archive_sink
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.recordings.marks import LOGGED_A_MINUTE, SOURCE, TriggerMarks, with_marks
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.rotation import parse_rotation
from scaraspec_recorder.recordings.triggers import parse_trigger
from scaraspec_recorder.sinks.clock_watch import ClockWatch
from scaraspec_recorder.sinks.decoder import Decoder, Item
from scaraspec_recorder.sinks.file_names import INDEX_NAME
from scaraspec_recorder.sinks.sink import OutputFolder
from scaraspec_recorder.sinks.text import LogLine
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.units import SECOND_NS

REFUSED = Acceptance(accepted=False, code="01")

Marks = list[tuple[int, str]]


class Tape:
    """An output that stores everything in order."""

    def __init__(self) -> None:
        self.printed: list[Any] = []
        self.marks: Marks = []

    def write(self, event: WireEvent) -> None:
        self.printed.append(event)

    def take(self, item: Item, number: int, line: LogLine | None) -> None:  # noqa: ARG002 - an `Output`
        self.printed.append(item)

    def mark(self, time_ns: int, line: LogLine) -> None:
        assert line.source == SOURCE
        self.printed.append(line)
        self.marks.append((time_ns, line.text))

    def tick(self, now_ns: int) -> None:
        self.printed.append(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:
        self.printed.append(summary)


class SinkWithTriggers:
    """A sink with triggers."""

    def __init__(self, *triggers: str) -> None:
        self.tape, self.folder = Tape(), OutputFolder(Path(), [])
        self.sink = Decoder(with_marks([self.tape], triggers, self.folder), Judge())

    def feed(self, events: Iterable[WireEvent]) -> Marks:
        for event in events:
            self.sink.write(event)
        return self.tape.marks


def marks(path: Path) -> Marks:
    """Return the marks of an MCAP file."""
    with path.open("rb") as file:
        found = [
            (message.log_time, Log.FromString(message.data))
            for _, _, message in make_reader(file).iter_messages(topics=["/log"])
        ]
    assert all(log.timestamp.ToNanoseconds() == time_ns for time_ns, log in found)
    return [(time_ns, log.message) for time_ns, log in found if log.name == SOURCE]


@pytest.fixture
def session(talk: Any) -> Any:
    """Return a conversation after its login."""
    talk.mark(A2C, Kind.OPENED, "10.0.0.1:5 to 10.0.0.2:8877")
    talk.ask("login", b"password", reply=True)
    talk.ask("get_status", None, "00")
    return talk


def test_a_mark_has_the_time_and_the_reason(session: Any, caplog: pytest.LogCaptureFixture) -> None:
    """The mark is in the recording and in the log of the process, in the form of `scaraspec view
    --at`."""
    session.ask("reset", None, REFUSED)
    session.mark(A2C, Kind.CLOSED)
    watched = SinkWithTriggers("refusal", "disconnect", "code:12")
    assert watched.feed(session.events) == [
        (session.time_ns, "refusal: reset: refused 01 running a program"),
        (session.time_ns, "disconnect: connection 1 closed"),
    ]
    assert [record.message for record in caplog.records] == [
        "trigger refusal at 2026-11-20T22:58:37 UTC: reset: refused 01 running a program",
        "trigger disconnect at 2026-11-20T22:58:37 UTC: connection 1 closed",
    ]


def test_triggers_do_not_change_other_outputs(shift: list[WireEvent]) -> None:
    """A mark is after its event and before the tick that makes it durable."""
    plain, watched = SinkWithTriggers(), SinkWithTriggers("refusal", "signal")
    for each in (plain, watched):
        each.feed(shift)
        each.folder.notify_mark_request()
        each.sink.tick(shift[-1].time_ns)
        each.sink.close()
    printed = watched.tape.printed
    refusal, signal = (number for number, each in enumerate(printed) if isinstance(each, LogLine))
    assert printed[refusal - 1].name == "run_program"
    assert printed[signal + 1] == shift[-1].time_ns
    del printed[signal], printed[refusal]
    assert list(map(type, printed)) == list(map(type, plain.tape.printed))


def test_a_tick_can_fire_a_trigger(session: Any) -> None:
    """Silence is detected by ticks, once and at the right time."""
    watched = SinkWithTriggers("silence:4s")
    assert watched.feed(session.events) == []
    quiet_ns = session.time_ns
    for quarter in range(4 * 20):
        watched.sink.tick(quiet_ns + quarter * SECOND_NS // 4)
    noticed_ns = quiet_ns + 4 * SECOND_NS
    assert watched.tape.marks == [(noticed_ns, "silence:4s: no bytes on connection 1 for 4.0 s")]


def test_a_slow_writer_detects_no_silence(session: Any) -> None:
    """Its clock is that of the events: delayed events are not silence."""
    watched = SinkWithTriggers("silence:4s", "late:1s")
    for event in session.events:
        watched.sink.write(event)
        watched.sink.tick(event.time_ns + 3600 * SECOND_NS)
    assert watched.tape.marks == []


def test_the_user_gets_a_mark_at_the_next_tick(session: Any) -> None:
    """Also if there is no traffic."""
    watched = SinkWithTriggers("signal")
    watched.folder.notify_mark_request()
    watched.sink.tick(session.events[0].time_ns - 1)
    watched.feed(session.events)
    watched.folder.notify_mark_request()
    watched.sink.tick(session.time_ns + SECOND_NS)
    assert watched.tape.marks == [
        (session.events[0].time_ns - 1, "signal: requested by SIGUSR1"),
        (session.time_ns, "signal: requested by SIGUSR1"),
    ]


def test_log_lines_are_limited(session: Any, caplog: pytest.LogCaptureFixture) -> None:
    """The recording has all marks; the next log line states the number of omitted ones."""
    begin_ns = session.time_ns
    for _ in range(40):
        session.time_ns += 2 * SECOND_NS
        session.ask("reset", None, REFUSED)
    assert len(SinkWithTriggers("refusal", "silence:1h").feed(session.events)) == 40
    logged = [record.message for record in caplog.records]
    assert len(logged) == LOGGED_A_MINUTE + 40 - 30 - 4
    assert logged[LOGGED_A_MINUTE].endswith("(24 marks before this one were not logged)")
    assert session.time_ns - begin_ns == pytest.approx(80 * SECOND_NS, rel=0.01)


def test_a_clock_set_back_does_not_stop_log_lines(
    session: Any, caplog: pytest.LogCaptureFixture
) -> None:
    """The limit of log lines does not wait for the old time."""
    for _ in range(LOGGED_A_MINUTE):
        session.ask("reset", None, REFUSED)
    session.time_ns -= 3600 * SECOND_NS
    session.ask("reset", None, REFUSED)
    SinkWithTriggers("refusal").feed(session.events)
    assert len(caplog.records) == LOGGED_A_MINUTE + 1


@pytest.mark.parametrize("redact", [False, True])
def test_marks_in_a_single_file(tmp_path: Path, shift: list[WireEvent], *, redact: bool) -> None:
    """The file is otherwise unchanged, and the marks contain no password."""
    sink = capture_sink(
        OutputFolder(tmp_path, []), draw=False, redact=redact, triggers=("refusal", "malformed")
    )
    for event in shift:
        sink.write(event)
    sink.close()
    path = tmp_path / "capture.mcap"
    assert [text.partition(":")[0] for _, text in marks(path)] == ["refusal", "malformed"]
    recorded = b"".join(e.data for e in read_mcap(path) if e.direction is C2A)
    sent = b"".join(e.data for e in shift if e.direction is C2A)
    assert len(recorded) == len(sent) if redact else recorded == sent
    assert "open sesame" not in f"{marks(path)}"


class RotatedFiles:
    """Rotated files with triggers."""

    def __init__(self, folder: Path, rotate: str, *triggers: str, draw: bool = False) -> None:
        archive = Archive("x", draw=draw, rotate=parse_rotation(rotate), triggers=triggers)
        self.path, self.folder = folder, OutputFolder(folder, [])
        self.sink = archive_sink(self.folder, archive=archive, free_bytes=lambda: 10**9)

    @property
    def marks(self) -> list[Marks]:
        """The marks of each file, by name."""
        return [marks(path) for path in sorted(self.path.glob("*.mcap"))]


def test_the_index_knows_the_marks(tmp_path: Path, talk: Any) -> None:
    """Those of the first and last mark of each file; also if it is rebuilt from the files."""
    files = RotatedFiles(tmp_path, "1h", "refusal")
    for _ in range(3):
        talk.ask("run_program", b"x", REFUSED)
    for event in talk.events:
        files.sink.write(event)
    files.sink.close()
    times = [time_ns for time_ns, _ in files.marks[0]]
    for _ in range(2):
        index = RecordingIndex(tmp_path)
        index.save()
        (entry,) = index.entries.values()
        assert (entry.first_mark_ns, entry.last_mark_ns) == (times[0], times[-1])
        (tmp_path / INDEX_NAME).unlink()


def test_a_mark_is_in_the_file_of_its_event(tmp_path: Path, talk: Any) -> None:
    """Also if the last event of a file causes it."""
    files = RotatedFiles(tmp_path, "connection", "disconnect")
    for number in range(3):
        talk.connection = f"{number}"
        talk.mark(A2C, Kind.OPENED)
        talk.ask("get_status", None, "00")
        talk.time_ns += SECOND_NS
        talk.mark(A2C, Kind.CLOSED)
    for event in talk.events:
        files.sink.write(event)
    files.sink.close()
    assert [[text for _, text in found] for found in files.marks] == [
        [f"disconnect: connection {number} closed"] for number in range(3)
    ]


def test_a_mark_between_two_files(tmp_path: Path, session: Any) -> None:
    """It starts the next file, with the .rrd file; later events are in the same file."""
    files = RotatedFiles(tmp_path, "1s", "signal", draw=True)
    now_ns = session.events[0].time_ns - SECOND_NS
    files.folder.notify_mark_request()
    files.sink.tick(now_ns)
    for event in session.events:
        files.sink.write(event)
    files.sink.close()
    assert files.marks == [[(now_ns, "signal: requested by SIGUSR1")]]
    (path,) = tmp_path.glob("*.mcap")
    assert [e for e in read_mcap(path) if e.data] == [e for e in session.events if e.data]
    assert path.with_suffix(".rrd").stat().st_size


def test_a_file_with_only_a_mark_is_complete(tmp_path: Path, new_talk: Callable[[], Any]) -> None:
    """The user requested a mark without any traffic."""
    files = RotatedFiles(tmp_path, "1h", "signal")
    files.folder.notify_mark_request()
    files.sink.tick(new_talk().time_ns)
    files.sink.close()
    assert [len(found) for found in files.marks] == [1]
    (path,) = tmp_path.glob("*.mcap")
    assert list(read_mcap(path)) == []
    again = RotatedFiles(tmp_path, "1h")
    again.sink.close()
    assert path.exists()


def test_an_invalid_trigger() -> None:
    """The error is raised before the recording starts."""
    with pytest.raises(ValueError, match="'bang' is not a trigger"):
        SinkWithTriggers("bang")


@pytest.fixture(autouse=True)
def _warnings(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)


def _read_ns(clock_s: dict[str, float], name: str) -> int:
    return int(clock_s[name] * SECOND_NS)


@pytest.mark.parametrize("hours", [24, -24])
def test_a_step_of_the_clock_is_no_silence(hours: int) -> None:
    """Whether a tick or an event comes first; a silence after the step is one."""
    for step_at_a_tick in (False, True):
        tape, clock_s = Tape(), {"wall": 10.0**6, "elapsed": 0.0}
        elapsed = partial(_read_ns, clock_s, "elapsed")
        clock = ClockWatch(partial(_read_ns, clock_s, "wall"), elapsed, elapsed)
        marked = TriggerMarks([tape], {"silence:30s": parse_trigger("silence:30s")}, clock)

        def pass_s(seconds: float, step_s: float = 0, now: dict[str, float] = clock_s) -> int:
            now["elapsed"] += seconds
            now["wall"] += seconds + step_s
            return int(now["wall"] * SECOND_NS)

        marked.write(WireEvent(pass_s(1), "1", A2C, Kind.OPENED))
        marked.write(WireEvent(old_ns := pass_s(1), "1", A2C, Kind.BYTES, b"a"))
        now_ns = pass_s(1, hours * 3600)
        if step_at_a_tick:
            marked.tick(now_ns)
            marked.write(WireEvent(old_ns + 1, "1", A2C, Kind.BYTES, b"b", 1))
        marked.write(WireEvent(pass_s(1), "1", A2C, Kind.BYTES, b"c", 2))
        for _ in range(20):
            marked.tick(pass_s(1))
        assert not tape.marks
        for _ in range(20):
            marked.tick(pass_s(1))
        assert len(tape.marks) == 1
