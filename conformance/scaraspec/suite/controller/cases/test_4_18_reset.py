"""Clause 4.18: reset the robot (0x33, L385-419)."""

import pytest

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    arm_returned,
    status_at_rest,
    stop,
    stop_motion,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    RESET,
    RUN,
    SIMULATE,
    begin,
    expect_accepted,
    require_command,
    start_program,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.performing import expect_standstill
from scaraspec.suite.controller.harness.two_stage.refusals import expect_busy, text_of
from scaraspec.suite.controller.harness.two_stage.results import expect_success, wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import (
    executing_task,
    initial_position_at_pose,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.STATE, Hazard.MOTION)
_OBSERVATION_S = 0.3


@case("4.18/2", hazards=_MOTION)
def test_refused_during_a_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A reset while a program runs is refused with "0|01" each time, and changes nothing."""
    require_command(subject, RESET)
    if subject.dialect["busy_reply"] == "queue":
        return
    with initial_position_at_pose(subject, line), executing_task(subject, line, RUN) as task:
        for _ in range(3):
            reply = try_request(line, RESET)
            task.require_executing()
            expect(
                reply is not None and text_of(reply) in (b"0|01", b"0 01"),
                "the reset was not refused with 01 while a program ran",
                expected="0|01",
                observed=f"{reply or 'silence'}",
            )
        status = line.ask("get_status")
        expect(
            status.value == "01" or task.finished,
            "the running program ended after a refused reset",
            expected="01",
            observed=f"{status}",
        )


@case("4.18/2", "4/15", name="simulation", hazards=_MOTION)
def test_refused_during_a_simulation(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A reset while a program is simulated is refused with the code of that state."""
    require_command(subject, RESET)
    if subject.dialect["busy_reply"] != "queue":
        with (
            initial_position_at_pose(subject, line),
            executing_task(subject, line, SIMULATE) as task,
        ):
            expect_busy(subject, line, task, RESET)


@case("4.18/3", hazards=_MOTION)
def test_idle_robot_is_reset(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An idle robot accepts a reset with "1", also after something was stopped."""
    require_command(subject, RESET)
    with arm_returned(subject, line):
        for after_stop in examples((False, True, False)):
            if after_stop:
                start_program(subject, line, RUN)
                stop(subject, line)
                stop_motion(subject, line)
            with initial_position_at_pose(
                subject, line
            ):  # after the program, which may set another position (A-6.3-3)
                reply = begin(subject, line, RESET)
                expect(
                    text_of(reply) == b"1",
                    "the first reply to a reset is not just the flag 1",
                    expected="1",
                    observed=f"{reply}",
                )
                expect_success(subject, line, RESET)


@case("4.18/4", "4/7", hazards=_MOTION)
def test_end_of_a_reset(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A reset with motion ends with "11" after the motion, and the robot can be used again."""
    with executing_task(subject, line, RESET):
        expect_success(subject, line, RESET)
        expect_standstill(
            line, "the arm continues to move after the end of its reset", for_s=_OBSERVATION_S
        )
        status = status_at_rest(line)
        expect(
            status.value == IDLE,
            UserMessage(
                "the status is {status} after a successful reset",
                status=status.value,
            ),
            expected=IDLE,
            observed=f"{status}",
            requirement="4/7",
        )
        start_program(subject, line, RUN, seconds=0)
        expect_success(subject, line, RUN)


@pytest.mark.parametrize("fault", ["position_fault", "angle_fault", "motor_fault"])
@case(
    "4.18/4",
    name="fault",
    hazards=_MOTION,
    needs=("position_fault", "angle_fault", "motor_fault", "clear_faults"),
    attended=True,
)
def test_reset_from_a_fault(
    subject: ControllerUnderTest, line: OutgoingConnection, fault: str
) -> None:
    """A reset does not succeed during a fault; after the cause is removed, the robot is idle."""
    require_command(subject, RESET)
    with arm_returned(subject, line), initial_position_at_pose(subject, line):
        subject.moved = True
        try:
            subject.hook(fault, **({"joints": "wrist,rotation"} if fault == "motor_fault" else {}))
            first = line.ask(RESET)
            if first.accepted:
                result = wait_for_result(subject, line, RESET)
                expect(
                    not result.done,
                    "a reset succeeded although the fault is still present",
                    expected="00|code",
                    observed=f"{result}",
                )
            else:
                message = "a robot in an error state refused the reset"
                subject.tolerate("4.18/4", "reset_from_error", "idle-only", message)
        finally:
            subject.hook("clear_faults")
        if line.ask("get_status").value != IDLE and line.ask(RESET).accepted:
            expect_success(subject, line, RESET)
        expect_accepted(RESET, line.ask(RESET))
        expect_success(subject, line, RESET)
