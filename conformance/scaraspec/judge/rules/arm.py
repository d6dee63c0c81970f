"""The arm as a recording shows it: reported joint angles and poses, and the motions between them.

A recording may not show everything that can move the arm: another client, a pendant, a person.
So rules compare reported values only shortly after evidence that nothing else moved the arm.
"""

from typing import Final

from scaraspec.judge.rules.rule import RuleResult, failed, places_of
from scaraspec.judge.rules.text import observed
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.robot_state import STATE_LAG_NS, RobotState

JOINTS: Final = "get_joint_angles"
POSE: Final = "get_tool_coordinates"
STOP, LOCK, RELEASE = "emergency_stop", "lock_joints", "release_joints"
MOVE, JOG = "set_tool_coordinates", "jog"
MOTIONS: Final = ("run_program", "reset", MOVE, JOG)

MOMENT_NS: Final = 2_000_000_000
"""Within this time after a motion no other client can have begun another one."""
_MAX_AGE_NS: Final = 60_000_000_000
"""Maximum age of a reported value that shows the state before a command."""


def ended_ns(y: Exchange) -> int:
    """Return when its final result arrived; -1 without one."""
    return y.result.place.time_ns if y.result else -1


def settled_ns(y: Exchange) -> int:
    """Return from when a reported pose is that after its end (A-4.8-3)."""
    return ended_ns(y) + STATE_LAG_NS


def last_motion(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the last two-stage command if it succeeded and the robot has been idle since."""
    motion = robot.history.accepted[-1] if robot.history.accepted else None
    done = motion is not None and motion.outcome is not None and motion.outcome.done
    idle = robot.history.idle_since_ns is not None and not robot.busy
    return motion if motion and done and idle and x.time_ns > ended_ns(motion) else None


def recent_motion(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the last motion as `last_motion`, if it ended within a `MOMENT_NS` before a query."""
    accepted = robot.history.accepted
    result = accepted[-1].result if accepted else None
    if result is None or x.time_ns - result.place.time_ns > MOMENT_NS:
        return None
    return last_motion(x, robot)


def reading_before(motion: Exchange, name: str, robot: RobotState) -> Exchange | None:
    """Return the last query `name` between the end of the previous command and `motion`."""
    query = robot.history.last(name, before_ns=motion.time_ns)
    if query is None or not query.reply_value or motion.time_ns - query.time_ns > _MAX_AGE_NS:
        return None
    earlier = (y for y in robot.history.accepted if y.time_ns < motion.time_ns)
    return query if all(0 < ended_ns(y) < query.time_ns for y in earlier) else None


def gripper_set_since(time_ns: int, robot: RobotState) -> bool:
    """Whether the gripper centre may have changed, which may be part of the pose (A-4.23-1)."""
    request = robot.history.last_requests.get("set_gripper_center")
    return request is not None and request.place.time_ns > time_ns


def locked(robot: RobotState) -> bool | None:
    """Whether the joints are locked, by the last lock, release or motion; None if not known."""
    about = (y for y in reversed(robot.history.accepted) if y.name in (LOCK, RELEASE, *MOTIONS))
    return next((y.name != RELEASE for y in about if y.outcome and y.outcome.done), None)


def changed(first: Exchange, x: Exchange, message: str) -> RuleResult:
    """Return the failure that two reported values contradict each other."""
    return failed(
        message,
        expected=observed(first.reply) if first.reply else "",
        observed=observed(x.reply) if x.reply else "",
        at=(*places_of(first), *places_of(x)),
    )
