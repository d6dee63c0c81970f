"""The frames that support findings are stored unchanged, except for passwords."""

import pytest

from scaraspec.judge.verdicts import Cause, Finding, Verdict
from scaraspec.protocol import commands
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame, SkipReason
from scaraspec.protocol.transfer import FILE_DATA, Chunk
from scaraspec.report.evidence import EvidenceCollector, evidence_of, step_of
from scaraspec.report.failed_step import FailedStep, Stage
from scaraspec.report.model import FrameField
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, InvalidBytes
from scaraspec.traffic.wire import WireRange


def seen(frame: Frame, at: int = 0) -> FrameSeen:
    """Return a frame at this offset of its stream."""
    place = WireRange("1", frame.direction, at, frame.size_bytes, 1000 + at)
    return FrameSeen(frame, place, 1000 + at, commands.parse_frame(frame))


def invalid_bytes(direction: Direction, data: bytes) -> InvalidBytes:
    """Return bytes that belong to no frame."""
    return InvalidBytes(data, SkipReason.BAD_END, WireRange("1", direction, 0, len(data), 5))


def finding(*places: WireRange, requirement: str = "3/18") -> Finding:
    """Return a failure with these positions as evidence."""
    return Finding(requirement, Verdict.FAIL, Cause.SUBJECT, "wrong", evidence=places)


def parts(frame: Frame) -> list[tuple[str, int, int, str]]:
    """Return the fields of a frame."""
    return [
        (f.name, f.offset_bytes, f.length_bytes, f.value) for f in evidence_of(seen(frame)).fields
    ]


def test_content_of_evidence() -> None:
    """Position, note and bytes."""
    found = evidence_of(seen(Frame(C2A, 0x30, b"11", tagged=True), at=66))
    assert (found.connection, found.direction, found.offset_bytes) == ("1", C2A, 66)
    assert (found.length_bytes, found.time_ns) == (7, 1066)
    assert (found.note, found.frame_hex) == ("run_program, final result", "CC9030023131AA")


def test_fields_of_a_frame() -> None:
    """Header, texts between bars, and end; bars have no field."""
    assert parts(Frame(A2C, 0x43, b"8|1")) == [
        ("start", 0, 1, "A2C"),
        ("opcode", 1, 1, "Set a digital output"),
        ("length", 2, 1, "3"),
        ("port", 3, 1, "8"),
        ("value", 5, 1, "1"),
        ("end", 6, 1, "A2C"),
    ]


@pytest.mark.parametrize(
    ("frame", "names"),
    [
        (Frame(C2A, 0x30, b"1"), ["flag"]),
        (Frame(C2A, 0x30, b"0|11"), ["flag", "code"]),
        (Frame(C2A, 0x30, b"00|12", tagged=True), ["flag", "code"]),
        (Frame(C2A, 0x0A, b"1|a.rob|00000003"), ["flag", "name", "run_time_s"]),
        (Frame(C2A, 0x0A, b"0"), ["flag"]),
        (Frame(C2A, 0x0B, b"0|a|b"), ["flag", "name", "name"]),
        (Frame(C2A, 0x04, b"192.168.1.2 255.255.255.0"), ["data"]),
        (Frame(C2A, 0x30, b"1|2|3|4"), ["data"] * 4),
        (Frame(A2C, 0x77, b"?"), ["data"]),
        (Frame(A2C, 0x09), []),
    ],
)
def test_names_of_text_fields(frame: Frame, names: list[str]) -> None:
    """Data that does not match the payload is named "data"."""
    marked = [name for name, *_ in parts(frame)]
    assert [n for n in marked if n not in ("start", "tag", "opcode", "length", "end")] == names


def test_fields_of_a_chunk() -> None:
    """The three numbers, the valid bytes and the padding."""
    data = FILE_DATA.encode(Chunk(300, 200, 100, b"x" * 100))
    assert parts(Frame(A2C, 0x52, data))[3:8] == [
        ("fileSize", 3, 4, "300"),
        ("position", 7, 4, "200"),
        ("length", 11, 4, "100"),
        ("data", 15, 100, "100 valid bytes"),
        ("padding", 115, 100, ""),
    ]


@pytest.mark.parametrize(
    "frame",
    [
        Frame(A2C, 0x01, b"sesame"),
        Frame(A2C, 0x03, b"sesame|sesame2"),
        Frame(C2A, 0x01, b"sesame"),
    ],
)
def test_a_password_is_masked(frame: Frame) -> None:
    """Length and bars remain; a reply that repeats the password is masked, too."""
    found = evidence_of(seen(frame))
    assert b"sesame".hex().upper() not in found.frame_hex
    assert set(bytes.fromhex(found.frame_hex[6:-2])) <= set(b"*|")
    assert "sesame" not in repr(found)


def test_the_flag_of_a_login_is_shown() -> None:
    """One byte cannot be a password, and a reader needs it."""
    assert evidence_of(seen(Frame(C2A, 0x01, b"0"))).frame_hex == "CC010130AA"


def test_a_password_in_invalid_bytes_is_masked() -> None:
    """An example is a login with a wrong length."""
    found = evidence_of(invalid_bytes(A2C, b"\x00\xaa\x01\x09sesame\xcc"))
    assert found.frame_hex == "00AA0109" + "2A" * 7
    assert found.note == "no frame: bad end"


def test_invalid_bytes_have_a_limit() -> None:
    """The first 512 bytes are shown."""
    assert evidence_of(invalid_bytes(C2A, b"\xcc\x09\x05")).frame_hex == "CC0905"
    assert len(evidence_of(invalid_bytes(C2A, b"\x55" * 4000)).frame_hex) == 1024


def test_evidence_of_a_finding_is_stored() -> None:
    """The bytes are available after the recording was read."""
    exhibits, frame = EvidenceCollector(), seen(Frame(A2C, 0x09))
    exhibits.add(frame)
    exhibits.add(finding(frame.place))
    for at in range(1000):
        exhibits.add(seen(Frame(A2C, 0x08), at))
    assert exhibits.evidence(frame.place).frame_hex == "AA0900CC"


def test_evidence_without_stored_bytes() -> None:
    """It has the position and no bytes."""
    exhibits, frame = EvidenceCollector(), seen(Frame(A2C, 0x09), at=12)
    exhibits.add(frame)
    for at in range(100, 1000):
        exhibits.add(seen(Frame(A2C, 0x08), at))
    exhibits.add(finding(frame.place))
    found = exhibits.evidence(frame.place)
    assert (found.offset_bytes, found.frame_hex, found.fields) == (12, "", ())


def test_memory_is_bounded() -> None:
    """A requirement that fails at every frame stores the first fifty."""
    exhibits = EvidenceCollector()
    for at in range(2000):
        exhibits.add(seen(Frame(A2C, 0x09), at))
        exhibits.add(finding(WireRange("1", A2C, at, 4, 1000 + at)))
    assert len(exhibits._stored) == 50
    assert (
        FrameField("start", 0, 1, "A2C")
        in exhibits.evidence(WireRange("1", A2C, 0, 4, 1000)).fields
    )


def test_the_last_passing_exchange() -> None:
    """The last exchange of the same command without a failure."""
    exhibits = EvidenceCollector()
    for at, code in ((0, b"01"), (100, b"00"), (200, b"0")):
        request, reply = seen(Frame(A2C, 0x09), at), seen(Frame(C2A, 0x09, code), at)
        command = BY_NAME["get_status"]
        exhibits.add(Exchange(request, command, reply, ending=Ending.ANSWERED))
    exhibits.add(finding(reply.place))
    wire = (exhibits.evidence(reply.place),)
    assert [e.frame_hex for e in exhibits.passing(wire)] == ["AA0900CC", "CC09023030AA"]
    assert exhibits.passing([evidence_of(seen(Frame(A2C, 0x08)))]) == ()


def test_the_step_that_a_failure_is_about() -> None:
    """Command, stage and field follow from the last frame; the instant from the first one."""
    request, reply = seen(Frame(A2C, 0x09)), seen(Frame(C2A, 0x09, b"7"), at=20)
    wire = [evidence_of(request), evidence_of(reply)]
    assert step_of(wire) == FailedStep(1000, Stage.REPLY, "get_status", "code")
    assert step_of(wire[:1]) == FailedStep(1000, Stage.REQUEST, "get_status")
    result = evidence_of(seen(Frame(C2A, 0x30, b"12", tagged=True)))
    assert step_of([result], "2") == FailedStep(1000, Stage.RESULT, "run_program", "flag")
    noise = evidence_of(invalid_bytes(C2A, b"\x00"))
    assert step_of([noise]) == FailedStep(5, Stage.FRAME)
    assert step_of([]) == FailedStep(0, Stage.CONNECTION)
