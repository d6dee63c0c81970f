"""Clause 4.20: set the gripper center (0x35, L433-443)."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import Point
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import joints_of
from scaraspec.suite.controller.harness.requests.poses import expect_numbers, gripper_of, initial_of
from scaraspec.suite.controller.harness.state.defaults import (
    default_program_preserved,
    expect_default,
)
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.controller.harness.two_stage.commands import RESET, begin, require_command
from scaraspec.suite.controller.harness.two_stage.executing import skip_if_other_program_runs
from scaraspec.suite.controller.harness.two_stage.results import expect_success
from scaraspec.suite.controller.harness.two_stage.tasks import initial_position_at_pose
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.suite.program_files.listed import store_program
from scaraspec.user_message import UserMessage

_EXAMPLE: Final = Point(200, 300, 456)  # L438
_PLAIN: Final = Point(1.5, -2, 30.5)
_OTHER: Final = Point(7.5, -8, 9)
_LARGE: Final = Point(123.4, -1234.5, 3276.8)  # the last one in tenths exceeds 15 bits
_SMALL: Final = Point(0.5, -0.5, 0.5)
_DEFINED_FIELDS: Final = 4  # fields of a position: x, y, z and thetaX (L1006)
_WAIT_S: Final = 0.1

_tenths = st.integers(-1000, 1000).map(lambda tenths: tenths / 10)
_thousandths = st.integers(-100_000, 100_000).map(lambda thousandths: thousandths / 1000)


def _set(subject: ControllerUnderTest, line: OutgoingConnection, center: Point) -> None:
    """Set the gripper center; a refusal is allowed while a program runs (A-4.20-1)."""
    reply = line.ask("set_gripper_center", center)
    with skip_if_other_program_runs(subject, line):
        expect(
            reply.accepted,
            "setting a gripper center was not answered 1",
            expected="1",
            observed=f"{reply}",
            requirement="4.20/2",
        )


def _expect_reported(line: OutgoingConnection, center: Point) -> None:
    message = "0x34 does not return the gripper center that was set"
    expect_numbers(gripper_of(line), center, message, "4.20/3")


@case("4.20/3", "4.20/2")
def test_set(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The gripper center that was set is returned, including sign and first decimal."""

    @example(Point(0, 0, 0))
    @example(Point(-0.1, 0.1, -100))
    @example(Point(99.9, -99.9, 5))
    @given(st.builds(Point, _tenths, _tenths, _tenths))
    def set_and_check(center: Point) -> None:
        _set(subject, line, center)
        _expect_reported(line, center)

    with settings_preserved(subject, line, "gripper centre"):
        set_and_check()
        line.close()
        new_line = subject.open()
        _set(subject, new_line, _PLAIN)
        new_line.close()
        _expect_reported(subject.open(), _PLAIN)


@case("4.20/3", name="decimals")
def test_decimals(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Numbers with more decimals, and the example of the document, are returned as set."""

    @example(_EXAMPLE)
    @example(_LARGE)
    @given(st.builds(Point, _thousandths, _thousandths, _thousandths))
    def set_and_check(center: Point) -> None:
        before = gripper_of(line)
        reply = line.ask("set_gripper_center", center)
        if reply.accepted:
            _expect_reported(line, center)
            return
        message = "a gripper center was refused but changed"
        expect_numbers(gripper_of(line), before, message, "4.20/2")

    with settings_preserved(subject, line, "gripper centre"):
        set_and_check()


@case("4.20/3", "4.20/2", name="while-running", hazards=PROGRAMS)
def test_set_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the gripper center in a run is answered "1" and works, or "0" without a change."""
    with settings_preserved(subject, line, "gripper centre"), running(subject, line):
        for center in examples((_PLAIN, _OTHER)):
            before = gripper_of(line)
            reply = line.ask("set_gripper_center", center)
            message = UserMessage(
                "setting the gripper center in a run was answered {reply}, but 0x34 returns "
                "another value",
                reply=reply,
            )
            expect_numbers(
                gripper_of(line), center if reply.accepted else before, message, "4.20/3"
            )


@case("4.20/3", "4.21/3", "4.13/3", name="behind-resets", hazards=PROGRAMS)
def test_settings_after_resets(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Gripper center, initial position and default program are unchanged after two resets."""
    require_command(subject, RESET)
    program = store_program(subject, line)
    with (
        settings_preserved(subject, line, "gripper centre"),
        default_program_preserved(subject, line),
    ):
        _set(subject, line, _SMALL)
        can_set_default = "set_default_program" not in subject.ics.unsupported
        default_set = can_set_default and line.ask("set_default_program", program).accepted
        with initial_position_at_pose(subject, line):
            home = initial_of(line)
            for _ in range(2):
                begin(subject, line, RESET)
                expect_success(subject, line, RESET)
                _expect_reported(line, _SMALL)
                message = "a reset changed the initial tool position"
                expect_numbers(
                    initial_of(line)[:_DEFINED_FIELDS], home[:_DEFINED_FIELDS], message, "4.21/3"
                )
                if default_set:
                    expect_default(subject, line, program, "4.13/3")


@case("4.20/4", "4.20/3")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A value that is not three numbers is not answered 1 and changes nothing."""
    with settings_preserved(subject, line, "gripper centre"):
        _set(subject, line, _PLAIN)
        _expect_reported(line, _PLAIN)
        for wrong in examples(malformed("set_gripper_center", _OTHER, subject.dialect)):
            result = send_malformed(subject, line, "set_gripper_center", wrong)
            line = result.line
            expect(
                not (result.accepted and wrong.firm),
                UserMessage("{wrong} was accepted as a gripper center", wrong=wrong),
                expected="0",
                observed=f"{result}",
            )
            if result.accepted:
                _set(subject, line, _PLAIN)
            message = UserMessage(
                "a gripper center with {wrong} was refused but changed it", wrong=wrong
            )
            expect_numbers(gripper_of(line), _PLAIN, message, "4.20/3")


@case("4.20/5", "4.20/2", hazards=(Hazard.STATE, Hazard.MOTION))
def test_moves_nothing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the gripper center moves no joint."""
    with settings_preserved(subject, line, "gripper centre"):
        for center in examples((Point(0, 0, 50), Point(20, -20, 0))):
            before = joints_of(line)
            subject.moved = True
            _set(subject, line, center)
            line.wait(_WAIT_S)
            after = joints_of(line)
            expect(
                max_deviation(before, after) <= STANDSTILL,
                "the arm moved when the gripper center was set",
                expected=f"{tuple(before)}",
                observed=f"{tuple(after)}",
                requirement="4.20/5",
            )
