"""Clause 4.23: the tool coordinates (0x38, L469-479; 7.1, L1004-1006)."""

import math
from typing import Final

from scaraspec.judge.tolerances import STANDSTILL, angle_difference, max_deviation
from scaraspec.protocol.commands import Point
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    arm_returned,
    begin_step_somewhere,
    pose_of,
)
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.controller.harness.two_stage.commands import (
    MOVE,
    expect_accepted,
    require_command,
)
from scaraspec.suite.controller.harness.two_stage.performing import expect_standstill
from scaraspec.suite.controller.harness.two_stage.results import expect_success
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, expect
from scaraspec.user_message import UserMessage

_READS: Final = 8
_PAUSE_S: Final = 0.05
_OBSERVATION_S: Final = 1.0
_OFFSETS: Final = (Point(0, 0, 30), Point(20, 0, 0))


@case("4.23/2", "4.23/5")
def test_coordinates(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The coordinates are six numbers with separators that do not change in an idle robot."""
    if line.ask("get_status").value != "00":
        raise CaseSkipped("the robot is not idle")
    first = pose_of(line)
    for _ in range(_READS):
        line.wait(_PAUSE_S)
        current = pose_of(line)
        if line.ask("get_status").value != "00":
            raise CaseSkipped("the robot is not idle")
        expect(
            max_deviation(first, current) <= STANDSTILL,
            "the coordinates changed although the robot was idle",
            expected=f"{tuple(first)}",
            observed=f"{tuple(current)}",
            requirement="4.23/5",
        )
    line.close()
    expect(
        max_deviation(first, pose_of(subject.open())) <= STANDSTILL,
        "another connection returned other coordinates",
        requirement="4.23/5",
    )


@case("4.23/5", name="behind-a-move", hazards=(Hazard.STATE, Hazard.MOTION), slow=True)
def test_standstill_after_a_move(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The tool stays in its position after a move ends."""
    require_command(subject, MOVE)
    with arm_returned(subject, line):
        _, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
        expect_standstill(
            line, "the tool continues to move after the end of its move", for_s=_OBSERVATION_S
        )


@case("4.23/3", hazards=(Hazard.STATE,))
def test_screw_end(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The coordinates are those of the screw end, or those of the gripper center."""
    with settings_preserved(subject, line, "gripper centre"):
        if not line.ask("set_gripper_center", Point(0, 0, 0)).accepted:
            raise CaseSkipped("the gripper center cannot be set")
        screw_end = pose_of(line)
        for offset in examples(_OFFSETS):
            if not line.ask("set_gripper_center", offset).accepted:
                continue
            reported = pose_of(line)
            distance_mm, offset_mm = math.dist(reported[:3], screw_end[:3]), math.hypot(*offset)
            if distance_mm > STANDSTILL and abs(distance_mm - offset_mm) <= STANDSTILL:
                message = "the coordinates are those of the gripper center"
                subject.tolerate("4.23/3", "pose_point", "gripper", message)
                distance_mm = 0
            expect(
                distance_mm <= STANDSTILL
                and abs(angle_difference(reported.theta_x, screw_end.theta_x)) <= STANDSTILL,
                "the coordinates are neither those of the screw end nor of the gripper center",
                expected=UserMessage(
                    "{pose}, or a distance of {distance_mm} mm",
                    pose=tuple(screw_end),
                    distance_mm=f"{offset_mm:g}",
                ),
                observed=f"{tuple(reported)}",
            )
