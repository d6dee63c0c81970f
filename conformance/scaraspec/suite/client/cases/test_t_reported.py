"""Clauses 3 and 4: how a client reports the replies that it receives (A-3-8, A-T-2, A-T-5)."""

from typing import Any, Final

from scaraspec.protocol import errors
from scaraspec.protocol.commands import BY_NAME, COMMANDS, JointValues
from scaraspec.protocol.payloads import FLAG, NameListPart
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    expect_completed,
    expect_reported,
    for_each_supported,
    request_operation,
    sent_or_answered,
)
from scaraspec.suite.client.harness.request_checks import expect_no_value
from scaraspec.suite.client.harness.two_stage import (
    RUN,
    begin_and_accept,
    ensure_open,
    expect_finished,
    require_while_executing,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect, expect_in
from scaraspec.suite.engine.strategies import payload_values
from scaraspec.user_message import UserMessage

_SETTINGS: Final = tuple(c.name for c in COMMANDS if c.reply is FLAG and c.clause.startswith("4."))
_OWN_CASES: Final = ("login", "set_network")
_TWO_STAGE: Final = tuple(c.name for c in COMMANDS if c.two_stage)
_PORTS: Final = ("get_digital_inputs", "get_analog_input", "get_digital_outputs")
_NUMBERS: Final = (
    b"200|300|456",
    b"200.0|300.0|456.0",
    b"200.000|300.00|456",
    b"-0.5|-300|0",
    b"0.001|-0.001|0.0",
    b"100000|-12345.6|12345.678",
    b"1.001|-4.35|0.29",  # binary fractions store these slightly too small
    b"-0|0|-0.0",
)
_SET_TO_OTHERS: Final = {
    "get_default_program": ("set_default_program", b"other.rob"),
    "get_gripper_center": ("set_gripper_center", b"1.5|-2|3"),
    "get_initial_tool_position": ("set_initial_tool_position", b"1.5|-2|3|4|0|0"),
    "get_digital_outputs": ("set_digital_output", b"1|0100000000000001"),
}
"""Queries: the command that sets the value, and a reply with another value."""

_WHILE_EXECUTING: Final = {
    "get_running_program": b"1|another.rob|01020304",
    "get_joint_angles": b"-1.5|2|3.25|-4",
    "get_digital_outputs": b"1|0100000000000001",
}
_SOON_S: Final = 0.3
_STEMS: Final = ("程序", "猪", "é", "программа")


@client_case("T/9")
def test_queries(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports many different replies to every query correctly."""

    def each(name: str) -> None:
        payload = BY_NAME[name].reply

        @given(payload_values(payload))
        def hand_on(value: Any) -> None:
            if isinstance(value, NameListPart):
                value = value._replace(more=False)
            elif (
                name == "get_motor_temperatures"
            ):  # the decimals of temperatures have their own case
                value = JointValues(*map(round, value))
            elif value is None and name in _PORTS:
                value = payload.decode(
                    REPLIES[name]
                ).value  # missing values have their own case below
            expect_reported(subject, line, name, payload.encode(value, subject.dialect))

        hand_on()

    for_each_supported(REPLIES, each)


@client_case("T/9", "T/5", name="numbers")
def test_numbers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports numbers with any number of decimals (A-T-5)."""
    for data in examples(_NUMBERS):
        expect_reported(subject, line, "get_gripper_center", data)


@client_case("T/5", name="decimals-received")
def test_decimals(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports joint angles as printed, negative, and with three decimals."""
    for data in examples(
        (REPLIES["get_joint_angles"], b"-20.4|0|-38.0|-0.5", b"20.125|30.250|38.000|0.001")
    ):
        expect_reported(subject, line, "get_joint_angles", data)


@client_case("T/9", name="each-bit")
def test_each_bit(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports single active ports, the highest port leftmost."""

    def each(name: str) -> None:
        count = len(REPLIES[name]) - 2
        for port in range(count):
            expect_reported(
                subject, line, name, b"1|" + b"0" * port + b"1" + b"0" * (count - port - 1)
            )

    for_each_supported(("get_digital_inputs", "get_digital_outputs"), each)


@client_case("T/9", name="no-value")
def test_no_value(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The reply to an input or output query is a single 0; the client reports no value."""

    def each(name: str) -> None:
        call, _ = request_operation(subject, line, name)
        line.reply(name, data=b"0")
        expect_no_value(subject, call)

    for_each_supported(_PORTS, each)


# ---------------------------------------------------------------------- outcomes


@client_case("T/9", name="flags")
def test_flags(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every setting is refused, accepted and accepted again; the client reports each correctly."""

    def each(name: str) -> None:
        for flag in (b"0", b"1", b"1"):
            call, _ = request_operation(subject, line, name)
            line.reply(name, data=flag)
            if flag == b"1":
                subject.expect_done(call)
            else:
                subject.expect_failure(call)

    for_each_supported(tuple(name for name in _SETTINGS if name not in _OWN_CASES), each)


@client_case("T/9", name="read-back")
def test_read_back(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A query returns another value than was set; the client reports the reply."""

    def each(getter: str) -> None:
        setter, data = _SET_TO_OTHERS[getter]
        call, _ = request_operation(subject, line, setter)
        line.reply(setter)
        subject.expect_done(call)
        expect_reported(subject, line, getter, data)

    for_each_supported(_SET_TO_OTHERS, each)


@client_case("T/9", name="while-executing")
def test_queries_while_executing(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports the replies to queries while a program runs."""

    def each(name: str) -> None:
        require_while_executing(subject, line, name)
        run = begin_and_accept(subject, line, RUN)
        expect_reported(subject, line, name, _WHILE_EXECUTING[name])
        line.result(RUN.name)
        expect_finished(subject, run)

    for_each_supported(_WHILE_EXECUTING, each)


@client_case("T/9", name="behind-nonsense")
def test_queries_after_an_invalid_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A query gets an invalid reply; the client reports the next reply correctly."""

    def each(name: str) -> None:
        nonlocal line
        call, _ = request_operation(subject, line, name)
        line.reply(name, data=b"?")
        if not subject.answers_within(call, _SOON_S) and not line.ended:
            line.reply(name, data=REPLIES[name])  # the client ignored the invalid reply
        subject.wait_for_answer(call)
        line = ensure_open(subject, line)
        expect_reported(subject, line, name)

    for_each_supported(
        ("get_time", "list_programs", "get_motor_temperatures", "get_joint_angles"), each
    )


@client_case("T/9", name="lost")
def test_lost(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The link ends before the first reply to each command; the client reports a failure."""

    def each(name: str) -> None:
        nonlocal line
        call, _ = request_operation(subject, line, name)
        line.close()
        subject.expect_failure(call)
        line = subject.open()

    for_each_supported(
        tuple(name for name in (*_SETTINGS, *_TWO_STAGE) if name not in _OWN_CASES), each
    )


@client_case("T/9", name="stages")
def test_outcomes_of_both_stages(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Each two-stage command is refused, fails and succeeds; the client reports each correctly."""

    def each(name: str) -> None:
        call, _ = request_operation(subject, line, name)
        line.reply(name, data=b"0|1A" if name != "emergency_stop" else b"0")
        subject.expect_failure(call)
        for code in examples(("1A", "05")):
            call, _ = request_operation(subject, line, name)
            line.reply(name, data=b"1")
            line.result(name, code)
            subject.expect_failure(call)
            _expect_code(call.result, code)
        call, _ = request_operation(subject, line, name)
        line.reply(name, data=b"1")
        line.result(name)
        expect_completed(subject, call)

    for_each_supported(_TWO_STAGE, each)


@client_case("T/9", name="codes")
def test_codes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A program is refused with every code, in upper and lower case; the client reports it."""
    for code in sorted(each.text for each in errors.REFUSALS):
        for text in examples(dict.fromkeys((code, code.lower()))):
            call, _ = request_operation(subject, line, "run_program")
            line.reply("run_program", data=f"0|{text}".encode())
            subject.expect_failure(call)
            _expect_code(call.result, code)


def _expect_code(result: Any, code: str) -> None:
    """Require the right code from a client that reports a code."""
    if isinstance(result, dict) and result.get("code") is not None:
        expect_in(result["code"], {code, code.lower()}, "the client reports a wrong code")


# ---------------------------------------------------------------------- beyond ASCII


@client_case("T/8")
def test_beyond_ascii(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client lists and deletes names in UTF-8 and GBK unchanged."""
    ways = {encoding: _passes_on(subject, line, encoding) for encoding in ("utf-8", "gb18030")}
    if all(ways.values()):
        return
    expect(
        any(ways.values()) or None in ways.values(),
        "the client alters names that are not ASCII",
        expected="the listed bytes",
        observed="other bytes in every encoding",
    )
    taken = next((encoding for encoding, way in ways.items() if way), "ascii")
    subject.tolerate(
        "T/8",
        "text_encoding",
        taken,
        UserMessage("the client accepts names in {encoding} only", encoding=taken),
    )


def _passes_on(subject: ClientUnderTest, line: IncomingConnection, encoding: str) -> bool | None:
    """Whether names pass through the client unchanged; None if it refuses them."""
    names = [f"{stem}.rob".encode(encoding) for stem in _STEMS]
    call, _ = request_operation(subject, line, "list_programs")
    line.reply("list_programs", data=b"|".join([b"0", *names]))
    subject.wait_for_answer(call)
    if not call.ok or not isinstance(call.result, list) or len(call.result) != len(names):
        return None
    intact = True
    for listed_name, name in zip(call.result, names, strict=True):
        deletion = subject.begin("delete_program", name=listed_name)
        if sent_or_answered(subject, line, deletion) is None:
            return None
        request = line.request("delete_program", deletion)
        intact &= request.frame.data.rstrip(b"\0") == name
        line.reply("delete_program", data=b"0")
        subject.wait_for_answer(deletion)
    return intact
