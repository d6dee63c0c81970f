"""The form of each command's payloads: a table for requirements that several clauses share.

The modules of the clauses judge the meaning of the values.
"""

from collections.abc import Collection
from functools import partial
from typing import Final

from scaraspec.judge.rules.diagnosis import Fault, diagnose
from scaraspec.judge.rules.flag import one_flag
from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, payload_of, rule
from scaraspec.judge.rules.text import observed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import Defect, Diagnostics, Number, show
from scaraspec.protocol.payloads import normalize
from scaraspec.traffic.events import Exchange, FrameSeen, InvalidBytes
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_EMPTY_REQUEST: Final = {
    "get_network": "4.3/1",
    "get_time": "4.6/1",
    "get_version": "4.7/1",
    "get_running_program": "4.9/1",
    "list_programs": "4.10/1",
    "get_motor_temperatures": "4.14/1",
    "emergency_stop": "4.17/1",
    "reset": "4.18/1",
    "get_gripper_center": "4.19/1",
    "get_initial_tool_position": "4.22/1",
    "get_tool_coordinates": "4.23/1",
    "release_joints": "4.25/1",
    "lock_joints": "4.26/1",
    "get_joint_angles": "4.27/1",
    "get_digital_inputs": "4.31/1",
    "get_digital_outputs": "4.34/1",
    "shutdown": "4.35/1",
}
"""Commands whose request has length 0, with the requirement."""

_COUNT: Final = (Defect.FIELD_COUNT, Defect.SPACE_FOR_BAR, Defect.SIZE)
_NUMBERS: Final = (*_COUNT, Defect.NUMBER)
_REASON: Final = (Defect.FLAG, Defect.FIELD_COUNT, Defect.SPACE_FOR_BAR)
_OF_THE_TEXT: Final = frozenset({Defect.TRAILING_NUL, Defect.QUOTES, Defect.BINARY})
"""Defects of the encoding, which T/2 to T/4 judge."""

_REQUEST: Final = {
    "4.2/1": ("set_password", _COUNT),
    "4.4/1": ("set_network", (*_COUNT, Defect.ADDRESS)),
    "4.5/1": ("set_time", (Defect.CLOCK,)),
    "4.5/2": ("set_time", (Defect.CALENDAR,)),
    "4.11/1": ("delete_program", (Defect.EMPTY_NAME,)),
    "4.13/1": ("set_default_program", (Defect.EMPTY_NAME,)),
    "4.15/1": ("run_program", (Defect.EMPTY_NAME,)),
    "4.16/1": ("simulate_program", (Defect.EMPTY_NAME,)),
    "4.20/1": ("set_gripper_center", _NUMBERS),
    "4.21/1": ("set_initial_tool_position", _NUMBERS),
    "4.28/1": ("jog", (Defect.SIZE,)),
    "4.32/1": ("set_digital_output", _NUMBERS),
}
"""Requirements on a request's form: its command, and the defects that violate it."""

_REPLY: Final = {
    "4.3/2": ("get_network", _COUNT),
    "4.3/3": ("get_network", (Defect.ADDRESS,)),
    "4.6/2": ("get_time", (Defect.CLOCK,)),
    "4.6/3": ("get_time", (Defect.CALENDAR,)),
    "4.7/2": ("get_version", (Defect.SIZE,)),
    "4.9/3": ("get_running_program", (Defect.RUN_TIME,)),
    "4.10/2": ("list_programs", (Defect.FLAG,)),
    "4.10/3": ("list_programs", (Defect.SPACE_FOR_BAR,)),
    "4.12/3": ("get_default_program", (Defect.BAR_IN_NAME,)),
    "4.14/2": ("get_motor_temperatures", _NUMBERS),
    "4.16/2": ("simulate_program", _REASON),
    "4.19/2": ("get_gripper_center", _NUMBERS),
    "4.22/2": ("get_initial_tool_position", _NUMBERS),
    "4.23/2": ("get_tool_coordinates", _NUMBERS),
    "4.25/2": ("release_joints", _REASON),
    "4.26/2": ("lock_joints", _REASON),
    "4.27/2": ("get_joint_angles", _NUMBERS),
    "4.28/4": ("jog", _REASON),
    "4.31/2": ("get_digital_inputs", (*_REASON, Defect.BITS)),
    "4.33/2": ("get_analog_input", (*_REASON, Defect.NUMBER)),
    "4.34/2": ("get_digital_outputs", (*_REASON, Defect.BITS)),
}
"""Requirements on a first reply's form: its command, and the defects that violate it."""

_FLAG_REPLY: Final = {
    "set_password": "4.2/2",
    "set_network": "4.4/2",
    "set_time": "4.5/3",
    "delete_program": "4.11/2",
    "set_default_program": "4.13/2",
    "set_gripper_center": "4.20/2",
    "set_initial_tool_position": "4.21/2",
    "set_digital_output": "4.32/4",
}
"""Commands with the reply "1" or "0", with the requirement."""

_REPLY_LENGTH: Final = {
    "get_network": "4.3/4",
    "get_running_program": "4.9/9",
    "list_programs": "4.10/9",
    "get_initial_tool_position": "4.21/6",
    "get_tool_coordinates": "4.21/6",
    "set_tool_coordinates": "4.24/4",
    "get_joint_angles": "4.27/3",
    "get_digital_inputs": "4.31/4",
    "get_digital_outputs": "4.34/4",
}
"""Replies that the document prints with a wrong length (section 11 of the register)."""

_SET_POSITION: Final = 0x36
_PORT_DIGITS: Final = 2
_SPEED_DIGITS: Final = 9  # with leading zeros; more digits are invalid
_MOVE: Final = ("set_tool_coordinates",)
_NUMBER: Final = Number("a field")


def _empty_request(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The request has length 0."""
    if not seen.frame.data:
        return PASSED
    return failed("the request carries data", expected="length 0", observed=observed(seen))


def _form(
    seen: FrameSeen, _: RobotState, *, part: str, defects: Collection[Defect]
) -> RuleResult | None:
    """Fail if the payload has one of these defects."""
    if not seen.parsed or seen.parsed.part != part:
        return None
    payload, decoded = payload_of(seen), seen.parsed.decoded
    for issue in decoded.issues:
        if issue.defect in defects:
            form = payload.form if payload else ""
            return failed(issue.text, expected=form, observed=observed(seen))
    readable = all(issue.defect not in _OF_THE_TEXT for issue in decoded.issues)
    return PASSED if readable else None


@rule("4.24/1", on=FrameSeen, names=_MOVE, sender=A2C)
def seven_numbers(seen: FrameSeen, robot: RobotState) -> RuleResult | None:
    """The request contains seven numbers (L483-486); 4.24/2 requires the first to be an integer."""
    result = _form(seen, robot, part="request", defects=_COUNT)
    diagnostics = Diagnostics()
    texts = normalize(seen.frame.data, Diagnostics()).removesuffix(b"|").split(b"|")  # A-T-4
    for text in texts if result is PASSED else ():
        _NUMBER.read(text.strip(b" "), diagnostics)
    if not diagnostics.issues:
        return result
    return failed(diagnostics.issues[0].text, expected="seven numbers", observed=observed(seen))


@rule("4.24/2", on=FrameSeen, names=_MOVE, sender=A2C)
def speed_in_percent(seen: FrameSeen, robot: RobotState) -> RuleResult | None:
    """Speed is an integer percentage, 1 to 100 (L488; A-4.24-4)."""
    if _form(seen, robot, part="request", defects=_COUNT) is not PASSED:
        return None
    text = normalize(seen.frame.data, Diagnostics()).split(b"|")[0]
    if text.isdigit() and len(text) <= _SPEED_DIGITS and 1 <= int(text) <= 100:  # noqa: PLR2004 - percent
        return PASSED
    return failed(
        UserMessage("the speed is {speed!r}", speed=show(text)),
        expected="an integer, 1 to 100",
        observed=show(text),
    )


def _real_length(x: Exchange, _: RobotState) -> RuleResult | None:
    """The reply's length is its real number of bytes."""
    if x.reply:
        return PASSED
    return _wrong_length(x.malformed) if x.malformed else None


@rule("4.18/5", on=Exchange, names=("reset",))
def length_of_a_failure(x: Exchange, _: RobotState) -> RuleResult | None:
    """A failed reset's length is its real number of bytes: 5, not the printed 4 (A-4.18-1)."""
    return _wrong_length(x.malformed) if x.accepted and x.malformed else None


def _wrong_length(found: InvalidBytes) -> RuleResult | None:
    diagnosis = diagnose(found)
    if diagnosis.fault is not Fault.LENGTH:
        return None
    message = "the length is not the number of data bytes"
    if diagnosis.hint:
        message = UserMessage("{problem} ({hint})", problem=message, hint=diagnosis.hint)
    return failed(
        message,
        expected=diagnosis.expected,
        observed=diagnosis.observed,
        at=(found.place,),
    )


@rule("4.21/6", on=FrameSeen, names=("set_initial_tool_position",), sender=A2C)
def length_of_a_position(_seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A valid frame has its real length: 23 for the documented text (L450)."""
    return PASSED


@rule("4.21/6", on=InvalidBytes, sender=A2C)
def wrong_length_of_a_position(found: InvalidBytes, _: RobotState) -> RuleResult | None:
    """The length is not the number of data bytes, such as the printed 25 (A-4.21-1)."""
    return _wrong_length(found) if found.data[1:2] == bytes((_SET_POSITION,)) else None


@rule("4.33/1", on=FrameSeen, names=("get_analog_input",), sender=A2C)
def port_in_two_characters(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The request is the port number in two characters (L667-670; A-4.32-1)."""
    text = seen.text
    if len(text) == _PORT_DIGITS and text.isdigit():
        return PASSED
    return failed("the port is not two digits", expected="two digits", observed=observed(seen))


for _name, _requirement in _EMPTY_REQUEST.items():
    rule(_requirement, on=FrameSeen, names=(_name,), sender=A2C)(_empty_request)
for _part, _table in (("request", _REQUEST), ("reply", _REPLY)):
    for _requirement, (_name, _defects) in _table.items():
        rule(_requirement, on=FrameSeen, names=(_name,))(
            partial(_form, part=_part, defects=frozenset(_defects))
        )
for _name, _requirement in _FLAG_REPLY.items():
    rule(_requirement, on=Exchange, names=(_name,))(one_flag)
for _name, _requirement in _REPLY_LENGTH.items():
    rule(_requirement, on=Exchange, names=(_name,), by_bytes=True)(_real_length)
