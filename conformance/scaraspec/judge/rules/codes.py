"""Clause 8: codes are text, and codes of table 8-1. Other modules judge their meaning."""

from typing import Final

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, rule, tolerated
from scaraspec.judge.rules.text import has_codes, observed
from scaraspec.protocol import errors
from scaraspec.protocol.direction import C2A
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_CODE_BYTES: Final = 2


def _code(seen: FrameSeen) -> bytes | None:
    """Return the bytes at the position of a code; None if the payload has no code."""
    data = seen.text or seen.frame.data
    if seen.name == "get_status":
        return data
    prefix = b"00" if seen.frame.tagged else b"0"
    rest = data.removeprefix(prefix)
    return rest[1:] if data.startswith(prefix) and len(rest) > 1 else None


@rule("8/1", on=FrameSeen, sender=C2A, payload=has_codes)
def code_is_text(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Codes are strings (L1014), not numbers in a byte."""
    code = _code(seen)
    if code is None:
        return None
    if code and all(0x20 <= byte < 0x7F for byte in code):  # noqa: PLR2004 - printable ASCII
        return PASSED
    return failed("a code is not text", expected="two characters", observed=code.hex(" "))


@rule("8/2", on=FrameSeen, sender=C2A, payload=has_codes)
def code_of_the_table(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Only codes of table 8-1 are used (L1017-1044); T/7 requires two characters."""
    code = _code(seen)
    if code is None or len(code) != _CODE_BYTES or not code.isalnum():
        return None
    if known := errors.lookup(code.decode("ascii")):
        if code.decode("ascii") == known.text:
            return PASSED
        return tolerated("A-T-7", "lower case", "a code was sent in lower case")
    return failed(
        "table 8-1 does not contain the code",
        expected="a code of the table",
        observed=observed(seen),
    )


@rule("8/3", on=FrameSeen, sender=C2A, payload=has_codes)
def no_reserved_code(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Reserved codes are not sent (L1024-1028; A-8-3)."""
    code = errors.lookup((_code(seen) or b"").decode("latin-1"))
    if code is None:
        return None
    if code not in errors.RESERVED:
        return PASSED
    return tolerated(
        "A-8-3",
        code.text,
        UserMessage("the reserved code {code} was sent", code=code.text),
    )
