"""Clause 4.8: the robot's status, compared with what executes."""

from functools import partial
from typing import Final

from scaraspec.judge.rules.busy import STATE_OF, never_idle_while_executing
from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, inconclusive, rule, tolerated
from scaraspec.judge.rules.two_stage import TWO_STAGE
from scaraspec.protocol import errors
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import show
from scaraspec.traffic.events import Ending, Exchange, FrameSeen
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_STATUS: Final = ("get_status",)
_MOMENT_NS: Final = 1_000_000_000
"""Within this time no client that is not recorded can begin and end a command."""
_REQUIREMENT_OF: Final = {"01": "4.8/4", "02": "4.8/5", "03": "4.8/6", "04": "4.8/7"}
"""The requirement for each status code (L1018-1021)."""


@rule("4.8/1", on=FrameSeen, names=_STATUS, sender=A2C)
def request_is_empty(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The request has length 0 (L209-212)."""
    if not seen.frame.data:
        return PASSED
    return failed(
        "a status request carries data", expected="no data", observed=show(seen.frame.data)
    )


@rule("4.8/2", on=Exchange, names=_STATUS, by_bytes=True)
def one_code(x: Exchange, _: RobotState) -> RuleResult | None:
    """The reply is exactly one two-character code of table 8-1 (L214-217)."""
    if not x.reply:
        return None
    if x.reply_value is not None:
        return PASSED
    text = show(x.reply.frame.data)
    return failed("the status is not a code of table 8-1", expected="two characters", observed=text)


@rule("4.8/3", on=Exchange, names=_STATUS)
def idle(x: Exchange, robot: RobotState) -> RuleResult | None:
    """An idle robot reports 00 (L1017). Another status may have a command that is missing."""
    return PASSED if x.reply_value == "00" and not robot.executing else None


@rule("4.8/3", on=Exchange, names=_STATUS)
def idle_between(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot that is idle before and after, and executed nothing, is idle between (L1017).

    A final result does not suffice: the status may follow it late, which 4/7 judges.
    """
    first = robot.history.idle_status_ns
    if x.reply_value != "00" or robot.executing or robot.transferring:
        return None
    if not 0 <= x.time_ns - first <= _MOMENT_NS or any(
        request.place.time_ns > first - _MOMENT_NS
        for name, request in robot.history.last_requests.items()
        if name in TWO_STAGE
    ):
        return None
    for y in robot.history.between("get_status", first, x.time_ns):
        if y.reply_value in STATE_OF.values():
            return failed(
                UserMessage(
                    "the status is {status} between two statuses 00, and nothing executed",
                    status=y.reply_value,
                ),
                expected="00",
                observed=y.reply_value,
                at=(*(seen.place for seen in y.frames), *(seen.place for seen in x.frames)),
            )
    return None


def _state(x: Exchange, robot: RobotState, *, name: str) -> RuleResult | None:
    """A status reported while only this command executed; a fault may take precedence (A-4.8-2).

    A status 00 is judged at the end of the command: without a final result it may be correct.
    """
    if (
        x.concurrent_uncertain
        or [y.name for y in x.concurrent] != [name]
        or x.reply_value in (None, "00")
    ):
        return None
    executing, expected, code = x.concurrent[0], STATE_OF[name], errors.TABLE_8_1[x.reply_value]
    if code.text == expected or code.kind is errors.Kind.FAULT:
        return PASSED
    if executing.request.place.connection != x.request.place.connection:
        return None  # the two may have been captured in another order
    if x.time_ns - answered_ns(executing) < robot.status_lag_ns:
        return None  # it may be the status from before the command (A-4.8-3)
    return failed(
        UserMessage(
            "the status is {code} ({meaning}) while {command} executes",
            code=code.text,
            meaning=code.meaning,
            command=name,
        ),
        expected=expected,
        observed=code.text,
        at=(executing.request.place, *(seen.place for seen in x.frames)),
    )


for _name, _code in STATE_OF.items():
    _requirement = _REQUIREMENT_OF[_code]
    rule(_requirement, on=Exchange, names=_STATUS)(partial(_state, name=_name))
    rule(_requirement, on=Exchange, names=(_name,))(never_idle_while_executing)


@rule("4.8/8", on=Exchange, names=_STATUS, by_bytes=True)
def fault_code(x: Exchange, _: RobotState) -> RuleResult | None:
    """With a fault present the status is the fault's code (L1022-1043)."""
    code = errors.lookup(x.reply_value) if x.reply_value else None
    return PASSED if code and code.kind is errors.Kind.FAULT else None


@rule("4.8/9", on=Exchange, names=_STATUS, by_bytes=True)
def status_is_a_state(x: Exchange, _: RobotState) -> RuleResult | None:
    """Reserved codes and 20 are no states (L1024-1028; A-8-3)."""
    code = errors.lookup(x.reply_value) if x.reply_value else None
    if code is None or code in errors.STATES:
        return PASSED if code else None
    return tolerated(
        "A-8-3",
        code.text,
        UserMessage("the status is {code}, which is not a robot state", code=code.text),
    )


@rule("4.8/10", on=Exchange, names=_STATUS, by_bytes=True)
def served_while_executing(x: Exchange, _: RobotState) -> RuleResult | None:
    """The status is answered while a two-stage command executes (A-4-3)."""
    if not x.concurrent:
        return None
    if x.reply:
        return PASSED
    if x.ending is not Ending.UNANSWERED:
        return None
    if not x.certain or not x.overtaken:
        return inconclusive(
            "the status was not answered while the robot was busy, or the reply is in a gap"
        )
    return tolerated("A-4-3", "not served", "the status was not answered while the robot was busy")
