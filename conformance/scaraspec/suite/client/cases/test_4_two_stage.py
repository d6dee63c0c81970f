"""Clause 4: two-stage commands, with a first reply and a final result (L306-637)."""

from collections.abc import Sequence
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
    LOCK,
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
from scaraspec.suite.client.harness.unrequested_connections import serve_unrequested
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseSkipped, NoReply, expect
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

_LATE_S: Final = 30.5  # longer than usual timeouts of clients
_LATE_LOCK_S: Final = 6.0
_MOMENT_S: Final = 0.01
_SHORT_S: Final = 0.03
_QUEUED_S: Final = 1.0
_POLLED_S: Final = 1.2  # a client may poll the status every second
_LATE_REPLY_S: Final = (1.2, 4.5)  # a controller may take 5 s (3/31)
_RECONNECTS_S: Final = 5.0  # until a client has reconnected by itself
_UNKNOWN: Final = ("21", "30", "99", "0A", "ZZ", "--")
"""Codes that are not in table 8-1."""

_CODES: Final = tuple(errors.TABLE_8_1)


# The tag


@client_case("4/9", attended=True)
def test_eleven(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """11 is a success as a final result, and a fault of the inner arm as a code."""
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
    """The client distinguishes refusal, failure and success of every command, for any code."""
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
    odd = line.result_frame(RUN.name, data=b"12")  # a code instead of a result is not a success
    line.send_bytes(odd.encode() + line.result_frame(RUN.name, "12").encode())
    subject.expect_failure(call, requirement="T/9")


@client_case("4/9", name="untagged")
def test_untagged(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A frame without the tag is not a final result, even with the data of one."""
    for operation in examples(OPERATIONS):
        call = begin_and_accept(subject, line, operation)
        stray = line.frame(operation.name, data=b"11")
        line.send_bytes(stray.encode() + line.result_frame(operation.name, "12").encode())
        expect_final_failure(
            subject, call, "the client took an untagged frame for the final result"
        )
        line = reopen(subject, line)
        call = begin_and_accept(subject, line, operation)
        stray = line.frame(operation.name, data=b"00|12")
        line.send_bytes(stray.encode() + line.result_frame(operation.name).encode())
        subject.wait_for_answer(call)
        expect(
            reported_code(call) is None,
            "the client took an untagged frame for the final result",
            expected="the success in the tagged frame, or an error",
            observed=f"{call}",
        )
        line = reopen(subject, line)


@client_case("4/9", name="waits")
def test_waits(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The first reply alone finishes no operation."""
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
    """The final result of another command finishes no operation."""
    for operation, other in examples(
        zip(OPERATIONS, (*OPERATIONS[1:], OPERATIONS[0]), strict=True)
    ):
        call = begin_and_accept(subject, line, operation)
        stray = line.result_frame(other.name)
        line.send_bytes(stray.encode() + line.result_frame(operation.name, "05").encode())
        why = UserMessage(
            "the client took the result of {other} for the result of {operation}",
            other=other.name,
            operation=operation.name,
        )
        expect_final_failure(subject, call, why)
        line = reopen(subject, line)


@client_case("4/9", name="second")
def test_second_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An untagged refusal of a second operation does not finish the first operation."""
    require_query_while_executing(subject, line)
    first = begin_and_accept(subject, line, RUN)
    second = subject.begin(RUN.name, name="other.rob")
    with suppress(NoReply):
        if request_unless_refused(line, second, within_s=_QUEUED_S):
            line.reply(RUN.name, data=b"0|01")
            expect_refused(subject, second, "01")
    subject.expect_pending(
        first, "the client took the refusal of a second operation for the end of the first"
    )
    line.result(RUN.name)
    expect_finished(subject, first)
    if second.answer is None:  # the client held the request back until now
        line.serve(second, data=b"0|01")
        expect_refused(subject, second, "01")


# A final result right after the first reply


@client_case("4/10")
def test_together(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The first reply and the final result arrive in one segment, for every command."""
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
    """The first reply and the final result arrive together, split at each byte in turn."""
    both = line.frame(RESET.name, data=b"1").encode() + line.result_frame(RESET.name, "14").encode()
    for cut in examples(range(1, len(both))):
        call = begin_and_request(subject, line, RESET)
        line.send_bytes(both[:cut])
        line.wait(_MOMENT_S)
        line.send_bytes(both[cut:])
        expect_execution_failed(subject, call, "14")


@client_case("4/10", name="among-others")
def test_among_other_replies(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result arrives in one segment with a query reply, before it and after it."""
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


# A late final result


@client_case("4/11", "4/16")
def test_late(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result arrives 30 s after the first reply; the request is not repeated.

    That of a lock arrives after 6 s.
    """
    _expect_waits(subject, line, RUN, _LATE_S)
    with suppress(CaseSkipped):  # a client need not lock joints
        _expect_waits(subject, line, LOCK, _LATE_LOCK_S)


def _expect_waits(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation, late_s: float
) -> None:
    """Require that the client waits for a final result that comes after this time."""
    call = begin_and_accept(subject, line, operation)
    line.wait(late_s)
    subject.expect_pending(call, "the client did not wait for the final result", requirement="4/11")
    _expect_not_repeated(line, operation)
    line.result(operation.name, "18")
    expect_execution_failed(subject, call, "18", requirement="4/11")


@client_case("4/16", name="at-once")
def test_not_repeated(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client repeats no request while its command executes, except a jog (A-4.28-3)."""
    for operation in examples(OPERATIONS):
        call = begin_and_accept(subject, line, operation)
        line.wait(_SHORT_S)
        if operation is not JOG:
            _expect_not_repeated(line, operation)
        line.result(operation.name, "05")
        expect_execution_failed(subject, call)


@client_case("4/16", name="late-reply")
def test_not_repeated_before_its_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client does not repeat a request whose first reply is late; it may time out."""
    for operation, late_s in examples(zip((RUN, MOVE), _LATE_REPLY_S, strict=True)):
        line = ensure_open(subject, line)
        call = begin_and_request(subject, line, operation)
        line.wait(late_s)
        _expect_not_repeated(line, operation)
        given_up = call.answer is not None and not call.ok
        if not line.ended:  # a client that has given up may have closed it
            line.reply(operation.name, data=b"1")
            line.result(operation.name)
        if given_up:
            message = UserMessage(
                "the client waits less than {late_reply_s:g} s for a first reply",
                late_reply_s=late_s,
            )
            subject.tolerate("4/16", "A-3-15", "short", message)
        else:
            expect_finished(subject, call)


@client_case("4/16", name="while-idle")
def test_not_repeated_when_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client does not repeat a request when the status is idle or a fault.

    Only the final result reports the outcome. A client need not wait for it any longer.
    """
    require_query_while_executing(subject, line)
    for status in examples(("00", "12", RUN.status)):
        call = begin_and_accept(subject, line, RUN)
        query = subject.begin("get_status")
        line.serve(query, status)
        subject.wait_for_answer(query)
        line.wait(_POLLED_S if status == "00" and subject.has_polled("get_status") else _SHORT_S)
        _expect_not_repeated(line, RUN)
        line.result(RUN.name, "12")
        expect_execution_failed(subject, call, "12")
        report_idle(subject, line)


@client_case("4/16", name="reconnected")
def test_not_repeated_on_a_new_connection(
    subject: ClientUnderTest, line: IncomingConnection
) -> None:
    """A request whose final result was lost with the link is not repeated or reported as done."""
    for operation in examples((MOVE, STOP)):
        call = begin_and_accept(subject, line, operation)
        line.wait(_SHORT_S)
        line.close()
        line = subject.open()
        line.wait(subject.silence_s)
        _expect_not_repeated(line, operation)
        _expect_no_success(call)


@client_case("4/16", name="by-itself")
def test_not_repeated_by_itself(subject: ClientUnderTest) -> None:
    """The link is lost before or after the first reply; the client may only reconnect by itself.

    It does not send a later query without a login either.
    """
    for operation, accepted in examples(((RUN, True), (MOVE, False))):
        line = subject.open()
        if accepted:
            call = begin_and_accept(subject, line, operation)
            line.close()
        else:
            call = begin_and_request(subject, line, operation)
            line.reset()
        again = serve_unrequested(subject, _RECONNECTS_S, (RUN.name, MOVE.name))
        message = UserMessage(
            "the client reconnected by itself and repeated {operation}, whose result was lost with"
            " the link",
            operation=again[0].name if again else operation.name,
        )
        _expect_none(again, message)
        _expect_no_success(call)
        query = subject.begin("get_status")  # the judge expects a login before it (2/10)
        deadline = Deadline(subject, _RECONNECTS_S)
        while not (subject.answers_within(query, _SHORT_S) or deadline.expired):
            serve_unrequested(subject, _SHORT_S, ())


def _expect_not_repeated(line: IncomingConnection, operation: Operation) -> None:
    again = [seen for seen in line.inbox if seen.name == operation.name]
    message = UserMessage(
        "the client repeated {operation} while its final result was pending",
        operation=operation.name,
    )
    _expect_none(again, message)


def _expect_none(again: Sequence[FrameSeen], message: str) -> None:
    expect(
        not again,
        message,
        expected="one request",
        observed=UserMessage("{count} requests", count=1 + len(again)),
        requirement="4/16",
    )


def _expect_no_success(call: Call) -> None:
    message = UserMessage(
        "the client reports success for {operation}, whose result was lost with the link",
        operation=call.name,
    )
    expect(not call.ok or call.failed, message, expected="an error", observed=f"{call}")


# Refusals


@client_case("4/13")
def test_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports a refusal, waits for no final result, and sends the next request."""
    call = begin_and_request(subject, line, MOVE)
    line.reply(MOVE.name, data=b"0|05")
    expect_refused(subject, call)
    call = begin_and_accept(subject, line, MOVE)
    line.result(MOVE.name)
    expect_finished(subject, call)


@client_case("4/13", name="every-order")
def test_every_order_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every command is refused and then accepted; the refusal has no later effect."""
    for operation in examples(OPERATIONS):
        call = begin_and_request(subject, line, operation)
        line.reply(operation.name, data=b"0|06" if operation in REFUSED_WITH_CODE else b"0")
        expect_refused(subject, call)
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name)
        expect_finished(subject, call)


@client_case("4/13", name="bare")
def test_bare_refusal(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A move is refused with a code and then with 0 alone, as its row prints (A-4.24-3)."""
    for data, code in examples(((b"0|05", "05"), (b"0", ""))):
        call = begin_and_request(subject, line, MOVE)
        line.reply(MOVE.name, data=data)
        expect_refused(subject, call, code)
    expect(
        reported_code(call) != "05",
        "the client reports the code of an earlier refusal",
        expected="no code",
        observed=f"{call}",
        requirement="T/9",
    )


@client_case("4/13", "4/12", name="unknown")
def test_unknown_codes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A code that table 8-1 lacks or reserves is neither a success nor another code."""

    @example("")
    @given(st.text("0123456789ABCDEFabcdef", min_size=2, max_size=2))
    def each(code: str) -> None:
        nonlocal line
        line = ensure_open(subject, line)
        call = begin_and_request(subject, line, RUN)
        line.reply(RUN.name, data=b"0|" + code.encode())
        expect_refused(subject, call, requirement="4/13")
        _expect_no_other_code(call, code)
        line = ensure_open(subject, line)
        call = begin_and_accept(subject, line, JOG)
        line.result(JOG.name, data=b"00|" + code.encode())
        expect_execution_failed(subject, call, requirement="4/12")
        _expect_no_other_code(call, code)

    for code in _UNKNOWN:
        each = example(code)(each)
    each()


def _expect_no_other_code(call: Call, code: str) -> None:
    reported = (reported_code(call) or "").upper()
    expect(
        reported == code.upper() or reported not in _CODES,
        "the client reports an unknown code as another code",
        expected=code,
        observed=reported,
        requirement="T/9",
    )


# Codes


@pytest.mark.parametrize("stage", ["refusals", "failures"])
@client_case("4/12", "8/4")
def test_codes(subject: ClientUnderTest, line: IncomingConnection, stage: str) -> None:
    """The client reports every code of table 8-1 unchanged, for the commands in turn."""
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
        message = UserMessage(
            "the client does not report the code {code} of a failed operation",
            code=silent[0],
        )
        subject.tolerate("4/12", "A-8-1", "not shown", message)


@client_case("4/12", name="interrupted")
def test_interrupted(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A failure with code 00, of a stopped command, is not a success (A-4.17-4)."""
    for operation in examples((RUN, SIMULATE, RESET, MOVE, JOG)):
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name, "00")
        expect_execution_failed(subject, call, "00")
