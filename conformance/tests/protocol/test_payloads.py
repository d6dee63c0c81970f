"""What decoders make of payloads that depart from the document, and of each reading."""

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
    """The last message of a list."""
    return NameListPart(more=False, names=names)


def payload(where: str) -> Payload:
    """The payload named like ``reset.reply``."""
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
def test_departures(where: str, data: bytes, value: Any, wrong: Defect) -> None:
    """Each departure has its complaint, and what was meant is read where that can be told."""
    decoded = payload(where).decode(data)
    assert wrong in {c.wrong for c in decoded.complaints}
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
def test_blanks_belong_to_names_and_passwords(where: str, data: bytes, value: Any) -> None:
    """They are kept byte for byte and complained of by nobody; they are opaque (A-T-2)."""
    decoded = payload(where).decode(data)
    assert (decoded.value, decoded.complaints) == (value, ())
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
    """A listed reading is read without complaint, named, and written again by its dialect."""
    decoded = payload(where).decode(data)
    assert decoded.complaints == ()
    assert decoded.value == value
    assert (key, option) in decoded.readings
    assert payload(where).encode(value, Dialect.of(**{key: option})) == data


def test_a_binary_flag_may_end_with_a_nul() -> None:
    """Of two NULs the first is the flag: two readings at once (A-T-1, A-T-3)."""
    decoded = payload("get_running_program.reply").decode(b"\0\0")
    assert decoded.value is None
    assert [c.wrong for c in decoded.complaints] == [Defect.TRAILING_NUL]
    assert ("runinfo_binary", "binary") in decoded.readings


@pytest.mark.parametrize(
    ("where", "value", "says"),
    [
        ("login.request", b"", "1 to 255 bytes"),
        ("login.request", b"a|b", "separator"),
        ("set_password.request", (b"a" * 200, b"b" * 200), "do not fit one frame"),
        ("upload_name.request", b"n" * 31, "1 to 30 bytes"),
        ("upload_name.request", b"a/b", "path element"),
        ("set_tool_coordinates.request", (0, 1, 2, 3, 4, 5, 6), "1 to 100"),
        ("set_gripper_center.request", (float("nan"), 0, 0), "finite"),
        ("set_network.request", ("10.0.0.1", "10.0.0", "10.0.0.1"), "no dotted IPv4"),
        ("set_digital_output.request", (8, 2), "0 to 1"),
        ("reset.reply", Acceptance(accepted=False, code="21"), "no code of table 8-1"),
        ("reset.reply", Acceptance(accepted=False), "needs a code"),
        ("reset.result", Outcome(done=False), "needs a code"),
    ],
)
def test_refuses_to_write(where: str, value: Any, says: str) -> None:
    """What the document forbids is not written, and the sentence says why."""
    with pytest.raises(PayloadError, match=says):
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
def test_written_as_drawn(where: str, value: Any, data: bytes) -> None:
    """Padding, plain decimals and saturation are as the document draws them."""
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
    """Bytes are shown as text where they are, never as control characters, never at length."""
    assert show(data) == text
