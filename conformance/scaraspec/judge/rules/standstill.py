"""Standstill: the arm does not move after a stop, a lock or a motion, or while idle."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from scaraspec.judge.rules.arm import (
    JOINTS,
    LOCK,
    MOMENT_NS,
    MOTIONS,
    POSE,
    STOP,
    changed,
    ended_ns,
    gripper_set_since,
    locked,
    reading_before,
    recent_motion,
    settled_ns,
)
from scaraspec.judge.rules.rule import PASSED, RuleResult, rule, tolerated
from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import STATE_LAG_NS, RobotState
from scaraspec.user_message import UserMessage

_SIMULATE: Final = "simulate_program"
_OUTPUTS: Final = "get_digital_outputs"
_SETTERS: Final = {
    "set_default_program": ("4.13/6", "A-4.12-3"),
    "set_gripper_center": ("4.20/5", "A-4.19-2"),
    "set_initial_tool_position": ("4.21/5", "A-4.21-2"),
}
"""Settings that cause no motion, with the requirement and the register entry."""
_MAX_STATUS_GAP_NS: Final = 1_000_000_000
"""Maximum time between two statuses 00 between which nothing has moved the arm."""


# Standing still


@rule("4.17/7", on=Exchange, names=(JOINTS,))
def still_after_a_stop(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After the stop's result "11" the joint angles no longer change (L373)."""
    return _still_after((STOP,), x, robot)


@rule("4.26/5", on=Exchange, names=(JOINTS,))
def still_after_a_lock(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After a successful lock the joint angles stay constant (L553)."""
    return _still_after((LOCK,), x, robot)


@rule("4.27/4", on=Exchange, names=(JOINTS,))
@rule("4.23/5", on=Exchange, names=(POSE,))
def still_after_a_motion(x: Exchange, robot: RobotState) -> RuleResult | None:
    """An idle, locked robot reports constant values (L476, L591); a motion proves the lock."""
    return _still_after(MOTIONS, x, robot)


def _still_after(names: Sequence[str], x: Exchange, robot: RobotState) -> RuleResult | None:
    motion = recent_motion(x, robot)
    if motion is None or motion.name not in names or not x.reply_value:
        return None
    if answered_ns(x) - ended_ns(motion) > MOMENT_NS:
        return None
    first = next(robot.history.between(x.name, ended_ns(motion), x.time_ns), None)
    if first is None or not first.reply_value:
        return None
    if max_deviation(first.reply_value, x.reply_value) <= STANDSTILL:
        return PASSED
    first = next(robot.history.between(x.name, settled_ns(motion), x.time_ns), x)
    if max_deviation(first.reply_value or x.reply_value, x.reply_value) <= STANDSTILL:
        return None
    if x.name == POSE and gripper_set_since(first.time_ns, robot):
        return None
    return changed(
        first, x, UserMessage("the arm kept moving after {command} had ended", command=motion.name)
    )


@rule("4.27/4", on=Exchange, names=("get_status",))
def joints_still_when_idle(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Between two statuses 00 the joint angles do not change (L591)."""
    return _still_between_statuses(JOINTS, x, robot)


@rule("4.23/5", on=Exchange, names=("get_status",))
def pose_still_when_idle(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Between two statuses 00 the tool coordinates do not change (L476)."""
    return _still_between_statuses(POSE, x, robot)


def _still_between_statuses(name: str, x: Exchange, robot: RobotState) -> RuleResult | None:
    before = robot.history.last("get_status", before_ns=x.time_ns)
    if (
        before is None
        or before.reply_value != "00"
        or x.reply_value != "00"
        or locked(robot) is not True
    ):
        return None
    begin_ns = answered_ns(before)
    since_ns = robot.history.idle_since_ns
    if since_ns is None or since_ns > begin_ns or x.time_ns - begin_ns > _MAX_STATUS_GAP_NS:
        return None
    readings = [y for y in robot.history.between(name, begin_ns, x.time_ns) if y.reply_value]
    if any(y.time_ns <= since_ns + STATE_LAG_NS for y in readings):
        return None
    for y in readings[1:]:
        if max_deviation(readings[0].reply_value, y.reply_value) > STANDSTILL:
            if name == POSE and gripper_set_since(before.time_ns, robot):
                return None
            return changed(readings[0], y, "the values changed although the robot was idle")
    return PASSED if len(readings) > 1 else None


# Commands without motion


def _moves_nothing(x: Exchange, robot: RobotState, *, setter: str) -> RuleResult | None:
    """A setting does not change the joint angles before and after it."""
    if setter not in robot.history.recent:
        return None
    before = robot.history.last(JOINTS, before_ns=x.time_ns)
    since_ns = robot.history.idle_since_ns
    if before is None or not before.reply_value or not x.reply_value or since_ns is None:
        return None
    if since_ns > before.time_ns or answered_ns(x) - before.time_ns > MOMENT_NS:
        return None
    if locked(robot) is False:
        return None
    settings = [
        y
        for name in _SETTERS
        for y in robot.history.between(name, answered_ns(before), x.time_ns)
        if y.accepted
    ]
    if len(settings) != 1 or settings[0].name != setter:
        return None
    if max_deviation(before.reply_value, x.reply_value) <= STANDSTILL:
        return PASSED
    if setter != "set_gripper_center":
        return tolerated(
            _SETTERS[setter][1], "moves", UserMessage("the arm moved after {setter}", setter=setter)
        )
    return changed(before, x, UserMessage("the arm moved after {setter}", setter=setter))


for _setter, (_requirement, _) in _SETTERS.items():
    rule(_requirement, on=Exchange, names=(JOINTS,))(partial(_moves_nothing, setter=_setter))


@rule("4.16/5", on=Exchange, names=(JOINTS, _OUTPUTS))
def simulation_does_nothing(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A simulated run moves no joint and sets no output (A-4.16-1)."""
    simulation = robot.history.accepted[-1] if robot.history.accepted else None
    if simulation is None or simulation.name != _SIMULATE or not x.reply_value:
        return None
    before = reading_before(simulation, x.name, robot)
    if before is None or x.concurrent_uncertain or x.time_ns < answered_ns(simulation):
        return None
    request = robot.history.last_requests.get("set_digital_output")
    if x.name == _OUTPUTS and request and request.place.time_ns > before.time_ns:
        return None
    same = x.reply_value == before.reply_value or (
        x.name == JOINTS and max_deviation(before.reply_value, x.reply_value) <= STANDSTILL
    )
    return PASSED if same else changed(before, x, "the values changed during a simulation")
