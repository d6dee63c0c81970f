"""Clauses 3 and 4: format of text, numbers and codes (L98-L706; A-0-1, A-0-3, A-T-1 to 7)."""

import re
from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol import errors
from scaraspec.protocol.commands import Point
from scaraspec.protocol.fields import Defect, show
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import expect_stored, send_chunk, upload
from scaraspec.suite.controller.harness.requests.queries import ask_all
from scaraspec.suite.controller.harness.two_stage.commands import (
    MOVE,
    RUN,
    SIMULATE,
    require_command,
)
from scaraspec.suite.controller.harness.two_stage.results import wait_for_result
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect, expect_equal
from scaraspec.suite.program_files.layout import short_program
from scaraspec.user_message import UserMessage

_STATE: Final = (Hazard.STATE,)
_MOTION: Final = (Hazard.MOTION, Hazard.STATE)
_FREE_TEXT: Final = ("get_version", "list_programs", "get_running_program")  # any characters
_DECIMAL: Final = re.compile(rb"-?[0-9]+(\.[0-9]+)?")


def _expect_no_defects(replies: list[ReceivedFrame], *defects: Defect) -> None:
    """Fail the case if a payload has one of these defects.

    Raises:
        CaseFailed: A payload has one.
    """
    for reply in replies:
        issues = reply.seen.parsed.decoded.issues if reply.seen.parsed else ()
        for issue in issues:
            if issue.defect in defects:
                message = UserMessage(
                    "{command}: {defect}", command=reply.seen.name, defect=issue.text
                )
                raise CaseFailed(message, observed=show(reply.frame.data))


# ---------------------------------------------------------------------- separators


@case("T/1")
def test_separators(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """In the reply to every query, fields are separated by a single |."""
    replies = ask_all(subject, line)
    _expect_no_defects(replies, Defect.SPACE_FOR_BAR, Defect.BLANKS)
    # If single separators are present, another case judges the number of fields.
    suspicious = [a for a in replies if b"||" in a.frame.data or b"|" not in a.frame.data]
    _expect_no_defects(suspicious, Defect.FIELD_COUNT)


@case("T/1", name="refusal", hazards=_MOTION)
def test_separator_before_a_code(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The refusal of a missing program has a single | before the code (A-0-2)."""
    for name in examples((RUN, SIMULATE)):
        require_command(subject, name)
        reply = line.ask(name, subject.new_name())
        replies = [reply, wait_for_result(subject, line, name)] if reply.accepted else [reply]
        _expect_no_defects(replies, Defect.SPACE_FOR_BAR, Defect.FIELD_COUNT)


@case("T/1", name="list", hazards=_STATE)
def test_separators_in_a_list(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The list of several programs has a single | between two names."""
    uploaded = [subject.new_name() for _ in range(3)]
    for name in uploaded:
        upload(line, name, short_program(subject))
    reply = line.ask("list_programs")
    _expect_no_defects([reply], Defect.SPACE_FOR_BAR, Defect.BLANKS, Defect.EMPTY_NAME)
    names: tuple[bytes, ...] = reply.value.names if reply.value else ()
    for name in names:
        stripped = name.strip(b" ,;\t")
        expect(
            name == stripped or stripped not in uploaded,
            "names are separated by more than one |",
            expected=show(stripped),
            observed=show(name),
        )


# ---------------------------------------------------------------------- characters


@case("T/2")
def test_no_quotation_marks(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No reply contains the quotation marks of the examples."""
    replies = ask_all(subject, line)
    _expect_no_defects(replies, Defect.QUOTES)
    for reply in replies:
        quotation_marks = [
            quotation_mark
            for quotation_mark in ('"', "“", "”")
            if quotation_mark.encode() in reply.frame.data
        ]
        if reply.seen.name not in _FREE_TEXT:
            expect(not quotation_marks, "a reply contains a quotation mark", observed=f"{reply}")


@case("T/3")
def test_digits_are_characters(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Flags and digits in replies are ASCII characters, not binary values."""
    replies = [*ask_all(subject, line), line.ask("download_name", subject.new_name())]
    if subject.access.needs_login:
        replies.append(line.ask("login", subject.password))
    _expect_no_defects(replies, Defect.BINARY)
    for reply in replies:
        if reply.seen.name in ("get_time", "get_status", "get_digital_outputs"):
            text = reply.frame.data.rstrip(b"\0")
            expect(
                text.isascii() and text.decode("latin-1").isprintable(),
                "digits are not ASCII characters",
                observed=f"{reply}",
            )


@case("T/3", name="settings", hazards=_STATE)
def test_flags_of_settings(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The flag in replies to settings and uploads is a character."""
    require_command(subject, "set_gripper_center")
    center = line.ask("get_gripper_center").value
    name = subject.new_name()
    replies = [line.ask("set_gripper_center", center), line.ask("upload_name", name)]
    _expect_no_defects(replies, Defect.BINARY)


@case("T/4")
def test_ends_of_texts(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No reply continues after its last character; a NUL or a | at the end is tolerated."""
    for reply in ask_all(subject, line):
        data = reply.frame.data
        text = data.rstrip(b"\0")
        expect(
            b"\0" not in text or reply.seen.name == "get_running_program",
            "a text continues after a NUL",
            expected="nothing after the last character",
            observed=show(data),
        )
        expect(
            reply.seen.name in _FREE_TEXT or text == text.rstrip(b" \r\n\t"),
            "a text ends with a blank or a line end",
            expected="nothing after the last character",
            observed=show(data),
        )
        if text and text != data:
            subject.tolerate("T/4", "trailing_nul", "yes", "a text ends with a NUL")
        elif text.endswith(b"|") and len(text) > 3:
            subject.tolerate("T/4", "A-T-4", "trailing bar", "a text ends with a |")


# ---------------------------------------------------------------------- numbers


@case("T/5")
def test_numbers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The numbers in replies to queries are plain decimal text."""
    _expect_no_defects(ask_all(subject, line), Defect.NUMBER)


_numbers = (
    st.integers(-9999, 9999).map(lambda tenths: f"{tenths / 10:.1f}")
    | st.sampled_from(("0", "-0.5", "0.05", "0.001", "100000", "12345.6", "-12345.6"))
    | st.integers(-500, 500).map(str)
)


@case("T/5", name="set", hazards=_STATE)
@given(texts=st.tuples(_numbers, _numbers, _numbers))
@example(texts=("100000", "0.001", "-0.5"))
@example(texts=("0.00001", "-0.0000001", "1000000"))
def test_numbers_that_were_set(subject: ControllerUnderTest, texts: tuple[str, str, str]) -> None:
    """Numbers of many sizes that are set are returned as plain decimal text."""
    require_command(subject, "set_gripper_center", "get_gripper_center")
    line = subject.open()
    before = line.ask("get_gripper_center").value
    try:
        if line.ask("set_gripper_center", data="|".join(texts).encode()).accepted:
            data = line.ask("get_gripper_center").frame.data.rstrip(b"\0|")
            for text, expected in zip(data.split(b"|"), texts, strict=False):
                expect(
                    _DECIMAL.fullmatch(text),
                    "a number is not plain decimal text",
                    expected=expected,
                    observed=show(text),
                )
    finally:
        if isinstance(before, Point):
            line.ask("set_gripper_center", before)
        line.close()


@case("T/5", name="decimals", hazards=_STATE)
def test_decimals_are_taken(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A number may have no decimals, or more than necessary."""
    require_command(subject, "set_gripper_center", "get_gripper_center")
    before = line.ask("get_gripper_center").value
    try:
        for data in examples((b"20|30|40", b"20.0|30.0|40.0", b"20.000|30.00|40", b"-20|-30.5|0")):
            reply = line.ask("set_gripper_center", data=data)
            if not reply.accepted and subject.dialect["num_format"] == "one-decimal":
                subject.tolerate(
                    "T/5",
                    "num_format",
                    "one-decimal",
                    UserMessage("{data} was refused", data=show(data)),
                )
                continue
            expect(
                reply.accepted,
                UserMessage("{data} was refused", data=show(data)),
                expected="1",
                observed=f"{reply}",
            )
            current = line.ask("get_gripper_center").value
            expected = Point(*map(float, data.split(b"|")))
            expect_equal(current, expected, "a number changed", requirement="4.20/3")
    finally:
        if before is not None:
            line.ask("set_gripper_center", before)


# ---------------------------------------------------------------------- codes


@case("T/7")
def test_status_code(line: OutgoingConnection) -> None:
    """The status is a two-character text of table 8-1."""
    data = line.ask("get_status").frame.data.rstrip(b"\0")
    expect(
        errors.lookup(data.decode("latin-1")),
        "the status is not a code of table 8-1",
        expected="two characters of the table",
        observed=show(data),
    )


@case("T/7", name="refusals", hazards=_MOTION)
def test_codes_of_refusals(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A refusal has a code of two characters, or none where this is allowed."""
    subject.moved = True
    missing = subject.new_name()
    unreachable = b"1|900000|900000|900000|0|0|0"
    for name, data in examples(((RUN, missing), (SIMULATE, missing), (MOVE, unreachable))):
        if name in subject.ics.unsupported:
            continue
        reply = line.ask(name, data=data)
        replies = [reply, wait_for_result(subject, line, name)] if reply.accepted else [reply]
        _expect_no_defects(replies, Defect.CODE)


# ---------------------------------------------------------------------- beyond ASCII

_NAMES: Final = ("程序".encode(), "程序".encode("gb18030"), "é".encode(), b"\xaa\xcc")


@case("T/8")
def test_names_beyond_ascii(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """File names in UTF-8 and GBK are kept byte by byte if they are accepted."""
    content = short_program(subject)
    accepted: dict[bytes, bool] = {}
    for stem in examples(_NAMES):
        name = subject.new_name().replace(b".", stem + b".")
        accepted[name] = line.ask("upload_name", data=name).accepted is True
        if not accepted[name]:
            continue
        for chunk in chunks_of(content):
            send_chunk(line, chunk)
        expect_stored(line, name, content)
        line.sync()
        line.ask("delete_program", data=name)  # there may be few places (A-5-21)
    refused = ", ".join(show(name) for name, is_accepted in accepted.items() if not is_accepted)
    if not refused:
        return
    for encoding in ("ascii", "utf-8", "gb18030"):
        if all(is_accepted is _is_text(name, encoding) for name, is_accepted in accepted.items()):
            subject.tolerate(
                "T/8",
                "text_encoding",
                encoding,
                UserMessage("names refused: {refused}", refused=refused),
            )
            return
    subject.tolerate(
        "T/8", "A-5-20", "some", UserMessage("names refused: {refused}", refused=refused)
    )


def _is_text(data: bytes, encoding: str) -> bool:
    try:
        data.decode(encoding)
    except UnicodeDecodeError:
        return False
    return True
