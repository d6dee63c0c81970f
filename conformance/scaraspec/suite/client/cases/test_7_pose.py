"""Clause 7: the six values of a pose (L1004-1010)."""

from scaraspec.protocol.commands import Pose
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.poses import expect_pose, expect_pose_reported
from scaraspec.suite.client.harness.two_stage import expect_finished
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples

_POSES = (
    Pose(200, 300, 324, 34.6, 0, 0),
    Pose(200, -300, 324.5, -34.6, 0, 0),
    Pose(0, 0, 0, 90, 0, 0),
    Pose(-1.5, 2.5, -3.5, 0, 0, 0),
)


@client_case("7/2")
def test_four_of_six(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends and reports x, y, z and thetaX of a pose correctly."""
    for pose in examples(_POSES):
        call = subject.begin("set_initial_tool_position", **pose._asdict())
        with subject.allow_refusal():
            expect_pose(subject, line.serve(call), pose)
            subject.expect_done(call)
        call = subject.begin("get_initial_tool_position")
        line.serve(call, pose)
        expect_pose_reported(subject, call, pose)
        call = subject.begin("set_tool_coordinates", speed=50, **pose._asdict())
        with subject.allow_refusal():
            expect_pose(subject, line.serve(call, data=b"1"), pose, speed=50)
            line.result("set_tool_coordinates")
            expect_finished(subject, call)
        call = subject.begin("get_tool_coordinates")
        line.serve(call, pose)
        expect_pose_reported(subject, call, pose)
