"""Clause 4.21: set the initial tool position (0x36, L445-455).

The workspace of the arm is unknown, so each position is close to the current one.
"""

from typing import Final

from hypothesis import strategies as st

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import Point, Pose
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import joints_of, pose_of
from scaraspec.suite.controller.harness.requests.poses import expect_numbers, gripper_of, initial_of
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage

_DEFINED_FIELDS: Final = 4  # x, y, z and thetaX; the others have no meaning (L1006)
_STEP: Final = 0.5  # mm or degrees
_WAIT_S: Final = 0.2
_READS: Final = 5


def _rounded(pose: Pose, decimals: int) -> Pose:
    """Return a pose with `decimals` decimals, and zeros in fields without meaning."""
    x, y, z, theta_x, *_ = (round(value, decimals) for value in pose)
    return Pose(x, y, z, theta_x, 0, 0)


def _set_current_position(line: OutgoingConnection) -> Pose:
    """Set the current position as the initial one, and the gripper center to zero; return it.

    Then both points that 0x38 may return are the same (A-4.23-1). At a limit of the workspace, the
    reported pose may be outside of it and may vary.

    Raises:
        CaseFailed: The current position is refused.
    """
    line.ask("set_gripper_center", Point(0, 0, 0))
    poses = dict.fromkeys(pose_of(line) for _ in range(_READS))
    for current in (candidate for pose in poses for candidate in (_rounded(pose, 1), pose)):
        reply = line.ask("set_initial_tool_position", current)
        if reply.accepted:
            return current
    message = "the current position is refused as an initial tool position"
    raise CaseFailed(message, expected="1", observed=f"{reply}", requirement="4.21/2")


def _set(line: OutgoingConnection, position: Pose) -> ReceivedFrame:
    reply = line.ask("set_initial_tool_position", position)
    expect(
        reply.accepted is not None,
        "the reply to 0x36 is not a single flag",
        expected="1 or 0",
        observed=f"{reply}",
        requirement="4.21/2",
    )
    return reply


def _expect_reported(
    line: OutgoingConnection, position: Pose, message: str, requirement: str = "4.21/3"
) -> None:
    expect_numbers(
        initial_of(line)[:_DEFINED_FIELDS], position[:_DEFINED_FIELDS], message, requirement
    )


@case("4.21/3", "4.21/2")
def test_set(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The position that was set is returned, and the gripper center is unchanged."""
    reach = round(subject.ics.motion.step_mm * 10)
    steps = st.integers(-reach, reach).map(lambda tenths: tenths / 10)
    accepted_positions: list[Pose] = []

    @given(st.tuples(*[steps] * _DEFINED_FIELDS), st.booleans())
    def set_and_check(step: tuple[float, ...], thetas: bool) -> None:  # noqa: FBT001 - drawn
        stepped = Pose(*(a + b for a, b in zip(current, (*step, 0, 0), strict=True)))
        position = _rounded(stepped, 1)._replace(theta_y=34.5 * thetas, theta_z=-1.0 * thetas)
        before = initial_of(line)
        if _set(line, position).accepted:
            accepted_positions.append(position)
            _expect_reported(line, position, "0x37 does not return the position that was set")
        else:
            message = "an initial tool position was refused but changed"
            _expect_reported(line, before, message, "4.21/2")
        message = "0x36 changed the gripper center"
        expect_numbers(gripper_of(line), gripper, message, "4.21/3")

    with settings_preserved(subject, line, "gripper centre", "initial tool position"):
        current = _set_current_position(line)
        gripper = Point(1.5, -2, 30.5)
        if not line.ask("set_gripper_center", gripper).accepted:
            gripper = gripper_of(line)
        set_and_check()
        line.close()
        last = accepted_positions[-1] if accepted_positions else current
        _expect_reported(subject.open(), last, "another connection returned another position")


@case("4.21/3", "4.21/2", name="while-running", hazards=PROGRAMS)
def test_set_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the initial position in a run is answered "1" and works, or "0" without a change."""
    with settings_preserved(subject, line, "gripper centre", "initial tool position"):
        current = _set_current_position(line)
        with running(subject, line):
            for step in examples((_STEP, -_STEP)):
                position, before = current._replace(z=current.z + step), initial_of(line)
                reply = _set(line, position)
                message = UserMessage(
                    "setting the initial position in a run was answered {reply}, but 0x37 differs",
                    reply=reply,
                )
                _expect_reported(line, position if reply.accepted else before, message)


@case("4.21/4", "4.21/3")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A value that is not six numbers is not answered 1 and changes nothing."""
    with settings_preserved(subject, line, "gripper centre", "initial tool position"):
        current = _set_current_position(line)
        _expect_reported(line, current, "0x37 does not return the initial position that was set")
        changed = _rounded(Pose(*(value + _STEP for value in current)), 3)
        for wrong in examples(malformed("set_initial_tool_position", changed, subject.dialect)):
            result = send_malformed(subject, line, "set_initial_tool_position", wrong)
            line = result.line
            expect(
                not (result.accepted and wrong.firm),
                UserMessage("{wrong} was accepted as an initial tool position", wrong=wrong),
                expected="0",
                observed=f"{result}",
            )
            if result.accepted:
                _set(line, current)
            message = UserMessage("a position with {wrong} was refused but changed it", wrong=wrong)
            _expect_reported(line, current, message)


@case("4.21/5", "4.21/2", hazards=(Hazard.STATE, Hazard.MOTION))
def test_moves_nothing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the initial tool position moves no joint."""
    with settings_preserved(subject, line, "gripper centre", "initial tool position"):
        current = _set_current_position(line)
        before = joints_of(line)
        subject.moved = True
        step = subject.ics.motion.step_mm
        if not _set(line, current._replace(z=current.z + step)).accepted:
            _set(line, current._replace(z=current.z - step))
        line.wait(_WAIT_S)
        if max_deviation(joints_of(line), before) > STANDSTILL:
            message = "the arm moved after set_initial_tool_position"
            subject.tolerate("4.21/5", "A-4.21-2", "moves", message)
