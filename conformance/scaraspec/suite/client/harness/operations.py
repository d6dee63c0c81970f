"""Operations with their values, and checks that the requests carry these values.

The command table defines how a value is written. A request that is written incorrectly violates
the requirement about the notation. A request with another value violates the requirement of the
case.
"""

import math
import re
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from datetime import datetime
from typing import TYPE_CHECKING, Any, Final

from scaraspec.protocol.commands import (
    BY_NAME,
    BY_OPCODE,
    Command,
    MoveTarget,
    Network,
    PasswordChange,
    Point,
    PortValue,
    Pose,
)
from scaraspec.protocol.fields import Defect, Number, show
from scaraspec.protocol.payloads import FirstReply, Jog, JogDirection, Record
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.driver_values import expected_value
from scaraspec.suite.client.harness.incoming_connection import PASSWORD, IncomingConnection
from scaraspec.suite.client.harness.poses import expect_pose_reported
from scaraspec.suite.client.harness.valid_bytes import expect_valid_bytes
from scaraspec.suite.engine.connection import ReceivedFrame as Request
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.suite.client.harness.client_under_test import ClientUnderTest

VALUES: Final[Mapping[str, Any]] = {
    "login": PASSWORD,
    "set_password": PasswordChange(b"oldpassword", b"newpassword"),
    "set_network": Network("192.168.1.2", "255.255.255.0", "192.168.1.1"),
    "set_time": datetime(2014, 12, 22, 14, 30),  # noqa: DTZ001 - the document names no zone
    "delete_program": b"pro1.txt",
    "set_default_program": b"pro2.txt",
    "run_program": b"pro1.txt",
    "simulate_program": b"pro1.txt",
    "set_gripper_center": Point(200, 300, 456),
    "set_initial_tool_position": Pose(200, 300, 324, 34.6, 0, 0),
    "set_tool_coordinates": MoveTarget(60, 200, 300, 324, 34.6, 0, 0),
    "jog": JogDirection.PLUS_Y,
    "set_digital_output": PortValue(8, 1),
    "get_analog_input": 8,
}
"""The example of the document for every operation of clause 4 that takes a value.

thetaY is 0 instead, because it has no meaning (L1006).
"""

OPENINGS: Final[Mapping[str, str]] = {"upload": "upload_name", "download": "download_name"}
"""The first command of each transfer."""

_NOTATION_REQUIREMENTS: Final[Mapping[Defect, str]] = {
    Defect.SPACE_FOR_BAR: "T/1",
    Defect.BLANKS: "T/1",
    Defect.QUOTES: "T/2",
    Defect.BINARY: "T/3",
    Defect.NUMBER: "T/5",
    Defect.BAR_IN_NAME: "T/6",
    Defect.CALENDAR: "4.5/2",
}
"""Defects of any text, and the requirement that each violates."""

_TRAILERS: Final[Mapping[Defect, tuple[str, str]]] = {
    Defect.TRAILING_NUL: ("trailing_nul", "yes"),
    Defect.TRAILING_BAR: ("A-T-4", "trailing bar"),
}
_IGNORED_DEFECTS: Final = (Defect.LONG_NAME, Defect.PATH_IN_NAME)

_EXACT: Final = 1e-6
_CONTROL: Final = 0x20
_DONE: Final = "11"
_FIXED: Final = re.compile(rb"-?[0-9]+\.([0-9]+)")
_HALF_OF_IT: Final = 0.501  # of the last decimal
_TURN_S: Final = 0.005


def operation_arguments(name: str, value: Any) -> dict[str, Any]:
    """Return a value of the command table as driver arguments: by name, with JSON types."""
    request = BY_NAME[name].request
    if isinstance(request, Jog):
        return {"direction": str(value)}
    if not isinstance(request, Record):
        return {}
    values = value if request.factory else (value,)
    return {field.name: _json(v) for field, v in zip(request.fields, values, strict=True)}


def _json(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("utf-8", "surrogateescape")
    return f"{value:%Y%m%d%H%M%S}" if isinstance(value, datetime) else value


def begin_operation(subject: "ClientUnderTest", name: str, value: Any = None) -> Call:
    """Begin an operation; by default with the value of the example in the document."""
    return subject.begin(
        name, **operation_arguments(name, VALUES.get(name) if value is None else value)
    )


def request_operation(
    subject: "ClientUnderTest",
    line: IncomingConnection,
    name: str,
    value: Any = None,
    *,
    requirement: str = "",
) -> tuple[Call, Request]:
    """Begin an operation and require that its request carries the value.

    A wrong request is answered too, so that the next operation is not blocked.

    Args:
        subject: The client.
        line: Its connection.
        name: The operation.
        value: The value of the operation; by default the example of the document.
        requirement: The requirement that another value violates; empty for that of the case.

    Returns:
        The operation, which is not answered yet, and the request.

    Raises:
        CaseFailed: No request came, or it carries another value.
        CaseSkipped: The client does not implement the operation.
    """
    call = begin_operation(subject, name, value)
    request = await_request(line, name, call)
    due_value = VALUES.get(name) if value is None else value
    try:
        expect_carries(subject, request, name, due_value, requirement=requirement)
    except CaseFailed:
        with suppress(NoReply):  # the client has closed the connection
            answer_request(line, name, request)
        raise
    return call, request


def await_request(line: IncomingConnection, name: str, call: Call) -> Request:
    """Wait for the request of an operation. Invalid bytes fail with their own requirement.

    Raises:
        CaseFailed: No request came.
        CaseSkipped: The client does not implement the operation.
    """
    try:
        return line.request(name, call)
    except CaseFailed:
        line.finish()
        expect_valid_bytes(line)
        raise


def expect_carries(
    subject: "ClientUnderTest", request: Request, name: str, value: Any, *, requirement: str = ""
) -> None:
    """Require that a request carries this value in the notation of the document.

    Raises:
        CaseFailed: It does not.
    """
    command, data = BY_NAME[name], request.frame.data
    decoded = command.request.decode(data)
    for issue in decoded.issues:
        if issue.defect in _TRAILERS:
            subject.tolerate(
                "T/4",
                *_TRAILERS[issue.defect],
                UserMessage("{command}: {issue}", command=name, issue=issue.text),
            )
        elif issue.defect not in _IGNORED_DEFECTS:
            raise CaseFailed(
                UserMessage("{command}: {issue}", command=name, issue=issue.text),
                expected=command.request.form,
                observed=show(data),
                requirement=_notation_requirement(issue.defect, data) or requirement,
            )
    if _alike(decoded.value, value):
        return
    decimals = _fixed_decimals(command, data, value)
    if decimals:
        key, option = ("num_format", "one-decimal") if decimals == 1 else ("A-T-5", f"{decimals}")
        subject.tolerate(
            "T/10",
            key,
            option,
            UserMessage(
                "{command}: each number has {decimals} decimals", command=name, decimals=decimals
            ),
        )
        return
    due_value = command.request.encode(value, subject.dialect.replace(name_max="255"))
    raise CaseFailed(
        UserMessage("{command} carries another value than the operation", command=name),
        expected=show(due_value, limit=255),
        observed=show(data, limit=255),
        requirement=requirement,
    )


def _notation_requirement(wrong: Defect, data: bytes) -> str:
    """Return the requirement about the notation of any such text; empty without one."""
    if wrong is Defect.NUMBER and min(data, default=_CONTROL) < _CONTROL:
        return "T/3"
    return _NOTATION_REQUIREMENTS.get(wrong, "")


def _alike(sent: Any, value: Any) -> bool:
    if isinstance(sent, tuple) and isinstance(value, tuple):
        return len(sent) == len(value) and all(map(_alike, sent, value))
    if isinstance(sent, float | int) and isinstance(value, float | int):
        return math.isclose(sent, value, rel_tol=_EXACT, abs_tol=_EXACT**2)
    return bool(sent == value)


def _fixed_decimals(command: Command, data: bytes, value: Any) -> int:
    """Return the number of decimals if all numbers are sent with the same one, or 0 (A-T-5)."""
    numbers = [isinstance(field, Number) for field in command.request.fields]
    texts = data.rstrip(b"\0|").split(b"|")
    if not any(numbers) or len(texts) != len(numbers):
        return 0
    counts = set()
    for is_number, text, due_value in zip(numbers, texts, value, strict=True):
        fixed = _FIXED.fullmatch(text)
        if is_number and fixed:
            counts.add(len(fixed[1]))
            if abs(float(text) - due_value) > _HALF_OF_IT / 10 ** len(fixed[1]):
                return 0
        elif is_number or text != str(due_value).encode():
            return 0
    return counts.pop() if len(counts) == 1 else 0


def answer_request(line: IncomingConnection, name: str, request: Request) -> None:
    """End an operation: answer a query with its example, and other requests with a refusal."""
    command = BY_NAME[name]
    if name in REPLIES:
        line.send_frame(line.frame(name, data=REPLIES[name])._replace(opcode=request.frame.opcode))
    elif isinstance(command.reply, FirstReply) and command.reply.has_code:
        line.reply(name, data=b"0|01")
    else:
        line.reply(name, data=b"1" if name == "login" else b"0")


def expect_reported(  # noqa: PLR0913 - a reply and how its report is judged
    subject: "ClientUnderTest",
    line: IncomingConnection,
    name: str,
    data: bytes | None = None,
    *,
    requirement: str = "",
    tolerated_as: tuple[str, str] | None = None,
) -> None:
    """Begin a query, answer it, and require that the client reports the reply.

    Args:
        subject: The client.
        line: Its connection.
        name: The query.
        data: The data of the reply; by default the example of the document.
        requirement: The requirement that another report violates; empty for that of the case.
        tolerated_as: The register entry and the reading that allow an error for this reply.

    Raises:
        CaseFailed: The client reports another value, or sends a wrong request.
        CaseSkipped: The client does not implement the query.
    """
    call, request = request_operation(subject, line, name)
    data = REPLIES[name] if data is None else data
    line.send_frame(line.frame(name, data=data)._replace(opcode=request.frame.opcode))
    if tolerated_as and not subject.wait_for_answer(call).ok:
        message = UserMessage(
            "{command}: the client reports {data} as an error", command=name, data=show(data)
        )
        subject.tolerate(requirement or "T/9", *tolerated_as, message)
        return
    expect_reply_reported(subject, call, name, data, requirement=requirement)


def expect_reply_reported(
    subject: "ClientUnderTest", call: Call, name: str, data: bytes, *, requirement: str = ""
) -> None:
    """Require that the client reports the value in the reply to a query.

    Raises:
        CaseFailed: The client reports another value, or nothing.
    """
    value = BY_NAME[name].reply.decode(data).value
    if isinstance(value, Pose):
        expect_pose_reported(subject, call, value, requirement=requirement)
    else:
        subject.expect_result(call, expected_value(value), requirement=requirement)


def expect_completed(subject: "ClientUnderTest", call: Call, *, requirement: str = "") -> None:
    """Require that a two-stage command is accepted and done.

    Raises:
        CaseFailed: The client reports something else.
    """
    result = subject.expect_done(call, requirement=requirement)
    if isinstance(result, Mapping):
        refused = result.get("accepted") is False or result.get("outcome", _DONE) != _DONE
        if refused:
            raise CaseFailed(
                UserMessage(
                    "{call} succeeded, but the client reports something else", call=call.name
                ),
                expected="accepted and done",
                observed=f"{call}",
                requirement=requirement,
            )


def expect_local_refusal(
    subject: "ClientUnderTest",
    line: IncomingConnection,
    name: str,
    value: Any,
    *,
    requirement: str = "",
) -> None:
    """Begin an operation that must not be sent, and require that it fails without a request.

    Raises:
        CaseFailed: The client sends something, or reports success.
        CaseSkipped: The client does not implement the operation.
    """
    expect_not_sent(
        subject,
        line,
        subject.begin(name, **operation_arguments(name, value)),
        requirement=requirement,
    )


def expect_not_sent(
    subject: "ClientUnderTest", line: IncomingConnection, call: Call, *, requirement: str = ""
) -> None:
    """Require that an operation fails without a request; see `expect_local_refusal`."""
    sent = sent_or_answered(subject, line, call)
    if sent is None:
        subject.expect_failure(call, requirement=requirement)
        return
    raise CaseFailed(
        UserMessage("the client sent {call}, which it must refuse", call=call.name),
        expected="nothing",
        observed=sent,
        requirement=requirement,
    )


def sent_or_answered(
    subject: "ClientUnderTest", line: IncomingConnection, call: Call
) -> str | None:
    """Wait until an operation is answered or sends something.

    Other requests of the client are ignored.

    Returns:
        What was sent; None if the operation was answered.

    Raises:
        CaseFailed: Neither happens.
        CaseSkipped: The client does not implement the operation.
    """
    deadline_s = subject.access.now_s + subject.answer_timeout_s
    while call.answer is None and not _brought_about(line, call) and not line.ended:
        if subject.access.now_s >= deadline_s:
            break
        line.wait(_TURN_S)
        line.flush()
    line.pump()
    if brought := _brought_about(line, call):
        return "; ".join(brought)
    subject.wait_for_answer(call)
    return None


def _brought_about(line: IncomingConnection, call: Call) -> list[str]:
    """Return what may belong to an operation: its request, and everything that is undefined."""
    opcode = BY_NAME[OPENINGS.get(call.name, call.name)].opcode
    due = [
        f"{seen.frame}"
        for seen in line.inbox
        if seen.frame.opcode == opcode or seen.frame.opcode not in BY_OPCODE
    ]
    return due + [show(noise.data) for noise in line.invalid_bytes]


def for_each_supported(names: Collection[str], try_one: Callable[[str], None]) -> None:
    """Try each of these operations that the client implements.

    Raises:
        CaseSkipped: The client implements none of them.
    """
    skipped = []
    for name in names:
        try:
            try_one(name)
        except CaseSkipped as error:
            skipped.append(error)
    if len(skipped) == len(names):
        raise skipped[0]
