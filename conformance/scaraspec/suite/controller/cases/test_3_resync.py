"""Clause 3: bytes that are no frame. Where the next frame is looked for is a reading (A-3-10).

The document says nothing of them. What counts is that the subject goes on to serve, on the same
connection or on a new one, and that it does nothing that nobody asked for.
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
    carriers,
    harmless,
    nothing_else,
    recovers,
    spoiled,
    strays,
    survives,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply, expect
from scaraspec.user_message import UserMessage

_LONG_BYTES: Final = 5000
_HANGING: Final = 4
_GIVEN_UP_S: Final = 2.3  # longer than most receivers wait for the rest of a frame (A-3-11)
_PARTS: Final = (
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
"""One of each way to be no frame."""


def _tell(subject: ControllerUnderTest, requirement: str, how: Recovery) -> None:
    """Closing is the one reading that shows beyond doubt."""
    if how is Recovery.ANEW:
        subject.tolerate(requirement, "resync", "close", "the connection was closed")


# ---------------------------------------------------------------------- stray bytes


@case("3/19", name="start")
def test_wrong_start(subject: ControllerUnderTest) -> None:
    """A request begins with every byte that is no start byte."""
    line = subject.open(judged=False)
    for start in {*range(256)} - {A2C.start, C2A.start}:
        try:
            line.send_bytes(bytes((start,)) + GET_TIME[1:])
        except NoReply:
            line = subject.open(judged=False)
            continue
        if start % 16 == 0:
            how = recovers(subject, line)
            nothing_else(line, requirement="3/19")
            if how is Recovery.ANEW:
                _tell(subject, "3/19", how)
                line = subject.open(judged=False)
    recovers(subject, line)


@case("3/19")
@given(garbage=strays, carrier=carriers)
def test_stray_bytes(subject: ControllerUnderTest, garbage: bytes, carrier: bytes) -> None:
    """Stray bytes come before, between and behind requests, in segments of their own."""
    assume(harmless((garbage + carrier) * 2 + FLOOD))
    line = subject.open(judged=False)
    for data in (garbage, carrier, garbage, carrier):
        try:
            line.send_bytes(data)
        except NoReply:
            break
    how = recovers(subject, line)
    nothing_else(line, requirement="3/19")
    _tell(subject, "3/19", how)
    line.close()


@case("3/19", name="joined")
@given(garbage=strays, carrier=carriers)
def test_joined_with_requests(subject: ControllerUnderTest, garbage: bytes, carrier: bytes) -> None:
    """Stray bytes come in one segment with the requests around them."""
    data = (garbage + carrier) * 2
    assume(harmless(data + FLOOD))
    _tell(subject, "3/19", survives(subject, data, requirement="3/19"))


@case("3/19", name="long")
def test_much_garbage(subject: ControllerUnderTest) -> None:
    """Thousands of bytes come none of which begins a frame, and then text as a person types it."""
    line = subject.open(judged=False)
    for data in examples(
        (b"\x55" * _LONG_BYTES, b"\x00" * _LONG_BYTES, b"\xff" * 300, b"help\r\n" * 50)
    ):
        try:
            line.send_bytes(data)
        except NoReply:
            break
    how = recovers(subject, line)
    nothing_else(line, requirement="3/19")
    _tell(subject, "3/19", how)


# ---------------------------------------------------------------------- spoilt frames


@case("3/20", slow=True)
@given(frame=spoiled)
def test_spoiled_frames(subject: ControllerUnderTest, frame: bytes) -> None:
    """A request has a wrong end byte, or a length that is not the number of its data bytes."""
    _tell(subject, "3/20", survives(subject, frame, requirement="3/20"))


@case("3/20", name="end")
def test_every_wrong_end(subject: ControllerUnderTest) -> None:
    """A request ends with each of many wrong bytes; that it is answered is only warned of."""
    for end in examples((0x00, 0x0D, 0x33, 0xAB, 0xAC, 0xCB, 0xCD, 0xEC, 0xFF)):
        data = GET_STATUS[:-1] + bytes((end,))
        _tell(subject, "3/20", survives(subject, data, requirement="3/20"))
    line = subject.open(judged=False)
    line.send_bytes(data)
    recovers(subject, line)
    if any(seen.name == "get_status" for seen in line.inbox):
        message = "a request with a wrong end byte was answered"
        subject.tolerate("3/20", "A-3-10", "answered", message)


@case("3/20", name="length")
def test_wrong_lengths(subject: ControllerUnderTest) -> None:
    """The length is one too small or too great, or that which counts the whole frame."""
    for size_bytes, wrong in examples(product((0, 1, 8), (-1, 1, 3, 4))):
        declared = (size_bytes + wrong) % 256
        data = bytes((A2C.start, 0x08, declared)) + b"0" * size_bytes + bytes((A2C.end,))
        _tell(subject, "3/20", survives(subject, data, requirement="3/20"))


@case("3/20", name="ascii-length")
def test_length_in_digits(subject: ControllerUnderTest) -> None:
    """The length is an ASCII digit, as a reader of the document's table may take it (A-0-4)."""
    data = b"\xaa\x09\x30\xcc" + b"\xaa\x08\x31\x30\xcc"
    _tell(subject, "3/20", survives(subject, data, requirement="3/20"))


@case("3/20", name="printed", hazards=(Hazard.STATE, Hazard.MOTION, Hazard.DESTRUCTIVE))
def test_printed_lengths(subject: ControllerUnderTest) -> None:
    """Requests have lengths that are as wrong as the document prints them (register, section 11).

    What they would do, if they were taken for whole, changes nothing.
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
        declared = (len(data) + off_by) % 256  # the subject may have told nothing, or too much
        raw = bytes((A2C.start, row.frame.opcode, declared)) + data + bytes((A2C.end,))
        opcodes = OPCODES | {row.frame.opcode}
        how = survives(subject, raw, requirement="3/20", opcodes=opcodes)
        _tell(subject, "3/20", how)


@case("3/20", name="truncated", slow=True)
def test_truncated(subject: ControllerUnderTest) -> None:
    """A request with data stops at every byte, and the next one follows at once."""
    frame = Frame(A2C, 0x08, b"0123456").encode()
    for cut in examples(range(1, len(frame))):
        _tell(subject, "3/20", survives(subject, frame[:cut], requirement="3/20"))


@case("3/20", name="inside")
@given(frame=carriers, before=strays, behind=strays)
def test_frames_inside_garbage(
    subject: ControllerUnderTest, frame: bytes, before: bytes, behind: bytes
) -> None:
    """A whole request stands in the data of a spoilt one; it is served or not."""
    inner = before + frame + behind
    data = bytes((A2C.start, 0x07, len(inner))) + inner + b"\x55"
    assume(harmless(data + FLOOD))
    _tell(subject, "3/20", survives(subject, data, requirement="3/20"))


@case("3/20", name="tag")
def test_tag_from_the_client(subject: ControllerUnderTest) -> None:
    """A request bears the tag of a final result."""
    _tell(subject, "3/20", survives(subject, b"\xaa\x90\x08\x00\xcc", requirement="3/20"))


@case("3/20", name="often")
def test_often(subject: ControllerUnderTest) -> None:
    """One connection brings two hundred spoilt requests; each time the next request is served."""
    line = subject.open(judged=False)
    for number in range(200):
        try:
            line.send_bytes(bytes((A2C.start, 0x08, number % 5)) + b"0" * 5 + b"\xcd")
        except NoReply:
            line = subject.open(judged=False)
            continue
        if number % 20 == 0 and recovers(subject, line) is Recovery.ANEW:
            line = subject.open(judged=False)
    _tell(subject, "3/20", recovers(subject, line))


# ---------------------------------------------------------------------- the other direction


@case("3/23", slow=True)
@given(opcode=st.sampled_from((0x07, 0x08, 0x09)), data=st.binary(max_size=20))
def test_wrong_direction(subject: ControllerUnderTest, opcode: int, data: bytes) -> None:
    """A frame comes in the controller's own form; it is garbage, or is answered in that form."""
    frame = Frame(C2A, opcode, data.replace(b"\xaa", b"\x55")).encode()
    line = subject.open(judged=False)
    line.send_bytes(frame)
    line.apart()
    nothing_else(line, requirement="3/23")
    if any(seen.frame.opcode == opcode for seen in line.inbox):
        subject.tolerate("3/23", "A-3-13", "accepted", "a frame of the other direction was served")
    line.inbox.clear()
    how = recovers(subject, line)
    nothing_else(line, requirement="3/23")
    _tell(subject, "3/23", how)
    line.close()


@case("3/23", name="reply")
def test_own_reply(subject: ControllerUnderTest) -> None:
    """The subject's own replies come back to it, as from a loop in the wiring."""
    replies = b"".join(
        Frame(C2A, opcode, data).encode()
        for opcode, data in ((0x07, b"20141222143000"), (0x08, b"1.0.0"), (0x09, b"00"))
    )
    _tell(subject, "3/23", survives(subject, replies, requirement="3/23"))


@case("3/20", "3/19", name="bystander")
def test_bystander(subject: ControllerUnderTest) -> None:
    """No damage on one connection ends another, as it would where the program dies and restarts."""
    subject.require_multiple_connections()
    bystander = subject.open()
    for data in examples(_DAMAGED):
        survives(subject, data, requirement="3/20")
        bystander.pump()
        expect(
            bystander.ending is None,
            UserMessage("{data} on one connection has ended another", data=show(data)),
            expected="a connection that stays",
            observed="the end of both",
        )
    bystander.ask("get_status")


# ---------------------------------------------------------------------- frames that stop


@case("3/29")
def test_half_frames(subject: ControllerUnderTest) -> None:
    """A connection stops in the middle of a frame; the next is served, and gets none of it."""
    subject.notices_leaving()
    for part in examples(_PARTS):
        line = subject.open(judged=False)
        line.send_bytes(part)
        if subject.takes_several:
            _serves(subject)
            line.close()
        else:
            line.close()
            subject.pause(SILENCE_S)
        _serves(subject)


@case("3/29", name="reset")
def test_cut_off_in_a_frame(subject: ControllerUnderTest) -> None:
    """A connection is cut off in the middle of a frame; the next is served."""
    subject.notices_leaving()
    for part in examples(_PARTS):
        line = subject.open(judged=False)
        line.send_bytes(part)
        line.reset()
        _serves(subject)


@case("3/29", name="half-close")
def test_half_close_in_a_frame(subject: ControllerUnderTest) -> None:
    """A client in the middle of a frame sends no more but listens on; the next is served."""
    if subject.access.port is None:
        raise CaseSkipped("only a network link can be half closed")
    for part in examples(_PARTS):
        line = subject.open(judged=False)
        line.send_bytes(part)
        line.half_close()
        if not subject.takes_several:
            line.close()
        _serves(subject)
        line.close()


@case("3/29", name="several")
def test_several_half_frames(subject: ControllerUnderTest) -> None:
    """Several connections stop in the middle of a frame; later ones are served."""
    _hang(subject)
    _serves(subject)


@case("3/29", name="silence", slow=True)
def test_silent_half_frames(subject: ControllerUnderTest) -> None:
    """Where they are silent for long the subject serves all the same, and them too or no more."""
    lines = _hang(subject)
    subject.pause(_GIVEN_UP_S)
    _serves(subject)
    for line in lines:
        line.inbox.clear()
        if line.ending is None:
            recovers(subject, line)
            nothing_else(line, requirement="3/29")


def _hang(subject: ControllerUnderTest) -> list[OutgoingConnection]:
    """Several connections, each in the middle of a frame."""
    subject.require_multiple_connections()
    lines = [subject.open(judged=False)]
    with suppress(CaseFailed):  # it may not serve so many (A-2-2)
        while len(lines) <= _HANGING:
            lines.append(subject.open(judged=False))
    lines.pop().close()  # one more is to be served
    for line, part in zip(lines, _PARTS, strict=False):
        line.send_bytes(part)
    return lines


def _serves(subject: ControllerUnderTest) -> None:
    """See that a new connection is served, and that nothing of others reaches it."""
    line = subject.open()
    line.ask("get_time")
    line.ask("get_status")
    expect(not line.inbox, "a new connection was sent what another one had asked for")
    line.close()
