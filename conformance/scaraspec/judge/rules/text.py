"""The text conventions T/1 to T/7, for every payload that the command table can decode."""

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, payload_of, rule, tolerated
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import Defect, Diagnostics, Number, StatusCode, show
from scaraspec.protocol.payloads import (
    Acceptance,
    FinalResult,
    FirstReply,
    NameList,
    NoData,
    OptionalRecord,
    Outcome,
    Payload,
    normalize,
)
from scaraspec.protocol.redaction import is_secret
from scaraspec.protocol.transfer import FileData
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage


def observed(seen: FrameSeen) -> str:
    """Return the payload's text as evidence; passwords are never shown."""
    if is_secret(seen.frame):
        return UserMessage("{count} bytes", count=len(seen.frame.data))
    return show(seen.frame.data)


def _is_text(payload: Payload) -> bool:
    return not isinstance(payload, NoData | FileData)


def _has_bars(payload: Payload) -> bool:
    has_bars = isinstance(payload, OptionalRecord | NameList | FirstReply | FinalResult)
    return has_bars or len(payload.fields) > 1


def _has_numbers(payload: Payload) -> bool:
    return any(isinstance(field, Number) for field in payload.fields)


def _is_opaque(payload: Payload) -> bool:
    return any(field.opaque for field in payload.fields)


def has_codes(payload: Payload) -> bool:
    """Whether it may contain a code of table 8-1."""
    status = any(isinstance(field, StatusCode) for field in payload.fields)
    return status or isinstance(payload, FirstReply | FinalResult)


def _first_issue(seen: FrameSeen, *defects: Defect) -> str:
    """Return the first issue with one of these defects; empty if there is none."""
    if not seen.parsed or not seen.parsed.decoded.issues:
        return ""
    return next((c.text for c in seen.parsed.decoded.issues if c.defect in defects), "")


def _without(seen: FrameSeen, *defects: Defect) -> RuleResult:
    """Pass if no issue has one of these defects."""
    text = _first_issue(seen, *defects)
    return _broken(seen, text) if text else PASSED


def _broken(seen: FrameSeen, text: str) -> RuleResult:
    payload = payload_of(seen)
    return failed(text, expected=payload.form if payload else "", observed=observed(seen))


@rule("T/1", on=FrameSeen, payload=_has_bars)
def bars(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Fields are separated by one bar (L125, L150, L226)."""
    data = seen.frame.data
    defects = [Defect.SPACE_FOR_BAR, Defect.BLANKS]
    # If single bars separate the fields, another requirement judges their number.
    if b"||" in data or b"|" not in data:
        defects.append(Defect.FIELD_COUNT)
    return _without(seen, *defects)


@rule("T/2", on=FrameSeen, payload=_is_text)
def quotes(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """The examples' quotation marks are not sent (A-0-3)."""
    return _without(seen, Defect.QUOTES)


@rule("T/3", on=FrameSeen, payload=_is_text)
def ascii_digits(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Flags and digits are ASCII; in 0x0A, printed without quotes, binary is tolerated (A-T-1)."""
    if seen.name == "get_running_program" and seen.parsed:
        readings = dict(seen.parsed.decoded.readings)
        if readings.get("runinfo_binary") == "binary":
            return tolerated("runinfo_binary", "binary", "the flag of 0x0A is a binary byte")
    return _without(seen, Defect.BINARY)


@rule("T/4", on=FrameSeen, payload=_is_text)
def no_trailer(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """No NUL and no bar ends a text (A-T-3, A-T-4)."""
    text = _first_issue(seen, Defect.TRAILING_NUL)
    if text:
        return tolerated("trailing_nul", "yes", text)
    text = _first_issue(seen, Defect.TRAILING_BAR)
    return tolerated("A-T-4", "trailing bar", text) if text else PASSED


@rule("T/5", on=FrameSeen, payload=_has_numbers)
def plain_numbers(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Numbers are plain decimal text (A-T-5); the clauses judge whether one must be an integer."""
    if not _first_issue(seen, Defect.NUMBER):
        return PASSED if seen.value is not None else None
    payload = payload_of(seen)
    assert payload
    texts = normalize(seen.frame.data, Diagnostics()).split(b"|")[
        isinstance(payload, OptionalRecord) :
    ]
    diagnostics = Diagnostics()
    for field, text in zip(payload.fields, texts, strict=False):
        if isinstance(field, Number):
            field.read(text.strip(b" "), diagnostics)
    return _broken(seen, diagnostics.issues[0].text) if diagnostics.issues else PASSED


@rule("T/6", on=FrameSeen, sender=A2C, payload=_is_opaque)
def no_bar_in_names(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Names and passwords of the client contain no bar (A-T-6); a pair may end in one (A-T-4)."""
    payload, data = payload_of(seen), seen.text
    if payload and len(payload.fields) > 1:
        data = data.removesuffix(b"|")
    if payload and data.count(b"|") >= len(payload.fields):
        return _broken(seen, "a name or a password contains the separator '|'")
    return PASSED


@rule("T/7", on=FrameSeen, sender=C2A, payload=has_codes)
def codes(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Codes are two characters of table 8-1 (L1014)."""
    result, value = _without(seen, Defect.CODE), seen.value
    without = isinstance(value, Acceptance | Outcome) and value.code is None
    return None if result is PASSED and without else result
