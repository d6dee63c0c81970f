"""Clause 4.22: read the initial tool position (0x37, L457-467)."""

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.poses import initial_of
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect_equal


@case("4.22/2")
def test_initial_position(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The initial tool position is six numbers with separators, the same on each connection."""
    first = initial_of(line)
    line.close()
    second = initial_of(subject.open())
    expect_equal(second, first, "the initial tool position changed although it was not set")
