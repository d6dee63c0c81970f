"""capture.mcap contains all raw bytes and the decoded items, and can be read again."""

import math
import struct
import subprocess
import sysconfig
from collections.abc import Callable, Iterable
from functools import partial
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.writer import Writer
from zstandard import ZstdCompressor, ZstdError

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Chunk
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.recordings.repair import repair
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap import mcap_sink, schemas
from scaraspec_recorder.sinks.mcap.chunk_writer import ChunkWriter
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.sinks.sink import FileRemoved, OutputFolder
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk

RERUN = Path(sysconfig.get_path("scripts")) / "rerun"
KINDS: dict[str, type[schemas.Message]] = {
    schemas.full_name(kind): kind for kind in schemas.MESSAGES
}


def record(path: Path, events: Iterable[WireEvent], redactor: Redactor | None = None) -> Path:
    """Record events like the writer process, with a tick every quarter of a second."""
    decoder = Decoder([McapSink(path.open("wb"))], Judge(), redactor)
    ticked_ns = 0
    for event in events:
        decoder.write(event)
        if event.time_ns - ticked_ns >= 250_000_000:
            ticked_ns = event.time_ns
            decoder.tick(ticked_ns)
    decoder.close()
    assert "defect" not in decoder.summary()
    return path


def messages(path: Path, topic: str) -> list[Any]:
    """Return the messages of a topic, read by the mcap package with index and checksums."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(topics=[topic])
        return [
            schemas.decode(KINDS[schema.name], message.data) if schema.name in KINDS else message
            for schema, _, message in found
            if schema
        ]


def chunk_indexes(path: Path) -> list[ChunkIndex]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary
    return summary.chunk_indexes


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        return {record.name: record.metadata for record in make_reader(file).iter_metadata()}


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory, shift: list[WireEvent]) -> Path:
    """Return the recorded shift."""
    return record(tmp_path_factory.mktemp("mcap") / "capture.mcap", shift)


def test_the_raw_layer_is_unchanged(capture: Path, shift: list[WireEvent]) -> None:
    """Every event is returned in order, and the file is complete."""
    back = read_mcap(capture)
    assert list(back) == shift
    assert back.summary.whole
    assert back.summary.events == len(shift)


texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)


@st.composite
def conversations(draw: st.DrawFn) -> list[WireEvent]:
    """Draw any events of two connections."""
    events: list[WireEvent] = []
    ends = dict.fromkeys([(name, d) for name in ("1", "2") for d in Direction], 0)
    for _ in range(draw(st.integers(0, 30))):
        name, direction = draw(st.sampled_from(sorted(ends, key=str)))
        kind = draw(st.sampled_from([Kind.BYTES, Kind.BYTES, Kind.BYTES, *Kind]))
        data = draw(st.binary(min_size=1, max_size=300)) if kind is Kind.BYTES else b""
        length = draw(st.integers(-1, 1000)) if kind is Kind.GAP else 0
        offset, note = ends[name, direction], draw(texts)
        time_ns = draw(st.integers(0, 2**63 - 1))
        event = (time_ns, name, direction, kind, data, offset, length, note)
        if kind is Kind.BYTES and draw(st.booleans()):
            events.append(
                ForwardedChunk(*event, draw(st.integers(1, 2**63 - 1)), draw(st.booleans()))
            )
        else:
            events.append(WireEvent(*event))
        ends[name, direction] += len(data) + max(length, 0)
        if kind in (Kind.OPENED, Kind.CLOSED, Kind.RESET):
            ends |= {(name, d): 0 for d in Direction}
    return events


@settings(max_examples=50)
@given(conversations())
def test_any_events_are_returned(
    tmp_path_factory: pytest.TempPathFactory, events: list[WireEvent]
) -> None:
    """Bytes, times, notes and kinds may have any values."""
    path = record(tmp_path_factory.mktemp("any") / "capture.mcap", events)
    back = read_mcap(path)
    assert list(back) == events
    assert back.summary.whole


def test_decoding_a_file_again_gives_the_same_items(capture: Path, tmp_path: Path) -> None:
    """A file that is recorded from the raw layer of another file has the same content."""
    again = record(tmp_path / "again.mcap", read_mcap(capture))
    for topic in ("/frames", "/undecodable", "/exchanges", "/transfers", "/findings"):
        assert messages(again, topic) == messages(capture, topic)


def test_the_accounts_balance(capture: Path, shift: list[WireEvent]) -> None:
    """received = recorded + lost, and the hash is that of the recorded bytes."""
    for direction in Direction:
        mine = [e for e in shift if e.direction is direction]
        data = b"".join(e.data for e in mine)
        lost = sum(e.length_bytes for e in mine)
        account = metadata(capture)[f"stream/1/{direction.value}"]
        assert account == {
            "first_offset_bytes": "0",
            "received_bytes": str(len(data) + lost),
            "recorded_bytes": str(len(data)),
            "lost_bytes": str(lost),
            "gaps": str(sum(e.kind is Kind.GAP for e in mine)),
            "gaps_of_unknown_length": "0",
            "sha256_recorded": sha256(data).hexdigest(),
        }


def test_content_of_exchanges(capture: Path) -> None:
    """Request, first reply, final result, outcome and times; numbered by requests."""
    found = messages(capture, "/exchanges")
    runs = [x for x in found if x.command == "run_program"]
    refused, run = runs  # the first run ended after the second was refused
    assert (run.request, run.reply, run.result) == ("pick.rob", "accepted", "failed 00 idle")
    assert (run.ending, run.accepted, run.code) == ("answered", True, "00")
    assert run.latency_ms == pytest.approx(2.0)
    assert run.duration_s > 1
    assert (refused.accepted, refused.code, refused.result) == (False, "01", "")
    assert refused.duration_s is None
    assert sorted(x.number for x in found) == list(range(1, len(found) + 1))


def test_latency_of_robot_and_recorder(tmp_path: Path, passed: list[WireEvent]) -> None:
    """Of two milliseconds between the times of reception, the recorder used twenty microseconds."""
    path = record(tmp_path / "capture.mcap", passed)
    chunks = messages(path, "/raw/a2c")
    assert {chunk.kernel_time for chunk in chunks} == {True}
    assert [chunk.forwarded_ns for chunk in chunks] == [
        e.time_ns + 20_000 for e in passed if e.kind is Kind.BYTES and e.direction is A2C
    ]
    answered = [x for x in messages(path, "/exchanges") if x.reply]
    assert {round(x.latency_ms, 6) for x in answered} == {2.0}
    assert {round(x.robot_ms, 6) for x in answered} == {1.98}
    assert {round(x.recorder_ms, 6) for x in answered} == {0.04}
    assert list(read_mcap(path)) == passed


def test_unknown_latencies_are_absent(capture: Path) -> None:
    """A capture of another tool has no forwarding times."""
    assert {x.robot_ms for x in messages(capture, "/exchanges")} == {None}
    assert {x.recorder_ms for x in messages(capture, "/exchanges")} == {None}
    assert {chunk.forwarded_ns for chunk in messages(capture, "/raw/c2a")} == {None}


def test_frames_invalid_bytes_and_gaps_cover_a_stream(
    capture: Path, shift: list[WireEvent]
) -> None:
    """Every byte of a stream belongs to exactly one of them."""
    pieces = [
        (f.offset_bytes, f.size_bytes) for f in messages(capture, "/frames") if f.direction == "C2A"
    ]
    pieces += [(u.offset_bytes, u.size_bytes) for u in messages(capture, "/undecodable")]
    pieces += [(g.offset_bytes, g.length_bytes) for g in messages(capture, "/gap")]
    end = 0
    for offset, size in sorted(pieces):
        assert offset == end
        end += size
    last = [e for e in shift if e.direction is C2A and e.data][-1]
    assert end == last.offset_bytes + len(last.data)


def test_a_transferred_file_is_an_attachment(capture: Path, program_file: bytes) -> None:
    """The attachment is complete, and the message of the transfer has its hash."""
    with capture.open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
    assert (attachment.name, attachment.data) == ("upload pick.rob", program_file)
    (transfer,) = messages(capture, "/transfers")
    assert (transfer.state, transfer.received_bytes) == ("done", len(program_file))
    assert transfer.sha256 == sha256(program_file).hexdigest()


def test_a_path_as_file_name(talk: Any, tmp_path: Path) -> None:
    """The name of the attachment has no path, whatever name the peer uses."""
    talk.send(A2C, Frame(A2C, 0x50, b"../../etc/pass\\wd").encode())
    talk.send(C2A, Frame(C2A, 0x50, b"1").encode())
    talk.ask("upload_chunk", Chunk(1, 0, 1, b"x"), reply=True)
    with record(tmp_path / "a.mcap", talk.events).open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
    assert attachment.name == "upload .._.._etc_pass_wd"


def test_the_log_is_a_foxglove_log(capture: Path) -> None:
    """It has invalid bytes, gaps, refusals and commands, but no queries."""
    lines = [Log.FromString(message.data) for message in messages(capture, "/log")]
    text = "\n".join(line.message for line in lines)
    for words in ("no frame (stray)", "are missing", "refused 01", "upload of pick.rob", "closed"):
        assert words in text
    assert "get_status" not in text
    assert {line.level for line in lines} >= {Log.INFO, Log.WARNING}


class Cdr:
    """A reader of CDR, written independently from its alignment rules."""

    def __init__(self, data: bytes) -> None:
        assert data[:4] == b"\0\1\0\0"
        self.data, self.at = data[4:], 0

    def take(self, form: str) -> Any:
        size = struct.calcsize(form)
        self.at += -self.at % size
        self.at += size
        return struct.unpack_from(f"<{form}", self.data, self.at - size)[0]

    def text(self) -> str:
        size = self.take("I")
        self.at += size
        return self.data[self.at - size : self.at - 1].decode()

    def double(self) -> float:
        value: float = self.take("d")
        return value

    def sequence(self, take: Callable[[], Any]) -> list[Any]:
        return [take() for _ in range(self.take("I"))]


def test_joint_states_are_cdr(capture: Path) -> None:
    """Radians and metres, the rates since the previous message, and no effort, which is unknown."""
    found = []
    for message in messages(capture, "/joint_states")[:2]:
        cdr = Cdr(message.data)
        assert cdr.take("i") * 10**9 + cdr.take("I") == message.log_time
        assert cdr.text() == ""
        assert cdr.sequence(cdr.text) == ["inner_arm", "outer_arm", "wrist", "rotation"]
        found.append([cdr.sequence(cdr.double) for _ in range(3)])
        assert cdr.at == len(cdr.data)
    (first, no_rates, _), (second, rates, efforts) = found
    assert first == pytest.approx([0, math.radians(60), 0.250, 0])
    assert second == pytest.approx([math.radians(3), math.radians(59), 0.249, math.radians(2)])
    assert all(map(math.isnan, [*no_rates, *efforts]))
    assert rates[0] == pytest.approx(-3 * rates[1])


def test_the_urdf_matches_the_transforms(capture: Path) -> None:
    """Every joint of the URDF has a transform from its parent to its child."""
    (message,) = messages(capture, "/robot_description")
    robot = ET.fromstring(Cdr(message.data).text())
    joints = {
        (joint.find("parent").get("link"), joint.find("child").get("link"))
        for joint in robot.iter("joint")
    }
    moved = set()
    for transforms in messages(capture, "/tf"):
        for transform in FrameTransforms.FromString(transforms.data).transforms:
            moved.add((transform.parent_frame_id, transform.child_frame_id))
    assert moved == joints | {("base", "measured_tool")}


def test_no_password_is_decoded(capture: Path) -> None:
    """Outside the raw layer no message, attachment or metadata contains it."""
    with capture.open("rb") as file:
        reader = make_reader(file)
        for _, channel, message in reader.iter_messages():
            assert channel.topic == "/raw/a2c" or b"sesame" not in message.data
    (login,) = [x for x in messages(capture, "/exchanges") if x.command == "login"]
    assert (login.request, login.reply) == ("(password)", "ok")


@pytest.mark.parametrize(
    "request_bytes",
    [
        pytest.param(b"\xaa\x01\x09open sesame\xcc", id="wrong length"),
        pytest.param(b"\xaa\x03\x0bopen sesame\xcc", id="no bar"),
        pytest.param(b"\xaa\x01\x0copen sesame\0\xcc", id="trailing NUL"),
        pytest.param(b"\xaa\x01\x0bopen ses", id="cut off"),
    ],
)
def test_no_malformed_password_is_decoded(talk: Any, tmp_path: Path, request_bytes: bytes) -> None:
    """Neither in findings nor in invalid bytes; an echo of it is masked, too."""
    talk.send(A2C, request_bytes)
    talk.send(C2A, Frame(C2A, request_bytes[1], b"open sesame").encode())
    talk.mark(A2C, Kind.CLOSED)
    with record(tmp_path / "a.mcap", talk.events).open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if not channel.topic.startswith("/raw/"):
                text = message.data.lower()
                assert b"sesa" not in text
                assert b"73 65 73 61" not in text
                assert b"73657361" not in text


def test_a_redacted_file_contains_no_password(shift: list[WireEvent], tmp_path: Path) -> None:
    """Not even in the raw layer; the frames are otherwise the same."""
    path = record(tmp_path / "redacted.mcap", shift, Redactor())
    back = list(read_mcap(path))
    assert b"sesame" not in b"".join(event.data for event in back)
    assert [(e.time_ns, e.kind, len(e.data)) for e in back] == [
        (e.time_ns, e.kind, len(e.data)) for e in shift
    ]


@pytest.mark.parametrize("needs_login", [True, False])
def test_the_link_is_in_the_metadata(
    shift: list[WireEvent], tmp_path: Path, *, needs_login: bool
) -> None:
    """A reader knows whether a login is required, also after a repair."""
    sink = capture_sink(OutputFolder(tmp_path, []), draw=False, needs_login=needs_login)
    for event in shift:
        sink.write(event)
    sink.close()
    capture = read_mcap(tmp_path / "capture.mcap")
    assert capture.needs_login is needs_login
    capture.path.write_bytes(capture.path.read_bytes()[:-100])
    repair(capture.path)
    assert capture.needs_login is needs_login


@pytest.mark.parametrize(("schema", "readable"), [("1", True), ("2", False)])
def test_the_description_of_the_session_has_a_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, schema: str, *, readable: bool
) -> None:
    """A description of a later version is not misread."""
    monkeypatch.setattr(mcap_sink, "SCHEMA", f"scaraspec.session/{schema}")
    path = record(tmp_path / "capture.mcap", [])
    if readable:
        assert read_mcap(path).session["schema"] == "scaraspec.session/1"
    else:
        with pytest.raises(
            CaptureError, match=r"'scaraspec.session/2', but .* scaraspec.session/1"
        ):
            _ = read_mcap(path).session


def test_rerun_reads_the_file(capture: Path) -> None:
    """The tools of Rerun report no problem."""
    for command in ("info", "check"):
        done = subprocess.run(
            [RERUN, "mcap", command, capture], capture_output=True, text=True, check=True
        )
        assert "/robot_description" in done.stdout
        assert "PROBLEM" not in done.stdout


# Damaged files


def test_a_file_truncated_anywhere(shift: list[WireEvent], tmp_path: Path) -> None:
    """The reader returns the events up to the last complete chunk, and notes that it is truncated.

    The cuts are at every byte near the ends of a chunk (its header has 57 bytes) and at every 31st
    byte elsewhere.
    """
    path = record(tmp_path / "torn.mcap", shift[:7])
    data = path.read_bytes()
    starts = [chunk.chunk_start_offset for chunk in chunk_indexes(path)]
    ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in chunk_indexes(path)]
    near = {
        at + step for at in (*starts, *ends) for step in range(-12, 64) if at + step < len(data)
    }
    counts = []
    for size in sorted({*range(0, len(data), 31), *near, len(data) - 1}):
        path.write_bytes(data[:size])
        back = read_mcap_or_nothing(path)
        assert back == shift[: len(back)]
        counts.append(len(back))
    assert counts == sorted(counts)
    assert counts[-1] == 7


def read_mcap_or_nothing(path: Path) -> list[WireEvent]:
    """Return the events of a truncated file; none if even its header is truncated."""
    try:
        back = read_mcap(path)
        events = list(back)
    except CaptureError:
        return []
    assert not back.summary.whole
    assert back.summary.notes
    return events


def test_a_damaged_chunk_becomes_gaps(
    shift: list[WireEvent], tmp_path: Path, damage_chunk: Callable[[Path, int], None]
) -> None:
    """Unreadable bytes become gaps at their offsets; all other events are returned."""
    path = record(tmp_path / "damaged.mcap", shift)
    damage_chunk(path, 3)
    back = read_mcap(path)
    events = list(back)
    assert back.summary.finished
    assert not back.summary.whole
    assert "1 damaged chunks" in back.summary.notes[0]
    ends = dict.fromkeys(Direction, 0)
    for event in events:
        if event.kind in (Kind.BYTES, Kind.GAP):
            assert event.offset_bytes == ends[event.direction]
            ends[event.direction] += len(event.data) + event.length_bytes
    kept = [event for event in events if event.note != "not in this recording"]
    assert kept == [event for event in shift if event in kept]
    assert 0 < len(kept) < len(shift)


def test_a_stream_that_began_before_its_file_begins_with_a_gap(tmp_path: Path) -> None:
    """In a later file the first byte is not the first byte of the connection."""
    late = WireEvent(5, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc", 1000)
    gap, event = read_mcap(record(tmp_path / "late.mcap", [late]))
    assert (gap.kind, gap.offset_bytes, gap.length_bytes) == (Kind.GAP, 0, 1000)
    assert event == late


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    """The error is one sentence with the file name."""
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel(
            "/a", "json", writer.register_schema("A", "jsonschema", b"{}")
        )
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()  # type: ignore[no-untyped-call] # the library has no types here
    text, empty = tmp_path / "text.mcap", tmp_path / "empty.mcap"
    text.write_text("no capture")
    empty.touch()
    cases = {
        foreign: "has no raw bytes of a link",
        text: "is not an MCAP file",
        empty: "is empty",
        tmp_path: "cannot be read",
        tmp_path / "absent.mcap": "cannot be read",
    }
    for path, reason in cases.items():
        with pytest.raises(CaptureError, match=reason) as caught:
            list(read_mcap(path))
        assert str(path) in str(caught.value)


def test_a_chunk_with_a_huge_size(shift: list[WireEvent], tmp_path: Path) -> None:
    """A size of a terabyte is noted; the checksum shows that the content is right."""
    path = record(tmp_path / "bomb.mcap", shift[:12])
    data = path.read_bytes()
    at = chunk_indexes(path)[-1].chunk_start_offset + 1 + 8 + 8 + 8  # after length and two times
    path.write_bytes(data[:at] + (1 << 40).to_bytes(8, "little") + data[at + 8 :])
    back = read_mcap(path)
    assert list(back) == shift[:12]
    assert "the length of 1 records was wrong" in back.summary.notes[0]


def test_a_chunk_with_a_wrong_size(tmp_path: Path) -> None:
    """The size in the zstd header counts, too: 128 MiB of zeros become a few kilobytes."""
    path = tmp_path / "bomb.mcap"
    packed = ZstdCompressor().compress(bytes(1 << 27))
    with path.open("wb") as file:
        McapSink(file)
        file.seek(0, 2)
        chunk = struct.pack("<QQQII", 0, 0, 10, 0, 4) + b"zstd" + struct.pack("<Q", len(packed))
        file.write(struct.pack("<BQ", Opcode.CHUNK, len(chunk) + len(packed)) + chunk + packed)
    back = read_mcap(path)
    assert list(back) == []
    assert "1 damaged chunks" in back.summary.notes[0]


@given(st.binary(max_size=400), st.integers(0, 3000))
def test_garbage_in_a_file(
    tmp_path_factory: pytest.TempPathFactory, garbage: bytes, at: int
) -> None:
    """Any replaced bytes result in events, notes or one error message."""
    path = tmp_path_factory.mktemp("garbage") / "capture.mcap"
    event = WireEvent(5, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc")
    data = record(path, [event]).read_bytes()
    path.write_bytes(data[:at] + garbage + data[at + len(garbage) :])
    try:
        back = read_mcap(path)
        list(back)
    except CaptureError:
        return


class FullDisk(BytesIO):
    """A file on a disk with limited space."""

    def __init__(self, room_bytes: int) -> None:
        super().__init__()
        self.room_bytes = room_bytes

    def write(self, data: Any) -> int:
        if self.tell() + len(data) > self.room_bytes:
            raise OSError(28, "No space left on device")
        return super().write(data)


def test_a_full_disk_loses_at_most_one_tick(shift: list[WireEvent], tmp_path: Path) -> None:
    """The error is raised; all events before the last tick can be read."""
    disk, removed, safe = FullDisk(1 << 20), [], 0
    sink = McapSink(disk, discard=lambda: removed.append(True))
    disk.room_bytes = disk.tell() + 5_000

    def go_on() -> None:
        nonlocal safe
        for count, event in enumerate(shift, start=1):
            sink.write(event)
            if count % 50 == 0:
                sink.tick(event.time_ns)
                safe = count

    with pytest.raises(OSError, match="No space"):
        go_on()
    path = tmp_path / "full.mcap"
    path.write_bytes(disk.getvalue())
    assert len(list(read_mcap(path))) >= safe > 0
    assert not removed


def test_an_empty_file_is_removed() -> None:
    """A full disk leaves no empty files."""
    removed: list[bool] = []
    with pytest.raises(OSError, match="No space"):
        McapSink(FullDisk(100), discard=lambda: removed.append(True))
    assert removed == [True]


def test_a_defect_in_decoding_loses_no_raw_bytes(
    shift: list[WireEvent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Decoding stops, the raw layer continues, and the file contains a note."""
    path = tmp_path / "defect.mcap"
    judge = Judge()
    monkeypatch.setattr(judge, "judge", lambda *_: 1 / 0)
    decoder = Decoder([McapSink(path.open("wb"))], judge)
    for event in shift:
        decoder.write(event)
    decoder.close()
    assert list(read_mcap(path)) == shift
    assert "ZeroDivisionError" in metadata(path)["summary"]["defect"]


def test_chunks_are_closed_when_they_are_full() -> None:
    """Memory is bounded between two flushes."""
    file = BytesIO()
    writer = ChunkWriter(file, "test")
    channel = writer.channel("/a", "", writer.schema("A", "", b""))
    for number in range(100):
        writer.message(channel, number, bytes(100_000))
    assert writer._chunk_bytes < 1 << 21
    writer.finish()
    file.seek(0)
    summary = make_reader(file).get_summary()
    assert summary
    assert summary.statistics
    assert summary.statistics.message_count == 100
    assert len(summary.chunk_indexes) >= 9


def test_messages_are_decoded_as_encoded() -> None:
    """Every field of every kind, including absent fields."""
    for kind in schemas.MESSAGES:
        empty = schemas.decode(kind, b"")
        assert schemas.decode(kind, schemas.encode(kind, **empty._asdict())) == empty
    exchange = schemas.decode(schemas.Exchange, b"")
    assert (exchange.accepted, exchange.latency_ms, exchange.number) == (None, None, 0)
    with pytest.raises(schemas.SchemaError):
        schemas.decode(schemas.Frame, b"\xff")


def test_a_removed_file(tmp_path: Path, talk: Any) -> None:
    """It is noticed at the next tick, also without traffic, and at the end."""
    path = tmp_path / "capture.mcap"
    file = path.open("wb")
    sink = McapSink(file)
    talk.mark(A2C, Kind.OPENED)
    talk.send(A2C, b"abc")
    talk.send(C2A, b"de")
    for event in talk.events:
        sink.write(event)
    sink.tick(0)
    talk.send(A2C, b"fg")
    sink.write(talk.events[-1])
    path.unlink()
    for notice in (partial(sink.tick, 0), partial(sink.close, {})):
        with pytest.raises(FileRemoved, match="capture") as raised:
            notice()
        loss = raised.value
        assert loss.begins == {("1", A2C): 0, ("1", C2A): 0}
        assert loss.lost_bytes == {A2C: 3, C2A: 2}
    file.close()


class _WithoutMemory:
    """Compresses like zstandard without memory."""

    def compress(self, data: bytes) -> bytes:
        raise ZstdError(f"cannot compress {len(data)} bytes: Allocation error : not enough memory")


def test_a_compressor_without_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is no defect of the sink: another writer process writes the data again."""
    monkeypatch.setattr("zstandard.ZstdCompressor", _WithoutMemory)
    writer = ChunkWriter(BytesIO(), "test")
    channel = writer.channel("/t", "json", writer.schema("s", "jsonschema", b"{}"))
    writer.message(channel, 1, b"{}")
    with pytest.raises(MemoryError, match="Allocation error"):
        writer.finish()
