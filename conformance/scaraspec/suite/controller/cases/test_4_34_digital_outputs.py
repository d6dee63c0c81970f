"""Clause 4.34: read the digital outputs (0x49, L677-687)."""

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    expect_form,
    expect_outputs,
    outputs_preserved,
    set_output,
    settable_outputs,
    with_port,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage


@case("4.34/2", "4.34/4")
def test_format(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every reply is "1|" and sixteen digits, eighteen bytes in total."""
    for _ in range(3):
        expect_form(subject, line, "get_digital_outputs")


@case("4.34/2", "4.34/4", name="while-running", hazards=PROGRAMS)
def test_format_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply has the same format while a program runs."""
    with running(subject, line):
        expect_form(subject, line, "get_digital_outputs")


@case("4.34/2", name="order", hazards=(Hazard.MOTION,))
def test_order(line: OutgoingConnection) -> None:
    """The highest port is first: the lowest and the highest output are at the two ends."""
    ports = settable_outputs(line)
    for port in {ports[0], ports[-1]}:
        with outputs_preserved(line) as before:
            on = not before[port - 1]
            set_output(line, port, on=on)
            expected_outputs = with_port(before, port, on=on)
            expect_outputs(
                line,
                expected_outputs,
                UserMessage("output {port} was set", port=port),
                requirement="4.34/3",
            )
