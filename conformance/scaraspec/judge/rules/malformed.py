"""Malformed requests and chunks: the receiver must not accept them.

The sender's violation is judged in the module of the clause.
"""

import re
from functools import lru_cache, partial
from typing import Final

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, places_of, rule
from scaraspec.judge.rules.text import observed
from scaraspec.protocol.fields import Defect, Diagnostics, show
from scaraspec.protocol.payloads import normalize
from scaraspec.protocol.program_files import ProgramDefect, lint
from scaraspec.protocol.program_files.layout import MAGIC
from scaraspec.protocol.program_files.lint import INVALID_PROGRAM_CODES
from scaraspec.protocol.transfer import BUFFER_BYTES
from scaraspec.traffic.events import Exchange, Transfer
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.transfers import REFUSED_NAME
from scaraspec.user_message import UserMessage

_FIELDS: Final = {
    "set_gripper_center": "4.20/4",
    "set_initial_tool_position": "4.21/4",
    "set_tool_coordinates": "4.24/10",
}
"""Requests that consist of numbers, with the requirement."""
_IMPOSSIBLE: Final = {
    "set_network": ("4.4/5", Defect.ADDRESS),
    "set_time": ("4.5/5", Defect.CLOCK),
}
"""Requests with values that cannot exist, with the requirement."""
_LENIENT_NUMBER: Final = re.compile(rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")
"""More than the plain numbers of A-T-5: a receiver may accept it."""
_PORTS: Final = 40
_INVALID: Final = INVALID_PROGRAM_CODES | {defect.code for defect in ProgramDefect}


def _refused(x: Exchange, what: str) -> RuleResult | None:
    """Return the result for a request that must not be accepted."""
    if x.accepted is None:
        return None
    if not x.accepted:
        return PASSED
    return failed(
        UserMessage("{command} was accepted although {what}", command=x.name, what=what),
        expected="0",
        observed="1",
        at=places_of(x),
    )


def _numbers(x: Exchange, _: RobotState) -> RuleResult | None:
    """A request with another number of fields, or a field that is no number, is not accepted."""
    issues = x.request.parsed.decoded.issues if x.request.parsed else ()
    if any(issue.defect is Defect.FIELD_COUNT for issue in issues):
        return _refused(x, "it has a wrong number of fields")
    if not any(issue.defect is Defect.NUMBER for issue in issues):
        return None
    fields = normalize(x.request.frame.data, Diagnostics()).split(b"|")
    wrong = next((f for f in fields if not _LENIENT_NUMBER.fullmatch(f.strip(b" "))), None)
    return (
        None
        if wrong is None
        else _refused(x, UserMessage("{wrong!r} is not a number", wrong=show(wrong)))
    )


for _name, _requirement in _FIELDS.items():
    rule(_requirement, on=Exchange, names=(_name,))(_numbers)


def _possible(x: Exchange, _: RobotState, *, defect: Defect) -> RuleResult | None:
    """An address or a time that cannot exist is not accepted (A-4.4-2, A-4.5-2)."""
    issues = x.request.parsed.decoded.issues if x.request.parsed else ()
    text = next((i.text for i in issues if i.defect in (defect, Defect.CALENDAR)), None)
    leap_second = defect is Defect.CLOCK and x.request.text[-2:] == b"60"
    return None if text is None or leap_second else _refused(x, text)


for _name, (_requirement, _defect) in _IMPOSSIBLE.items():
    rule(_requirement, on=Exchange, names=(_name,))(partial(_possible, defect=_defect))


@rule("4.28/7", on=Exchange, names=("jog",))
def jog_direction_exists(x: Exchange, _: RobotState) -> RuleResult | None:
    """A direction outside 1 to 4 is not accepted (L605-608)."""
    if len(x.request.frame.data) != 1 or x.request_value is not None:
        return None
    return _refused(x, UserMessage("{value} is no direction", value=observed(x.request)))


@rule("4.32/5", on=Exchange, names=("set_digital_output",))
def port_exists(x: Exchange, _: RobotState) -> RuleResult | None:
    """Port 0 and the ports above 40 do not exist (L655, L850; A-4.32-2)."""
    if x.request_value is None or 1 <= x.request_value.port <= _PORTS:
        return None
    return _refused(x, UserMessage("port {port} does not exist", port=x.request_value.port))


# Chunks


@rule("5.2/10", on=Exchange, names=("upload_chunk",))
@rule("5.3/13", on=Exchange, names=("download_chunk",))
def chunk_in_bounds(x: Exchange, _: RobotState) -> RuleResult | None:
    """A chunk of more than 200 bytes, or beyond the end of the file, is refused (A-5-6)."""
    if x.chunk is None or x.error_signal:
        return None
    if x.chunk.length > BUFFER_BYTES:
        return _refused(x, UserMessage("its length is {length}", length=x.chunk.length))
    if x.chunk.position + x.chunk.length > x.chunk.file_size:
        return _refused(x, "it reaches beyond the end of the file")
    return None


@rule("5.2/11", on=Exchange, names=("upload_chunk",))
def chunk_has_a_name(x: Exchange, _: RobotState) -> RuleResult | None:
    """Content without an accepted file name before it is not accepted (L712)."""
    before = x.previous_transfer
    if x.transfer or (before and before.reason != REFUSED_NAME):
        return None
    return _refused(x, "no file name was accepted before it")


# Programs


@rule("6.5/28", on=Exchange, names=("run_program",))
def invalid_program_is_not_done(x: Exchange, robot: RobotState) -> RuleResult | None:
    """An uploaded file that clause 6 does not allow is never reported as done (A-4.15-2)."""
    stored = robot.files.get(x.request.text)
    defect = _defect_of(stored) if stored and stored.whole_content else ""
    if not defect or x.accepted is None or (x.accepted and not x.outcome):
        return None
    if not x.accepted or (x.outcome and not x.outcome.done):
        return PASSED
    return failed(
        UserMessage(
            "{program} was run with success although it is no valid program: {defect}",
            program=show(x.request.text),
            defect=defect,
        ),
        expected="a refusal or a failure",
        observed="11",
        at=(*(places_of(stored) if stored else ()), *places_of(x)),
    )


@lru_cache(maxsize=16)
def _defect_of(transfer: Transfer) -> str:
    content = bytes(transfer.content)
    if not content.startswith(MAGIC):
        return "it does not begin with SCARA"
    return next((f.message for f in lint(content) if f.code in _INVALID), "")
