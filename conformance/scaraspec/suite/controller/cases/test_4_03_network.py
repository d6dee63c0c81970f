"""Clause 4.3: read the network settings (0x04, L143-153)."""

from scaraspec.protocol.commands import Network
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect, expect_equal


@case("4.3/2", "4.3/3", "4.3/4")
def test_network(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The network is three IPv4 values with separators, the same on each connection."""
    first = line.ask("get_network")
    expect(
        isinstance(first.value, Network),
        "the network is not three IPv4 values with separators",
        expected="ip|mask|gateway",
        observed=f"{first}",
    )
    line.close()
    second = subject.open().ask("get_network")
    expect_equal(second.value, first.value, "the network changed although it was not set")
