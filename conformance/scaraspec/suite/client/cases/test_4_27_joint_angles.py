"""4.27: reading the joint angles (0x3C, L584-594)."""

from typing import Final

from hypothesis import example

from scaraspec.protocol.commands import BY_NAME, JointValues
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.strategies import payload_values

_REPLY: Final = BY_NAME["get_joint_angles"].reply


@client_case("4.27/1", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reads the joint angles without data and reports them."""
    data = _REPLY.encode(JointValues(20.4, 30.5, 38, 0))
    expect_reported(subject, line, "get_joint_angles", data)


@client_case("4.27/1", "T/9", name="values")
def test_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports angles of every size and sign, each for its joint."""

    @example(JointValues(1, 2, 3, 4))
    @example(JointValues(-0.5, 0.5, -360, 360))
    @given(payload_values(_REPLY))
    def each(reported: JointValues) -> None:
        expect_reported(
            subject, line, "get_joint_angles", _REPLY.encode(reported), requirement="T/9"
        )

    each()
