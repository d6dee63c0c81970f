"""Readiness: a robot that will not move where it stands is made ready to, and brought back.

All by small moves, one axis at a time. Faults of the robot during these moves are for the cases to
find.
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

_MOVE: Final = "set_tool_coordinates"
_READINGS: Final = 5
_TRIES: Final = 2  # of two readings in a row one at least may lie within the travel


def make_ready(subject: ControllerUnderTest) -> None:
    """Make an idle robot ready that will not move where it stands (A-4-1, A-4.25-1, A-4.24-5).

    It may have been switched on with its joints loose, or want to be reset before all else. Or it
    stands at an end of its travel, and what its unsteady readings say lies beyond, now and then.

    Raises:
        CaseFailed: It answers something otherwise than it must.
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
    """Bring the arm back to where it stood before it stepped aside.

    What it said then may lie beyond an end of its travel, now and then: one reading will do.

    Returns:
        A sentence if it could not be brought back.
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
        why = str(error)
    return [f"the arm did not return to its start pose {stood[0][:4]}: {why}"]


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
    """Whether it goes as far as readings may differ, along each axis and either way, and back."""
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
    """Go a step away from the ends of the travel, along one axis after another."""
    subject.traits.start_poses = subject.traits.start_poses or stood
    step_mm = subject.ics.motion.step_mm
    for axis in AXES:
        for by in (step_mm,) * _TRIES + (-step_mm,) * _TRIES:
            there = _beside(pose_of(line), axis, by)
            if in_box(subject, there) and _goes(subject, line, there):
                break


def _goes_back(subject: ControllerUnderTest, line: OutgoingConnection, stood: Pose) -> bool:
    """Whether it goes there, along the same axes the other way round."""
    there = pose_of(line)
    for axis in reversed(AXES):
        there = there._replace(**{axis: getattr(stood, axis)})
        if not _goes(subject, line, there):
            return False
    return True


def _beside(pose: Pose, axis: str, by: float) -> Pose:
    return pose._replace(**{axis: round(getattr(pose, axis) + by, 3)})
