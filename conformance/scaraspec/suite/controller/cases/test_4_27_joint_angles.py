"""Clause 4.27: the joint angles (0x3C, L584-594)."""

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import JointValues
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    arm_returned,
    begin_step_somewhere,
    joints_of,
    pose_of,
    same_place,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    MOVE,
    expect_accepted,
    require_command,
)
from scaraspec.suite.controller.harness.two_stage.results import expect_success
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect


@case("4.27/2", "4.27/3")
def test_four_numbers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The angles are four numbers with separators in a frame of the right length, in each reply."""
    require_command(subject, "get_joint_angles")
    for _ in range(10):
        reply = line.ask("get_joint_angles")
        expect(
            isinstance(reply.value, JointValues),
            "the joint angles are not four numbers",
            expected="20.4|30.5|38.0|0",
            observed=f"{reply}",
        )
    invalid_bytes = line.invalid_bytes
    expect(
        not invalid_bytes,
        "a reply with the joint angles is not a frame of its stated length",
        expected="a length equal to the number of data bytes",
        observed=" ".join(invalid.data.hex(" ") for invalid in invalid_bytes),
        requirement="4.27/3",
    )


@case("4.27/2", "4.27/3", name="while-moving", hazards=(Hazard.STATE, Hazard.MOTION), slow=True)
def test_while_moving(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The angles are four numbers while the arm moves, too, with any number of decimals."""
    with executing_task(subject, line, MOVE) as task:
        for _ in range(30):
            joints_of(line)
            expect(
                not line.invalid_bytes,
                "a reply with the joint angles is not a frame of its stated length",
                observed=" ".join(invalid.data.hex(" ") for invalid in line.invalid_bytes),
                requirement="4.27/3",
            )
            if task.finished:
                break
            line.wait(0.02)


@case("4.27/4")
def test_idle_joints_stay(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The joint angles do not change while the robot is idle."""
    require_command(subject, "get_joint_angles")
    if line.ask("get_status").value != "00":
        return
    first = joints_of(line)
    for pause_s in (0.0, 0.0, 0.2, 0.4):
        line.wait(pause_s)
        current = joints_of(line)
        if line.ask("get_status").value != "00":
            return
        expect(
            max_deviation(first, current) <= STANDSTILL,
            "the joint angles changed although the robot was idle",
            expected=f"{first}",
            observed=f"{current}",
        )
    other = joints_of(subject.open()) if subject.supports_multiple_connections else first
    expect(
        max_deviation(first, other) <= STANDSTILL,
        "another connection returned other joint angles",
        expected=f"{first}",
        observed=f"{other}",
    )


@case("4.27/6", hazards=(Hazard.MOTION,))
def test_motion_shows(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A step that changes the tool coordinates changes the joint angles; 4.24/8 tries all axes."""
    require_command(subject, "get_joint_angles", MOVE)
    with arm_returned(subject, line) as pose:
        before = joints_of(line)
        _, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
        after, current = joints_of(line), pose_of(line)
        expect(
            same_place(current, pose) or max_deviation(before, after) > 0,
            "the tool coordinates changed but the joint angles did not",
            expected="other joint angles",
            observed=f"{after}",
        )
