"""Clause 7: the tool, the gripper center and the six values of a pose (L1002-1010)."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import Point
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    REACHED,
    arm_returned,
    ask_move,
    begin_step_somewhere,
    joints_of,
    pose_deviation,
    pose_of,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    MOVE,
    expect_accepted,
    require_command,
)
from scaraspec.suite.controller.harness.two_stage.results import expect_success
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, CaseSkipped, expect
from scaraspec.user_message import UserMessage

_STATE = (Hazard.STATE,)
_MOTION = (Hazard.MOTION,)
_OFFSET = Point(12.0, 5.0, -20.0)


@contextmanager
def _gripper_center(line: OutgoingConnection, center: Point) -> Iterator[None]:
    """Set another gripper center for the duration of the context.

    Raises:
        CaseSkipped: The controller refuses it.
    """
    before = line.ask("get_gripper_center").value
    if before is None or not line.ask("set_gripper_center", center).accepted:
        raise CaseSkipped("the controller accepts no other gripper center")
    try:
        yield
    finally:
        with suppress(CaseFailed, CaseInconclusive):
            line.ask("set_gripper_center", before)


@case("7/1", hazards=_STATE)
def test_tool_point(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The tool coordinates do not change with the gripper center (7.1, 7.2)."""
    require_command(subject, "get_tool_coordinates", "set_gripper_center")
    with _gripper_center(line, Point(0.0, 0.0, 0.0)):
        without_gripper = pose_of(line)
        line.ask("set_gripper_center", _OFFSET)
        with_gripper = pose_of(line)
    deviation = max_deviation(without_gripper[:3], with_gripper[:3])
    if deviation <= STANDSTILL:
        return
    length = sum(value**2 for value in _OFFSET) ** 0.5
    shift = (
        sum((p - q) ** 2 for p, q in zip(without_gripper[:3], with_gripper[:3], strict=True)) ** 0.5
    )
    expect(
        abs(shift - length) <= REACHED,
        "the gripper center changes the tool coordinates, but not by its own length",
        expected=UserMessage(
            "{pose}, or at a distance of {distance_mm} mm",
            pose=without_gripper,
            distance_mm=f"{length:.1f}",
        ),
        observed=f"{with_gripper}",
    )
    message = "the tool coordinates are those of the gripper center"
    subject.tolerate("7/1", "pose_point", "gripper", message)


@case("7/1", name="steady")
def test_tool_point_is_constant(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The same pose is returned each time on every connection."""
    require_command(subject, "get_tool_coordinates")
    first = pose_of(line)
    lines = [line, subject.open()] if subject.supports_multiple_connections else [line]
    for connection in lines:
        current = pose_of(connection)
        expect(
            pose_deviation(current, first) <= STANDSTILL,
            "the tool coordinates of an idle robot changed",
            expected=f"{first}",
            observed=f"{current}",
        )


@case("7/2", hazards=_MOTION)
def test_meaningless_angles(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The values of thetaY and thetaZ in a move do not change its target."""
    require_command(subject, MOVE)
    with arm_returned(subject, line) as pose:
        for theta_y, theta_z in examples(((7.0, 0.0), (0.0, 7.0), (-3.5, 3.5))):
            target_pose = pose._replace(theta_y=theta_y, theta_z=theta_z)
            reply = ask_move(subject, line, target_pose)
            if not reply.accepted:
                message = "a move with thetaY or thetaZ is refused"
                subject.tolerate("7/2", "theta_yz", "reject", message)
                continue
            expect_success(subject, line, MOVE)
            current = pose_of(line)
            expect(
                pose_deviation(current, pose) <= REACHED,
                "thetaY or thetaZ, which have no meaning, changed the target",
                expected=f"{pose}",
                observed=f"{current}",
            )
        current = pose_of(line)
        if current.theta_y or current.theta_z:
            subject.tolerate("7/2", "A-4.21-3", "not 0", "thetaY and thetaZ are reported")


@case("7/5", "4.27/6", hazards=_MOTION)
def test_one_geometry(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A pose has the same joint angles when the arm returns to it, and another pose has others."""
    require_command(subject, MOVE)
    with arm_returned(subject, line) as pose:
        joints = joints_of(line)
        second_pose, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
        second_joints, current = joints_of(line), pose_of(line)
        expect(
            max_deviation(joints, second_joints) > 0 or pose_deviation(current, pose) <= STANDSTILL,
            "two poses have the same joint angles",
            expected=UserMessage("other joint angles at {pose}", pose=second_pose),
            observed=f"{second_joints}",
            requirement="4.27/6",
        )
        expect_accepted(MOVE, ask_move(subject, line, pose))
        expect_success(subject, line, MOVE)
        returned_joints = joints_of(line)
        if max_deviation(joints, returned_joints) > REACHED:
            message = "the same pose has other joint angles than before"
            subject.tolerate("7/5", "A-4.24-5", "another elbow", message)
