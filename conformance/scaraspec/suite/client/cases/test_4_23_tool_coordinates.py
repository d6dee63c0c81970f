"""4.23: reading the tool coordinates (0x38, L469-479)."""

from typing import Final

from hypothesis import example

from scaraspec.protocol.commands import BY_NAME, Pose
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported
from scaraspec.suite.client.harness.poses import expect_pose_reported
from scaraspec.suite.client.harness.two_stage import MOVE, begin_and_accept, expect_finished
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.strategies import payload_values

_REPLY: Final = BY_NAME["get_tool_coordinates"].reply


@client_case("4.23/1", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reads the tool coordinates without data and reports them."""
    call = subject.begin("get_tool_coordinates")
    line.serve(call, Pose(200, 300, 324, 34.6, 0, 0), sent=b"")
    useful = {"x": 200, "y": 300, "z": 324, "theta_x": 34.6}
    subject.expect_result(call, {**useful, "theta_y": 0, "theta_z": 0})


@client_case("4.23/1", "T/9", name="values")
def test_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports coordinates of every size and sign, also after a move to others."""

    @example(Pose(-0.5, 0, 1234.125, -179.9, 0, 0))
    @given(payload_values(_REPLY))
    def each(reported: Pose) -> None:
        expect_reported(
            subject, line, "get_tool_coordinates", _REPLY.encode(reported), requirement="T/9"
        )

    call = begin_and_accept(subject, line, MOVE)
    line.result(MOVE.name)
    expect_finished(subject, call)
    each()


@client_case("4.23/4", "7/2")
def test_useless_angles(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports x, y, z and thetaX correctly for any thetaY and thetaZ (L1006)."""
    for name in ("get_tool_coordinates", "get_initial_tool_position"):
        for useless in examples(
            ((0, 0), (34.5, 0), (0, -34.5), (90, 180), (-0.1, 720.5), (99999, -99999))
        ):
            reported = Pose(200, -300, 324.5, -34.6, *useless)
            call = subject.begin(name)
            line.serve(call, data=_REPLY.encode(reported))
            expect_pose_reported(subject, call, reported)
