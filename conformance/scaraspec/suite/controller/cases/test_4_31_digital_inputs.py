"""Clause 4.31: read the digital inputs (0x42, L639-651)."""

from typing import Final

from hypothesis import strategies as st

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    driven_inputs,
    expect_form,
    expect_inputs,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage

_INPUTS: Final = 8


@case("4.31/2", "4.31/4")
def test_format(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every reply is "1|" and eight digits, ten bytes in total."""
    for _ in range(3):
        expect_form(subject, line, "get_digital_inputs")


@case("4.31/2", "4.31/4", name="while-running", hazards=PROGRAMS)
def test_format_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply has the same format while a program runs."""
    with running(subject, line):
        expect_form(subject, line, "get_digital_inputs")


@case("4.31/2", name="driven", needs=("set_input",), attended=True)
def test_driven(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each driven input changes only its own digit; the highest port is first."""
    with driven_inputs(subject, line) as drive:
        for port in range(1, _INPUTS + 1):
            drive(port, on=not drive.now[port - 1])
            message = UserMessage("input {port} was driven", port=port)
            expect_inputs(line, drive.now, message, requirement="4.31/3")


@case("4.31/2", name="patterns", needs=("set_input",))
def test_patterns(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Any pattern of driven inputs is reported."""
    with driven_inputs(subject, line) as drive:

        @given(st.tuples(*[st.booleans()] * _INPUTS))
        def drive_and_check(pattern: Bits) -> None:
            for port, on in enumerate(pattern, 1):
                drive(port, on=on)
            expect_inputs(line, pattern, "all inputs were driven", requirement="4.31/3")

        drive_and_check()
