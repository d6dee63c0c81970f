"""Clause 4: commands that are answered twice (L306-637): the first reply, and the final result."""

from contextlib import suppress
from itertools import cycle
from typing import Final

import pytest
from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol import errors
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.request_checks import request_unless_refused
from scaraspec.suite.client.harness.two_stage import (
    JOG,
    MOVE,
    OPERATIONS,
    REFUSED_WITH_CODE,
    RESET,
    RUN,
    SIMULATE,
    STOP,
    Operation,
    begin_and_accept,
    begin_and_request,
    ensure_open,
    expect_execution_failed,
    expect_final_failure,
    expect_finished,
    expect_refused,
    reopen,
    report_idle,
    reported_code,
    reports_code,
    require_query_while_executing,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply, expect
from scaraspec.user_message import UserMessage

_LATE_S: Final = 10.5
_MOMENT_S: Final = 0.01
_SHORT_S: Final = 0.03
_QUEUED_S: Final = 1.0
_POLLED_S: Final = 1.2  # who shows the status asks for it every second
_LATE_REPLY_S: Final = 1.2  # a controller may take 5 s (3/31)
_UNKNOWN: Final = ("21", "30", "99", "0A", "ZZ", "--")
"""Codes that table 8-1 does not have."""

_CODES: Final = tuple(errors.TABLE_8_1)


# By its tag


@client_case("4/9", attended=True)
def test_eleven(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """11 is a success as a final result and the inner arm's fault as a code of either stage."""
    call = begin_and_accept(subject, line, RUN)
    line.result(RUN.name)
    expect_finished(subject, call)
    call = begin_and_accept(subject, line, RUN)
    line.result(RUN.name, "11")
    expect_execution_failed(subject, call, "11")
    call = begin_and_request(subject, line, RUN)
    line.reply(RUN.name, data=b"0|11")
    expect_refused(subject, call, "11")


@client_case("4/9", "4/13", name="stages")
def test_stages(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Refusal, failure and success are told apart for every command, whatever the code."""
    for operation, code in examples(
        zip(REFUSED_WITH_CODE, cycle(("11", "01", "10", "06")), strict=False)
    ):
        call = begin_and_request(subject, line, operation)
        line.reply(operation.name, data=b"0|" + code.encode())
        expect_refused(subject, call, code)
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name, code)
        expect_execution_failed(subject, call, code)
    for operation in examples(OPERATIONS):
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name)
        expect_finished(subject, call)
    call = begin_and_accept(subject, line, RUN)
    odd = line.result_frame(RUN.name, data=b"12")  # a code in place of a result is no success
    line.send_bytes(odd.encode() + line.result_frame(RUN.name, "12").encode())
    subject.expect_failure(call, requirement="T/9")


@client_case("4/9", name="untagged")
def test_untagged(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """What bears no tag is no final result, even if its data are those of one."""
    for operation in examples(OPERATIONS):
        call = begin_and_accept(subject, line, operation)
        stray = line.frame(operation.name, data=b"11")
        line.send_bytes(stray.encode() + line.result_frame(operation.name, "12").encode())
        expect_final_failure(subject, call, "an untagged frame was taken for the final result")
        line = reopen(subject, line)
        call = begin_and_accept(subject, line, operation)
        stray = line.frame(operation.name, data=b"00|12")
        line.send_bytes(stray.encode() + line.result_frame(operation.name).encode())
        subject.wait_for_answer(call)
        expect(
            reported_code(call) is None,
            "an untagged frame was taken for the final result",
            expected="the success that the tagged frame tells, or an error",
            observed=f"{call}",
        )
        line = reopen(subject, line)


@client_case("4/9", name="waits")
def test_waits(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The first reply alone ends no order, whichever it is."""
    for operation in examples(OPERATIONS):
        call = begin_and_accept(subject, line, operation)
        line.wait(_SHORT_S)
        subject.expect_pending(
            call,
            UserMessage(
                "the client reports {operation} as finished after the first reply",
                operation=operation.name,
            ),
        )
        line.result(operation.name)
        expect_finished(subject, call)


@client_case("4/9", name="of-another")
def test_result_of_another(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The tagged result of another command ends no order."""
    for operation, other in examples(
        zip(OPERATIONS, (*OPERATIONS[1:], OPERATIONS[0]), strict=True)
    ):
        call = begin_and_accept(subject, line, operation)
        stray = line.result_frame(other.name)
        line.send_bytes(stray.encode() + line.result_frame(operation.name, "05").encode())
        why = UserMessage(
            "the result of {other} was taken for that of {operation}",
            other=other.name,
            operation=operation.name,
        )
        expect_final_failure(subject, call, why)
        line = reopen(subject, line)


@client_case("4/9", name="second")
def test_second_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A refusal without tag, to a second order while the first executes, does not end the first."""
    require_query_while_executing(subject, line)
    first = begin_and_accept(subject, line, RUN)
    second = subject.begin(RUN.name, name="other.rob")
    with suppress(NoReply):
        if request_unless_refused(line, second, within_s=_QUEUED_S):
            line.reply(RUN.name, data=b"0|01")
            expect_refused(subject, second, "01")
    subject.expect_pending(
        first, "the refusal of a second order was taken for the end of the first"
    )
    line.result(RUN.name)
    expect_finished(subject, first)
    if second.answer is None:  # it was held back until now
        line.serve(second, data=b"0|01")
        expect_refused(subject, second, "01")


# Right behind the first reply


@client_case("4/10")
def test_together(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """First reply and final result come in one segment, for every command, done and failed."""
    for operation in OPERATIONS:
        for code in examples(("", "12")):
            call = begin_and_request(subject, line, operation)
            both = line.frame(operation.name, data=b"1"), line.result_frame(operation.name, code)
            line.send_bytes(b"".join(frame.encode() for frame in both))
            if code:
                expect_execution_failed(subject, call, code)
            else:
                expect_finished(subject, call)


@client_case("4/10", name="split")
def test_split(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """First reply and final result come one behind the other, cut at every byte."""
    both = line.frame(RESET.name, data=b"1").encode() + line.result_frame(RESET.name, "14").encode()
    for cut in examples(range(1, len(both))):
        call = begin_and_request(subject, line, RESET)
        line.send_bytes(both[:cut])
        line.wait(_MOMENT_S)
        line.send_bytes(both[cut:])
        expect_execution_failed(subject, call, "14")


@client_case("4/10", name="among-others")
def test_among_other_replies(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result comes in one segment with a query's reply, ahead of it and behind it."""
    require_query_while_executing(subject, line)
    for operation in (RUN, MOVE, JOG):
        for ahead in examples((True, False)):
            call = begin_and_accept(subject, line, operation)
            query = subject.begin("get_version")
            line.request("get_version", query)
            pair = [line.result_frame(operation.name), line.frame("get_version", "1.0.0")]
            line.send_bytes(b"".join(f.encode() for f in (pair if ahead else reversed(pair))))
            expect_finished(subject, call)
            subject.expect_result(query, "1.0.0")


# Long after it


@client_case("4/11", "4/16")
def test_late(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result comes 10 s after the first reply, and the request is not sent again."""
    call = begin_and_accept(subject, line, RUN)
    line.wait(_LATE_S)
    subject.expect_pending(call, "the final result was not waited for", requirement="4/11")
    _not_sent(line, RUN)
    line.result(RUN.name, "18")
    expect_execution_failed(subject, call, "18", requirement="4/11")


@client_case("4/16", name="at-once")
def test_not_repeated(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No request is sent again while its command executes, but a jog's (A-4.28-3)."""
    for operation in examples(OPERATIONS):
        call = begin_and_accept(subject, line, operation)
        line.wait(_SHORT_S)
        if operation is not JOG:
            _not_sent(line, operation)
        line.result(operation.name, "05")
        expect_execution_failed(subject, call)


@client_case("4/16", name="late-reply")
def test_not_repeated_before_its_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No request is sent again because its first reply is late; a client may give it up."""
    for operation in examples((RUN, MOVE)):
        call = begin_and_request(subject, line, operation)
        line.wait(_LATE_REPLY_S)
        _not_sent(line, operation)
        given_up = call.answer is not None and not call.ok
        line.reply(operation.name, data=b"1")
        line.result(operation.name)
        if given_up:
            told = UserMessage(
                "the client waits less than {late_reply_s:g} s for a first reply",
                late_reply_s=_LATE_REPLY_S,
            )
            subject.tolerate("4/16", "A-3-15", "short", told)
        else:
            expect_finished(subject, call)


@client_case("4/16", name="while-idle")
def test_not_repeated_when_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A request is not sent again although the robot says that it is idle, or at fault.

    What came of it is known only from its result, for which a client need not wait any longer.
    """
    require_query_while_executing(subject, line)
    for status in examples(("00", "12", RUN.status)):
        call = begin_and_accept(subject, line, RUN)
        query = subject.begin("get_status")
        line.serve(query, status)
        subject.wait_for_answer(query)
        line.wait(_POLLED_S if status == "00" and subject.has_polled("get_status") else _SHORT_S)
        _not_sent(line, RUN)
        line.result(RUN.name, "12")
        expect_execution_failed(subject, call, "12")
        report_idle(subject, line)


@client_case("4/16", name="reconnected")
def test_not_repeated_on_a_new_connection(
    subject: ClientUnderTest, line: IncomingConnection
) -> None:
    """A request whose result was lost with the link is not sent again, nor said to be done."""
    for operation in examples((MOVE, STOP)):
        call = begin_and_accept(subject, line, operation)
        line.wait(_SHORT_S)
        line.close()
        line = subject.open()
        line.wait(subject.silence_s)
        _not_sent(line, operation)
        message = UserMessage(
            "{operation} is said to be done, and its result was lost with the link",
            operation=operation.name,
        )
        expect(not call.ok or call.failed, message, expected="an error", observed=f"{call}")


def _not_sent(line: IncomingConnection, operation: Operation) -> None:
    again = [seen for seen in line.inbox if seen.name == operation.name]
    expect(
        not again,
        UserMessage(
            "{operation} was sent again while its final result was outstanding",
            operation=operation.name,
        ),
        expected="one request",
        observed=f"{1 + len(again)} requests",
        requirement="4/16",
    )


# Refusals


@client_case("4/13")
def test_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A refused order is told as such, and nothing is waited for: the next one is sent."""
    call = begin_and_request(subject, line, MOVE)
    line.reply(MOVE.name, data=b"0|05")
    expect_refused(subject, call)
    call = begin_and_accept(subject, line, MOVE)
    line.result(MOVE.name)
    expect_finished(subject, call)


@client_case("4/13", name="every-order")
def test_every_order_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every command is refused, then accepted: the refusal leaves nothing behind."""
    for operation in examples(OPERATIONS):
        call = begin_and_request(subject, line, operation)
        line.reply(operation.name, data=b"0|06" if operation in REFUSED_WITH_CODE else b"0")
        expect_refused(subject, call)
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name)
        expect_finished(subject, call)


@client_case("4/13", name="bare")
def test_bare_refusal(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A move is refused with 0 alone, as its row prints the length (A-4.24-3), behind a reason."""
    for data, code in examples(((b"0|05", "05"), (b"0", ""))):
        call = begin_and_request(subject, line, MOVE)
        line.reply(MOVE.name, data=data)
        expect_refused(subject, call, code)
    expect(
        reported_code(call) != "05",
        "the code of a refusal is told of the next one, which has none",
        expected="no code",
        observed=f"{call}",
        requirement="T/9",
    )


@client_case("4/13", "4/12", name="unknown")
def test_unknown_codes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A code that table 8-1 does not have, or reserves, is neither a success nor another code."""

    @example("")
    @given(st.text("0123456789ABCDEFabcdef", min_size=2, max_size=2))
    def each(code: str) -> None:
        nonlocal line
        line = ensure_open(subject, line)
        call = begin_and_request(subject, line, RUN)
        line.reply(RUN.name, data=b"0|" + code.encode())
        expect_refused(subject, call, requirement="4/13")
        _tells_no_other(call, code)
        line = ensure_open(subject, line)
        call = begin_and_accept(subject, line, JOG)
        line.result(JOG.name, data=b"00|" + code.encode())
        expect_execution_failed(subject, call, requirement="4/12")
        _tells_no_other(call, code)

    for code in _UNKNOWN:
        each = example(code)(each)
    each()


def _tells_no_other(call: Call, code: str) -> None:
    said = (reported_code(call) or "").upper()
    expect(
        said == code.upper() or said not in _CODES,
        "a code that is unknown is told as another one",
        expected=code,
        observed=said,
        requirement="T/9",
    )


# Codes


@pytest.mark.parametrize("stage", ["refusals", "failures"])
@client_case("4/12", "8/4")
def test_codes(subject: ClientUnderTest, line: IncomingConnection, stage: str) -> None:
    """Every code of table 8-1 is told as it was sent, for the commands in turn."""
    silent = []
    for operation, code in examples(zip(cycle(REFUSED_WITH_CODE), _CODES, strict=False)):
        if stage == "refusals":
            call = begin_and_request(subject, line, operation)
            line.reply(operation.name, data=b"0|" + code.encode())
            expect_refused(subject, call, code)
        else:
            call = begin_and_accept(subject, line, operation)
            line.result(operation.name, code)
            expect_execution_failed(subject, call, code)
        if not reports_code(call, code):
            silent.append(code)
    if silent:
        told = UserMessage(
            "of an order that did not succeed the client does not tell the code {silent}",
            silent=silent[0],
        )
        subject.tolerate("4/12", "A-8-1", "not shown", told)


@client_case("4/12", name="interrupted")
def test_interrupted(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The code 00 in a failure, of a command that was stopped, makes it no success (A-4.17-4)."""
    for operation in examples((RUN, SIMULATE, RESET, MOVE, JOG)):
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name, "00")
        expect_execution_failed(subject, call, "00")
