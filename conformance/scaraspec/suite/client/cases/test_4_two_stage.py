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
from scaraspec.suite.client.harness.executing import (
    JOG,
    MOVE,
    ORDERS,
    REASONED,
    RESET,
    RUN,
    SIMULATE,
    STOP,
    Order,
    beside,
    code_of,
    executing,
    failed,
    fails_in_the_end,
    finished,
    is_idle,
    ordered,
    refused,
    renewed,
    shows,
    still,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.request_checks import request_unless_refused
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
    call = executing(subject, line, RUN)
    line.result(RUN.name)
    finished(subject, call)
    call = executing(subject, line, RUN)
    line.result(RUN.name, "11")
    failed(subject, call, "11")
    call = ordered(subject, line, RUN)
    line.reply(RUN.name, data=b"0|11")
    refused(subject, call, "11")


@client_case("4/9", "4/13", name="stages")
def test_stages(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Refusal, failure and success are told apart for every command, whatever the code."""
    for order, code in examples(zip(REASONED, cycle(("11", "01", "10", "06")), strict=False)):
        call = ordered(subject, line, order)
        line.reply(order.name, data=b"0|" + code.encode())
        refused(subject, call, code)
        call = executing(subject, line, order)
        line.result(order.name, code)
        failed(subject, call, code)
    for order in examples(ORDERS):
        call = executing(subject, line, order)
        line.result(order.name)
        finished(subject, call)
    call = executing(subject, line, RUN)
    odd = line.result_frame(RUN.name, data=b"12")  # a code in place of a result is no success
    line.send_bytes(odd.encode() + line.result_frame(RUN.name, "12").encode())
    subject.fails(call, requirement="T/9")


@client_case("4/9", name="untagged")
def test_untagged(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """What bears no tag is no final result, even if its data are those of one."""
    for order in examples(ORDERS):
        call = executing(subject, line, order)
        stray = line.frame(order.name, data=b"11")
        line.send_bytes(stray.encode() + line.result_frame(order.name, "12").encode())
        fails_in_the_end(subject, call, "an untagged frame was taken for the final result")
        line = renewed(subject, line)
        call = executing(subject, line, order)
        stray = line.frame(order.name, data=b"00|12")
        line.send_bytes(stray.encode() + line.result_frame(order.name).encode())
        subject.settled(call)
        expect(
            code_of(call) is None,
            "an untagged frame was taken for the final result",
            expected="the success that the tagged frame tells, or an error",
            observed=f"{call}",
        )
        line = renewed(subject, line)


@client_case("4/9", name="waits")
def test_waits(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The first reply alone ends no order, whichever it is."""
    for order in examples(ORDERS):
        call = executing(subject, line, order)
        line.wait(_SHORT_S)
        subject.undone(call, f"{order.name} is said to be over behind its first reply")
        line.result(order.name)
        finished(subject, call)


@client_case("4/9", name="of-another")
def test_result_of_another(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The tagged result of another command ends no order."""
    for order, other in examples(zip(ORDERS, (*ORDERS[1:], ORDERS[0]), strict=True)):
        call = executing(subject, line, order)
        stray = line.result_frame(other.name)
        line.send_bytes(stray.encode() + line.result_frame(order.name, "05").encode())
        why = UserMessage(
            "the result of {other} was taken for that of {order}",
            other=other.name,
            order=order.name,
        )
        fails_in_the_end(subject, call, why)
        line = renewed(subject, line)


@client_case("4/9", name="second")
def test_second_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A refusal without tag, to a second order while the first executes, does not end the first."""
    beside(subject, line)
    first = executing(subject, line, RUN)
    second = subject.begin(RUN.name, name="other.rob")
    with suppress(NoReply):
        if request_unless_refused(line, second, within_s=_QUEUED_S):
            line.reply(RUN.name, data=b"0|01")
            refused(subject, second, "01")
    subject.undone(first, "the refusal of a second order was taken for the end of the first")
    line.result(RUN.name)
    finished(subject, first)
    if second.answer is None:  # it was held back until now
        line.serve(second, data=b"0|01")
        refused(subject, second, "01")


# Right behind the first reply


@client_case("4/10")
def test_together(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """First reply and final result come in one segment, for every command, done and failed."""
    for order in ORDERS:
        for code in examples(("", "12")):
            call = ordered(subject, line, order)
            both = line.frame(order.name, data=b"1"), line.result_frame(order.name, code)
            line.send_bytes(b"".join(frame.encode() for frame in both))
            if code:
                failed(subject, call, code)
            else:
                finished(subject, call)


@client_case("4/10", name="split")
def test_split(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """First reply and final result come one behind the other, cut at every byte."""
    both = line.frame(RESET.name, data=b"1").encode() + line.result_frame(RESET.name, "14").encode()
    for cut in examples(range(1, len(both))):
        call = ordered(subject, line, RESET)
        line.send_bytes(both[:cut])
        line.wait(_MOMENT_S)
        line.send_bytes(both[cut:])
        failed(subject, call, "14")


@client_case("4/10", name="among-others")
def test_among_other_replies(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result comes in one segment with a query's reply, ahead of it and behind it."""
    beside(subject, line)
    for order in (RUN, MOVE, JOG):
        for ahead in examples((True, False)):
            call = executing(subject, line, order)
            query = subject.begin("get_version")
            line.request("get_version", query)
            pair = [line.result_frame(order.name), line.frame("get_version", "1.0.0")]
            line.send_bytes(b"".join(f.encode() for f in (pair if ahead else reversed(pair))))
            finished(subject, call)
            subject.gives(query, "1.0.0")


# Long after it


@client_case("4/11", "4/16")
def test_late(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result comes 10 s after the first reply, and the request is not sent again."""
    call = executing(subject, line, RUN)
    line.wait(_LATE_S)
    subject.undone(call, "the final result was not waited for", requirement="4/11")
    _not_sent(line, RUN)
    line.result(RUN.name, "18")
    failed(subject, call, "18", requirement="4/11")


@client_case("4/16", name="at-once")
def test_not_repeated(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No request is sent again while its command executes, but a jog's (A-4.28-3)."""
    for order in examples(ORDERS):
        call = executing(subject, line, order)
        line.wait(_SHORT_S)
        if order is not JOG:
            _not_sent(line, order)
        line.result(order.name, "05")
        failed(subject, call)


@client_case("4/16", name="late-reply")
def test_not_repeated_before_its_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No request is sent again because its first reply is late; a client may give it up."""
    for order in examples((RUN, MOVE)):
        call = ordered(subject, line, order)
        line.wait(_LATE_REPLY_S)
        _not_sent(line, order)
        given_up = call.answer is not None and not call.ok
        line.reply(order.name, data=b"1")
        line.result(order.name)
        if given_up:
            told = UserMessage(
                "the client waits less than {late_reply_s:g} s for a first reply",
                late_reply_s=_LATE_REPLY_S,
            )
            subject.tolerate("4/16", "A-3-15", "short", told)
        else:
            finished(subject, call)


@client_case("4/16", name="while-idle")
def test_not_repeated_when_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A request is not sent again although the robot says that it is idle, or at fault.

    What came of it is known only from its result, for which a client need not wait any longer.
    """
    beside(subject, line)
    for status in examples(("00", "12", RUN.status)):
        call = executing(subject, line, RUN)
        query = subject.begin("get_status")
        line.serve(query, status)
        subject.settled(query)
        line.wait(_POLLED_S if status == "00" and subject.has_polled("get_status") else _SHORT_S)
        _not_sent(line, RUN)
        line.result(RUN.name, "12")
        failed(subject, call, "12")
        is_idle(subject, line)


@client_case("4/16", name="reconnected")
def test_not_repeated_on_a_new_connection(
    subject: ClientUnderTest, line: IncomingConnection
) -> None:
    """A request whose result was lost with the link is not sent again, nor said to be done."""
    for order in examples((MOVE, STOP)):
        call = executing(subject, line, order)
        line.wait(_SHORT_S)
        line.close()
        line = subject.open()
        line.wait(subject.silence_s)
        _not_sent(line, order)
        message = UserMessage(
            "{order} is said to be done, and its result was lost with the link", order=order.name
        )
        expect(not call.ok or call.failed, message, expected="an error", observed=f"{call}")


def _not_sent(line: IncomingConnection, order: Order) -> None:
    again = [seen for seen in line.inbox if seen.name == order.name]
    expect(
        not again,
        UserMessage(
            "{order} was sent again while its final result was outstanding", order=order.name
        ),
        expected="one request",
        observed=f"{1 + len(again)} requests",
        requirement="4/16",
    )


# Refusals


@client_case("4/13")
def test_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A refused order is told as such, and nothing is waited for: the next one is sent."""
    call = ordered(subject, line, MOVE)
    line.reply(MOVE.name, data=b"0|05")
    refused(subject, call)
    call = executing(subject, line, MOVE)
    line.result(MOVE.name)
    finished(subject, call)


@client_case("4/13", name="every-order")
def test_every_order_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every command is refused, then accepted: the refusal leaves nothing behind."""
    for order in examples(ORDERS):
        call = ordered(subject, line, order)
        line.reply(order.name, data=b"0|06" if order in REASONED else b"0")
        refused(subject, call)
        call = executing(subject, line, order)
        line.result(order.name)
        finished(subject, call)


@client_case("4/13", name="bare")
def test_bare_refusal(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A move is refused with 0 alone, as its row prints the length (A-4.24-3), behind a reason."""
    for data, code in examples(((b"0|05", "05"), (b"0", ""))):
        call = ordered(subject, line, MOVE)
        line.reply(MOVE.name, data=data)
        refused(subject, call, code)
    expect(
        code_of(call) != "05",
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
        line = still(subject, line)
        call = ordered(subject, line, RUN)
        line.reply(RUN.name, data=b"0|" + code.encode())
        refused(subject, call, requirement="4/13")
        _tells_no_other(call, code)
        line = still(subject, line)
        call = executing(subject, line, JOG)
        line.result(JOG.name, data=b"00|" + code.encode())
        failed(subject, call, requirement="4/12")
        _tells_no_other(call, code)

    for code in _UNKNOWN:
        each = example(code)(each)
    each()


def _tells_no_other(call: Call, code: str) -> None:
    said = (code_of(call) or "").upper()
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
    for order, code in examples(zip(cycle(REASONED), _CODES, strict=False)):
        if stage == "refusals":
            call = ordered(subject, line, order)
            line.reply(order.name, data=b"0|" + code.encode())
            refused(subject, call, code)
        else:
            call = executing(subject, line, order)
            line.result(order.name, code)
            failed(subject, call, code)
        if not shows(call, code):
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
    for order in examples((RUN, SIMULATE, RESET, MOVE, JOG)):
        call = executing(subject, line, order)
        line.result(order.name, "00")
        failed(subject, call, "00")
