"""Clause 4.17: when an emergency stop is accepted, and how the stopped command ends."""

from typing import Final

from scaraspec.judge.rules.busy import STATE_OF, certainly_executes
from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, places_of, rule, tolerated
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.fields import show
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_STOP: Final = "emergency_stop"
_CONTINUED_NS: Final = 500_000_000
"""A command that continues for this long after a refused stop was still executing at the stop."""


@rule("4.17/2", on=Exchange, names=(_STOP,))
def refusal_is_one_flag(x: Exchange, _: RobotState) -> RuleResult | None:
    """When no stop is needed the reply is "0" (L363-366)."""
    if not x.reply or x.reply.frame.data[:1] != b"0":
        return None
    refusal = x.reply.text
    if refusal == b"0":
        return PASSED
    return tolerated(
        "A-4.17-1", "0|…", UserMessage("the stop was refused with {reply}", reply=show(refusal))
    )


@rule("4.17/3", "4.17/6", on=Exchange, names=(_STOP,))
def stop_is_accepted(x: Exchange, robot: RobotState) -> RuleResult | None:
    """While a command executes the stop is answered "1" (L363-371; A-4.17-1)."""
    moving = [y for y in x.concurrent if y.name in STATE_OF and certainly_executes(y, x, robot)]
    return PASSED if moving and x.accepted else None


@rule("4.17/3", "4.17/6", on=Exchange, names=STATE_OF)
def stop_was_needed(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A stop is needed if the command ends long after the stop was refused."""
    if not x.stop_requested or not x.result:
        return None
    for stop in robot.history.between(_STOP, answered_ns(x), x.result.begun_ns - _CONTINUED_NS):
        if stop.accepted is False:
            return _needed(stop, x)
    return None


@rule("4.17/3", "4.17/6", on=Exchange, names=("get_status",))
def stop_is_still_needed(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A stop is needed if the status still shows the command after the stop was refused."""
    if x.reply_value not in BUSY:
        return None
    for y in x.concurrent:
        for stop in robot.history.between(_STOP, answered_ns(y), x.time_ns):
            if stop.accepted is False and y.name in STATE_OF:
                return _needed(stop, y)
    return None


def _needed(stop: Exchange, y: Exchange) -> RuleResult:
    return failed(
        UserMessage("the stop was refused while {command} executed", command=y.name),
        expected="1",
        observed="0",
        at=(*places_of(y), *places_of(stop)),
    )


@rule("4.17/8", on=Exchange, names=STATE_OF)
def stopped_command_fails(x: Exchange, _: RobotState) -> RuleResult | None:
    """The stopped command's own result is a failure; a jog's may be "11" (A-4.17-4)."""
    if not x.interrupted_by or x.interrupted_by.name != _STOP or not x.outcome or not x.result:
        return None
    if not x.outcome.done or x.name == "jog":
        return PASSED
    return failed(
        UserMessage("{command} ended with 11 although a stop interrupted it", command=x.name),
        expected="00|code",
        observed="11",
        at=(*places_of(x.interrupted_by), x.result.place),
    )
