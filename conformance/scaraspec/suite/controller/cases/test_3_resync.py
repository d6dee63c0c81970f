"""Clause 3: bytes that are not a frame.

The document does not mention them. Where a receiver looks for the next frame is a reading
(A-3-10). The cases require that the controller continues to serve, on the same connection or a new
one, and that it executes nothing that was not requested.
"""

from contextlib import suppress
from itertools import product
from typing import Final

from hypothesis import assume
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.wrong_lengths import WRONG_LENGTHS
from scaraspec.suite.controller.harness.controller_under_test import SILENCE_S, ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.mutation_targets import (
    FLOOD,
    GET_STATUS,
    GET_TIME,
    OPCODES,
    Recovery,
    damaged_targets,
    expect_only_replies,
    expect_recovery,
    is_harmless,
    recovery_of,
    stray_bytes,
    whole_targets,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply, expect
from scaraspec.user_message import UserMessage

_LONG_BYTES: Final = 5000
_ALONE: Final = (b"\0", b"help\r\n")
_ALONE_S: Final = 1.0
_MAX_PARTIAL_CONNECTIONS: Final = 4
_FRAME_TIMEOUT_S: Final = 2.3  # longer than most receivers wait for the rest of a frame (A-3-11)
_PARTIAL_FRAMES: Final = (
    b"\xaa",
    b"\xaa\x09",
    b"\xaa\x09\x00",
    b"\xaa\x09\xff",
    b"\xaa\x08\xff" + b"0" * 100,
    GET_STATUS + b"\xaa\x08\x04\x30",
)

_DAMAGED: Final = (
    GET_STATUS[:-1] + b"\x55",
    GET_TIME[:1] + b"\x09\x03" + GET_TIME[3:],
    b"\xaa\x08\xff" + b"0" * 255 + b"\x55",
    b"\xcc",
    b"\x55" * _LONG_BYTES,
    b"\0" * _LONG_BYTES,
)
"""One example of each kind of bytes that are not a frame."""


def _tolerate_close(subject: ControllerUnderTest, requirement: str, recovery: Recovery) -> None:
    """Tolerate a closed connection: it is the only reading that can be observed with certainty."""
    if recovery is Recovery.NEW_CONNECTION:
        subject.tolerate(requirement, "resync", "close", "the connection was closed")


# ---------------------------------------------------------------------- stray bytes


@case("3/19", name="start")
def test_wrong_start(subject: ControllerUnderTest) -> None:
    """The controller recovers from requests with every wrong start byte."""
    line = subject.open(judged=False)
    for start in {*range(256)} - {A2C.start, C2A.start}:
        try:
            line.send_bytes(bytes((start,)) + GET_TIME[1:])
        except NoReply:
            line = subject.open(judged=False)
            continue
        if start % 16 == 0:
            recovery = recovery_of(subject, line)
            expect_only_replies(line, requirement="3/19")
            if recovery is Recovery.NEW_CONNECTION:
                _tolerate_close(subject, "3/19", recovery)
                line = subject.open(judged=False)
    recovery_of(subject, line)


@case("3/19")
@given(garbage=stray_bytes, carrier=whole_targets)
def test_stray_bytes(subject: ControllerUnderTest, garbage: bytes, carrier: bytes) -> None:
    """The controller recovers from stray bytes between requests, in their own segments."""
    assume(is_harmless((garbage + carrier) * 2 + FLOOD))
    line = subject.open(judged=False)
    for data in (garbage, carrier, garbage, carrier):
        try:
            line.send_bytes(data)
        except NoReply:
            break
    recovery = recovery_of(subject, line)
    expect_only_replies(line, requirement="3/19")
    _tolerate_close(subject, "3/19", recovery)
    line.close()


@case("3/19", name="joined")
@given(garbage=stray_bytes, carrier=whole_targets)
def test_joined_with_requests(subject: ControllerUnderTest, garbage: bytes, carrier: bytes) -> None:
    """The controller recovers from stray bytes in one segment with requests."""
    data = (garbage + carrier) * 2
    assume(is_harmless(data + FLOOD))
    _tolerate_close(subject, "3/19", expect_recovery(subject, data, requirement="3/19"))


@case("3/19", name="long")
def test_much_garbage(subject: ControllerUnderTest) -> None:
    """The controller recovers from thousands of stray bytes, and from typed text."""
    line = subject.open(judged=False)
    for data in examples(
        (b"\x55" * _LONG_BYTES, b"\x00" * _LONG_BYTES, b"\xff" * 300, b"help\r\n" * 50)
    ):
        try:
            line.send_bytes(data)
        except NoReply:
            break
    recovery = recovery_of(subject, line)
    expect_only_replies(line, requirement="3/19")
    _tolerate_close(subject, "3/19", recovery)


@case("3/19", name="alone")
def test_stray_bytes_alone(subject: ControllerUnderTest) -> None:
    """The first request is answered one second after stray bytes; or the connection is closed."""
    count = len(_ALONE) if subject.supports_multiple_connections else 1
    for number in range(0, len(_ALONE), count):  # on several connections at the same time
        sent = [(subject.open(judged=False), each) for each in _ALONE[number : number + count]]
        for line, garbage in sent:
            line.send_bytes(garbage)
        subject.pause(_ALONE_S)
        for line, _ in examples(sent):
            _expect_reply_or_close(subject, line)
        subject.close_lines()


def _expect_reply_or_close(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Expect that a request on this connection is answered, or that the connection is closed."""
    try:
        line.ask("get_version")
    except NoReply as error:
        if line.ending is None:
            error.requirement = "3/19"
            raise
        _tolerate_close(subject, "3/19", recovery_of(subject, line))
    else:
        expect_only_replies(line, requirement="3/19")


# ---------------------------------------------------------------------- malformed frames


@case("3/20", slow=True)
@given(frame=damaged_targets)
def test_spoiled_frames(subject: ControllerUnderTest, frame: bytes) -> None:
    """The controller recovers from a request with a wrong end byte or a wrong length."""
    _tolerate_close(subject, "3/20", expect_recovery(subject, frame, requirement="3/20"))


@case("3/20", name="end")
def test_every_wrong_end(subject: ControllerUnderTest) -> None:
    """The controller recovers from each of many wrong end bytes; a reply to it is tolerated."""
    for end in examples((0x00, 0x0D, 0x33, 0xAB, 0xAC, 0xCB, 0xCD, 0xEC, 0xFF)):
        data = GET_STATUS[:-1] + bytes((end,))
        _tolerate_close(subject, "3/20", expect_recovery(subject, data, requirement="3/20"))
    line = subject.open(judged=False)
    line.send_bytes(data)
    recovery_of(subject, line)
    if any(received.name == "get_status" for received in line.inbox):
        message = "a request with a wrong end byte was answered"
        subject.tolerate("3/20", "A-3-10", "answered", message)


@case("3/20", name="length")
def test_wrong_lengths(subject: ControllerUnderTest) -> None:
    """The controller recovers from a length that is too small, too large, or of the whole frame."""
    for size_bytes, offset in examples(product((0, 1, 8), (-1, 1, 3, 4))):
        declared = (size_bytes + offset) % 256
        data = bytes((A2C.start, 0x08, declared)) + b"0" * size_bytes + bytes((A2C.end,))
        _tolerate_close(subject, "3/20", expect_recovery(subject, data, requirement="3/20"))


@case("3/20", name="ascii-length")
def test_length_in_digits(subject: ControllerUnderTest) -> None:
    """The controller recovers from a length in ASCII digits, a reading of the document (A-0-4)."""
    data = b"\xaa\x09\x30\xcc" + b"\xaa\x08\x31\x30\xcc"
    _tolerate_close(subject, "3/20", expect_recovery(subject, data, requirement="3/20"))


@case("3/20", name="printed", hazards=(Hazard.STATE, Hazard.MOTION, Hazard.DESTRUCTIVE))
def test_printed_lengths(subject: ControllerUnderTest) -> None:
    """The controller recovers from requests with the wrong lengths of the document's examples.

    They are in section 11 of the register. If they are executed, they change nothing.
    """
    subject.moved = True
    line = subject.open()
    values = {
        0x05: line.ask("get_network").frame.data,
        0x36: line.ask("get_initial_tool_position").frame.data,
        0x39: b"1|" + line.ask("get_tool_coordinates").frame.data,
        0x54: subject.new_name(),
    }
    line.close()
    for row in examples(row for row in WRONG_LENGTHS if row.frame.direction is A2C):
        data = values[row.frame.opcode].rstrip(b"\0")
        off_by = row.declared - len(row.frame.data)
        declared = (len(data) + off_by) % 256  # the reported value may be empty or too long
        raw = bytes((A2C.start, row.frame.opcode, declared)) + data + bytes((A2C.end,))
        opcodes = OPCODES | {row.frame.opcode}
        recovery = expect_recovery(subject, raw, requirement="3/20", opcodes=opcodes)
        _tolerate_close(subject, "3/20", recovery)


@case("3/20", name="truncated", slow=True)
def test_truncated(subject: ControllerUnderTest) -> None:
    """The controller recovers from a request that is truncated at any byte."""
    frame = Frame(A2C, 0x08, b"0123456").encode()
    for cut in examples(range(1, len(frame))):
        _tolerate_close(subject, "3/20", expect_recovery(subject, frame[:cut], requirement="3/20"))


@case("3/20", name="inside")
@given(frame=whole_targets, before=stray_bytes, after=stray_bytes)
def test_frames_inside_garbage(
    subject: ControllerUnderTest, frame: bytes, before: bytes, after: bytes
) -> None:
    """The controller recovers from a malformed request whose data contains a valid one."""
    inner = before + frame + after
    data = bytes((A2C.start, 0x07, len(inner))) + inner + b"\x55"
    assume(is_harmless(data + FLOOD))
    _tolerate_close(subject, "3/20", expect_recovery(subject, data, requirement="3/20"))


@case("3/20", name="tag")
def test_tag_from_the_client(subject: ControllerUnderTest) -> None:
    """The controller recovers from a request with the tag of a final result."""
    _tolerate_close(
        subject, "3/20", expect_recovery(subject, b"\xaa\x90\x08\x00\xcc", requirement="3/20")
    )


@case("3/20", name="often")
def test_many_malformed_requests(subject: ControllerUnderTest) -> None:
    """The controller serves valid requests between two hundred malformed ones."""
    line = subject.open(judged=False)
    for number in range(200):
        try:
            line.send_bytes(bytes((A2C.start, 0x08, number % 5)) + b"0" * 5 + b"\xcd")
        except NoReply:
            line = subject.open(judged=False)
            continue
        if number % 20 == 0 and recovery_of(subject, line) is Recovery.NEW_CONNECTION:
            line = subject.open(judged=False)
    _tolerate_close(subject, "3/20", recovery_of(subject, line))


# ---------------------------------------------------------------------- wrong direction


@case("3/23", slow=True)
@given(opcode=st.sampled_from((0x07, 0x08, 0x09)), data=st.binary(max_size=20))
def test_wrong_direction(subject: ControllerUnderTest, opcode: int, data: bytes) -> None:
    """A request in the format of replies is ignored as invalid, or answered."""
    frame = Frame(C2A, opcode, data.replace(b"\xaa", b"\x55")).encode()
    line = subject.open(judged=False)
    line.send_bytes(frame)
    line.separate_frames()
    expect_only_replies(line, requirement="3/23")
    if any(received.frame.opcode == opcode for received in line.inbox):
        message = "a request in the format of replies was served"
        subject.tolerate("3/23", "A-3-13", "accepted", message)
    line.inbox.clear()
    recovery = recovery_of(subject, line)
    expect_only_replies(line, requirement="3/23")
    _tolerate_close(subject, "3/23", recovery)
    line.close()


@case("3/23", name="reply")
def test_own_reply(subject: ControllerUnderTest) -> None:
    """The controller recovers from its own replies, as in a wiring loop."""
    replies = b"".join(
        Frame(C2A, opcode, data).encode()
        for opcode, data in ((0x07, b"20141222143000"), (0x08, b"1.0.0"), (0x09, b"00"))
    )
    _tolerate_close(subject, "3/23", expect_recovery(subject, replies, requirement="3/23"))


@case("3/20", "3/19", name="bystander")
def test_bystander(subject: ControllerUnderTest) -> None:
    """Invalid bytes on one connection do not end another one, for example by a crash."""
    subject.require_multiple_connections()
    bystander = subject.open()
    for data in examples(_DAMAGED):
        expect_recovery(subject, data, requirement="3/20")
        bystander.pump()
        expect(
            bystander.ending is None,
            UserMessage("{data} on one connection ended another one", data=show(data)),
            expected="an open connection",
            observed="the end of both connections",
        )
    bystander.ask("get_status")


# ---------------------------------------------------------------------- incomplete frames


@case("3/29")
def test_half_frames(subject: ControllerUnderTest) -> None:
    """After a connection ends within a frame, the next one is served and is not affected."""
    subject.require_close_detection()
    for part in examples(_PARTIAL_FRAMES):
        line = subject.open(judged=False)
        line.send_bytes(part)
        if subject.supports_multiple_connections:
            _expect_served(subject)
            line.close()
        else:
            line.close()
            subject.pause(SILENCE_S)
        _expect_served(subject)


@case("3/29", name="reset")
def test_cut_off_in_a_frame(subject: ControllerUnderTest) -> None:
    """After a connection is reset within a frame, the next one is served."""
    subject.require_close_detection()
    for part in examples(_PARTIAL_FRAMES):
        line = subject.open(judged=False)
        line.send_bytes(part)
        line.reset()
        _expect_served(subject)


@case("3/29", name="half-close")
def test_half_close_in_a_frame(subject: ControllerUnderTest) -> None:
    """After a client half-closes within a frame, the next connection is served."""
    if subject.access.port is None:
        raise CaseSkipped("only a network link can be half closed")
    for part in examples(_PARTIAL_FRAMES):
        line = subject.open(judged=False)
        line.send_bytes(part)
        line.half_close()
        if not subject.supports_multiple_connections:
            line.close()
        _expect_served(subject)
        line.close()


@case("3/29", name="several")
def test_several_half_frames(subject: ControllerUnderTest) -> None:
    """While several connections wait within a frame, new ones are served."""
    _open_partial_frames(subject)
    _expect_served(subject)


@case("3/29", name="silence", slow=True)
def test_silent_half_frames(subject: ControllerUnderTest) -> None:
    """While connections wait long within a frame, new ones are served; the old ones work or end."""
    lines = _open_partial_frames(subject)
    subject.pause(_FRAME_TIMEOUT_S)
    _expect_served(subject)
    for line in lines:
        line.inbox.clear()
        if line.ending is None:
            recovery_of(subject, line)
            expect_only_replies(line, requirement="3/29")


def _open_partial_frames(subject: ControllerUnderTest) -> list[OutgoingConnection]:
    """Return several connections, each with an incomplete frame."""
    subject.require_multiple_connections()
    lines = [subject.open(judged=False)]
    with suppress(CaseFailed):  # so many may not be served (A-2-2)
        while len(lines) <= _MAX_PARTIAL_CONNECTIONS:
            lines.append(subject.open(judged=False))
    lines.pop().close()  # leave room for one more
    for line, part in zip(lines, _PARTIAL_FRAMES, strict=False):
        line.send_bytes(part)
    return lines


def _expect_served(subject: ControllerUnderTest) -> None:
    """Expect that a new connection is served and gets no reply to requests of others."""
    line = subject.open()
    line.ask("get_time")
    line.ask("get_status")
    message = "a new connection received a reply to another connection's request"
    expect(not line.inbox, message)
    line.close()
