"""Orders: operations with their values, and whether the requests that they bring about carry these.

How a value may be written is the table's matter. A request that is written wrong is blamed on the
requirement that says so, one that carries another value on that of the case.
"""

import math
import re
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from datetime import datetime
from typing import TYPE_CHECKING, Any, Final

from scaraspec.judge.rules.diagnosis import Diagnosis, Fault, diagnose
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
from scaraspec.suite.engine.connection import ReceivedFrame as Request
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply
from scaraspec.traffic.events import InvalidBytes
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
"""The document's own example for every operation of clause 4 that takes a value.

But for thetaY, which means nothing (L1006).
"""

OPENINGS: Final[Mapping[str, str]] = {"upload": "upload_name", "download": "download_name"}
"""The command that each transfer begins with."""

_OF_WRITING: Final[Mapping[Defect, str]] = {
    Defect.SPACE_FOR_BAR: "T/1",
    Defect.BLANKS: "T/1",
    Defect.QUOTES: "T/2",
    Defect.BINARY: "T/3",
    Defect.NUMBER: "T/5",
    Defect.BAR_IN_NAME: "T/6",
    Defect.CALENDAR: "4.5/2",
}
"""What is wrong with a text, wherever it stands, and the requirement that says so."""

_TRAILERS: Final[Mapping[Defect, tuple[str, str]]] = {
    Defect.TRAILING_NUL: ("trailing_nul", "yes"),
    Defect.TRAILING_BAR: ("A-T-4", "trailing bar"),
}
_NO_MATTER: Final = (Defect.LONG_NAME, Defect.PATH_IN_NAME)

_OF_LAYOUT: Final[Mapping[Fault, str]] = {
    Fault.STRAY: "3/32",
    Fault.START: "3/2",
    Fault.TAG: "3/15",
    Fault.END: "3/3",
}
_EXACT: Final = 1e-6
_CONTROL: Final = 0x20
_DONE: Final = "11"
_SHORTEST_BYTES: Final = 4  # start, opcode, length, end
_FIXED: Final = re.compile(rb"-?[0-9]+\.([0-9]+)")
_HALF_OF_IT: Final = 0.501  # of the last decimal
_TURN_S: Final = 0.005


def operation_arguments(name: str, value: Any) -> dict[str, Any]:
    """A value of the table as an order gives it: by name, in the types of JSON."""
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
    """Order an operation; without a value, with that of the document's example."""
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
    """Order an operation and await its request, which has to carry what was ordered.

    One that carries something else is answered all the same, so that the next is not held back.

    Args:
        subject: The client.
        line: Where it is connected.
        name: The operation.
        value: What it takes; by default that of the document's example.
        requirement: What a request that carries something else violates; empty for the case's own.

    Returns:
        The order, which is not answered yet, and the request.

    Raises:
        CaseFailed: No request came, or another one.
        CaseSkipped: The client lacks the operation.
    """
    call = begin_operation(subject, name, value)
    request = await_request(line, name, call)
    wanted = VALUES.get(name) if value is None else value
    try:
        expect_carries(subject, request, name, wanted, requirement=requirement)
    except CaseFailed:
        with suppress(NoReply):  # it has closed already
            answer_request(line, name, request)
        raise
    return call, request


def await_request(line: IncomingConnection, name: str, call: Call) -> Request:
    """The request of an operation; bytes that are none are blamed for what is wrong with them.

    Raises:
        CaseFailed: No request came.
        CaseSkipped: The client lacks the operation.
    """
    try:
        return line.request(name, call)
    except CaseFailed:
        line.finish()
        expect_valid_bytes(line)
        raise


def expect_valid_bytes(line: IncomingConnection, *, length_requirement: str = "3/7") -> None:
    """Fail the client for the first bytes that are no frame, or for an undefined opcode.

    Args:
        line: Where they came.
        length_requirement: The requirement that a wrong length violates.

    Raises:
        CaseFailed: There are some.
    """
    line.flush()
    for noise in line.invalid_bytes:
        diagnosis = diagnose(noise)
        raise CaseFailed(
            UserMessage(
                "what the client sent is no frame: {fault_value}", fault_value=diagnosis.fault.value
            ),
            expected=diagnosis.expected or "start, opcode, length, data, end",
            observed=f"{show(noise.data)} ({noise.data[:20].hex(' ').upper()})",
            requirement=_violated(noise, diagnosis, length_requirement),
        )
    for seen in line.inbox:
        if seen.frame.opcode not in BY_OPCODE:
            raise CaseFailed(
                "the client sends an opcode that nobody has defined",
                expected="an opcode of clauses 4 and 5",
                observed=f"{seen.frame}",
                requirement="3/10",
            )


def _violated(noise: InvalidBytes, diagnosis: Diagnosis, length_requirement: str) -> str:
    """The requirement that bytes which are no frame violate."""
    match diagnosis.fault:
        case Fault.LENGTH:
            wraps = not diagnosis.surplus_bytes % 256
            return "3/8" if diagnosis.observed == "0" else "3/28" if wraps else length_requirement
        case Fault.NONE if len(noise.data) >= _SHORTEST_BYTES:  # it announces more than there is
            return length_requirement
    return _OF_LAYOUT.get(diagnosis.fault, "3/1")


def expect_carries(
    subject: "ClientUnderTest", request: Request, name: str, value: Any, *, requirement: str = ""
) -> None:
    """A request has to carry this value, written as the document wants it.

    Raises:
        CaseFailed: It does not.
    """
    command, data = BY_NAME[name], request.frame.data
    decoded = command.request.decode(data)
    for complaint in decoded.issues:
        if complaint.defect in _TRAILERS:
            subject.tolerate(
                "T/4",
                *_TRAILERS[complaint.defect],
                UserMessage("{name}: {complaint_text}", name=name, complaint_text=complaint.text),
            )
        elif complaint.defect not in _NO_MATTER:
            raise CaseFailed(
                UserMessage("{name}: {complaint_text}", name=name, complaint_text=complaint.text),
                expected=command.request.form,
                observed=show(data),
                requirement=_of_writing(complaint.defect, data) or requirement,
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
                "{name}: each number has {decimals} decimals", name=name, decimals=decimals
            ),
        )
        return
    wanted = command.request.encode(value, subject.dialect.replace(name_max="255"))
    raise CaseFailed(
        UserMessage("{name} carries another value than was ordered", name=name),
        expected=show(wanted, limit=255),
        observed=show(data, limit=255),
        requirement=requirement,
    )


def _of_writing(wrong: Defect, data: bytes) -> str:
    """The requirement that says how any such text is written; empty where none does."""
    if wrong is Defect.NUMBER and min(data, default=_CONTROL) < _CONTROL:
        return "T/3"
    return _OF_WRITING.get(wrong, "")


def _alike(sent: Any, value: Any) -> bool:
    if isinstance(sent, tuple) and isinstance(value, tuple):
        return len(sent) == len(value) and all(map(_alike, sent, value))
    if isinstance(sent, float | int) and isinstance(value, float | int):
        return math.isclose(sent, value, rel_tol=_EXACT, abs_tol=_EXACT**2)
    return bool(sent == value)


def _fixed_decimals(command: Command, data: bytes, value: Any) -> int:
    """With how many decimals each all numbers were sent that were ordered; 0 if not so (A-T-5)."""
    numbers = [isinstance(field, Number) for field in command.request.fields]
    texts = data.rstrip(b"\0|").split(b"|")
    if not any(numbers) or len(texts) != len(numbers):
        return 0
    counts = set()
    for is_number, text, wanted in zip(numbers, texts, value, strict=True):
        fixed = _FIXED.fullmatch(text)
        if is_number and fixed:
            counts.add(len(fixed[1]))
            if abs(float(text) - wanted) > _HALF_OF_IT / 10 ** len(fixed[1]):
                return 0
        elif is_number or text != str(wanted).encode():
            return 0
    return counts.pop() if len(counts) == 1 else 0


def answer_request(line: IncomingConnection, name: str, request: Request) -> None:
    """Answer a request so that it is over: a query with its example, anything else with a no."""
    command = BY_NAME[name]
    if name in REPLIES:
        line.send_frame(line.frame(name, data=REPLIES[name])._replace(opcode=request.frame.opcode))
    elif isinstance(command.reply, FirstReply) and command.reply.has_code:
        line.reply(name, data=b"0|01")
    else:
        line.reply(name, data=b"1" if name == "login" else b"0")


def expect_reported(  # noqa: PLR0913 - an answer, and what is thought of it
    subject: "ClientUnderTest",
    line: IncomingConnection,
    name: str,
    data: bytes | None = None,
    *,
    requirement: str = "",
    tolerated_as: tuple[str, str] | None = None,
) -> None:
    """Order a query and answer it; the client has to say what the answer says.

    Args:
        subject: The client.
        line: Where it is connected.
        name: The query.
        data: The answer's data; by default the document's example.
        requirement: What a client that says something else violates; empty for the case's own.
        tolerated_as: The register entry and the reading that allow an error for this reply.

    Raises:
        CaseFailed: It says something else, or asks wrongly.
        CaseSkipped: It lacks the operation.
    """
    call, request = request_operation(subject, line, name)
    data = REPLIES[name] if data is None else data
    line.send_frame(line.frame(name, data=data)._replace(opcode=request.frame.opcode))
    if tolerated_as and not subject.wait_for_answer(call).ok:
        message = UserMessage("{name}: {data} is told as an error", name=name, data=show(data))
        subject.tolerate(requirement or "T/9", *tolerated_as, message)
        return
    expect_reply_reported(subject, call, name, data, requirement=requirement)


def expect_reply_reported(
    subject: "ClientUnderTest", call: Call, name: str, data: bytes, *, requirement: str = ""
) -> None:
    """A query that was answered with these data has to be told with what they say.

    Raises:
        CaseFailed: The client says something else, or nothing.
    """
    value = BY_NAME[name].reply.decode(data).value
    if isinstance(value, Pose):
        expect_pose_reported(subject, call, value, requirement=requirement)
    else:
        subject.expect_result(call, expected_value(value), requirement=requirement)


def expect_completed(subject: "ClientUnderTest", call: Call, *, requirement: str = "") -> None:
    """A two-stage operation has to have been done, in both of its stages.

    Raises:
        CaseFailed: The client says otherwise.
    """
    result = subject.expect_done(call, requirement=requirement)
    if isinstance(result, Mapping):
        refused = result.get("accepted") is False or result.get("outcome", _DONE) != _DONE
        if refused:
            raise CaseFailed(
                UserMessage("{call} was done, and the client says otherwise", call=call.name),
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
    """Order what must not be sent: the client has to say that it failed, and to send nothing.

    Raises:
        CaseFailed: It sends something, or says that it was done.
        CaseSkipped: It lacks the operation.
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
    """An order that was given must fail without anything being sent; see `refuses`."""
    sent = sent_or_answered(subject, line, call)
    if sent is None:
        subject.expect_failure(call, requirement=requirement)
        return
    raise CaseFailed(
        UserMessage("the client sends what it has to refuse: {call}", call=call.name),
        expected="nothing",
        observed=sent,
        requirement=requirement,
    )


def sent_or_answered(
    subject: "ClientUnderTest", line: IncomingConnection, call: Call
) -> str | None:
    """Wait until an order is answered or brings its request about; that, or None for an answer.

    What else the client may ask meanwhile is left alone.

    Raises:
        CaseFailed: Neither comes.
        CaseSkipped: The client lacks the operation.
    """
    deadline_s = subject.access.now_s + subject.answer_timeout_s
    while call.answer is None and not _brought_about(line, call) and not line.over:
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
    """What has come that may be of an order: its request, and whatever no client should send."""
    opcode = BY_NAME[OPENINGS.get(call.name, call.name)].opcode
    due = [
        f"{seen.frame}"
        for seen in line.inbox
        if seen.frame.opcode == opcode or seen.frame.opcode not in BY_OPCODE
    ]
    return due + [show(noise.data) for noise in line.invalid_bytes]


def for_each_supported(names: Collection[str], try_one: Callable[[str], None]) -> None:
    """Try something with each of these operations that the client has.

    Raises:
        CaseSkipped: It has none of them.
    """
    lacking = []
    for name in names:
        try:
            try_one(name)
        except CaseSkipped as error:
            lacking.append(error)
    if len(lacking) == len(names):
        raise lacking[0]
