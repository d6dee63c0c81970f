"""4.18: the reset (0x33, L385-419)."""

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import (
    expect_execution_failed,
    expect_finished,
    expect_refused,
)
from scaraspec.suite.engine.case import client_case


@client_case("4.18/1", attended=True)
def test_reset(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client resets the robot."""
    call = subject.begin("reset")
    line.serve(call, data=b"1", sent=b"")
    line.result("reset")
    expect_finished(subject, call)


@client_case("4.18/1", "4/13", name="as-drawn")
def test_as_drawn(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports the refusal and the failure of the document; no reset carries data."""
    call = subject.begin("reset")
    line.serve(call, data=b"0|01", sent=b"")
    expect_refused(subject, call, "01")
    call = subject.begin("reset")
    line.serve(call, data=b"1", sent=b"")
    line.result("reset", data=b"00|11")
    expect_execution_failed(subject, call, "11")
