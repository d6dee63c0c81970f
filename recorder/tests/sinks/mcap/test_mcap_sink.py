"""capture.mcap holds every byte as it came, says what it means, and reads back."""

import math
import struct
import subprocess
import sysconfig
from collections.abc import Callable, Iterable
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
from zstandard import ZstdCompressor

from scaraspec.judge.judge import Judge
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Chunk
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.recordings.repair import repair
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.chunk_writer import ChunkWriter
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.sinks.sink import OutputFolder
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk

RERUN = Path(sysconfig.get_path("scripts")) / "rerun"
KINDS: dict[str, type[schemas.Message]] = {
    schemas.full_name(kind): kind for kind in schemas.MESSAGES
}


def record(path: Path, events: Iterable[WireEvent], redactor: Redactor | None = None) -> Path:
    """Record events as the scribe does, with a tick every quarter of a second."""
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
    """The messages of a topic, read by the mcap package by its index and checksums."""
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
    """The shift, recorded."""
    return record(tmp_path_factory.mktemp("mcap") / "capture.mcap", shift)


def test_raw_in_is_raw_out(capture: Path, shift: list[WireEvent]) -> None:
    """Every event comes back as it was given, in its order, and the file says that it is whole."""
    back = read_mcap(capture)
    assert list(back) == shift
    assert back.summary.whole
    assert back.summary.events == len(shift)


texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)


@st.composite
def conversations(draw: st.DrawFn) -> list[WireEvent]:
    """Anything that a source may tell of two connections."""
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
def test_any_conversation_comes_back(
    tmp_path_factory: pytest.TempPathFactory, events: list[WireEvent]
) -> None:
    """Whatever the bytes, times, notes and kinds are, the raw layer gives them back."""
    path = record(tmp_path_factory.mktemp("any") / "capture.mcap", events)
    back = read_mcap(path)
    assert list(back) == events
    assert back.summary.whole


def test_what_is_derived_from_the_file_is_what_was_derived_live(
    capture: Path, tmp_path: Path
) -> None:
    """A file recorded again from its own raw layer says the same."""
    again = record(tmp_path / "again.mcap", read_mcap(capture))
    for topic in ("/frames", "/undecodable", "/exchanges", "/transfers", "/findings"):
        assert messages(again, topic) == messages(capture, topic)


def test_the_accounts_balance(capture: Path, shift: list[WireEvent]) -> None:
    """Received = recorded + lost, and the hash is that of the bytes recorded."""
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


def test_exchanges_tell_the_whole_story(capture: Path) -> None:
    """Request, first reply, final result, outcome and times, numbered by the requests."""
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


def test_the_robots_latency_is_told_from_the_recorders(
    tmp_path: Path, passed: list[WireEvent]
) -> None:
    """Two milliseconds between the times of receipt: twenty microseconds were the recorder's."""
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


def test_what_is_not_known_of_a_latency_is_not_said(capture: Path) -> None:
    """A capture of somebody else does not tell when bytes were passed on."""
    assert {x.robot_ms for x in messages(capture, "/exchanges")} == {None}
    assert {x.recorder_ms for x in messages(capture, "/exchanges")} == {None}
    assert {chunk.forwarded_ns for chunk in messages(capture, "/raw/c2a")} == {None}


def test_frames_tile_what_was_recorded(capture: Path, shift: list[WireEvent]) -> None:
    """Frames, undecodable runs and gaps leave no byte of a stream unexplained."""
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
    """It can be taken out of the recording whole, and its message holds its hash."""
    with capture.open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
    assert (attachment.name, attachment.data) == ("upload pick.rob", program_file)
    (transfer,) = messages(capture, "/transfers")
    assert (transfer.state, transfer.received_bytes) == ("done", len(program_file))
    assert transfer.sha256 == sha256(program_file).hexdigest()


def test_a_file_name_is_no_path(talk: Any, tmp_path: Path) -> None:
    """Whatever a peer calls its file, the attachment's name leads nowhere."""
    talk.send(A2C, Frame(A2C, 0x50, b"../../etc/pass\\wd").encode())
    talk.send(C2A, Frame(C2A, 0x50, b"1").encode())
    talk.ask("upload_chunk", Chunk(1, 0, 1, b"x"), reply=True)
    with record(tmp_path / "a.mcap", talk.events).open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
    assert attachment.name == "upload .._.._etc_pass_wd"


def test_the_log_is_sparse_and_speaks_foxglove(capture: Path) -> None:
    """Noise, gap, refusal and what was commanded stand in it; mere queries do not."""
    lines = [Log.FromString(message.data) for message in messages(capture, "/log")]
    text = "\n".join(line.message for line in lines)
    for words in ("no frame (stray)", "are missing", "refused 01", "upload of pick.rob", "closed"):
        assert words in text
    assert "get_status" not in text
    assert {line.level for line in lines} >= {Log.INFO, Log.WARNING}


class Cdr:
    """Reads CDR as another implementation would: by its alignment rules."""

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
    """Radians and metres, their rates since the last ones, and no effort, for none is told."""
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


def test_the_description_is_the_arm_that_the_transforms_move(capture: Path) -> None:
    """Every joint of the URDF has a transform of that name, from its parent to its child."""
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
    """Outside the raw layer no message, attachment or metadata holds it."""
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
    """Neither in findings nor in undecodable bytes; an echo of it is masked as well."""
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


def test_a_redacted_file_holds_no_password(shift: list[WireEvent], tmp_path: Path) -> None:
    """Not even raw; the frames are the same otherwise."""
    path = record(tmp_path / "redacted.mcap", shift, Redactor())
    back = list(read_mcap(path))
    assert b"sesame" not in b"".join(event.data for event in back)
    assert [(e.time_ns, e.kind, len(e.data)) for e in back] == [
        (e.time_ns, e.kind, len(e.data)) for e in shift
    ]


@pytest.mark.parametrize("needs_login", [True, False])
def test_the_file_says_what_link_it_was(
    shift: list[WireEvent], tmp_path: Path, *, needs_login: bool
) -> None:
    """So that whoever reads it knows whether a login was due, also where its end is torn."""
    sink = capture_sink(OutputFolder(tmp_path, []), draw=False, needs_login=needs_login)
    for event in shift:
        sink.write(event)
    sink.close()
    capture = read_mcap(tmp_path / "capture.mcap")
    assert capture.needs_login is needs_login
    capture.path.write_bytes(capture.path.read_bytes()[:-100])
    repair(capture.path)
    assert capture.needs_login is needs_login


def test_rerun_reads_it(capture: Path) -> None:
    """Rerun's own tools find no fault with it."""
    for command in ("info", "check"):
        done = subprocess.run(
            [RERUN, "mcap", command, capture], capture_output=True, text=True, check=True
        )
        assert "/robot_description" in done.stdout
        assert "PROBLEM" not in done.stdout


# What may become of a file.


def test_a_file_torn_anywhere_gives_what_was_flushed(
    shift: list[WireEvent], tmp_path: Path
) -> None:
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
    """The events of a torn file; none where even its beginning is torn."""
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
    """Bytes that cannot be read are told as missing, at their offsets; the rest stands."""
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
    """A file of a later hour does not pretend that its first byte was the connection's first."""
    late = WireEvent(5, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc", 1000)
    gap, event = read_mcap(record(tmp_path / "late.mcap", [late]))
    assert (gap.kind, gap.offset_bytes, gap.length_bytes) == (Kind.GAP, 0, 1000)
    assert event == late


def test_foreign_files_are_refused_in_one_sentence(tmp_path: Path) -> None:
    """What is no recording of this tool is said to be none, by its name."""
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


def test_a_chunk_that_would_fill_the_memory_is_left_alone(
    shift: list[WireEvent], tmp_path: Path
) -> None:
    """A chunk that claims a terabyte is damage, and is not unpacked."""
    path = record(tmp_path / "bomb.mcap", shift[:12])
    data = path.read_bytes()
    at = chunk_indexes(path)[-1].chunk_start_offset + 1 + 8 + 8 + 8  # behind length and two times
    path.write_bytes(data[:at] + (1 << 40).to_bytes(8, "little") + data[at + 8 :])
    back = read_mcap(path)
    assert 0 < len(list(back)) < 12
    assert "1 damaged chunks" in back.summary.notes[0]


def test_a_chunk_that_lies_about_its_size_is_left_alone(tmp_path: Path) -> None:
    """What zstd says of itself counts too: a gigabyte of zeros packs into thirty kilobytes."""
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
def test_garbage_is_told_and_never_raises(
    tmp_path_factory: pytest.TempPathFactory, garbage: bytes, at: int
) -> None:
    """Any bytes in the place of any others end in events, notes, or one sentence."""
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
    """A file that takes so many bytes and no more."""

    def __init__(self, room_bytes: int) -> None:
        super().__init__()
        self.room_bytes = room_bytes

    def write(self, data: Any) -> int:
        if self.tell() + len(data) > self.room_bytes:
            raise OSError(28, "No space left on device")
        return super().write(data)


def test_a_full_disk_is_told_and_costs_only_what_came_last(
    shift: list[WireEvent], tmp_path: Path
) -> None:
    """The error goes through; every tick that returned can be read from what is on the disk."""
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


def test_a_file_that_never_held_anything_is_removed() -> None:
    """A full disk leaves no trail of empty files behind."""
    removed: list[bool] = []
    with pytest.raises(OSError, match="No space"):
        McapSink(FullDisk(100), discard=lambda: removed.append(True))
    assert removed == [True]


def test_a_defect_in_decoding_costs_no_raw_byte(
    shift: list[WireEvent], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The raw layer goes on when the derived one cannot, and the file says so."""
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
    """Memory stays bounded between two flushes."""
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


def test_messages_survive_their_encoding() -> None:
    """Every field of every kind comes back, absent ones as absent."""
    for kind in schemas.MESSAGES:
        empty = schemas.decode(kind, b"")
        assert schemas.decode(kind, schemas.encode(kind, **empty._asdict())) == empty
    exchange = schemas.decode(schemas.Exchange, b"")
    assert (exchange.accepted, exchange.latency_ms, exchange.number) == (None, None, 0)
    with pytest.raises(schemas.SchemaError):
        schemas.decode(schemas.Frame, b"\xff")
