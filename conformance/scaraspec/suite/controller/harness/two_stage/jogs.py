"""Jogs: watches a short jog, and judges where it moved the arm (L605-608)."""

from typing import Final, NamedTuple

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import JointValues, Pose
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import is_responsive, joints_of, pose_of
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_MIN_MOTION_MM: Final = 1.0
_POLL_S: Final = 0.05
_AXES: Final = {
    JogDirection.PLUS_Y: ("y", 1),
    JogDirection.MINUS_Y: ("y", -1),
    JogDirection.PLUS_X: ("x", 1),
    JogDirection.MINUS_X: ("x", -1),
}


class Position(NamedTuple):
    """Where the arm is: the pose of the tool and the angles of the joints."""

    pose: Pose
    joints: JointValues


def position_of(line: OutgoingConnection) -> Position:
    """Query the pose and the joint angles."""
    return Position(pose_of(line), joints_of(line))


def moved(before: Position, after: Position) -> bool:
    """Whether the tool or a joint has moved."""
    return max_deviation((*after.pose, *after.joints), (*before.pose, *before.joints)) > STANDSTILL


def wait_for_motion(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Wait until a jog is visible, or for the longest duration that is allowed."""
    deadline = Deadline(subject, subject.ics.motion.jog_s)
    if not is_responsive(subject, line, jogs=True):
        line.wait(deadline.remaining_s)
        return
    first = current = pose_of(line)
    while max_deviation(current[:2], first[:2]) < _MIN_MOTION_MM and not deadline.expired:
        line.wait(_POLL_S)
        current = pose_of(line)


def expect_direction(
    subject: ControllerUnderTest, direction: JogDirection, before: Position, after: Position
) -> None:
    """Require that a jog which moved the arm moved it in its direction.

    A jog of a single joint has no direction (A-4.28-2).

    Raises:
        CaseFailed: It moved the arm elsewhere.
    """
    start, end = before.pose, after.pose
    axis, sign = _AXES[direction]
    along = (getattr(end, axis) - getattr(start, axis)) * sign
    across = max(
        abs(getattr(end, other) - getattr(start, other)) for other in "xyz" if other != axis
    )
    turned = [abs(p - q) > STANDSTILL for p, q in zip(before.joints, after.joints, strict=True)]
    if sum(turned) == 1 and along < across:
        subject.tolerate("4.28/3", "A-4.28-2", "joints", "a jog moved a single joint")
        return
    expect(
        along > across,
        UserMessage("a jog towards {direction} moved the arm elsewhere", direction=direction),
        expected=f"{direction}",
        observed=UserMessage("from {first} to {last}", first=start[:3], last=end[:3]),
        requirement="4.28/3",
    )
