"""Clause 4.21: set the initial tool position (0x36, L445-455).

The workspace of the arm is unknown, so each position is close to the current one.
"""

from typing import Final

from hypothesis import strategies as st

from scaraspec.judge.tolerances import STANDSTILL, farthest
from scaraspec.protocol.commands import Point, Pose
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, offer
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import joints_of, pose_of
from scaraspec.suite.controller.harness.requests.poses import expect_numbers, gripper_of, initial_of
from scaraspec.suite.controller.harness.state.preserve import kept
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage

_MEANT: Final = 4  # x, y, z and thetaX; the others have no meaning (L1006)
_ASIDE: Final = 0.5  # mm or degrees
_SOON_S: Final = 0.2
_READINGS: Final = 5


def _at(pose: Pose, decimals: int) -> Pose:
    """Return a pose with `decimals` decimals, and zeros in fields without meaning."""
    x, y, z, theta_x, *_ = (round(value, decimals) for value in pose)
    return Pose(x, y, z, theta_x, 0, 0)


def _near(line: OutgoingConnection) -> Pose:
    """Set the current position as the initial one, and the gripper center to zero; return it.

    Then both points that 0x38 may return are the same (A-4.23-1). At a limit of the workspace, the
    reported pose may be outside of it and may vary.

    Raises:
        CaseFailed: The current position is refused.
    """
    line.ask("set_gripper_center", Point(0, 0, 0))
    read = dict.fromkeys(pose_of(line) for _ in range(_READINGS))
    for near in (candidate for pose in read for candidate in (_at(pose, 1), pose)):
        answer = line.ask("set_initial_tool_position", near)
        if answer.accepted:
            return near
    message = "the current position is refused as an initial tool position"
    raise CaseFailed(message, expected="1", observed=f"{answer}", requirement="4.21/2")


def _set(line: OutgoingConnection, wanted: Pose) -> ReceivedFrame:
    answer = line.ask("set_initial_tool_position", wanted)
    expect(
        answer.accepted is not None,
        "the reply to 0x36 is not a single flag",
        expected="1 or 0",
        observed=f"{answer}",
        requirement="4.21/2",
    )
    return answer


def _expect_shown(
    line: OutgoingConnection, wanted: Pose, message: str, requirement: str = "4.21/3"
) -> None:
    expect_numbers(initial_of(line)[:_MEANT], wanted[:_MEANT], message, requirement)


@case("4.21/3", "4.21/2")
def test_set(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The position that was set is returned, and the gripper center is unchanged."""
    reach = round(subject.ics.motion.step_mm * 10)
    steps = st.integers(-reach, reach).map(lambda tenths: tenths / 10)
    taken: list[Pose] = []

    @given(st.tuples(*[steps] * _MEANT), st.booleans())
    def each(step: tuple[float, ...], thetas: bool) -> None:  # noqa: FBT001 - drawn
        stepped = Pose(*(a + b for a, b in zip(near, (*step, 0, 0), strict=True)))
        wanted = _at(stepped, 1)._replace(theta_y=34.5 * thetas, theta_z=-1.0 * thetas)
        before = initial_of(line)
        if _set(line, wanted).accepted:
            taken.append(wanted)
            _expect_shown(line, wanted, "0x37 does not return the position that was set")
        else:
            message = "an initial tool position was refused but changed"
            _expect_shown(line, before, message, "4.21/2")
        message = "0x36 changed the gripper center"
        expect_numbers(gripper_of(line), gripper, message, "4.21/3")

    with kept(subject, line, "gripper centre", "initial tool position"):
        near = _near(line)
        gripper = Point(1.5, -2, 30.5)
        if not line.ask("set_gripper_center", gripper).accepted:
            gripper = gripper_of(line)
        each()
        line.close()
        last = taken[-1] if taken else near
        _expect_shown(subject.open(), last, "another connection returned another position")


@case("4.21/3", "4.21/2", name="while-running", hazards=PROGRAMS)
def test_set_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the initial position in a run is answered "1" and works, or "0" without a change."""
    with kept(subject, line, "gripper centre", "initial tool position"):
        near = _near(line)
        with running(subject, line):
            for step in examples((_ASIDE, -_ASIDE)):
                wanted, before = near._replace(z=near.z + step), initial_of(line)
                answer = _set(line, wanted)
                message = UserMessage(
                    "setting the initial position in a run was answered {answer}, but 0x37 differs",
                    answer=answer,
                )
                _expect_shown(line, wanted if answer.accepted else before, message)


@case("4.21/4", "4.21/3")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A value that is not six numbers is not answered 1 and changes nothing."""
    with kept(subject, line, "gripper centre", "initial tool position"):
        near = _near(line)
        _expect_shown(line, near, "0x37 does not return the initial position that was set")
        other = _at(Pose(*(value + _ASIDE for value in near)), 3)
        for wrong in examples(malformed("set_initial_tool_position", other, subject.dialect)):
            offered = offer(subject, line, "set_initial_tool_position", wrong)
            line = offered.line
            expect(
                not (offered.accepted and wrong.firm),
                UserMessage("{wrong} was accepted as an initial tool position", wrong=wrong),
                expected="0",
                observed=f"{offered}",
            )
            if offered.accepted:
                _set(line, near)
            message = UserMessage("a position with {wrong} was refused but changed it", wrong=wrong)
            _expect_shown(line, near, message)


@case("4.21/5", "4.21/2", hazards=(Hazard.STATE, Hazard.MOTION))
def test_moves_nothing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the initial tool position moves no joint."""
    with kept(subject, line, "gripper centre", "initial tool position"):
        near = _near(line)
        before = joints_of(line)
        subject.moved = True
        step = subject.ics.motion.step_mm
        if not _set(line, near._replace(z=near.z + step)).accepted:
            _set(line, near._replace(z=near.z - step))
        line.wait(_SOON_S)
        if farthest(joints_of(line), before) > STANDSTILL:
            message = "the arm moved after set_initial_tool_position"
            subject.tolerate("4.21/5", "A-4.21-2", "moves", message)
