"""Motions: the commanded pose, the direction of a jog, and joints that follow the pose."""

import math
from collections.abc import Sequence
from typing import Final

from scaraspec.judge.rules.arm import (
    JOG,
    JOINTS,
    MOMENT_NS,
    MOTIONS,
    MOVE,
    POSE,
    STOP,
    changed,
    ended_ns,
    gripper_set_since,
    last_motion,
    reading_before,
    recent_motion,
    settled_ns,
)
from scaraspec.judge.rules.busy import STATE_OF
from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    rule,
    tolerated,
)
from scaraspec.judge.rules.settings import PROGRAMS, executed_since, in_force
from scaraspec.judge.rules.text import observed
from scaraspec.judge.tolerances import STANDSTILL, angle_difference, max_deviation
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import show
from scaraspec.protocol.payloads import JogDirection
from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_AXES: Final = {
    JogDirection.PLUS_Y: (1, 1),
    JogDirection.MINUS_Y: (1, -1),
    JogDirection.PLUS_X: (0, 1),
    JogDirection.MINUS_X: (0, -1),
}
"""The axis of a jog, 0 for x and 1 for y, and the sign of the motion."""
_RUN: Final = "run_program"
_VISIBLE: Final = 20.0
"""A change of the pose (mm, degrees) that joint angles show even without decimals."""
_REACHED: Final = 1.0
"""Tolerance of a commanded pose in mm and degrees (4.24/8)."""
_THETA_X, _LIFT = 3, 2
"""Index of thetaX in a pose, and of the wrist in the joint angles: a height, not an angle."""
_BEYOND_ALL_REACH_MM: Final = 1_000_000


# Moves


@rule("4.24/8", on=Exchange, names=(POSE,))
def pose_is_reached(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "11" 0x38 returns the commanded pose within 1 mm and 1 degree (L504, L476)."""
    move = recent_motion(x, robot)
    if move is None or move.name != MOVE or not move.request_value or not x.reply_value:
        return None
    if gripper_set_since(move.time_ns, robot):
        return None
    target = move.request_value[1:5]
    if max(abs(value) for value in target[:3]) >= _BEYOND_ALL_REACH_MM:
        return None  # 4.24/9 judges it
    if max_deviation(target, x.reply_value[:4]) <= _REACHED:
        return PASSED
    if x.time_ns <= settled_ns(move):
        return None
    gripper = _gripper(x, robot)
    message = "the pose that was reached is not the one that was commanded"
    if gripper is None:
        result = inconclusive(
            UserMessage(
                "{message}: either the move is wrong, which is a violation, or the pose is that of"
                " the gripper, whose centre the capture does not show",
                message=message,
            )
        )
        return result._replace(places=(*places_of(move), *places_of(x)))
    known, centre = gripper
    if any(centre):
        return tolerated("A-4.23-1", "another point", message)
    return failed(
        message,
        expected=observed(move.request),
        observed=observed(x.reply) if x.reply else "",
        at=(*places_of(known), *places_of(move), *places_of(x)),
    )


def _gripper(x: Exchange, robot: RobotState) -> tuple[Exchange, Sequence[float]] | None:
    """Return the gripper centre, after the exchange that shows it; None if unknown."""
    setting = in_force("set_gripper_center", x, robot)
    read = robot.history.last("get_gripper_center", before_ns=x.time_ns)
    if setting:
        known, value = setting, setting.request_value
    elif read and not gripper_set_since(read.time_ns, robot):
        known, value = read, read.reply_value
    else:
        return None
    return None if executed_since(known.time_ns, robot, PROGRAMS) else (known, value)


@rule("4.24/9", on=Exchange, names=(MOVE,))
def out_of_reach(x: Exchange, _: RobotState) -> RuleResult | None:
    """A target 1,000,000 mm away is refused or fails, with 05 or 06 (L1022-1023; A-4.24-5)."""
    if (
        not x.request_value
        or max(abs(value) for value in x.request_value[1:4]) < _BEYOND_ALL_REACH_MM
    ):
        return None
    failure = x.reply_value if x.accepted is False else x.outcome
    if failure and failure.code in ("05", "06"):
        return PASSED
    if not x.outcome or not x.outcome.done:
        return None
    return failed(
        "the controller reports that it reached a target far out of reach",
        expected="05 or 06",
        observed="11",
    )


@rule("4.27/6", on=Exchange, names=(JOINTS, POSE))
def joints_follow_the_pose(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A motion that changed the tool coordinates also changed the joint angles (L591, L1004)."""
    motion = recent_motion(x, robot)
    return _consistent(motion, x, robot) if motion and motion.name != _RUN else None


@rule("4.27/6", "7/3", on=Exchange, names=(JOINTS, POSE))
def angles_in_degrees(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A motion that turns the tool by many degrees turns a joint by degrees, too (L591, L1006).

    Angles that all stay within pi and turn by 180/pi less are probably radians. The document states
    neither the unit of a joint angle nor the gear ratios (A-4.27-3).
    """
    motion = recent_motion(x, robot)
    pair = _around(motion, x, robot) if motion and motion.name in MOTIONS else None
    if pair is None:
        return None
    joints, poses = (tuple(y.reply_value[:4] for y in two) for two in pair)
    turned_deg = abs(angle_difference(poses[1][_THETA_X], poses[0][_THETA_X]))
    angles = [angle for reading in joints for at, angle in enumerate(reading) if at != _LIFT]
    sums = [sum(angle for at, angle in enumerate(reading) if at != _LIFT) for reading in joints]
    in_radians = turned_deg / math.degrees(1)
    if turned_deg < _VISIBLE or max(map(abs, angles)) > math.pi or not any(angles):
        return None
    if abs(abs(sums[1] - sums[0]) - in_radians) > in_radians / 4:
        return None
    result = inconclusive(
        UserMessage(
            "the tool turned by {turned_deg:.0f} degrees but the joint angles by {sum:.2f} in all,"
            " and all are within pi: either they are in radians, which is a violation, or they"
            " belong to another geometry",
            turned_deg=turned_deg,
            sum=sums[1] - sums[0],
        )
    )
    return result._replace(places=tuple(p for two in pair for y in two for p in places_of(y)))


@rule("7/5", on=Exchange, names=(JOINTS, POSE))
def one_geometry(x: Exchange, robot: RobotState) -> RuleResult | None:
    """One arm has one pose for one set of joint angles; a program may set another tool."""
    motion = recent_motion(x, robot)
    return _consistent(motion, x, robot) if motion else None


def _consistent(motion: Exchange, x: Exchange, robot: RobotState) -> RuleResult | None:
    """Check that the joint angles differ if the poses before and after a motion differ."""
    if motion.name not in MOTIONS:
        return None
    pair = _around(motion, x, robot)
    if pair is None:
        return None
    joints, poses = pair
    if max_deviation(poses[0].reply_value[:4], poses[1].reply_value[:4]) <= _VISIBLE:
        return None
    if max_deviation(joints[0].reply_value, joints[1].reply_value) > 0:
        return PASSED
    if joints[1].time_ns <= settled_ns(motion):
        return None
    return changed(joints[0], joints[1], "the pose changed but the joint angles did not")


_Two = tuple[Exchange, Exchange]


def _around(motion: Exchange, x: Exchange, robot: RobotState) -> tuple[_Two, _Two] | None:
    """Return joint angles and poses before and after a motion; `x` is one of the two after it."""
    if answered_ns(x) - ended_ns(motion) > MOMENT_NS:
        return None
    other = POSE if x.name == JOINTS else JOINTS
    then = next(robot.history.between(other, ended_ns(motion), x.time_ns), None)
    if not then or not then.reply_value or not x.reply_value:
        return None
    before, other_before = (reading_before(motion, name, robot) for name in (x.name, other))
    if not before or not other_before:
        return None
    first_ns = min(before.time_ns, other_before.time_ns)
    interval_ns = max(before.time_ns, other_before.time_ns) - first_ns
    if interval_ns > MOMENT_NS or gripper_set_since(first_ns, robot):
        return None
    mine, theirs = (before, x), (other_before, then)
    return (mine, theirs) if x.name == JOINTS else (theirs, mine)


# Jogs


@rule("4.28/3", on=Exchange, names=(JOINTS, POSE))
def jog_direction(x: Exchange, robot: RobotState) -> RuleResult | None:
    """1, 2, 3, 4 mean +Y, -Y, +X, -X (L605-608); for a jog of single joints see A-4.28-2."""
    motion = last_motion(x, robot)
    if motion is None or motion.name not in (JOG, STOP):
        return None
    motions = [y for y in robot.history.accepted if y.name != STOP]
    jog = motions[-1] if motions else None
    pair = _around(jog, x, robot) if jog and jog.name == JOG and jog.result else None
    if jog is None or pair is None or jog.request_value not in _AXES:
        return None
    (joints, joints_then), (pose, pose_then) = pair
    if not all(
        abs(joints_then.reply_value[i] - joints.reply_value[i]) > STANDSTILL for i in (0, 1)
    ):
        return None
    axis, sign = _AXES[jog.request_value]
    along = (pose_then.reply_value[axis] - pose.reply_value[axis]) * sign
    across = abs(pose_then.reply_value[1 - axis] - pose.reply_value[1 - axis])
    if max(abs(along), across) < _REACHED or along > across:
        return PASSED if along > across else None
    if pose_then.time_ns <= settled_ns(jog):
        return None
    return changed(
        pose,
        pose_then,
        UserMessage(
            "a jog in direction {direction} moved the arm in another direction",
            direction=jog.request_value,
        ),
    )


@rule("4.28/8", on=Exchange, names=(JOG,))
def jog_ends(x: Exchange, _: RobotState) -> RuleResult | None:
    """A jog ends on 0x32 (A-4.28-3)."""
    return PASSED if x.interrupted_by and x.interrupted_by.name == STOP and x.result else None


@rule("4.28/8", on=Exchange, names=("get_status",))
def jog_stops_after_stop(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot whose status is still that of a jog after a successful stop did not stop."""
    if len(robot.history.accepted) < 2 or x.reply_value != STATE_OF[JOG]:  # noqa: PLR2004 - jog and stop
        return None
    jog, stop = list(robot.history.accepted)[-2:]
    stopped = stop.name == STOP and stop.outcome is not None and stop.outcome.done
    if (
        jog.name != JOG
        or not stopped
        or not settled_ns(stop) < x.time_ns < ended_ns(stop) + MOMENT_NS
    ):
        return None
    return failed(
        "the jog continued after the emergency stop",
        expected="00",
        observed=show(x.reply.frame.data) if x.reply else "",
        at=(*places_of(stop), *places_of(x)),
    )


# The pose


@rule("7/2", on=FrameSeen, names=(MOVE,), sender=A2C)
@rule("7/2", on=FrameSeen, names=(POSE,), sender=C2A)
def four_of_six(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Only x, y, z and thetaX have a meaning (L1006; A-4.21-3)."""
    if seen.value is None:
        return None
    if not seen.value.theta_y and not seen.value.theta_z:
        return PASSED
    return tolerated(
        "A-4.21-3", "not 0", UserMessage("thetaY or thetaZ is not 0: {pose}", pose=observed(seen))
    )
