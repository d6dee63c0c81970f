"""Motion: small moves around the current pose of the arm, one axis at a time, and back.

The suite assumes nothing about the arm: it reports its pose itself, and the ICS limits the moves.
The cases judge whether a move was correct.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

from scaraspec.judge.tolerances import STANDSTILL, differences, max_deviation
from scaraspec.protocol.commands import BY_NAME, JointValues, MoveTarget, Pose
from scaraspec.protocol.errors import BUSY
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.poses import numbers_of
from scaraspec.suite.controller.harness.state_lag import TOLERATED_S
from scaraspec.suite.controller.harness.timeouts import ExpectedReply
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, CaseSkipped, NoReply
from scaraspec.user_message import UserMessage

AXES: Final = ("x", "y", "z", "theta_x")
"""The values of a pose that have a meaning (7.1, L1006)."""

REACHED: Final = 1.0
"""The tolerance of a reached pose, in mm or degrees (4.24/8)."""
SLOWEST_PERCENT: Final = 1
IDLE: Final = "00"

_POLL_S: Final = 0.05
_SLICE_S: Final = 0.5
_PUT_OFF_S: Final = (
    0.2  # a reply this late with the idle status was delayed until the command ended …
)
_TIMES_LATER: Final = 3  # … if an idle robot replies this many times faster
_NS: Final = 1e9
_POSES: Final = 3
_STOPS: Final = 2  # a queued command may start when the first one has ended (A-4-2)
_MOVE, _RESET, _LOCK = "set_tool_coordinates", "reset", "lock_joints"


# ---------------------------------------------------------------------- where it is


def pose_of(line: OutgoingConnection) -> Pose:
    """Query the pose of the tool (0x38); see `numbers_of`."""
    return numbers_of(line, "get_tool_coordinates", Pose, "4.23/2")


def joints_of(line: OutgoingConnection) -> JointValues:
    """Query the joint angles (0x3C); see `numbers_of`."""
    return numbers_of(line, "get_joint_angles", JointValues, "4.27/2")


def pose_deviation(pose: Pose, expected: Pose) -> float:
    """Return the largest difference of two poses, in mm or degrees, of the values in `AXES`."""
    return max_deviation(pose[:4], expected[:4])


def same_place(a: Pose, b: Pose) -> bool:
    """Whether two poses are equal within the standstill tolerance."""
    return pose_deviation(a, b) <= STANDSTILL


# ---------------------------------------------------------------------- where to go


def move_target(pose: Pose, speed_percent: int) -> MoveTarget:
    """Return the value of a request that moves the tool to a pose."""
    return MoveTarget(speed_percent, *pose)


def neighbours(subject: ControllerUnderTest, pose: Pose, axis: str) -> list[Pose]:
    """Return the poses one step away along an axis, in both directions, that are in the box.

    Raises:
        CaseSkipped: The current pose is outside of the box.
    """
    motion = subject.ics.motion
    if not in_box(subject, pose):
        raise CaseSkipped(
            UserMessage(
                "the arm is at {pose}, outside of motion.box_mm: move it into the box",
                pose=pose[:3],
            )
        )
    value = getattr(pose, axis)
    steps = (value + motion.step_mm, value - motion.step_mm)
    poses = [pose._replace(**{axis: round(each, 3)}) for each in steps]
    return [each for each in poses if in_box(subject, each)]


def pose_between(pose: Pose, there: Pose, part: float) -> Pose:
    """Return the pose at a fraction of the way between two poses."""
    return Pose(
        *(round(p + way * part, 3) for p, way in zip(pose, differences(there, pose), strict=True))
    )


def in_box(subject: ControllerUnderTest, pose: Pose) -> bool:
    """Whether the pose is in the box that the ICS permits."""
    box_mm = subject.ics.motion.box_mm
    return all(low <= v <= high for v, (low, high) in zip(pose[:3], box_mm, strict=False))


def ask_move(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    pose: Pose,
    speed_percent: int | None = None,
) -> ReceivedFrame:
    """Request a move, by default at the speed that the ICS permits."""
    subject.moved = True
    speed = subject.ics.motion.speed_percent if speed_percent is None else speed_percent
    return line.ask(_MOVE, move_target(pose, speed))


def begin_step(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    axis: str,
    speed_percent: int | None = None,
) -> tuple[Pose, ReceivedFrame]:
    """Start a step along an axis. If one direction is out of reach, try the other one.

    Returns:
        The target pose and the first reply.

    Raises:
        CaseSkipped: Both directions are out of reach.
    """
    for pose in neighbours(subject, pose_of(line), axis):
        answer = ask_move(subject, line, pose, speed_percent)
        if not is_out_of_reach(answer):
            return pose, answer
    raise CaseSkipped(UserMessage("there is no room for a step along {axis}", axis=axis))


def begin_step_somewhere(
    subject: ControllerUnderTest, line: OutgoingConnection, speed_percent: int | None = None
) -> tuple[Pose, ReceivedFrame]:
    """Start a step along the first axis that has room.

    Raises:
        CaseFailed: No axis has room: the arm cannot move from its current pose (4.24/5).
    """
    for axis in ("y", "x", "z", "theta_x"):
        with suppress(CaseSkipped):
            return begin_step(subject, line, axis, speed_percent)
    message = "no step from the current pose is possible along any axis"
    raise CaseFailed(message, expected="1", observed="0|05 or 0|06", requirement="4.24/5")


def is_out_of_reach(answer: ReceivedFrame) -> bool:
    """Whether a move is refused because of its target, perhaps without a code (err_bare0)."""
    bare = answer.frame.data.rstrip(b"\0") == b"0"
    return answer.accepted is False and (bare or answer.code in ("05", "06"))


@contextmanager
def arm_returned(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[Pose]:
    """Yield the pose of the tool; stop the robot and move the tool back to it afterwards.

    Raises:
        CaseInconclusive: The tool could not be moved back.
    """
    release_latch(subject, line)
    pose = pose_of(line)
    try:
        yield pose
    except BaseException:
        with suppress(CaseFailed, CaseInconclusive):
            _go_back(subject, line, pose)
        raise
    try:
        _go_back(subject, line, pose)
    except CaseFailed as error:
        raise CaseInconclusive(
            UserMessage(
                "the arm did not return to its start pose {pose}: {error}",
                pose=pose[:4],
                error=error,
            )
        ) from None


def _go_back(subject: ControllerUnderTest, line: OutgoingConnection, pose: Pose) -> None:
    if not subject.moved:
        return
    if line.closed or line.ending is not None:
        subject.close_lines()
        line = subject.open()
    stop_motion(subject, line)
    if same_place(pose_of(line), pose):
        return
    answer = ask_move(subject, line, pose)
    if not answer.accepted:
        raise CaseFailed(
            "the controller refused the move back to the start pose",
            expected="1",
            observed=f"{answer}",
        )
    wait_for_end(subject, line, _MOVE)


# ---------------------------------------------------------------------- while it executes


def responsiveness_known(subject: ControllerUnderTest) -> bool:
    """Whether it is known if the robot answers queries while it executes."""
    return subject.traits.unresponsive_while_executing is not None


def is_responsive(
    subject: ControllerUnderTest, line: OutgoingConnection, *, jogs: bool = False
) -> bool:
    """Whether the robot answers queries while it executes (A-4-3). Call this while it executes.

    Nothing is learned if the connection ends.

    Args:
        subject: The controller under test.
        line: A connection to it.
        jogs: Whether a jog executes. A robot may be unresponsive only while it jogs, and the jog
            continues during the wait for a reply.
    """
    traits = subject.traits
    if jogs and not traits.unresponsive_while_executing:
        if traits.unresponsive_while_jogging is None:
            try:
                line.ask("get_status", within_s=subject.ics.motion.jog_s)
            except NoReply:
                if line.ending is not None:
                    return False
                traits.unresponsive_while_jogging = True
            else:
                traits.unresponsive_while_jogging = False
        return not traits.unresponsive_while_jogging
    if traits.unresponsive_while_executing is None:
        try:
            waited_s, status = _timed_status(subject, line)
        except NoReply:
            if line.ending is not None:
                return False
            traits.unresponsive_while_executing = True
        else:
            put_off = status not in BUSY and waited_s > _PUT_OFF_S
            usual_s = _timed_status(subject, line)[0] if put_off else 0.0
            too_late = put_off and waited_s > _TIMES_LATER * usual_s
            traits.unresponsive_while_executing = too_late
    return not traits.unresponsive_while_executing


def _timed_status(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> tuple[float, str | None]:
    requested_ns = subject.now_ns
    answer = line.ask("get_status")
    return answer.time_s - requested_ns / _NS, answer.value


def require_known_responsive(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Continue only if the robot answers queries while it executes. Call this while it executes.

    Raises:
        CaseSkipped: The robot does not answer.
    """
    if not is_responsive(subject, line):
        raise CaseSkipped("the robot does not answer queries while it executes (A-4-3)")


# ---------------------------------------------------------------------- coming to rest


def stop(
    subject: ControllerUnderTest, line: OutgoingConnection, owner: OutgoingConnection | None = None
) -> ReceivedFrame:
    """Send an emergency stop, wait for its result and release the latch.

    Args:
        subject: The controller under test.
        line: The connection that sends the stop.
        owner: The connection that started the command, if it is another one.

    Returns:
        The first reply to the stop.

    Raises:
        NoReply: The stop is not answered.
    """
    answer = stop_without_reset(subject, line, owner)
    if answer.accepted:
        release_latch(subject, line)
    return answer


def stop_without_reset(
    subject: ControllerUnderTest, line: OutgoingConnection, owner: OutgoingConnection | None = None
) -> ReceivedFrame:
    """Send an emergency stop and wait for its result, without a reset; see `stop`.

    Returns:
        The first reply to the stop.

    Raises:
        NoReply: The stop is not answered.
    """
    answer = line.ask("emergency_stop")
    if answer.accepted:
        with suppress(NoReply):
            line.result("emergency_stop", within_s=subject.reply_s)
        await_own_result(subject, owner or line)
        wait_until_at_rest(subject, line)
        if not subject.lag.is_absent:
            line.wait(TOLERATED_S)
    return answer


def await_own_result(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Wait for the result of the stopped command, which may follow that of the stop (A-4.17-4)."""
    deadline = Deadline(subject, SILENCE_S)
    line.pump()
    while not (deadline.expired or line.ended or any(seen.frame.tagged for seen in line.inbox)):
        line.wait(_POLL_S)


def stop_motion(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Stop every command that executes.

    Raises:
        NoReply: The subject does not answer any more.
    """
    for _ in range(_STOPS):
        if status_of(subject, line) not in (*BUSY, None):
            break
        stop(subject, line)
    wait_until_at_rest(subject, line)
    release_latch(subject, line)
    line.sync()


def status_after_result(line: OutgoingConnection) -> ReceivedFrame:
    """Query the status after a final result; once more if it still reports the ended command.

    The document does not define when the status returns to 00 (L318): it may be a moment later.
    """
    status = line.ask("get_status")
    if status.value in BUSY:
        line.wait(MOMENT_S)
        status = line.ask("get_status")
    return status


def status_at_rest(line: OutgoingConnection) -> ReceivedFrame:
    """Query the status shortly after a final result, when it must not show the ended command."""
    line.wait(MOMENT_S)
    return line.ask("get_status")


def status_of(subject: ControllerUnderTest, line: OutgoingConnection) -> str | None:
    """Query the status; None if the robot answers no query while it executes (A-4-3)."""
    unresponsive = subject.traits.unresponsive_while_executing
    if unresponsive:
        _drop_late_replies(line)
    try:
        answer = line.ask("get_status", within_s=_POLL_S if unresponsive else None)
    except NoReply:
        if not unresponsive:
            raise
        return None
    status: str | None = answer.value
    return status


def _drop_late_replies(line: OutgoingConnection) -> None:
    """Drop status replies that came only after the end of a command: they may be outdated."""
    opcode = BY_NAME["get_status"].opcode
    line.pump()
    line.inbox[:] = [s for s in line.inbox if s.frame.tagged or s.frame.opcode != opcode]


@contextmanager
def _set_aside(line: OutgoingConnection, name: str) -> Iterator[None]:
    """Ignore final results of earlier requests of this command while the context is active."""
    opcode = BY_NAME[name].opcode
    line.pump()
    earlier = [s for s in line.inbox if s.frame.tagged and s.frame.opcode == opcode]
    line.inbox[:] = [s for s in line.inbox if s not in earlier]
    try:
        yield
    finally:
        line.inbox[:0] = earlier


def wait_for_end(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    name: str,
    *,
    within_s: float | None = None,
) -> ReceivedFrame | None:
    """Wait for a final result until the robot is idle, and a moment longer.

    A status that reports a fault does not show whether the robot is idle (A-4.8-2).

    Returns:
        The final result; None if it does not come.
    """
    due = ExpectedReply(name, result=True)
    full_s = subject.longest_s if within_s is None else within_s
    deadline = Deadline(subject, subject.timeout_policy.timeout_s(due, full_s))
    idle = False
    while not (idle or deadline.expired or line.ended):
        with suppress(NoReply):
            return line.result(name, within_s=min(_SLICE_S, deadline.remaining_s))
        is_responsive(subject, line)  # `status_of` depends on this
        idle = status_of(subject, line) == IDLE
    with suppress(NoReply):
        return line.result(name, within_s=max(SILENCE_S, subject.lag.result_s))
    if not line.ended:
        subject.timeout_policy.note_timeout(due)
    return None


def wait_until_at_rest(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Wait until nothing executes. The status may then report a fault."""
    full_s = subject.timeout_policy.rest_timeout_s(subject.longest_s)
    deadline = Deadline(subject, full_s)
    while (busy := status_of(subject, line) in (*BUSY, None)) and not (
        deadline.expired or line.ended
    ):
        line.wait(deadline.poll_s)
    subject.timeout_policy.note_rest(full_s - deadline.remaining_s, rests=not busy)


def release_latch(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Reset a robot that an emergency stop has latched (A-4.17-2).

    A latched robot reports it in its status, or refuses a move to its current pose. If the first
    stop has not latched the robot, later stops are not checked.
    """
    traits = subject.traits
    if not traits.may_be_latched:
        return
    if line.ask("get_status").value == IDLE:
        with _set_aside(line, _MOVE):
            for _ in range(_POSES):  # an unsteady pose may be beyond the end of the travel
                answer = ask_move(subject, line, pose_of(line), SLOWEST_PERCENT)
                if answer.accepted:
                    wait_for_end(subject, line, _MOVE)
                    break
                if answer.code in BUSY:  # the judge compares it with the status (4/15)
                    line.wait(_POLL_S)
                    line.ask("get_status")
                    line.wait(_POLL_S)
        if answer.accepted:
            if not traits.latches:
                traits.may_be_latched = False
            return
    traits.latches = True
    for remedy in (_RESET, _LOCK):  # it may have released its joints (A-4.25-1)
        with _set_aside(line, remedy):
            if remedy not in subject.ics.unsupported and line.ask(remedy).accepted:
                wait_for_end(subject, line, remedy)
                line.wait(_POLL_S)
                break
