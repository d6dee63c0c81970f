"""Replies that consist of one flag: a check that several clauses share."""

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed
from scaraspec.judge.rules.text import observed
from scaraspec.protocol.fields import Defect
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_OF_THE_TEXT = (Defect.TRAILING_NUL, Defect.QUOTES, Defect.BINARY)


def one_flag(x: Exchange, _: RobotState) -> RuleResult | None:
    """The answer is "1" or "0" and nothing else; T/2 to T/4 judge its encoding."""
    if not x.reply or not x.reply.parsed:
        return None
    if x.reply.frame.data in (b"0", b"1"):
        return PASSED
    issues = x.reply.parsed.decoded.issues
    if issues and all(c.defect in _OF_THE_TEXT for c in issues):
        return None
    return failed(
        UserMessage("the answer to {command} is not one flag", command=x.name),
        expected="1 or 0",
        observed=observed(x.reply),
    )
