"""4.8: reading the status."""

from typing import Any, Final

from scaraspec.protocol.errors import TABLE_8_1, Code, Kind
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported, request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect, expect_in
from scaraspec.user_message import UserMessage

_STATES: Final = {Kind.IDLE: "idle", Kind.RUNNING: "running"}
_ENTRIES: Final = {Kind.RESERVED: "A-8-3", Kind.MISSING_FILE: "A-4.8-2"}
"""Codes that are not states, and their register entries."""

_UNKNOWN: Final = (b"21", b"2f", b"0A", b"99", b"FF", b"zz", b"  ", b"1G", b"-1")


@client_case("4.8/1", attended=True)
def test_the_request_carries_no_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_status without data and reports the reply."""
    expect_reported(subject, line, "get_status", b"00", requirement="4.8/11")


@client_case("4.8/11", "T/9")
def test_every_code(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports every code of table 8-1, in upper and lower case.

    It may report an error for a code that is no state (A-8-3, A-4.8-2) or is in lower case (A-T-7).
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
                    UserMessage("the client reports the status {code} as an error", code=text),
                )
                continue
            result = subject.expect_done(call)
            expect_in(
                _code_in(result), {code.text, code.text.lower()}, "the client reports a wrong code"
            )
            _expect_state(result, code)


def _code_in(result: Any) -> Any:
    return result.get("code") if isinstance(result, dict) else result


def _expect_state(result: Any, code: Code) -> None:
    """Require that a reported state (idle, running, error) matches the code."""
    state = result.get("state") if isinstance(result, dict) else None
    due = _STATES.get(code.kind, "error")
    expect(
        not isinstance(state, str) or state.lower() == due,
        UserMessage("the client reports a wrong state for the code {code}", code=code.text),
        expected=due,
        observed=f"{state}",
    )


@client_case("4.8/11", name="states", attended=True)
def test_states(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports an idle robot, a running program and a fault of all motors."""
    for text in examples(("00", "01", "1F")):
        expect_reported(subject, line, "get_status", text.encode())


@client_case("4.8/11", name="unknown")
def test_unknown_codes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The status is a code that is not in table 8-1; the client reports it or an error."""
    for data in examples(_UNKNOWN):
        call, _ = request_operation(subject, line, "get_status")
        line.reply("get_status", data=data)
        subject.wait_for_answer(call)
        expect(
            not call.ok or _code_in(call.result) not in ("00", "01"),
            "the client reports an unknown code as a code of the table",
            expected=UserMessage("{value}, or an error", value=data.decode()),
            observed=f"{call}",
        )
        expect_reported(subject, line, "get_status", b"05")
