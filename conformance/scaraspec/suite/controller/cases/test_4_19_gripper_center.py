"""Clause 4.19: read the gripper center (0x34, L421-431)."""

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.poses import gripper_of
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect_equal


@case("4.19/2")
def test_gripper_center(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The gripper center is three numbers with separators, the same on each connection."""
    first = gripper_of(line)
    line.close()
    second = gripper_of(subject.open())
    expect_equal(second, first, "the gripper center changed although it was not set")
