"""Clauses 4.32 and 4.34: setting digital outputs, and their positions in the reply to 0x49."""

from typing import Final

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, places_of, rule
from scaraspec.judge.rules.settings import (
    MAX_UNSEEN_NS,
    executed_since,
    in_force,
    switched_off_since,
)
from scaraspec.protocol.direction import A2C
from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.exchange_history import KEPT_EXCHANGES, answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_SET: Final = "set_digital_output"
_GET: Final = ("get_digital_outputs",)
OUTPUTS: Final = 16
_CHANGERS: Final = ("run_program", "simulate_program", "emergency_stop", "reset")
"""Commands that may set outputs themselves."""


@rule("4.32/2", on=FrameSeen, names=(_SET,), sender=A2C)
def zero_or_one(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The value is 0 or 1 (L655; A-4.32-4)."""
    if seen.value is None:
        return None
    if seen.value.value in (0, 1):
        return PASSED
    return failed(
        "the value for the digital output is not valid",
        expected="0 or 1",
        observed=str(seen.value.value),
    )


@rule("4.32/3", on=FrameSeen, names=(_SET,), sender=A2C)
def only_outputs(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The client addresses one of the 16 digital outputs that 0x49 reports (L655; A-4.32-3)."""
    if seen.value is None:
        return None
    if 1 <= seen.value.port <= OUTPUTS:
        return PASSED
    return failed(
        "the port is outside the range of the digital outputs",
        expected="1 to 16",
        observed=str(seen.value.port),
    )


def _setting(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the last setting of an output that 0x49 must report; None if uncertain."""
    setting = in_force(_SET, x, robot)
    if setting is None or x.reply_value is None or setting.request_value.port > OUTPUTS:
        return None
    return None if _may_be_off(setting.time_ns, robot) else setting


def _may_be_off(since_ns: int, robot: RobotState) -> bool:
    """Whether outputs may have been switched off since then; even a refused stop may do so."""
    stop = robot.history.last_requests.get("emergency_stop")
    stopped = stop is not None and stop.place.time_ns >= since_ns
    return stopped or executed_since(since_ns, robot, _CHANGERS)


def _with(bits: str, port: int, value: int) -> str:
    """Return the digits with one port set to this value; the rightmost is port 1 (L684)."""
    at = len(bits) - port
    return f"{bits[:at]}{value}{bits[at + 1 :]}"


def _before(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the previous reply if only recorded settings can have changed the outputs since."""
    before = robot.history.last(x.name, before_ns=x.time_ns)
    if before is None or before.reply_value is None or x.time_ns - before.time_ns > MAX_UNSEEN_NS:
        return None
    if switched_off_since(before, robot):
        return None
    return None if _may_be_off(before.time_ns, robot) else before


def _expected_reply(x: Exchange, robot: RobotState) -> str | None:
    """Return the expected reply to 0x49, from the previous reply and the settings since then."""
    before = _before(x, robot)
    if before is None:
        return None
    settings = list(robot.history.between(_SET, answered_ns(before), x.time_ns))
    if len(settings) == KEPT_EXCHANGES:  # older settings may have been dropped
        return None
    if any(_overlap(setting, y) for setting in robot.history.recent[_SET] for y in (before, x)):
        return None
    expected: str = before.reply_value
    for setting in settings:
        if setting.accepted is None or setting.request_value is None:
            return None
        if setting.accepted and 1 <= setting.request_value.port <= OUTPUTS:
            expected = _with(expected, *setting.request_value)
    return expected


def _overlap(x: Exchange, y: Exchange) -> bool:
    """Whether two exchanges are so close that their order of execution is unknown."""
    return x.time_ns <= answered_ns(y) and y.time_ns <= answered_ns(x)


def _shows_mirrored(x: Exchange, setting: Exchange, robot: RobotState) -> bool:
    """Whether the set value is reported as if the leftmost digit were port 1."""
    before, (port, value) = _before(x, robot), setting.request_value
    mirrored = OUTPUTS + 1 - port
    if before is None:
        return bool(value == 1 and x.reply_value[-mirrored] == "1")
    changed = x.reply_value != before.reply_value
    return changed and bool(x.reply_value == _with(before.reply_value, mirrored, value))


@rule("4.32/6", on=Exchange, names=_GET)
def output_shows(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" 0x49 reports the value at that port; no other digit changes (L655, L684)."""
    setting = _setting(x, robot)
    if setting is None:
        return None
    port, value = setting.request_value
    expected = _expected_reply(x, robot)
    if x.reply_value[-port] != str(value):
        if _shows_mirrored(x, setting, robot):
            return None  # 4.34/3 judges it
        message = UserMessage("output {port} does not show the value that was set", port=port)
    elif expected not in (None, x.reply_value):
        message = UserMessage("an output changed that was not set")
    else:
        return PASSED
    return failed(
        message,
        expected=expected or UserMessage("{value} at port {port}", value=value, port=port),
        observed=x.reply_value,
        at=(*places_of(setting), *places_of(x)),
    )


@rule("4.32/4", on=Exchange, names=_GET)
def refused_output_stays(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A setting that was answered "0" does not change its output (L660)."""
    before, refused = _before(x, robot), robot.history.last(_SET, before_ns=x.time_ns)
    if before is None or refused is None or refused.accepted is not False or not x.reply_value:
        return None
    other = robot.history.previous_requests.get(_SET)
    if robot.history.last_requests.get(_SET) is not refused.request:
        return None
    if refused.time_ns <= answered_ns(before) or (other and other.place.time_ns > before.time_ns):
        return None
    if refused.request_value is None or not 1 <= refused.request_value.port <= OUTPUTS:
        return None
    if x.reply_value == before.reply_value:
        return PASSED
    if x.reply_value != _with(before.reply_value, *refused.request_value):
        return None
    return failed(
        UserMessage(
            "the setting of output {port} was refused, but the output changed",
            port=refused.request_value.port,
        ),
        expected=before.reply_value,
        observed=x.reply_value,
        at=(*places_of(before), *places_of(refused), *places_of(x)),
    )


@rule("4.34/3", on=Exchange, names=_GET)
def high_port_first(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The leftmost digit is port 16, the rightmost is port 1 (L684; A-4.34-2)."""
    setting = _setting(x, robot)
    if setting is None:
        return None
    port, value = setting.request_value
    if x.reply_value[-port] == str(value):
        return PASSED if x.reply_value[port - 1] != str(value) else None
    if not _shows_mirrored(x, setting, robot):
        return None
    return failed(
        UserMessage(
            "output {port} is reported as port {reported_port}: the order is reversed",
            port=port,
            reported_port=OUTPUTS + 1 - port,
        ),
        expected=_expected_reply(x, robot)
        or UserMessage("{value} at port {port}", value=value, port=port),
        observed=x.reply_value,
        at=(*places_of(setting), *places_of(x)),
    )
