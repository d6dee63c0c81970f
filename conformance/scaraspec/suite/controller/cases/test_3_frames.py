"""Clause 3: the frame format, in frames sent and received by the controller (L89-98)."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Final

from hypothesis import assume, example
from hypothesis import strategies as st

from scaraspec.judge.rules.diagnosis import Fault, diagnose
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.malformed.mutation_targets import (
    GET_STATUS,
    GET_TIME,
    GET_VERSION,
    OPCODES,
    is_harmless,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    StoreFull,
    expect_round_trip,
    expect_stored,
    upload,
)
from scaraspec.suite.controller.harness.requests.queries import ask_all, supported_queries
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.suite.program_files.layout import short_program
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

_REQUIREMENT_OF_FAULT: Final[Mapping[Fault, str]] = {
    Fault.START: "3/4",
    Fault.END: "3/5",
    Fault.LENGTH: "3/7",
    Fault.STRAY: "3/32",
    Fault.TAG: "3/14",
}
_LONG_NAME_BYTES: Final = 30  # L226
_MANY_FILES: Final = 9  # this many such names, with separators, do not fit into one frame
_SHORT_REPLIES: Final = 45  # this many status replies fill the longest frame
_IDLE_S: Final = 0.6
_LENGTHS: Final = (
    *range(18),
    *range(29, 36),
    *range(60, 67),
    *range(124, 132),
    A2C.start,
    *range(196, 256, 3),
    A2C.end,
    254,
    255,
)

# ---------------------------------------------------------------------- frames sent by the SUT


@case("3/1", "3/4", "3/5", "3/6", "3/7", "3/8", "3/32")
def test_replies_are_frames(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every query is answered with a frame of the right format, and with no bytes around it."""
    for query in examples(supported_queries(subject)):
        with _report_invalid_reply(line, query.name):
            line.ask(*query)
        line.sync()
        _expect_no_invalid_bytes(line, query.name)


@contextmanager
def _report_invalid_reply(line: OutgoingConnection, name: str) -> Iterator[None]:
    """If no valid reply arrives, report the fault of the invalid bytes.

    A reply with a wrong length contains the frames after it. Status requests are sent until it
    ends.
    """
    try:
        yield
    except CaseFailed:
        for _ in range(_SHORT_REPLIES):
            if line.invalid_bytes or line.ending:
                break
            line.send("get_status")
            line.wait(SILENCE_S)
        _expect_no_invalid_bytes(line, name)
        raise


def _expect_no_invalid_bytes(line: OutgoingConnection, name: str = "") -> None:
    """Fail the case if there are invalid bytes, and report their fault.

    Args:
        line: The connection.
        name: The command that was sent, if any.
    """
    line.pump()
    for invalid in line.invalid_bytes:
        diagnosis = diagnose(invalid)
        requirement = _REQUIREMENT_OF_FAULT.get(diagnosis.fault, "3/1")
        if requirement == "3/7" and diagnosis.observed == "0":
            requirement = "3/8"
        raise CaseFailed(
            UserMessage("{command} was answered with bytes that are not a frame", command=name)
            if name
            else "bytes that are not a frame arrived without a request",
            expected=f"{diagnosis.fault.value} {diagnosis.expected}",
            observed=invalid.data.hex(" "),
            requirement=requirement,
        )


@case("3/8", name="empty")
def test_reply_without_data(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply to a request for the default program is a valid frame, even if there is none."""
    command = line.send("get_default_program")
    replies = [
        received
        for received in line.sync()
        if received.frame.opcode in (command.opcode, command.alternate_opcode)
    ]
    _expect_no_invalid_bytes(line, "get_default_program")
    if not replies:
        message = "the request for the default program is not answered at all"
        subject.tolerate("3/8", "default_none", "silence", message)


@case("3/6", "3/5", "3/7", name="long", hazards=(Hazard.STATE,))
def test_long_replies(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program list that does not fit one frame, and full chunks of a download, are valid."""
    content = short_program(subject)
    stem = "n" * (_LONG_NAME_BYTES - len(subject.new_name()) - 1)
    names = [subject.new_name(stem) for _ in range(_MANY_FILES)]
    try:
        for name in names:
            upload(line, name, content)
    except StoreFull as full:
        if full.deleted == names[0]:
            raise
    with _report_invalid_reply(line, "download_name"):
        expect_stored(line, names[0], content)
    with _report_invalid_reply(line, "list_programs"):
        line.ask("list_programs")
    line.wait(MOMENT_S)
    line.sync()
    _expect_no_invalid_bytes(line, "list_programs")


@case("3/32", "3/10", "3/26", name="idle")
def test_nothing_while_idle(subject: ControllerUnderTest) -> None:
    """A connection is silent before the login, after it, and after a query."""
    lines = [subject.open(login=False)]
    if subject.supports_multiple_connections:
        lines.append(subject.open())
        with suppress(CaseFailed):  # three connections may be too many (A-2-2)
            lines.append(subject.open())
        lines[-1].ask("get_status")
    subject.pause(_IDLE_S)
    for line in lines:
        _expect_silence(subject, line)
    if not subject.supports_multiple_connections:
        if subject.access.needs_login:
            subject.log_in(line)
        line.ask("get_status")
        line.wait(_IDLE_S)
        _expect_silence(subject, line)
    line.sync()
    _expect_no_invalid_bytes(line, "get_status")


def _expect_silence(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Fail on an undefined opcode or a final result; tolerate other unsolicited frames (A-3-16)."""
    _expect_no_invalid_bytes(line)
    for received in line.inbox:
        expect(
            received.frame.opcode in BY_OPCODE,
            "a frame with an undefined opcode arrived without a request",
            expected="silence",
            observed=f"{received.frame}",
            requirement="3/10",
        )
        expect(
            not received.frame.tagged,
            "a final result arrived without a request",
            expected="silence",
            observed=f"{received.frame}",
            requirement="3/16",
        )
        subject.tolerate(
            "3/26",
            "A-3-16",
            "unsolicited frame",
            UserMessage("{frame} arrived without a request", frame=received.frame),
        )
    line.inbox.clear()


@case("3/10")
def test_opcodes_of_replies(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No query is answered with an undefined opcode."""
    replies = [reply.seen for reply in ask_all(subject, line)]
    for received in (*replies, *line.inbox):
        expect(
            received.frame.opcode in BY_OPCODE,
            "a reply has an undefined opcode",
            expected="an opcode of clauses 4 and 5",
            observed=f"{received.frame}",
        )


# ---------------------------------------------------------------------- frames received by the SUT


@case("3/9", "3/6")
@given(
    data=st.binary(max_size=MAX_DATA_BYTES)
    | st.integers(0, 160).map(lambda n: b"\xaa" * n)
    | st.integers(0, MAX_DATA_BYTES).map(lambda n: b"\xcc" * n)
    | st.integers(0, 63).map(lambda n: GET_VERSION * n)
    | st.integers(0, 127).map(lambda n: b"\xcc\xaa" * n)
)
@example(data=b"\xcc" + GET_VERSION)  # a search for the end byte in small frames finds one
def test_data_on_a_query(subject: ControllerUnderTest, data: bytes) -> None:
    """Data of up to 255 bytes in a query is never treated as a frame, whether answered or not."""
    frame = Frame(A2C, 0x07, data).encode()
    assume(is_harmless(frame + GET_STATUS))
    line = subject.open()
    line.send_bytes(frame)
    for received in _replies_or_close(subject, line):
        expect(
            received.frame.opcode == 0x07,
            "bytes in the data of a frame were treated as a frame",
            expected="a reply to 0x07, or none (A-3-12)",
            observed=f"{received.frame}",
        )
    line.close()


@case("3/6", name="lengths")
def test_every_length(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Data of every length up to 255 bytes in a query is never treated as a frame."""
    ignored_opcodes = OPCODES - {GET_TIME[1]}  # some controllers send these unsolicited (A-3-16)
    for length_bytes in examples(_LENGTHS):
        repeats, rest = divmod(length_bytes, len(GET_TIME))
        line.send_bytes(Frame(A2C, 0x08, b"0" * rest + GET_TIME * repeats).encode())
        others = [
            received
            for received in _replies_or_close(subject, line)
            if received.frame.opcode not in ignored_opcodes
        ]
        expect(
            not others,
            UserMessage(
                "after {length_bytes} bytes of data, the frame boundaries are lost",
                length_bytes=length_bytes,
            ),
        )
        if line.ending is not None:
            line = subject.open()


def _replies_or_close(subject: ControllerUnderTest, line: OutgoingConnection) -> list[FrameSeen]:
    """Return the replies to a query with data; closing the connection is a reading (A-3-9)."""
    try:
        return line.sync()
    except NoReply:
        if line.ending is None:
            raise
        message = "a query with data closes the connection"
        subject.tolerate("3/6", "on_unknown", "close", message)
        return line.inbox


_DELIMITER_CONTENTS: Final = (
    b"\xaa" * 150,
    b"\xcc" * 200,
    b"\xcc\xaa" * 150,
    b"\xaa\x09\x00\xcc" * 75,
    b"\xcc\x09\x02\x30\x30\xaa" * 40,
)


@case("3/9", name="content", hazards=(Hazard.STATE,))
def test_delimiters_in_files(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Files full of start and end bytes are stored unchanged."""
    expect_round_trip(subject, line, b"plain" * 50)
    for content in examples(_DELIMITER_CONTENTS):
        expect_round_trip(subject, line, content, "3/9")
        expect(not line.sync(), "bytes of a file were treated as a frame", observed="a reply")


@case("3/9", name="name", hazards=(Hazard.STATE,))
def test_delimiters_in_names(line: OutgoingConnection) -> None:
    """A name that contains 0xAA and 0xCC is refused with one frame."""
    for data in examples((b"\xaa.rob", b"\xcc.rob", b"a\xcc\xaab.rob", b"\xb0\xcc\xaa\xcc.rob")):
        reply = line.ask("download_name", data=data)
        message = "a missing file was accepted for download"
        expect(reply.accepted is False, message, requirement="5.3/3")
        expect(not line.sync(), "bytes of a name were treated as a frame", observed="a reply")
