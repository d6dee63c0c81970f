"""Clause 4.19: the gripper centre as it is read (0x34, L421-431)."""

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.poses import gripper_of
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect_equal


@case("4.19/2")
def test_gripper_center(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The gripper centre is three numbers between bars, the same for every connection."""
    first = gripper_of(line)
    line.close()
    second = gripper_of(subject.open())
    expect_equal(second, first, "the gripper centre changed although nobody set it")
