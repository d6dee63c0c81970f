"""Values of simple queries: version (4.7), default program (4.12) and temperatures (4.14)."""

from typing import Final

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, places_of, rule, tolerated
from scaraspec.judge.rules.text import observed
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import Defect
from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_VERSION: Final = ("get_version",)
_DEFAULT: Final = ("get_default_program",)
_TEMPERATURES: Final = ("get_motor_temperatures",)
_COLDEST_C, _HOTTEST_C = -20, 120


@rule("4.7/3", on=FrameSeen, names=_VERSION, sender=C2A)
def dotted_version(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The version has the form digits.digits.digits (L203; A-4.7-1)."""
    if not seen.parsed or not seen.frame.data:
        return None
    if all(c.defect is not Defect.VERSION for c in seen.parsed.decoded.issues):
        return PASSED
    return tolerated(
        "A-4.7-1", "free text", UserMessage("the version is {version}", version=observed(seen))
    )


@rule("4.7/4", on=Exchange, names=_VERSION)
def constant_version(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The version does not change within a session (L203)."""
    before = robot.history.last(x.name, before_ns=x.time_ns)
    if before is None or before.reply_value is None or x.reply_value is None:
        return None
    if before.request.place.connection != x.request.place.connection:
        return None
    if before.reply_value == x.reply_value:
        return PASSED
    return failed(
        "the version changed within a session",
        expected=before.reply_value,
        observed=x.reply_value,
        at=(*places_of(before), *places_of(x)),
    )


@rule("4.12/1", on=FrameSeen, names=_DEFAULT, sender=A2C)
def default_is_requested(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The request is 0x0D or 0x13, without data (L265-270; A-4.12-1)."""
    if seen.frame.data:
        return failed("the request carries data", expected="length 0", observed=observed(seen))
    if seen.frame.opcode == BY_NAME["get_default_program"].opcode:
        return PASSED
    return tolerated("op_get_default", "0x13", "the default program was requested with 0x13")


@rule("4.12/2", on=Exchange, names=_DEFAULT, by_bytes=True)
def default_has_its_opcode(x: Exchange, _: RobotState) -> RuleResult | None:
    """The reply carries the opcode of the request (L272-275; A-4.12-1)."""
    if not x.reply:
        return None
    requested, replied = x.request.frame.opcode, x.reply.frame.opcode
    if requested == replied:
        return PASSED
    return failed(
        "the reply has the alternate opcode of the command",
        expected=f"{requested:02X}",
        observed=f"{replied:02X}",
    )


@rule("4.12/4", on=FrameSeen, names=_DEFAULT, sender=C2A)
def no_default(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Without a default program the reply is empty or "0" (L272; A-4.12-2)."""
    form = dict(seen.parsed.decoded.readings).get("default_none") if seen.parsed else None
    if form is None:
        return None
    return (
        PASSED
        if form == "empty"
        else tolerated("default_none", form, "the reply 0 is used for no default program")
    )


@rule("4.14/3", on=Exchange, names=_TEMPERATURES, by_bytes=True)
def temperatures_have_their_opcode(x: Exchange, _: RobotState) -> RuleResult | None:
    """The reply's opcode is 0x0F; the printed 0x0E is tolerated (L296-302; A-4.14-1)."""
    if not x.reply:
        return None
    if x.reply.frame.opcode == x.request.frame.opcode:
        return PASSED
    return tolerated("op_temp_reply", "0x0E", "the temperatures were answered with 0x0E")


@rule("4.14/5", on=Exchange, names=_TEMPERATURES, by_bytes=True)
def plausible_temperatures(x: Exchange, _: RobotState) -> RuleResult | None:
    """Values are temperatures in degrees Celsius (L299; A-T-8)."""
    if not x.reply_value or not x.reply:
        return None
    if all(_COLDEST_C <= value <= _HOTTEST_C for value in x.reply_value):
        return PASSED
    return failed(
        "a motor temperature is implausible in degrees Celsius",
        expected=UserMessage("{first} to {last}", first=_COLDEST_C, last=_HOTTEST_C),
        observed=observed(x.reply),
    )
