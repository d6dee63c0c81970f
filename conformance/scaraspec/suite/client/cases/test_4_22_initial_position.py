"""4.22: reading the initial tool position (0x37, L457-467)."""

from typing import Final

from hypothesis import example

from scaraspec.protocol.commands import BY_NAME, Pose
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.strategies import payload_values

_REPLY: Final = BY_NAME["get_initial_tool_position"].reply


@client_case("4.22/1", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reads the initial tool position without data and reports it."""
    call = subject.begin("get_initial_tool_position")
    line.serve(call, Pose(200, 300, 324, 34.6, 0, 0), sent=b"")
    useful = {"x": 200, "y": 300, "z": 324, "theta_x": 34.6}
    subject.expect_result(call, {**useful, "theta_y": 0, "theta_z": 0})


@client_case("4.22/1", "T/9", name="values")
def test_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports positions of every size and sign, also after it set another one."""

    @example(Pose(-0.5, 0, 1234.125, -179.9, 34.5, -12))
    @given(payload_values(_REPLY))
    def each(reported: Pose) -> None:
        expect_reported(
            subject, line, "get_initial_tool_position", _REPLY.encode(reported), requirement="T/9"
        )

    call = subject.begin("set_initial_tool_position", **Pose(190, 280, 317, 6, 5, 4)._asdict())
    line.serve(call)
    subject.expect_done(call)
    each()
