"""Clause 4.31: the digital inputs (0x42, L639-651)."""

from typing import Final

from hypothesis import strategies as st

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    expect_form,
    expect_inputs,
    inputs_driven,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.program_files.bench import PROGRAMS, running

_INPUTS: Final = 8


@case("4.31/2", "4.31/4")
def test_form(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply is "1|" and eight digits, ten bytes in all, however often it is asked for."""
    for _ in range(3):
        expect_form(subject, line, "get_digital_inputs")


@case("4.31/2", "4.31/4", name="while-running", hazards=PROGRAMS)
def test_form_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply is the same while a program runs."""
    with running(subject, line):
        expect_form(subject, line, "get_digital_inputs")


@case("4.31/2", name="driven", needs=("set_input",))
def test_driven(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each input that is driven shows at its digit, the highest port first, and at no other."""
    with inputs_driven(subject, line) as drive:
        for port in range(1, _INPUTS + 1):
            drive(port, on=not drive.now[port - 1])
            expect_inputs(line, drive.now, f"input {port} was driven", requirement="4.31/3")


@case("4.31/2", name="patterns", needs=("set_input",))
def test_patterns(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Any pattern of the inputs shows as it is driven."""
    with inputs_driven(subject, line) as drive:

        @given(st.tuples(*[st.booleans()] * _INPUTS))
        def shows(pattern: Bits) -> None:
            for port, on in enumerate(pattern, 1):
                drive(port, on=on)
            expect_inputs(line, pattern, "all inputs were driven", requirement="4.31/3")

        shows()
