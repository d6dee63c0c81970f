"""Executing: the two-stage commands of a client under test: ordered, accepted, ended.

What the client says of them is held against what it was sent.
"""

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
    """An order to execute something.

    Attributes:
        name: Its command.
        values: What is ordered.
        status: What the robot says while it executes.
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
"""What takes a while, and may be stopped."""

REFUSED_WITH_CODE: Final = (RUN, SIMULATE, RESET, MOVE, RELEASE, LOCK, JOG)
"""What is refused for a reason; the stop is refused without one (L366)."""

OPERATIONS: Final = (*REFUSED_WITH_CODE, STOP)
"""Every two-stage command."""

_BESIDE_S: Final = 2.0
_KNOWN_S: Final = 0.1  # until a client knows that something executes
_SOME: Final = b"content"


def begin_and_request(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> Call:
    """Give an order, and await its request."""
    call = subject.begin(operation.name, **operation.values)
    line.request(operation.name, call)
    return call


def begin_and_accept(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> Call:
    """Give an order, and accept it."""
    call = begin_and_request(subject, line, operation)
    line.reply(operation.name, data=b"1")
    line.auto_responder.answers["get_status"] = operation.status.encode()
    return call


def run_unless_refused(
    subject: ClientUnderTest, line: IncomingConnection, operation: Operation
) -> None:
    """Give an order to run a program, and see it through unless the client declines the name.

    Raises:
        CaseFailed: It asks for another program, or tells another outcome.
    """
    call = subject.begin(operation.name, **operation.values)
    with subject.allow_refusal():
        request = line.serve(call, data=b"1")
        line.result(operation.name)
        name = operation.values["name"].encode()
        expect_equal(
            request.seen.text,
            name,
            UserMessage("what {operation} carries", operation=operation.name),
        )
        expect_finished(subject, call)


def report_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Tell it that the robot is idle: none that it takes for faulty need be moved."""
    call = subject.begin("get_status")
    line.serve(call, "00")
    subject.wait_for_answer(call)


def reopen(subject: ClientUnderTest, line: IncomingConnection) -> IncomingConnection:
    """A new connection in place of one that the client may end, at its leisure, after nonsense."""
    line.close()
    return subject.open()


def ensure_open(subject: ClientUnderTest, line: IncomingConnection) -> IncomingConnection:
    """This connection, or another one where the client has ended it for what it was sent."""
    return subject.open() if line.over else line


def require_query_while_executing(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Go on only where it takes another order while one executes.

    Raises:
        CaseSkipped: It, or its driver, does not.
    """
    if "beside" not in subject.discoveries:
        first = begin_and_accept(subject, line, RUN)
        name, _ = subject.prefer_unpolled("get_version", "get_time", "get_joint_angles")
        second = subject.begin(name)
        with suppress(NoReply):
            line.request(name, within_s=_BESIDE_S)
            subject.discoveries["beside"] = True
            line.reply(name, data=REPLIES[name])
        line.result(RUN.name)
        expect_finished(subject, first)
        if not subject.discoveries.setdefault("beside", False) and second.answer is None:
            line.serve(second, data=REPLIES[name])
        subject.wait_for_answer(second)
    if not subject.discoveries["beside"]:
        raise CaseSkipped("the client takes no order while another one executes")


def require_while_executing(subject: ClientUnderTest, line: IncomingConnection, name: str) -> None:
    """Go on only where it begins this, too, while a program runs; found out once.

    What is no query is refused.

    Raises:
        CaseSkipped: It does not, or lacks it.
    """
    require_query_while_executing(subject, line)
    key = f"{name} beside"
    if key not in subject.discoveries:
        opening = OPENINGS.get(name, name)
        reply = REPLIES.get(name, b"0")
        if name in OPENINGS:
            local = subject.make_file(_SOME) if name == "upload" else subject.missing_file()
            values = {"local": local, "remote": "beside.txt"}
        else:
            values = operation_arguments(name, VALUES.get(name))
        run = begin_and_accept(subject, line, RUN)
        line.wait(_KNOWN_S)
        call = subject.begin(name, **values)
        try:
            with suppress(NoReply, OperationRefused):
                line.request(opening, call, within_s=_BESIDE_S)
                line.reply(opening, data=reply)
        finally:
            line.result(RUN.name)
            expect_finished(subject, run)
        subject.discoveries[key] = call.request_seen
        if not call.request_seen and call.answer is None:
            line.request(opening, call)
            line.reply(opening, data=reply)
        subject.wait_for_answer(call)
    if not subject.discoveries[key]:
        raise CaseSkipped(
            UserMessage("the client begins no {name} while another command executes", name=name)
        )


def expect_finished(subject: ClientUnderTest, call: Call, *, requirement: str = "") -> None:
    """An order has to be said to have been accepted and done.

    Raises:
        CaseFailed: The client says something else, or nothing.
    """
    subject.expect_done(call, requirement=requirement)
    _expect_said(call, {"accepted": True, "outcome": "11"}, requirement)


def expect_refused(
    subject: ClientUnderTest, call: Call, code: str = "", *, requirement: str = ""
) -> None:
    """An order has to be said to have been refused; a code that is told has to be this one.

    Raises:
        CaseFailed: The client says something else, or nothing.
    """
    subject.expect_failure(call, requirement=requirement)
    _expect_said(call, {"accepted": False}, requirement)
    _expect_code(call, code, requirement)


def expect_execution_failed(
    subject: ClientUnderTest, call: Call, code: str = "", *, requirement: str = ""
) -> None:
    """An order has to be said to have been accepted and to have failed; so has its code.

    Raises:
        CaseFailed: The client says something else, or nothing.
    """
    subject.expect_failure(call, requirement=requirement)
    _expect_said(call, {"accepted": True, "outcome": "00"}, requirement)
    _expect_code(call, code, requirement)


def expect_final_failure(subject: ClientUnderTest, call: Call, why: str) -> None:
    """An order whose own result tells of a failure has to be said to have failed.

    Raises:
        CaseFailed: It is not; the sentence says for what that was taken.
    """
    subject.wait_for_answer(call)
    expect(
        call.failed,
        why,
        expected="the failure that its own result tells, or an error",
        observed=f"{call}",
    )


def reported_code(call: Call) -> str | None:
    """The code that the client tells of an order, if it does."""
    code = call.result.get("code") if isinstance(call.result, Mapping) else None
    return None if code is None else str(code)


def reports_code(call: Call, code: str) -> bool:
    """Whether the client tells this code, in a field of its own or in what it complains of."""
    return code.upper() in (reported_code(call) or call.error).upper()


def _expect_said(call: Call, stages: Mapping[str, Any], requirement: str) -> None:
    """Both stages, where they are told: an error tells neither."""
    said = call.result if isinstance(call.result, Mapping) else {}
    expect(
        all(said.get(key, value) == value for key, value in stages.items()),
        UserMessage(
            "the client tells the stages of {call} otherwise than they were", call=call.name
        ),
        expected=json.dumps(stages),
        observed=f"{call}",
        requirement=requirement,
    )


def _expect_code(call: Call, code: str, requirement: str) -> None:
    told = reported_code(call)
    if code and told is not None:
        expect_in(
            told.upper(),
            (code.upper(),),
            UserMessage("the client tells another code of {call} than it was sent", call=call.name),
            requirement=requirement,
        )
