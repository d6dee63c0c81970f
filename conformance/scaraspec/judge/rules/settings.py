"""Values that must read back as set: passwords, network, default program, gripper, home position.

A value is compared with the last setting only if no later request could change it.
"""

from collections.abc import Callable, Collection
from typing import Any, Final

from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    rule,
    tolerated,
)
from scaraspec.judge.rules.text import observed
from scaraspec.judge.tolerances import read_back
from scaraspec.traffic.events import Ending, Exchange
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

MAX_UNSEEN_NS: Final = 60_000_000_000
"""After this time the robot may have been switched off, or an unrecorded client may have logged in
or changed a setting."""
_MAX_UNSEEN_SAME_CONNECTION_NS: Final = 10 * MAX_UNSEEN_NS
"""The same on one connection: only a serial line stays open if a robot is switched off."""

PROGRAMS: Final = ("run_program", "simulate_program")
"""Programs, whose files contain their own positions (A-6.3-3)."""


def in_force(setter: str, x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the accepted setting that is in force while `x` is answered; None if uncertain.

    The setting was accepted shortly before the request `x`, it is the last one requested, and the
    robot was not switched off since: which settings survive that is open (A-4-6).
    """
    setting = robot.history.last(setter, before_ns=x.time_ns)
    if (
        setting is None
        or not setting.accepted
        or robot.history.last_requests.get(setter) is not setting.request
    ):
        return None
    if setting.request.parsed and setting.request.parsed.decoded.issues:
        return None
    same = setting.request.place.connection == x.request.place.connection
    if x.time_ns - setting.time_ns > (_MAX_UNSEEN_SAME_CONNECTION_NS if same else MAX_UNSEEN_NS):
        return None
    return None if switched_off_since(setting, robot) else setting


def switched_off_since(x: Exchange, robot: RobotState) -> bool:
    """Return whether the robot may have been switched off since `x`, on request or not.

    A new network address also ends the connections (A-4.4-1).
    """
    shutdown = robot.history.last_requests.get("shutdown")
    if shutdown and shutdown.place.time_ns > x.time_ns:
        return True
    return x.name != "set_network" and robot.history.all_closed_ns > x.time_ns


def executed_since(time_ns: int, robot: RobotState, names: Collection[str]) -> bool:
    """Return whether one of these two-stage commands executed, or may have, since then."""
    return any(
        y.name in names and (y.result is None or y.result.place.time_ns > time_ns)
        for y in robot.history.accepted
    )


def _other_value(setting: Exchange, x: Exchange) -> RuleResult:
    return failed(
        UserMessage(
            "{query} reports a value that differs from the one set by {setter}",
            query=x.name,
            setter=setting.name,
        ),
        expected=observed(setting.request),
        observed=observed(x.reply) if x.reply else "",
        at=(*places_of(setting), *places_of(x)),
    )


def _read_back(
    setter: str, x: Exchange, robot: RobotState, same: Callable[[Exchange, Any], bool]
) -> RuleResult | None:
    setting = in_force(setter, x, robot)
    if setting is None or x.reply_value is None:
        return None
    return PASSED if same(setting, x.reply_value) else _other_value(setting, x)


# Refused settings


@rule("4.4/2", on=Exchange, names=("get_network",))
def refused_network(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "0" the reply to 0x04 is unchanged (L162)."""
    return _unchanged("set_network", x, robot, 3)


@rule("4.13/2", "4.13/5", on=Exchange, names=("get_default_program",))
def refused_default(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "0" the default program is unchanged (L284-L287); a deletion may leave none."""
    before = robot.history.last(x.name, before_ns=x.time_ns)
    deletion = robot.history.last_requests.get("delete_program")
    if before and deletion and deletion.place.time_ns > before.time_ns:
        return None
    if before and _may_be_unknown_opcode(x, robot, since_ns=before.time_ns):
        return None
    return _unchanged("set_default_program", x, robot, 1)


@rule("4.20/2", on=Exchange, names=("get_gripper_center",))
def refused_gripper(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "0" the reply to 0x34 is unchanged (L440-L443)."""
    return _unchanged("set_gripper_center", x, robot, 3)


@rule("4.21/2", on=Exchange, names=("get_initial_tool_position",))
def refused_position(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "0" the reply to 0x37 is unchanged (L452-L455)."""
    return _unchanged("set_initial_tool_position", x, robot, 4)


def _unchanged(setter: str, x: Exchange, robot: RobotState, count: int) -> RuleResult | None:
    """After a refusal the value is the one that was reported before."""
    refused = robot.history.last(setter, before_ns=x.time_ns)
    if refused is None or refused.accepted is not False or refused.request_value is None:
        return None
    before = robot.history.last(x.name, before_ns=refused.time_ns)
    if before is None or before.reply_value is None or x.reply_value is None:
        return None
    since_ns, other = answered_ns(before), robot.history.previous_requests.get(setter)
    if robot.history.last_requests.get(setter) is not refused.request:
        return None
    if other and other.place.time_ns > before.time_ns:
        return None
    if x.time_ns - since_ns > MAX_UNSEEN_NS or switched_off_since(before, robot):
        return None
    if executed_since(since_ns, robot, PROGRAMS):
        return None
    now, former, requested = (
        _fields(y)[:count] for y in (x.reply_value, before.reply_value, refused.request_value)
    )
    changed = [
        (value, requested_value)
        for value, requested_value, was in zip(now, requested, former, strict=True)
        if value != was
    ]
    if not changed:
        return PASSED
    if any(value != requested_value for value, requested_value in changed):
        result = inconclusive(
            UserMessage(
                "{setter} was refused, but {query} then reports another value than before: either"
                " the refused request changed it, which is a violation, or another client did",
                setter=setter,
                query=x.name,
            )
        )
        return result._replace(places=(*places_of(before), *places_of(refused), *places_of(x)))
    return failed(
        UserMessage(
            "{setter} was refused, but {query} reports the requested value",
            setter=setter,
            query=x.name,
        ),
        expected=observed(before.reply) if before.reply else "",
        observed=observed(x.reply) if x.reply else "",
        at=(*places_of(before), *places_of(refused), *places_of(x)),
    )


def _fields(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


# 4.2 and 4.4


@rule("4.2/3", on=Exchange, names=("set_password",))
def wrong_old_password(x: Exchange, robot: RobotState) -> RuleResult | None:
    """With a wrong old password the change is answered "0" (L140; A-4.2-1)."""
    known = robot.history.passwords
    if (
        x.accepted is None
        or x.request_value is None
        or len(known) != 1
        or x.request_value.old in known
    ):
        return None
    if not x.accepted:
        return PASSED
    return failed(
        "a new password was accepted with a wrong old password", expected="0", observed="1"
    )


@rule("4.2/4", on=Exchange, names=("login",))
def new_password_opens(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" the new password opens the next login, and the old one does not (L123).

    A controller may refuse further clients (A-2-2), so that a refusal alone proves nothing.
    """
    setting = in_force("set_password", x, robot)
    if setting is None or x.accepted is None or setting.request_value is None:
        return None
    old, new = setting.request_value
    if x.request_value not in (old, new) or old == new:
        return None
    opens = x.request_value == new
    if x.accepted is opens:
        return PASSED
    at = (*places_of(setting), *places_of(x))
    if opens:
        message = "the new password was refused although 0x03 was answered 1"
        return None if _others(x, robot) else inconclusive(message)._replace(places=at)
    message = "the old password still opens a login although 0x03 was answered 1"
    return failed(message, expected="0", observed="1", at=at)


@rule("4.2/2", "4.2/5", on=Exchange, names=("login",))
def refused_password(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "0" the new password opens no login (L123, L133)."""
    refused = robot.history.last("set_password", before_ns=x.time_ns)
    if refused is None or refused.accepted is not False or not refused.request_value:
        return None
    old, new = refused.request_value
    last = robot.history.last_requests.get("set_password") is refused.request
    unknown = old == new or new in robot.history.passwords
    if not x.accepted or not last or unknown or x.time_ns - refused.time_ns > MAX_UNSEEN_NS:
        return None
    if x.request_value != new:
        return PASSED if x.request_value == old else None
    return failed(
        "the new password opens a login although 0x03 was answered 0",
        expected="0",
        observed="1",
        at=(*places_of(refused), *places_of(x)),
    )


def _others(x: Exchange, robot: RobotState) -> set[str]:
    return robot.sessions - {x.request.place.connection}


@rule("4.4/3", on=Exchange, names=("set_network",))
def reply_before_the_change(x: Exchange, _: RobotState) -> RuleResult | None:
    """The reply is sent before the new address interrupts the connection (A-4.4-1)."""
    if x.accepted:
        return PASSED
    if x.reply or x.ending is not Ending.HUNG_UP:
        return None
    return tolerated("A-4.4-1", "no reply", "the connection was closed without a reply to 0x05")


@rule("4.4/4", on=Exchange, names=("get_network",))
def network_reads_back(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" 0x04 returns the new values (L157); padding zeros do not matter (A-4.3-2)."""
    return _read_back(
        "set_network", x, robot, lambda setting, answer: setting.request_value == answer
    )


# 4.13


@rule("4.13/3", on=Exchange, names=("get_default_program",))
def default_reads_back(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" the default program is the requested one (L279, L272).

    There may be none if a program was deleted since.
    """
    setting = in_force("set_default_program", x, robot)
    deletion = robot.history.last_requests.get("delete_program")
    if setting is None or (deletion and deletion.place.time_ns >= setting.time_ns):
        return None
    if _may_be_unknown_opcode(x, robot, since_ns=setting.time_ns):
        message = UserMessage(
            "0x{opcode:02X} was answered with 0; the controller may not support this opcode",
            opcode=x.request.frame.opcode,
        )
        return tolerated("on_unknown", "0", message)
    return _read_back(
        "set_default_program", x, robot, lambda setting, answer: setting.request_value == answer
    )


def _may_be_unknown_opcode(x: Exchange, robot: RobotState, since_ns: int) -> bool:
    """Whether "0" may mean that the controller does not support this opcode (A-4.12-1).

    This opcode never returned a program name. The controller supports at least one of the two
    opcodes: if the other one was also answered "0" since then, this one is supported.
    """
    if x.reply is None or x.reply.frame.data != b"0":
        return False
    answered = [y for y in robot.history.recent.get(x.name, ()) if y.reply]
    same = [y for y in answered if y.request.frame.opcode == x.request.frame.opcode]
    others = [y for y in answered if y not in same and y.time_ns > since_ns]
    named = any(y.reply and y.reply.frame.data != b"0" for y in same)
    return not named and not any(y.reply and y.reply.frame.data == b"0" for y in others)


# 4.20 and 4.21


def _same_numbers(setting: Exchange, answer: Any, count: int) -> bool:
    return read_back(answer[:count], setting.request_value[:count])


@rule("4.20/3", on=Exchange, names=("get_gripper_center",))
def gripper_reads_back(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" 0x34 returns the same numbers (L428, L440; A-4.19-2)."""
    setting = in_force("set_gripper_center", x, robot)
    if setting is None or executed_since(setting.time_ns, robot, PROGRAMS):
        return None
    return _read_back("set_gripper_center", x, robot, lambda s, answer: _same_numbers(s, answer, 3))


@rule("4.21/3", on=Exchange, names=("get_initial_tool_position",))
def position_reads_back(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" 0x37 returns the same x, y, z, thetaX (L452, L464); thetaY and thetaZ are open."""
    setting = in_force("set_initial_tool_position", x, robot)
    if setting is None or executed_since(setting.time_ns, robot, PROGRAMS):
        return None
    return _read_back(
        "set_initial_tool_position", x, robot, lambda s, answer: _same_numbers(s, answer, 4)
    )


@rule("4.21/3", on=Exchange, names=("get_gripper_center",))
def gripper_stays(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Setting the initial position does not change the reply to 0x34."""
    setting = in_force("set_initial_tool_position", x, robot)
    if setting is None or x.reply_value is None:
        return None
    before = robot.history.last("get_gripper_center", before_ns=setting.time_ns)
    changed = robot.history.last_requests.get("set_gripper_center")
    if before is None or (changed and changed.place.time_ns >= before.time_ns):
        return None
    if executed_since(before.time_ns, robot, PROGRAMS) or switched_off_since(before, robot):
        return None
    if before.reply_value == x.reply_value:
        return PASSED
    return failed(
        "setting the initial tool position changed the gripper centre",
        expected=observed(before.reply) if before.reply else "",
        observed=observed(x.reply) if x.reply else "",
        at=(*places_of(before), *places_of(setting), *places_of(x)),
    )
