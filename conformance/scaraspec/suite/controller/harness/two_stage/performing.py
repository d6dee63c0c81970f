"""Performing: runs a two-stage command with minimal effect from its request to its result.

It also checks that the arm stands still afterwards.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.errors import BUSY
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    SLOWEST_PERCENT,
    arm_returned,
    move_target,
    pose_of,
    status_at_rest,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    LOCK,
    MOVE,
    RELEASE,
    RESET,
    RUN,
    SIMULATE,
    STOP,
    begin,
    expect_accepted,
    require_command,
    start_program,
)
from scaraspec.suite.controller.harness.two_stage.results import (
    interrupted_result,
    locked_afterwards,
    release_joints,
    wait_for_result,
)
from scaraspec.suite.controller.harness.two_stage.tasks import (
    initial_position_at_pose,
    jog_somewhere,
)
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import expect


class Performed(NamedTuple):
    """A two-stage command from its request to its end.

    Attributes:
        first: The first reply.
        result: The final result; None if an emergency stop ended it without a result (A-4.17-4).
        status: The status after the result.
    """

    first: ReceivedFrame
    result: ReceivedFrame | None
    status: ReceivedFrame


def perform(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> Performed:
    """Run a two-stage command with minimal effect on an idle robot. The arm returns afterwards.

    Raises:
        CaseFailed: The subject refuses the command, or sends no final result.
    """
    require_command(subject, name)
    with arm_returned(subject, line) as pose:
        return _PERFORM.get(name, _perform_without_value)(subject, line, name, pose)


def _finish(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, first: ReceivedFrame
) -> Performed:
    return Performed(first, wait_for_result(subject, line, name), _status(subject, line))


def _status(subject: ControllerUnderTest, line: OutgoingConnection) -> ReceivedFrame:
    """Return the status; only the cases of 4/7 judge it."""
    return status_at_rest(line) if subject.is_case_about("4/7") else line.ask("get_status")


def _perform_without_value(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, _: Pose
) -> Performed:
    return _finish(subject, line, name, begin(subject, line, name))


def _perform_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, _: Pose
) -> Performed:
    return _finish(subject, line, name, start_program(subject, line, name, seconds=0).answer)


def _perform_lock(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, _: Pose
) -> Performed:
    """Lock the joints. A robot may refuse to lock joints that are locked (A-4.25-3)."""
    first = line.ask(name)
    if first.accepted is False and first.code not in BUSY:
        release_joints(subject, line)
        first = begin(subject, line, name)
    return _finish(subject, line, name, expect_accepted(name, first))


def _perform_move(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, pose: Pose
) -> Performed:
    first = begin(subject, line, name, move_target(pose, SLOWEST_PERCENT))
    return _finish(subject, line, name, first)


def _perform_reset(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, pose: Pose
) -> Performed:
    with initial_position_at_pose(subject, line):
        return _perform_without_value(subject, line, name, pose)


def _perform_release(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, _: Pose
) -> Performed:
    """Release the joints. The result may come only when they are locked again (A-4.25-2)."""
    with locked_afterwards(subject, line):
        first, result = release_joints(subject, line)
        if result is not None:
            return Performed(first, result, _status(subject, line))
    return _finish(subject, line, name, first)


def _perform_jog(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    _: str,
    pose: Pose,  # noqa: ARG001 - one signature for all
) -> Performed:
    first = jog_somewhere(subject, line)
    expect_accepted(STOP, line.ask(STOP))
    status = _finish(subject, line, STOP, first).status
    return Performed(first, interrupted_result(line, JOG), status)


def _perform_stop(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, _: Pose
) -> Performed:
    start_program(subject, line, RUN)
    return _finish(subject, line, name, expect_accepted(name, line.ask(name)))


_PERFORM: Final[
    Mapping[str, Callable[[ControllerUnderTest, OutgoingConnection, str, Pose], Performed]]
] = {
    RUN: _perform_program,
    SIMULATE: _perform_program,
    STOP: _perform_stop,
    RESET: _perform_reset,
    MOVE: _perform_move,
    LOCK: _perform_lock,
    RELEASE: _perform_release,
    JOG: _perform_jog,
}


def expect_standstill(
    line: OutgoingConnection, message: str, *, for_s: float, pose: Pose | None = None
) -> None:
    """Require that the tool does not move.

    Args:
        line: The connection.
        message: The message of the failure.
        for_s: How long to wait before the pose is compared, in seconds.
        pose: The earlier pose; None for the current pose.

    Raises:
        CaseFailed: The tool has moved.
    """
    first = pose or pose_of(line)
    line.wait(for_s)
    now = pose_of(line)
    still = max_deviation(first, now) <= STANDSTILL
    expect(still, message, expected=f"{tuple(first)}", observed=f"{tuple(now)}")
