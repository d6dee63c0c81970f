"""4.8: asking for the status."""

from typing import Any, Final

from scaraspec.protocol.errors import TABLE_8_1, Code, Kind
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect, expect_in
from scaraspec.user_message import UserMessage

_STATES: Final = {Kind.IDLE: "idle", Kind.RUNNING: "running"}
_ENTRIES: Final = {Kind.RESERVED: "A-8-3", Kind.MISSING_FILE: "A-4.8-2"}
"""Codes that are no states, and what the register says of them."""

_UNKNOWN: Final = (b"21", b"2f", b"0A", b"99", b"FF", b"zz", b"  ", b"1G", b"-1")


@client_case("4.8/1", attended=True)
def test_the_request_carries_no_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """get_status is asked for without data, and answered."""
    call, _ = request_operation(subject, line, "get_status")
    line.reply("get_status", "00")
    subject.expect_result(call, "00", requirement="4.8/11")


@client_case("4.8/11", "T/9")
def test_every_code(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every code of table 8-1 is the status, in upper and lower case.

    One that is no state (A-8-3, A-4.8-2), or in small letters (A-T-7), may be told as an error.
    """
    for code in TABLE_8_1.values():
        for text in examples(dict.fromkeys((code.text, code.text.lower()))):
            call, _ = request_operation(subject, line, "get_status")
            line.reply("get_status", data=text.encode())
            tolerated_as = _ENTRIES.get(code.kind, "" if text == code.text else "A-T-7")
            if tolerated_as and not subject.wait_for_answer(call).ok:
                subject.tolerate(
                    "4.8/11",
                    tolerated_as,
                    text,
                    UserMessage("the status {text} is told as an error", text=text),
                )
                continue
            result = subject.expect_done(call)
            expect_in(_code_in(result), {code.text, code.text.lower()}, "the code that is told")
            _expect_state(result, code)


def _code_in(result: Any) -> Any:
    return result.get("code") if isinstance(result, dict) else result


def _expect_state(result: Any, code: Code) -> None:
    """Where the client tells one of the three states, too, it has to be the right one."""
    state = result.get("state") if isinstance(result, dict) else None
    due = _STATES.get(code.kind, "error")
    expect(
        not isinstance(state, str) or state.lower() == due,
        UserMessage("{code_text} is placed under another state", code_text=code.text),
        expected=due,
        observed=f"{state}",
    )


@client_case("4.8/11", name="states", attended=True)
def test_states(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The robot is idle, runs a program, and has a fault of all its motors."""
    for text in examples(("00", "01", "1F")):
        call, _ = request_operation(subject, line, "get_status")
        line.reply("get_status", text)
        subject.expect_result(call, text)


@client_case("4.8/11", name="unknown")
def test_unknown_codes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Codes that table 8-1 lacks are the status; the client survives them, as idle or not."""
    for data in examples(_UNKNOWN):
        call, _ = request_operation(subject, line, "get_status")
        line.reply("get_status", data=data)
        subject.wait_for_answer(call)
        expect(
            not call.ok or _code_in(call.result) not in ("00", "01"),
            "a code that nobody knows is told as one of the table",
            expected=f"{data.decode()}, or an error",
            observed=f"{call}",
        )
        call, _ = request_operation(subject, line, "get_status")
        line.reply("get_status", "05")
        subject.expect_result(call, "05")
