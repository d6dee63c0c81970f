"""Clause 4.7: the software version (0x08, L191-203)."""

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect, expect_equal
from scaraspec.user_message import UserMessage

_REQUESTS = 300


@case("4.7/2", "4.7/3")
def test_version(line: OutgoingConnection) -> None:
    """The version is a text of at least one character."""
    reply = line.ask("get_version")
    expect(reply.value, "the version is empty", expected="1.0.0", observed=f"{reply}")


@case("4.7/4")
def test_constant(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The version is the same in all replies and on another connection."""
    first = line.ask("get_version").value
    for number in range(2, _REQUESTS):
        message = UserMessage("request {number} returned another version", number=number)
        expect_equal(line.ask("get_version").value, first, message)
    line.close()
    version = subject.open().ask("get_version").value
    expect_equal(version, first, "another connection returned another version")
