"""A recording in several files has the same bytes and findings as one in a single file."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings.recording_files import RecordingFolder
from scaraspec_recorder.recordings.recording_index import RecordingIndex
from scaraspec_recorder.recordings.rotation import (
    MAX_WAIT_TICKS,
    Rotation,
    RotationPolicy,
    parse_rotation,
)
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.gap_filler import GapFiller
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.open_connections import OpenConnections
from scaraspec_recorder.sinks.sink import TICK_NS, OutputFolder
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.sources.pcap_reader import read_pcap
from scaraspec_recorder.units import SECOND_NS, Limits, QuantityError

FIELD = sorted((Path(__file__).parents[3] / "fixtures" / "captures" / "field").glob("*.pcapng"))
AT_EVERY_TICK = RotationPolicy(Limits(duration_ns=1))


def recorder(folder: Path, rotate: RotationPolicy) -> Decoder:
    index = RecordingIndex(folder)
    index.save()
    judge = Judge()
    recording_folder = RecordingFolder(OutputFolder(folder, []), index, "line 3", draw=False)
    return Decoder([Rotation(recording_folder, judge, rotate)], judge)


def record_in_files(folder: Path, events: Iterable[WireEvent], cuts: set[int]) -> list[Path]:
    """Record in several files, which end after the given numbers of events."""
    sink = recorder(folder, AT_EVERY_TICK)
    for number, event in enumerate(events, start=1):
        sink.write(event)
        if number in cuts:
            for later_ns in range(MAX_WAIT_TICKS + 2):
                sink.tick(event.time_ns + later_ns)
    sink.close()
    return [folder / name for name in RecordingIndex(folder).entries]


def judge_all(events: Iterable[WireEvent]) -> list[Finding]:
    """Return the findings for events that are read from a single file."""
    judge, gap_filler = Judge(), GapFiller()
    items = [i for event in events for e in gap_filler.fill(event) for i in judge.feed(e)]
    return [item for item in (*items, *judge.close()) if isinstance(item, Finding)]


def messages(path: Path, topic: str, kind: type[Any]) -> list[Any]:
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(topics=[topic], log_time_order=False)
        return [schemas.decode(kind, message.data) for _, _, message in found]


def metadata(path: Path, name: str) -> dict[str, str]:
    with path.open("rb") as file:
        return next(m.metadata for m in make_reader(file).iter_metadata() if m.name == name)


def listed(folder: Path) -> int:
    """Return the number of complete files; a new index would repair the current file."""
    return len((folder / "contents.jsonl").read_text().splitlines())


def streams(events: Iterable[WireEvent]) -> dict[tuple[str, Direction], bytes]:
    joined: dict[tuple[str, Direction], bytes] = {}
    for event in events:
        key = (event.connection, event.direction)
        joined[key] = joined.get(key, b"") + event.data
    return joined


@pytest.fixture(scope="module")
def unrotated(tmp_path_factory: pytest.TempPathFactory, shift: list[WireEvent]) -> Path:
    """Return the shift in one file."""
    (path,) = record_in_files(tmp_path_factory.mktemp("one"), shift, set())
    return path


@settings(max_examples=10)
@given(st.data())
def test_rotation_anywhere_keeps_bytes_and_findings(
    tmp_path_factory: pytest.TempPathFactory,
    shift: list[WireEvent],
    unrotated: Path,
    data: st.DataObject,
) -> None:
    """The joined bytes are those of the streams, and the decoded messages are those of one file."""
    cuts = data.draw(st.sets(st.integers(1, len(shift) - 1), max_size=4))
    paths = record_in_files(tmp_path_factory.mktemp("record_in_files"), shift, cuts)
    captures = [read_mcap(path) for path in paths]
    assert streams(event for capture in captures for event in capture) == streams(shift)
    assert [capture.summary.whole for capture in captures] == [True] * (len(cuts) + 1)
    for topic, kind in (
        ("/findings", schemas.Finding),
        ("/exchanges", schemas.Exchange),
        ("/transfers", schemas.Transfer),
        ("/frames", schemas.Frame),
    ):
        together = [message for path in paths for message in messages(path, topic, kind)]
        assert together == messages(unrotated, topic, kind)


def beginnings(events: list[WireEvent], step: int) -> Iterable[list[WireEvent]]:
    """Yield the events from every `step`-th one on, as in a file that starts there."""
    links = OpenConnections()
    for number, event in enumerate(events):
        if number % step == 0:
            yield [*links.reopening_events(event.time_ns), *events[number:]]
        links.update(event)


def test_a_single_file_causes_no_false_findings(shift: list[WireEvent]) -> None:
    """Wherever a file starts, its certain findings are findings of the whole recording."""
    certain = {Verdict.FAIL, Verdict.TOLERATED}
    there = {(f.requirement, f.evidence) for f in judge_all(shift) if f.verdict in certain}
    for events in beginnings(shift, 11):
        found = [f for f in judge_all(events) if f.verdict in certain]
        assert {(f.requirement, f.evidence) for f in found} <= there


@pytest.mark.parametrize("path", FIELD, ids=lambda path: path.stem)
def test_no_start_of_a_field_capture_causes_a_failure(path: Path) -> None:
    """Other implementations, other dialects, a truncated start."""
    events = list(read_pcap(path))
    there = {(f.requirement, f.verdict) for f in judge_all(events)}
    for part in beginnings(events, len(events) // 12 + 1):
        for finding in judge_all(part):
            if finding.verdict is not Verdict.INCONCLUSIVE:
                assert (finding.requirement, finding.verdict) in there


def test_operations_across_two_files_are_complete(
    tmp_path: Path, talk: Any, program_file: bytes
) -> None:
    """A transfer and a two-stage command begin in one file and end in the next."""
    talk.mark(A2C, Kind.OPENED)
    talk.ask("login", b"password", reply=True)
    talk.ask("run_program", b"old.rob", Acceptance(accepted=True))
    talk.upload(b"pick.rob", program_file)
    seam = len(talk.events) - 2
    talk.result("run_program", Outcome(done=True))
    _, second = record_in_files(tmp_path, talk.events, {seam})
    (transfer,) = messages(second, "/transfers", schemas.Transfer)
    assert (transfer.state, transfer.received_bytes) == ("done", len(program_file))
    with second.open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
    assert attachment.data == program_file
    (run,) = [x for x in messages(second, "/exchanges", schemas.Exchange) if x.result]
    assert (run.command, run.ending, run.number) == ("run_program", "answered", 2)
    assert messages(second, "/findings", schemas.Finding) == []
    assert metadata(second, "summary")["conclusion"] == "conformant"


def test_a_file_starts_with_the_open_connections(tmp_path: Path, talk: Any) -> None:
    """They are opened again at the start time, with their current offsets."""
    talk.mark(A2C, Kind.OPENED, "10.0.0.1:5 to 10.0.0.2:8877")
    talk.ask("login", b"password", reply=True)
    talk.ask("get_status", None, "00")
    _, second = record_in_files(tmp_path, talk.events, {3})
    opened, *pieces, _, _ = [e for e in read_mcap(second) if e.kind is not Kind.GAP]
    assert (opened.kind, opened.time_ns) == (Kind.OPENED, talk.events[3].time_ns)
    assert opened.note == "10.0.0.1:5 to 10.0.0.2:8877, since 2026-11-20 22:58:37 UTC"
    sent = {
        direction: sum(len(e.data) for e in talk.events[:3] if e.direction is direction)
        for direction in Direction
    }
    assert [(e.direction, e.offset_bytes, e.data) for e in pieces] == [
        (A2C, sent[A2C], b""),
        (C2A, sent[C2A], b""),
    ]
    account = metadata(second, "stream/1/A2C")
    assert account["first_offset_bytes"] == str(sent[A2C])
    assert account["received_bytes"] == account["recorded_bytes"] == "4"
    assert account["lost_bytes"] == "0"


def test_an_unknown_start_is_repeated_in_the_next_file(tmp_path: Path, talk: Any) -> None:
    """A gap of unknown length is written again, because no offset shows it."""
    talk.mark(A2C, Kind.OPENED)
    talk.mark(C2A, Kind.GAP, "its beginning is not recorded", length=-1)
    talk.mark(A2C, Kind.GAP, "its beginning is not recorded", length=-1)
    talk.ask("get_status", None, "00")
    _, second = record_in_files(tmp_path, talk.events, {3})
    kinds = [(event.kind, event.direction, event.length_bytes) for event in read_mcap(second)]
    assert kinds[1:3] == [(Kind.GAP, C2A, -1), (Kind.GAP, A2C, -1)]


def test_each_file_has_its_own_summary(tmp_path: Path, talk: Any) -> None:
    """A violation in the first file does not count in the second one."""
    talk.mark(A2C, Kind.OPENED)
    talk.ask("login", b"password", reply=True)
    talk.send(C2A, b"\x00noise")
    talk.ask("get_status", None, "00")
    talk.ask("get_status", None, "00")
    first, second = record_in_files(tmp_path, talk.events, {6})
    assert metadata(first, "summary")["conclusion"] == "nonconformant"
    summary = metadata(second, "summary")
    assert (summary["conclusion"], summary["exchanges"]) == ("conformant", "1")


def test_rotation_by_time(tmp_path: Path, talk: Any) -> None:
    """By the clock of the ticks; a clock set back also ends the file, and silence starts none."""
    sink = recorder(tmp_path, parse_rotation("10s"))
    talk.mark(A2C, Kind.OPENED)
    now_ns = talk.time_ns
    sink.write(talk.events[0])
    for second in range(10):
        sink.tick(now_ns + second * SECOND_NS)
    assert listed(tmp_path) == 0
    sink.tick(now_ns + 10 * SECOND_NS)
    assert listed(tmp_path) == 1
    for second in range(11, 40):
        sink.tick(now_ns + second * SECOND_NS)
    assert listed(tmp_path) == 1
    talk.ask("get_status", None, "00")
    for event in talk.events[1:]:
        sink.write(event)
    sink.tick(now_ns + 40 * SECOND_NS)
    sink.tick(now_ns - 3600 * SECOND_NS)
    assert listed(tmp_path) == 2
    sink.close()


def test_a_file_ends_after_a_reply(tmp_path: Path, talk: Any) -> None:
    """If one comes soon, so that each file is conclusive by itself."""
    talk.mark(A2C, Kind.OPENED)
    talk.ask("login", b"password", reply=True)
    for _ in range(20):
        talk.ask("get_status", None, "00")
    sink = recorder(tmp_path, AT_EVERY_TICK)
    for event in talk.events:
        sink.write(event)
        if event.direction is A2C:
            sink.tick(event.time_ns)
    sink.close()
    entries = RecordingIndex(tmp_path).entries.values()
    assert len(entries) > 3
    for entry in entries:
        assert judge_all(read_mcap(tmp_path / entry.name)) == []


def test_rotation_by_size(tmp_path: Path, talk: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file ends at the first tick at which it has the size."""
    monkeypatch.setattr("os.fdatasync", lambda _: None)
    sink = recorder(tmp_path, RotationPolicy(Limits(size_bytes=60_000)))
    talk.mark(A2C, Kind.OPENED)
    for _ in range(400):
        talk.ask("get_status", None, "00")
    for event in talk.events:
        sink.write(event)
        sink.tick(event.time_ns)
    sink.close()
    entries = list(RecordingIndex(tmp_path).entries.values())
    assert len(entries) > 2
    assert all(60_000 <= entry.size_bytes < 120_000 for entry in entries[:-1])


@pytest.fixture
def sessions(new_talk: Callable[..., Any]) -> Callable[..., list[list[WireEvent]]]:
    """Return short sessions at this distance in time."""

    def make(count: int, interval_ns: int) -> list[list[WireEvent]]:
        talks = [new_talk(str(number)) for number in range(1, count + 1)]
        for number, talk in enumerate(talks):
            talk.time_ns += number * interval_ns
            talk.mark(A2C, Kind.OPENED)
            talk.ask("login", b"password", reply=True)
            talk.mark(A2C, Kind.CLOSED)
        return [talk.events for talk in talks]

    return make


def test_rotation_by_connection(
    tmp_path: Path, sessions: Callable[..., list[list[WireEvent]]]
) -> None:
    """Overlapping connections share a file; it ends at the next tick after the last of them."""
    sink = recorder(tmp_path, parse_rotation("connection"))
    one, two, three = sessions(3, 1)
    for event in (*one[:2], *two[:2], *one[2:], *two[2:]):
        sink.write(event)
    sink.tick(two[-1].time_ns)
    for event in three:
        sink.write(event)
    sink.close()
    index = RecordingIndex(tmp_path)
    assert [entry.connections for entry in index.entries.values()] == [2, 1]
    assert [entry.exchanges for entry in index.entries.values()] == [2, 1]


@pytest.mark.parametrize(("interval_ns", "files"), [(TICK_NS // 10, 10), (TICK_NS, 50)])
def test_short_connections_share_a_file(
    tmp_path: Path, sessions: Callable[..., list[list[WireEvent]]], interval_ns: int, files: int
) -> None:
    """A file for each of many short connections would delay the writing.

    The file ends with the first connection that ends at least a tick after its start.
    """
    sink = recorder(tmp_path, parse_rotation("connection"))
    for session in sessions(100, interval_ns):
        for event in session:
            sink.write(event)
    sink.close()
    entries = RecordingIndex(tmp_path).entries.values()
    assert len(entries) == files
    assert sum(entry.connections for entry in entries) == 100


def test_a_connection_without_bytes_needs_no_file(
    tmp_path: Path, sessions: Callable[..., list[list[WireEvent]]]
) -> None:
    """A health check; but a client that could not reach the robot is recorded."""
    sink = recorder(tmp_path, parse_rotation("connection"))
    check, session, later, failed = sessions(4, 2 * TICK_NS)
    begun, *rest, ended = session
    unreachable = replace(failed[-1], kind=Kind.RESET, note="no connection: refused")
    for event in (
        *(check[0], check[-1], begun, later[0], *rest, later[-1], ended),
        *(failed[0], unreachable),
    ):
        sink.write(event)
        sink.tick(event.time_ns)
    sink.close()
    entries = list(RecordingIndex(tmp_path).entries.values())
    assert [entry.connections for entry in entries] == [1, 1]
    assert entries[0].a2c_bytes == sum(len(e.data) for e in session if e.direction is A2C)
    events = [event for entry in entries for event in read_mcap(tmp_path / entry.name)]
    assert [event.connection for event in events if event.kind is Kind.OPENED] == ["2", "4"]


def test_a_recording_without_events(tmp_path: Path) -> None:
    """A file starts with its first event."""
    sink = recorder(tmp_path, RotationPolicy())
    sink.tick(1)
    sink.close()
    assert [path.name for path in tmp_path.iterdir()] == ["contents.jsonl"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "'' is neither a duration such as 1h nor a size such as 512MB, nor connection"),
        (
            "daily",
            "'daily' is neither a duration such as 1h nor a size such as 512MB, nor connection",
        ),
        ("1ms", "1ms is too small for a file: use at least 1s or 1MB"),
        ("1h,10kB", "1h,10kB is too small for a file: use at least 1s or 1MB"),
    ],
)
def test_invalid_rotation(text: str, sentence: str) -> None:
    """One sentence: the error and the valid form."""
    with pytest.raises(QuantityError) as caught:
        parse_rotation(text)
    assert str(caught.value) == sentence


def test_parse_rotation() -> None:
    """The text names a time, a size, both, or `connection`."""
    assert parse_rotation("1h") == RotationPolicy(Limits(3600 * SECOND_NS))
    assert parse_rotation("512MB,1h") == RotationPolicy(Limits(3600 * SECOND_NS, 512_000_000))
    assert parse_rotation("connection") == RotationPolicy(each_connection=True)
