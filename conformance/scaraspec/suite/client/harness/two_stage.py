"""Two-stage commands of a client: begin, accept, finish, and check what the client reports."""

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final, NamedTuple

from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import OPENINGS, VALUES, operation_arguments
from scaraspec.suite.engine.expectations import (
    CaseSkipped,
    NoReply,
    OperationRefused,
    expect,
    expect_equal,
    expect_in,
)
from scaraspec.user_message import UserMessage


class Operation(NamedTuple):
    """A two-stage operation.

    Attributes:
        name: The command.
        values: The values of the operation.
        status: The status of the robot while the command executes.
    """

    name: str
    values: Mapping[str, Any]
    status: str = "04"


RUN: Final = Operation("run_program", {"name": "pro1.rob"}, "01")
SIMULATE: Final = Operation("simulate_program", {"name": "pro2.rob"}, "02")
STOP: Final = Operation("emergency_stop", {})
RESET: Final = Operation("reset", {}, "03")
MOVE: Final = Operation(
    "set_tool_coordinates",
    {"speed": 60, "x": 200, "y": 300, "z": 324, "theta_x": 34.6, "theta_y": 0, "theta_z": 0},
)
RELEASE: Final = Operation("release_joints", {})
LOCK: Final = Operation("lock_joints", {})
JOG: Final = Operation("jog", {"direction": "+x"})

INTERRUPTIBLE: Final = (RUN, SIMULATE, RESET, MOVE, JOG)
"""Operations that take a while and may be stopped."""

REFUSED_WITH_CODE: Final = (RUN, SIMULATE, RESET, MOVE, RELEASE, LOCK, JOG)
"""Operations that are refused with a code; the stop is refused without one (L366)."""

OPERATIONS: Final = (*REFUSED_WITH_CODE, STOP)
"""All two-stage operations."""

_PARALLEL_S: Final = 2.0
_KNOWN_S: Final = 0.1  # until the client knows that a command executes
_CONTENT: Final = b"content"


def begin_and_request(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> Call:
    """Begin an operation and wait for its request."""
    call = subject.begin(operation.name, **operation.values)
    line.request(operation.name, call)
    return call


def begin_and_accept(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> Call:
    """Begin an operation and accept it."""
    call = begin_and_request(subject, line, operation)
    line.reply(operation.name, data=b"1")
    line.auto_responder.replies["get_status"] = operation.status.encode()
    return call


def run_unless_refused(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> None:
    """Run a program to its end, unless the client refuses the name.

    Raises:
        CaseFailed: The client requests another program, or reports another outcome.
    """
    call = subject.begin(operation.name, **operation.values)
    with subject.allow_refusal():
        request = line.serve(call, data=b"1")
        line.result(operation.name)
        name = operation.values["name"].encode()
        expect_equal(
            request.seen.text,
            name,
            UserMessage("the request {operation} carries a wrong name", operation=operation.name),
        )
        expect_finished(subject, call)


def report_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Report an idle robot. A client need not move a robot that it takes for faulty."""
    call = subject.begin("get_status")
    line.serve(call, "00")
    subject.wait_for_answer(call)


def reopen(subject: ClientUnderTest, line: IncomingConnection) -> IncomingConnection:
    """Return a new connection. A client may end the old one at any time after invalid frames."""
    line.close()
    return subject.open()


def ensure_open(subject: ClientUnderTest, line: IncomingConnection) -> IncomingConnection:
    """Return this connection, or a new one if the client has ended it."""
    return subject.open() if line.ended else line


def require_query_while_executing(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Require that the client starts another operation while a command executes.

    Raises:
        CaseSkipped: The client, or its driver, does not.
    """
    traits = subject.traits
    if traits.queries_while_executing is None:
        first = begin_and_accept(subject, line, RUN)
        name, _ = subject.prefer_unpolled("get_version", "get_time", "get_joint_angles")
        second = subject.begin(name)
        with suppress(NoReply):
            line.request(name, within_s=_PARALLEL_S)
            traits.queries_while_executing = True
            line.reply(name, data=REPLIES[name])
        line.result(RUN.name)
        expect_finished(subject, first)
        traits.queries_while_executing = bool(traits.queries_while_executing)
        if not traits.queries_while_executing and second.answer is None:
            line.serve(second, data=REPLIES[name])
        subject.wait_for_answer(second)
    if not traits.queries_while_executing:
        raise CaseSkipped("the client starts no operation while a command executes")


def require_while_executing(subject: ClientUnderTest, line: IncomingConnection, name: str) -> None:
    """Require that the client starts this operation while a program runs; tried once per run.

    An operation that is not a query is refused.

    Raises:
        CaseSkipped: The client does not, or does not implement it.
    """
    require_query_while_executing(subject, line)
    starts = subject.traits.starts_while_executing
    if name not in starts:
        opening = OPENINGS.get(name, name)
        reply = REPLIES.get(name, b"0")
        if name in OPENINGS:
            local = subject.make_file(_CONTENT) if name == "upload" else subject.missing_file()
            values = {"local": local, "remote": "beside.txt"}
        else:
            values = operation_arguments(name, VALUES.get(name))
        run = begin_and_accept(subject, line, RUN)
        line.wait(_KNOWN_S)
        call = subject.begin(name, **values)
        try:
            with suppress(NoReply, OperationRefused):
                line.request(opening, call, within_s=_PARALLEL_S)
                line.reply(opening, data=reply)
        finally:
            line.result(RUN.name)
            expect_finished(subject, run)
        starts[name] = call.request_seen
        if not call.request_seen and call.answer is None:
            line.request(opening, call)
            line.reply(opening, data=reply)
        subject.wait_for_answer(call)
    if not starts[name]:
        raise CaseSkipped(
            UserMessage(
                "the client does not start {command} while another command executes", command=name
            )
        )


def expect_finished(subject: ClientUnderTest, call: Call, *, requirement: str = "") -> None:
    """Require that the client reports the operation as accepted and done.

    Raises:
        CaseFailed: The client reports something else, or nothing.
    """
    subject.expect_done(call, requirement=requirement)
    _expect_stages(call, {"accepted": True, "outcome": "11"}, requirement)


def expect_refused(
    subject: ClientUnderTest, call: Call, code: str = "", *, requirement: str = ""
) -> None:
    """Require that the client reports a refusal. A reported code must be this one.

    Raises:
        CaseFailed: The client reports something else, or nothing.
    """
    subject.expect_failure(call, requirement=requirement)
    _expect_stages(call, {"accepted": False}, requirement)
    _expect_code(call, code, requirement)


def expect_execution_failed(
    subject: ClientUnderTest, call: Call, code: str = "", *, requirement: str = ""
) -> None:
    """Require that the client reports acceptance and a failure. A reported code must be this one.

    Raises:
        CaseFailed: The client reports something else, or nothing.
    """
    subject.expect_failure(call, requirement=requirement)
    _expect_stages(call, {"accepted": True, "outcome": "00"}, requirement)
    _expect_code(call, code, requirement)


def expect_final_failure(subject: ClientUnderTest, call: Call, why: str) -> None:
    """Require that the client reports the failure of the real final result.

    Raises:
        CaseFailed: It does not; `why` states what was taken for the result.
    """
    subject.wait_for_answer(call)
    expect(
        call.failed,
        why,
        expected="the failure in its own final result, or an error",
        observed=f"{call}",
    )


def reported_code(call: Call) -> str | None:
    """Return the code that the client reports, if any."""
    code = call.result.get("code") if isinstance(call.result, Mapping) else None
    return None if code is None else str(code)


def reports_code(call: Call, code: str) -> bool:
    """Whether the client reports this code, in its own field or in the error text."""
    return code.upper() in (reported_code(call) or call.error).upper()


def _expect_stages(call: Call, stages: Mapping[str, Any], requirement: str) -> None:
    """Require correct stages from a client that reports stages. An error reports none."""
    stages_reported = call.result if isinstance(call.result, Mapping) else {}
    expect(
        all(stages_reported.get(key, value) == value for key, value in stages.items()),
        UserMessage("the client reports the stages of {call} incorrectly", call=call.name),
        expected=json.dumps(stages),
        observed=f"{call}",
        requirement=requirement,
    )


def _expect_code(call: Call, code: str, requirement: str) -> None:
    code_reported = reported_code(call)
    if code and code_reported is not None:
        expect_in(
            code_reported.upper(),
            (code.upper(),),
            UserMessage(
                "the client reports another code for {call} than it received", call=call.name
            ),
            requirement=requirement,
        )
