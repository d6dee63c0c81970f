"""4.19: reading the gripper center (0x34, L421-431)."""

from typing import Final

from hypothesis import example

from scaraspec.protocol.commands import BY_NAME, Point
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.strategies import payload_values

_REPLY: Final = BY_NAME["get_gripper_center"].reply


@client_case("4.19/1", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reads the gripper center without data and reports it."""
    expect_reported(subject, line, "get_gripper_center", _REPLY.encode(Point(200, 300, 456)))


@client_case("4.19/1", "T/9", name="values")
def test_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports gripper centers of every size and sign, also after it set another one."""

    @example(Point(-0.5, 0, 1234.125))
    @example(Point(0.001, -9999.9, 9999.9))
    @given(payload_values(_REPLY))
    def each(reported: Point) -> None:
        expect_reported(
            subject, line, "get_gripper_center", _REPLY.encode(reported), requirement="T/9"
        )

    call = subject.begin("set_gripper_center", x=1.5, y=-2.5, z=100)
    line.serve(call)
    subject.expect_done(call)
    each()
