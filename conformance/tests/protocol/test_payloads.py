"""Decoding of payloads that deviate from the document, and of each reading."""

from datetime import datetime
from typing import Any

import pytest

from scaraspec.protocol.commands import (
    BY_NAME,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    RunningProgram,
)
from scaraspec.protocol.fields import Defect, PayloadError, show
from scaraspec.protocol.payloads import Acceptance, JogDirection, NameListPart, Outcome, Payload
from scaraspec.protocol.readings import Dialect

NETWORK = Network("1.0.0.1", "255.0.0.0", "1.0.0.2")
TOO_FAST = MoveTarget(101, 1, 2, 3, 4, 5, 6)
RUNNING_1_S = RunningProgram(b"a", 1)
NOT_THERE = Acceptance(accepted=False, code="05")


def listed(*names: bytes) -> NameListPart:
    """Return the last message of a list."""
    return NameListPart(more=False, names=names)


def payload(where: str) -> Payload:
    """Return the payload with a name such as ``reset.reply``."""
    name, part = where.split(".")
    found: Payload = getattr(BY_NAME[name], part)
    return found


@pytest.mark.parametrize(
    ("where", "data", "value", "wrong"),
    [
        ("get_network.reply", b"1.0.0.1 255.0.0.0 1.0.0.2", NETWORK, Defect.SPACE_FOR_BAR),
        ("get_network.reply", b"10.0.0.1,255.0.0.0,10.0.0.2", None, Defect.FIELD_COUNT),
        ("get_network.reply", b"10.0.0.256|255.0.0.0|10.0.0.2", None, Defect.ADDRESS),
        ("get_gripper_center.reply", b"1|2|3|", Point(1, 2, 3), Defect.TRAILING_BAR),
        ("get_gripper_center.reply", b"1 | 2 | 3", Point(1, 2, 3), Defect.BLANKS),
        ("get_running_program.reply", b"1| a |00000001 ", RunningProgram(b" a ", 1), Defect.BLANKS),
        ("get_gripper_center.reply", b"1|2|3\0", Point(1, 2, 3), Defect.TRAILING_NUL),
        ("get_gripper_center.reply", b'"1|2|3"', Point(1, 2, 3), Defect.QUOTES),
        ("get_gripper_center.reply", b"1,5|2|3", None, Defect.NUMBER),
        ("get_gripper_center.reply", b"1e3|2|3", None, Defect.NUMBER),
        ("get_gripper_center.reply", b"nan|2|3", None, Defect.NUMBER),
        ("get_gripper_center.reply", b"|2|3", None, Defect.NUMBER),
        ("set_tool_coordinates.request", b"101|1|2|3|4|5|6", TOO_FAST, Defect.RANGE),
        ("set_tool_coordinates.request", b"5.5|1|2|3|4|5|6", None, Defect.NUMBER),
        ("login.reply", b"\1", True, Defect.BINARY),
        ("login.reply", b"2", None, Defect.FLAG),
        ("reset.reply", b"0 11", Acceptance(accepted=False, code="11"), Defect.SPACE_FOR_BAR),
        ("reset.reply", b"0", Acceptance(accepted=False), Defect.NO_CODE),
        ("reset.reply", b"0|21", Acceptance(accepted=False), Defect.CODE),
        ("reset.reply", b"0|08", Acceptance(accepted=False, code="08"), Defect.RESERVED_CODE),
        ("reset.result", b"00|11|", Outcome(done=False), Defect.CODE),
        ("reset.result", b"1", None, Defect.FLAG),
        ("emergency_stop.reply", b"0|11", Acceptance(accepted=False), Defect.FLAG),
        ("get_time.reply", b"2014122214300", None, Defect.CLOCK),
        ("get_time.reply", b"20150229000000", None, Defect.CALENDAR),
        ("get_running_program.reply", b"1myprog00011230", None, Defect.FIELD_COUNT),
        ("get_running_program.reply", b"1|a|00016530", RunningProgram(b"a", 7530), Defect.RUN_TIME),
        ("get_digital_inputs.reply", b"1|1000000", None, Defect.BITS),
        ("list_programs.reply", b"2|a", None, Defect.FLAG),
        ("list_programs.reply", b"0|a|a", listed(b"a", b"a"), Defect.REPEATED_NAME),
        ("list_programs.reply", b"0|a||b", listed(b"a", b"", b"b"), Defect.EMPTY_NAME),
        ("get_version.reply", b"v1", "v1", Defect.VERSION),
        ("get_status.request", b"0", None, Defect.SIZE),
        ("jog.request", b"5", None, Defect.RANGE),
        ("jog.request", b"11", None, Defect.SIZE),
        ("upload_name.request", b"../x", b"../x", Defect.PATH_IN_NAME),
        ("upload_name.request", b"a|b", b"a|b", Defect.BAR_IN_NAME),
        ("upload_name.request", b"n" * 31, b"n" * 31, Defect.LONG_NAME),
    ],
)  # fmt: skip
def test_deviations(where: str, data: bytes, value: Any, wrong: Defect) -> None:
    """Each deviation gives its issue; the intended value is decoded if it is clear."""
    decoded = payload(where).decode(data)
    assert wrong in {c.defect for c in decoded.issues}
    assert decoded.value == value


@pytest.mark.parametrize(
    ("where", "data", "value"),
    [
        ("set_password.request", b" old |new ", PasswordChange(b" old ", b"new ")),
        ("get_running_program.reply", b"1| a.rob |00000001", RunningProgram(b" a.rob ", 1)),
        ("list_programs.reply", b"0| a |b ", listed(b" a ", b"b ")),
        ("login.request", b" password ", b" password "),
    ],
)
def test_names_and_passwords_keep_spaces(where: str, data: bytes, value: Any) -> None:
    """Names and passwords are opaque (A-T-2): spaces are kept and give no issue."""
    decoded = payload(where).decode(data)
    assert (decoded.value, decoded.issues) == (value, ())
    assert payload(where).encode(value) == data


@pytest.mark.parametrize(
    ("where", "data", "value", "key", "option"),
    [
        ("get_running_program.reply", b"0", None, "runinfo_none", "0"),
        ("get_running_program.reply", b"0||", None, "runinfo_none", "0||"),
        ("get_running_program.reply", b"\1|a|00000001", RUNNING_1_S, "runinfo_binary", "binary"),
        ("list_programs.reply", b"0|a|b", listed(b"a", b"b"), "list_prefix_sep", "0|a"),
        ("list_programs.reply", b"0a|b", listed(b"a", b"b"), "list_prefix_sep", "0a"),
        ("list_programs.reply", b"0", listed(), "list_empty", "0"),
        ("list_programs.reply", b"0|", listed(), "list_empty", "0|"),
        ("list_programs.reply", b"", listed(), "list_empty", "empty"),
        ("get_default_program.reply", b"", b"", "default_none", "empty"),
        ("get_default_program.reply", b"0", b"", "default_none", "0"),
        ("set_tool_coordinates.reply", b"0", Acceptance(accepted=False), "err_bare0", "0"),
        ("set_tool_coordinates.reply", b"0|05", NOT_THERE, "err_bare0", "0|code"),
        ("jog.request", b"1", JogDirection.PLUS_Y, "jog_byte", "ascii"),
        ("jog.request", b"\4", JogDirection.MINUS_X, "jog_byte", "binary"),
    ],
)  # fmt: skip
def test_readings(where: str, data: bytes, value: Any, key: str, option: str) -> None:
    """A listed reading is decoded without an issue, reported, and encoded again in its dialect."""
    decoded = payload(where).decode(data)
    assert decoded.issues == ()
    assert decoded.value == value
    assert (key, option) in decoded.readings
    assert payload(where).encode(value, Dialect.of(**{key: option})) == data


def test_a_binary_flag_may_end_with_a_nul() -> None:
    """The first of two NULs is the flag: two readings at once (A-T-1, A-T-3)."""
    decoded = payload("get_running_program.reply").decode(b"\0\0")
    assert decoded.value is None
    assert [c.defect for c in decoded.issues] == [Defect.TRAILING_NUL]
    assert ("runinfo_binary", "binary") in decoded.readings


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        ("login.request", b"", "1 to 255 bytes"),
        ("login.request", b"a|b", "separator"),
        ("set_password.request", (b"a" * 200, b"b" * 200), "do not fit into one frame"),
        ("upload_name.request", b"n" * 31, "1 to 30 bytes"),
        ("upload_name.request", b"a/b", "path element"),
        ("set_tool_coordinates.request", (0, 1, 2, 3, 4, 5, 6), "1 to 100"),
        ("set_gripper_center.request", (float("nan"), 0, 0), "finite"),
        ("set_network.request", ("10.0.0.1", "10.0.0", "10.0.0.1"), "not a dotted IPv4"),
        ("set_digital_output.request", (8, 2), "0 to 1"),
        ("reset.reply", Acceptance(accepted=False, code="21"), "not a code of table 8-1"),
        ("reset.reply", Acceptance(accepted=False), "needs a code"),
        ("reset.result", Outcome(done=False), "needs a code"),
    ],
)
def test_encoding_errors(where: str, value: Any, message: str) -> None:
    """Encoding a forbidden value raises an error that states the reason."""
    with pytest.raises(PayloadError, match=message):
        payload(where).encode(value)


@pytest.mark.parametrize(
    ("where", "value", "data"),
    [
        ("get_analog_input.request", 8, b"08"),
        ("set_digital_output.request", (8, 1), b"8|1"),
        ("set_gripper_center.request", (-0.0, 1e6, 0.12345), b"0|1000000|0.123"),
        ("get_running_program.reply", RunningProgram(b"a", 200 * 86400), b"1|a|99235959"),
        ("set_time.request", datetime(2014, 12, 22, 14, 30), b"20141222143000"),  # noqa: DTZ001 - the document names no zone
    ],
)
def test_encoding(where: str, value: Any, data: bytes) -> None:
    """Padding, plain decimals and saturation follow the document."""
    assert payload(where).encode(value) == data


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"plain", "plain"),
        ("程序".encode(), "程序"),
        ("程序".encode("gb18030"), "程序"),
        (b"\x1b[31m", "\\x1b[31m"),
        (b"\xff\xff", "\xff\xff"),
        (b"x" * 61, "x" * 59 + "…"),
    ],
)
def test_show(data: bytes, text: str) -> None:
    """Bytes are shown as text if possible, without control characters, and cut to the limit."""
    assert show(data) == text
