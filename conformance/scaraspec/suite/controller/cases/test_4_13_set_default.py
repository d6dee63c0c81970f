"""Clause 4.13: set the default program (0x0E, L277-287)."""

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.fields import NAME_MAX_BYTES, show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    is_responsive,
    joints_of,
    stop_motion,
)
from scaraspec.suite.controller.harness.state.defaults import (
    default_program_preserved,
    expect_default,
)
from scaraspec.suite.controller.harness.two_stage.commands import RUN, start_program
from scaraspec.suite.controller.harness.two_stage.results import wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import probe_responsiveness
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.suite.program_files.listed import long_name, program_names, store_program

_WAIT_S = 0.3


def _set(line: OutgoingConnection, name: bytes) -> None:
    reply = line.ask("set_default_program", name)
    expect(
        reply.accepted,
        "a stored program cannot be made the default program",
        expected="1",
        observed=f"{reply}",
        requirement="4.13/2",
    )


@case("4.13/3", "4.13/2", "4.10/11")
def test_set(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The default program is the one that was set last, not one that was uploaded later."""
    with default_program_preserved(subject, line):
        names = [subject.new_name(), long_name(subject, NAME_MAX_BYTES), subject.new_name("a")]
        for name in names:
            store_program(subject, line, name)
        for name in names:
            _set(line, name)
            expect_default(subject, line, name, "4.13/3")
        store_program(subject, line)
        expect_default(subject, line, name, "4.13/3")
        listed = program_names(subject, line)
        expect(
            name in listed,
            "an uploaded program is not listed while it is the default program",
            expected=show(name),
            observed=", ".join(map(show, listed)),
            requirement="4.10/11",
        )
        line.close()
        expect_default(subject, subject.open(), name, "4.13/3")


@case("4.13/5", "4.13/4")
def test_missing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting a program that is not stored is refused, and the default program is unchanged."""
    with default_program_preserved(subject, line):
        name = store_program(subject, line)
        _set(line, name)
        missing = subject.new_name()
        reply = line.ask("set_default_program", missing)
        if reply.accepted:
            message = "a program that is not stored can be made the default program"
            subject.tolerate("4.13/4", "A-4.13-1", "accepted", message)
        else:
            expect_default(subject, line, name, "4.13/5")


@case("4.13/5", "4.13/2", name="malformed")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A malformed name that is refused does not change the default program."""
    with default_program_preserved(subject, line):
        name = store_program(subject, line)
        _set(line, name)
        for wrong in examples(malformed("set_default_program", name)):
            result = send_malformed(subject, line, "set_default_program", wrong)
            line = result.line
            if result.accepted:
                _set(line, name)
            else:
                expect_default(subject, line, name, "4.13/5")


@case("4.13/6", "4.13/2", "4.13/3", "4.13/5", hazards=(Hazard.STATE, Hazard.MOTION))
def test_moves_nothing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting a default program starts nothing, and running another program does not change it.

    While it runs, another default program can be set or is refused.
    """
    with default_program_preserved(subject, line):
        other, name = store_program(subject, line), store_program(subject, line)
        before = joints_of(line)
        subject.moved = True
        _set(line, name)
        try:
            statuses = [line.ask("get_status").value]
            line.wait(_WAIT_S)
            statuses.append(line.ask("get_status").value)
            if any(status != IDLE for status in statuses):
                message = "the program that was set as default program was started"
                raise CaseFailed(message, expected=IDLE, observed=", ".join(map(str, statuses)))
            if max_deviation(joints_of(line), before) > STANDSTILL:
                message = "the arm moved after set_default_program"
                subject.tolerate("4.13/6", "A-4.12-3", "moves", message)
            if RUN not in subject.ics.unsupported:
                probe_responsiveness(subject, line)
                start_program(subject, line, RUN)
                if is_responsive(subject, line):
                    expect_default(subject, line, name, "4.13/3")
                    accepted = line.ask("set_default_program", other).accepted
                    name = other if accepted else name
                    expect_default(subject, line, name, "4.13/3" if accepted else "4.13/5")
                stop_motion(subject, line)
                expect_default(subject, line, name, "4.13/3")
                start_program(subject, line, RUN, seconds=0)
                wait_for_result(subject, line, RUN)
                expect_default(subject, line, name, "4.13/3")
        finally:
            stop_motion(subject, line)
