"""4.17: the emergency stop (0x32, L356-383), and the command that it stops (A-4.17-4)."""

from contextlib import suppress

import pytest

from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import begin_operation, for_each_supported
from scaraspec.suite.client.harness.request_checks import request_unless_refused
from scaraspec.suite.client.harness.two_stage import (
    INTERRUPTIBLE,
    JOG,
    LOCK,
    MOVE,
    RUN,
    STOP,
    Operation,
    begin_and_accept,
    begin_and_request,
    expect_execution_failed,
    expect_finished,
    expect_refused,
    require_query_while_executing,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, NoReply, expect, expect_equal
from scaraspec.user_message import UserMessage

_WHILE_S = 1.0
_AT_ONCE_S = 1.0  # shorter than the timeout of a reply
_GIVEN_UP_S = 5.5  # longer than the timeout of a reply
_FATES = ("first", "after", "together", "none")
"""When the final result of the stopped command arrives, relative to that of the stop.

"none" is last, because a client may wait for that result for a while and not start the command.
"""


@client_case("4.17/1", attended=True)
def test_stop(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The stop carries no data; it succeeds once and is then refused without a code (L366)."""
    call = subject.begin(STOP.name)
    line.serve(call, data=b"1", sent=b"")
    line.result(STOP.name)
    expect_finished(subject, call)
    call = subject.begin(STOP.name)
    line.serve(call, data=b"0", sent=b"")
    expect_refused(subject, call)


@client_case("4.17/1", name="behind-others")
def test_stop_after_requests_with_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The stop carries no data after requests that carried data."""
    for operation in examples(INTERRUPTIBLE):
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name)
        expect_finished(subject, call)
        call = subject.begin(STOP.name)
        request = line.serve(call, data=b"0")
        expect_equal(
            request.frame.data,
            b"",
            UserMessage("the stop carries data after {operation}", operation=operation.name),
        )
        expect_refused(subject, call)


@client_case("4.17/9", name="of-a-former")
def test_result_of_a_former_command(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The stop ends a command of another client; its final result arrives first, last, or never."""
    for operation in INTERRUPTIBLE:
        for fate in examples(_FATES):
            call = begin_and_accept(subject, line, STOP)
            _end(line, operation, fate)
            expect_finished(subject, call, requirement="4.17/9")
    _still_works(subject, line, RUN)


@pytest.mark.parametrize("operation", INTERRUPTIBLE, ids=lambda operation: operation.name)
@client_case("4.17/9")
def test_interrupted(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> None:
    """The stopped command's result arrives before, with or after that of the stop, or never."""
    require_query_while_executing(subject, line)
    for fate in examples(_FATES):
        call = begin_and_accept(subject, line, operation)
        stop = _begun(subject, line)
        _end(line, operation, fate)
        expect_finished(subject, stop, requirement="4.17/9")
        if fate == "none":
            _not_done(call)
        else:
            expect_execution_failed(subject, call, "00", requirement="4.17/9")
        line.inbox.clear()
        _still_works(subject, line, LOCK)
    if operation is RUN:  # of one is enough: a client may only wait for the result for a while
        subject.answers_within(call, _GIVEN_UP_S)
        _not_done(call)


@client_case("4.17/9", name="of-a-later")
def test_later_command(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A move that starts after a stop executes for a while and succeeds."""
    require_query_while_executing(subject, line)
    call = begin_and_accept(subject, line, RUN)
    stop = _begun(subject, line)
    _end(line, RUN, "first")
    expect_finished(subject, stop)
    expect_execution_failed(subject, call, "00")
    call = begin_and_accept(subject, line, MOVE)
    line.wait(_WHILE_S)
    line.result(MOVE.name)
    expect_finished(subject, call)


@client_case("4.17/9", name="failed")
def test_stop_fails(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The stop is refused or fails; the running program continues to its end."""
    require_query_while_executing(subject, line)
    for accepted in examples((False, True)):
        call = begin_and_accept(subject, line, RUN)
        if accepted:
            stop = _begun(subject, line)
            line.result(STOP.name, "12")
            expect_execution_failed(subject, stop, "12")
        else:
            stop = begin_and_request(subject, line, STOP)
            line.reply(STOP.name, data=b"0")
            expect_refused(subject, stop)
        subject.expect_pending(
            call, "the client took a failed stop for the end of the running program"
        )
        line.result(RUN.name)
        expect_finished(subject, call)


@client_case("4.17/10")
def test_stop_beside_a_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the stop at once while the reply to a query is pending."""
    if not _starts_another(subject, line):
        return
    for name in examples(("get_version", "get_tool_coordinates", "list_programs")):
        query = subject.begin(name)
        line.request(name, query)
        stop = _sent_at_once(subject, line)
        line.reply(STOP.name, data=b"0")
        line.reply(name, data=_REPLIES[name])  # a client that reads the position may wait for it
        expect_refused(subject, stop)
        subject.expect_done(query)


@client_case("4.17/10", name="unaccepted")
def test_stop_beside_an_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the stop at once while the first reply to a move is pending."""
    if not _starts_another(subject, line):
        return
    for operation in examples((RUN, MOVE, JOG)):
        call = begin_and_request(subject, line, operation)
        stop = _sent_at_once(subject, line)
        line.reply(STOP.name, data=b"0")
        expect_refused(subject, stop)
        line.reply(operation.name, data=b"1")
        line.result(operation.name)
        expect_finished(subject, call)


@client_case("4.17/10", name="setting")
def test_stop_beside_a_setting(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the stop at once while the reply to a setting is pending."""
    if not _starts_another(subject, line):
        return

    def each(name: str) -> None:
        call = begin_operation(subject, name)
        line.request(name, call)
        stop = _sent_at_once(subject, line)
        line.reply(STOP.name, data=b"0")
        expect_refused(subject, stop)
        line.reply(name)
        subject.expect_done(call)

    for_each_supported(("set_digital_output", "set_time", "delete_program"), each)


@client_case("4.17/10", name="executing")
def test_stop_beside_an_execution(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the stop at once while a command executes."""
    if not _starts_another(subject, line):
        return
    for operation in examples(INTERRUPTIBLE):
        call = begin_and_accept(subject, line, operation)
        stop = _sent_at_once(subject, line)
        line.reply(STOP.name, data=b"1")
        line.result(operation.name, "00")
        line.result(STOP.name)
        expect_finished(subject, stop)
        expect_execution_failed(subject, call)


_REPLIES = {
    "get_version": b"1.0.0",
    "get_tool_coordinates": b"200|300|324|34.6|0|0",
    "list_programs": b"0|pro1.rob",
}


def _starts_another(subject: ClientUnderTest, line: IncomingConnection) -> bool:
    """Whether the client starts an operation while a reply or a final result is pending.

    A client, or its driver, that never does so cannot send the stop either. This is tolerated.
    """
    with suppress(CaseSkipped):
        subject.require_concurrency(line)
        return True
    try:
        require_query_while_executing(subject, line)
    except CaseSkipped as why:
        message = UserMessage("{reason}; this includes the stop", reason=why)
        subject.tolerate("4.17/10", "A-4-3", "one at a time", message)
        return False
    return True


def _sent_at_once(subject: ClientUnderTest, line: IncomingConnection) -> Call:
    """Begin a stop and require that its request does not wait for anything.

    Raises:
        CaseFailed: The client does not send it at once.
        CaseInconclusive: The request may be on a further connection.
    """
    stop = subject.begin(STOP.name)
    try:
        line.request(STOP.name, stop, within_s=_AT_ONCE_S)
    except NoReply:
        subject.require_single_connection()
        raise
    return stop


def _end(line: IncomingConnection, operation: Operation, fate: str) -> None:
    """Send the final result of the stop and, depending on `fate`, of the stopped command."""
    own, of_stop = line.result_frame(operation.name, "00"), line.result_frame(STOP.name)
    frames = {"first": [own, of_stop], "after": [of_stop, own], "none": [of_stop]}
    if fate == "together":
        line.send_bytes(own.encode() + of_stop.encode())
    for frame in frames.get(fate, ()):
        line.send_frame(frame)


def _not_done(call: Call) -> None:
    expect(
        call.answer is None or call.failed,
        UserMessage("{call} was stopped, but the client reports success", call=call.name),
        expected="an error, or no answer yet",
        observed=f"{call}",
        requirement="4.17/9",
    )


def _begun(subject: ClientUnderTest, line: IncomingConnection) -> Call:
    """Begin a stop and accept it. The status shows the stopped command while it continues."""
    stop = begin_and_request(subject, line, STOP)
    line.reply(STOP.name, data=b"1")
    return stop


def _still_works(subject: ClientUnderTest, line: IncomingConnection, other: Operation) -> None:
    """Require that a query works, and another operation if the client does not refuse it."""
    query = subject.begin("get_version")
    line.serve(query, "1.0.0")
    subject.expect_result(query, "1.0.0", requirement="4.17/9")
    call = subject.begin(other.name, **other.values)
    if request_unless_refused(line, call):
        line.reply(other.name, data=b"1")
        line.result(other.name)
        expect_finished(subject, call, requirement="4.17/9")
