"""Clause 8: codes are texts of table 8-1 (L1014-1044)."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations
from typing import Final

from scaraspec.protocol import errors
from scaraspec.protocol.errors import Joint
from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.two_stage.commands import (
    LOCK,
    MOVE,
    RUN,
    SIMULATE,
    require_command,
    start_program,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.results import wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect, expect_equal
from scaraspec.user_message import UserMessage

_MOTION: Final = (Hazard.MOTION, Hazard.STATE)
_FAULTS: Final = ("motor_fault", "clear_faults")
_MISSING_PROGRAM: Final = "20"  # L1044
_UNREACHABLE_MOVE: Final = b"1|900000|900000|900000|0|0|0"
_POLL_S: Final = 0.05


def _expect_code(subject: ControllerUnderTest, data: bytes) -> None:
    """Expect that a code is a text of the table, and warn of a reserved one."""
    text = data.rstrip(b"\0").decode("latin-1")
    expect(
        text and text.isascii() and text.isprintable(),
        "a code is not a text",
        expected="two characters",
        observed=data.hex(" "),
        requirement="8/1",
    )
    code = errors.lookup(text)
    expect(
        code is not None,
        "a code is not in table 8-1",
        expected="a code of the table",
        observed=show(data),
        requirement="8/2",
    )
    if code in errors.RESERVED:
        subject.tolerate(
            "8/3", "A-8-3", text, UserMessage("the reserved code {text} was sent", text=text)
        )


def _code_of(reply: ReceivedFrame) -> bytes:
    """Return the data after the separator of a refusal or a failure; empty if there is none."""
    return reply.frame.data[3 if reply.frame.tagged else 2 :]


@case("8/1", "8/2", "8/3")
def test_status(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The code of the status is a text of the table."""
    _expect_code(subject, line.ask("get_status").frame.data)


@case("8/2", "8/1", "8/3", name="refusals", hazards=_MOTION)
def test_refusals(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Requests that cannot be executed are refused with codes of the table."""
    subject.moved = True
    missing = subject.new_name()
    for name, data in examples(((RUN, missing), (SIMULATE, missing), (MOVE, _UNREACHABLE_MOVE))):
        if name not in subject.ics.unsupported:
            reply = line.ask(name, data=data)
            if reply.accepted:  # the problem may be detected late (A-4.15-1, A-4.24-5)
                wait_for_result(subject, line, name)
            elif reply.accepted is False and _code_of(reply):
                _expect_code(subject, _code_of(reply))


@case("8/2", "8/1", "8/3", name="busy", hazards=_MOTION)
def test_refusals_of_a_busy_robot(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """While a program runs, status and refusals have codes of the table."""
    with executing_task(subject, line, RUN):
        _expect_code(subject, line.ask("get_status").frame.data)
        reply = try_request(line, LOCK)
        if reply is not None and reply.accepted is False and _code_of(reply):
            _expect_code(subject, _code_of(reply))


@case("8/5", hazards=_MOTION)
def test_missing_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Running or simulating a missing program fails with code 20, at either stage."""
    subject.moved = True
    for name in examples((RUN, SIMULATE)):
        require_command(subject, name)
        reply = line.ask(name, subject.new_name())
        if reply.accepted:
            reply = wait_for_result(subject, line, name)
        expect_equal(
            reply.code,
            _MISSING_PROGRAM,
            UserMessage("{name} of a missing program does not fail with code 20", name=name),
        )


@case("8/5", name="deleted", hazards=(Hazard.MOTION, Hazard.STATE))
def test_deleted_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Running a program again after it is deleted fails with code 20."""
    program = start_program(subject, line, RUN, 0).program
    wait_for_result(subject, line, RUN)
    line.ask("delete_program", program)
    reply = line.ask(RUN, program)
    if reply.accepted:
        reply = wait_for_result(subject, line, RUN)
    message = "the run of a deleted program does not fail with code 20"
    expect_equal(reply.code, _MISSING_PROGRAM, message)


# ---------------------------------------------------------------------- motor faults


@contextmanager
def _motor_fault(subject: ControllerUnderTest, joints: tuple[Joint, ...]) -> Iterator[None]:
    names = ",".join(joint.name.lower() for joint in joints)
    subject.hook("motor_fault", joints=names)
    try:
        subject.pause(_POLL_S)
        yield
    finally:
        subject.hook("clear_faults")
        subject.pause(_POLL_S)


@case("8/2", "8/1", "8/3", name="faults", needs=_FAULTS, hazards=_MOTION, attended=True)
def test_codes_of_faults(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Status and refusals have codes of the table for every combination of motor faults.

    If the status is a code of motors, it names exactly the motors with a fault (8/4).
    An operator is asked only for a fault of each motor and of all motors.
    """
    subject.moved = True
    attended = subject.hooks.asks("motor_fault")
    for count in (1, len(Joint)) if attended else range(1, len(Joint) + 1):
        for joints in examples(combinations(Joint, count)):
            with _motor_fault(subject, joints):
                status = line.ask("get_status")
                _expect_code(subject, status.frame.data)
                code = errors.lookup(status.value) if isinstance(status.value, str) else None
                expect(
                    code is None or not code.joints or {*code.joints} == {*joints},
                    "the status names other motors than those with a fault",
                    expected=errors.code_for_joints(joints).text,
                    observed=f"{status}",
                    requirement="8/4",
                )
                reply = line.ask(MOVE, data=_UNREACHABLE_MOVE)
                if reply.accepted is False and _code_of(reply):
                    _expect_code(subject, _code_of(reply))


@case("8/2", "8/1", "8/3", name="failure", needs=_FAULTS, hazards=_MOTION)
def test_code_of_a_failure(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The final result of a program during which a motor fails has a code of the table."""
    start_program(subject, line, RUN)
    with _motor_fault(subject, (Joint.ROTATION,)):
        result = wait_for_result(subject, line, RUN)
        if result.done is False:
            _expect_code(subject, _code_of(result))
