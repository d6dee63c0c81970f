"""Readiness: makes a robot ready that refuses to move from its current pose, and moves it back.

It uses small moves, one axis at a time. The cases report faults of the robot during these moves.
"""

from functools import partial
from typing import Final

from scaraspec.judge.tolerances import STANDSTILL
from scaraspec.protocol.commands import Pose
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    AXES,
    IDLE,
    SLOWEST_PERCENT,
    ask_move,
    in_box,
    pose_of,
    status_of,
    wait_for_end,
)
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.user_message import UserMessage, sentence_of

_MOVE: Final = "set_tool_coordinates"
_READINGS: Final = 5
_TRIES: Final = 2  # of two readings in a row one at least may lie within the travel


def make_ready(subject: ControllerUnderTest) -> None:
    """Make an idle robot ready that refuses to move (A-4-1, A-4.25-1, A-4.24-5).

    Its joints may be released after power-on, or it may need a reset first. It may also be at an
    end of its travel, so that some of its unsteady reported poses are beyond the end.

    Raises:
        CaseFailed: The robot answers incorrectly.
    """
    line = subject.open()
    subject.moved = True
    stood = tuple(pose_of(line) for _ in range(_READINGS))
    unsteady = len(set(stood)) > 1
    lock, reset = (partial(_command, subject, line, name) for name in ("lock_joints", "reset"))
    aside = partial(_step_aside, subject, line, stood)
    for remedy in (lock, aside, reset) if unsteady else (lock, reset):
        if status_of(subject, line) != IDLE or _goes(subject, line, pose_of(line), SLOWEST_PERCENT):
            break
        remedy()
    if unsteady and not _has_room(subject, line):
        aside()


def return_to_start_pose(subject: ControllerUnderTest) -> list[str]:
    """Move the arm back to the pose at which it was before `make_ready` moved it.

    Some of the poses reported then may be beyond the end of its travel: one of them is enough.

    Returns:
        A sentence for the user if the arm could not be moved back.
    """
    stood, subject.traits.start_poses = subject.traits.start_poses, ()
    if not stood:
        return []
    try:
        line = subject.open()
        if any(_goes_back(subject, line, pose) for pose in stood):
            return []
        why = "the controller refuses the move"
    except (CaseFailed, CaseInconclusive) as error:
        why = sentence_of(error)
    return [
        UserMessage(
            "the arm did not return to its start pose {pose}: {reason}",
            pose=stood[0][:4],
            reason=why,
        )
    ]


def _command(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    if name not in subject.ics.unsupported and line.ask(name).accepted:
        wait_for_end(subject, line, name)


def _goes(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    pose: Pose,
    speed_percent: int | None = None,
) -> bool:
    lacks = _MOVE in subject.ics.unsupported
    if lacks or not ask_move(subject, line, pose, speed_percent).accepted:
        return False
    end = wait_for_end(subject, line, _MOVE)
    return end is None or end.done is True


def _has_room(subject: ControllerUnderTest, line: OutgoingConnection) -> bool:
    """Whether the arm can move by the standstill tolerance along each axis in both directions."""
    here = pose_of(line)
    for axis in AXES:
        beside = [_beside(here, axis, by) for by in (STANDSTILL, -STANDSTILL)]
        ways = [there for there in beside if in_box(subject, there)]
        if not all(_goes(subject, line, there) for there in (*ways, here)):
            return False
    return True


def _step_aside(
    subject: ControllerUnderTest, line: OutgoingConnection, stood: tuple[Pose, ...]
) -> None:
    """Move a step away from the ends of the travel, along one axis after another."""
    subject.traits.start_poses = subject.traits.start_poses or stood
    step_mm = subject.ics.motion.step_mm
    for axis in AXES:
        for by in (step_mm,) * _TRIES + (-step_mm,) * _TRIES:
            there = _beside(pose_of(line), axis, by)
            if in_box(subject, there) and _goes(subject, line, there):
                break


def _goes_back(subject: ControllerUnderTest, line: OutgoingConnection, stood: Pose) -> bool:
    """Move to this pose along the axes in reverse order. Return whether this succeeds."""
    there = pose_of(line)
    for axis in reversed(AXES):
        there = there._replace(**{axis: getattr(stood, axis)})
        if not _goes(subject, line, there):
            return False
    return True


def _beside(pose: Pose, axis: str, by: float) -> Pose:
    return pose._replace(**{axis: round(getattr(pose, axis) + by, 3)})
