"""Clause 4.1: login."""

from scaraspec.judge.rules.flag import one_flag
from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, rule
from scaraspec.judge.rules.settings import MAX_UNSEEN_NS, new_password_opens
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.redaction import is_masked
from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_LOGIN = ("login",)


@rule("4.1/1", on=FrameSeen, names=_LOGIN, sender=A2C)
def request_has_password(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A login request carries the password as its data (L104-109)."""
    if seen.frame.data:
        return PASSED
    return failed("the login carries no password", expected="a password", observed="no data")


def _is_last_accepted(x: Exchange, robot: RobotState) -> bool | None:
    """Return whether this is the last accepted password, not changed since; None if unknown.

    Whether quotation marks or a NUL make it another password is open (A-0-3, A-T-3).
    """
    before = robot.last.get("login")
    if before is None or not before.accepted:
        return None
    if before.request.frame.data == x.request.frame.data:
        return None if is_masked(x.request.frame.data) else True
    return None if before.request_value == x.request_value else False


@rule("4.1/2", on=Exchange, names=_LOGIN)
def right_password_accepted(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A correct password is answered "1" (L111-114): one that was accepted before is correct.

    A controller may refuse further clients while one is logged in (A-2-2).
    """
    if x.accepted is None:
        return None
    if x.accepted:
        return PASSED
    before = robot.last.get("login")
    if before is None or x.time_ns - before.time_ns > MAX_UNSEEN_NS:
        return None
    others = robot.sessions - {x.request.place.connection}
    if others or not _is_last_accepted(x, robot):
        return None
    return failed(
        "a previously accepted password was refused, although no other was set",
        expected="1",
        observed="0",
    )


@rule("4.1/3", on=Exchange, names=_LOGIN)
def wrong_password_refused(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A wrong password, one that differs from the correct one, is answered "0" (L116-119)."""
    if x.accepted is None:
        return None
    if not x.accepted:
        return PASSED
    if _is_last_accepted(x, robot) is not False or new_password_opens(x, robot):
        return None  # 4.2/4 judges the passwords of a change
    return failed(
        "two different passwords were accepted, although none was set between them",
        expected="0",
        observed="1",
    )


rule("4.1/4", on=Exchange, names=_LOGIN)(one_flag)


@rule("4.1/5", on=Exchange, sender=A2C, by_bytes=True)
def nothing_after_a_refused_login(x: Exchange, _: RobotState) -> RuleResult | None:
    """After a login answered "0" the client uses no other command (L116); a stop is tolerated."""
    if x.name in ("login", "emergency_stop") or x.logged_in is None:
        return None
    if not x.refused_login:
        return PASSED if x.logged_in else None
    return failed(
        UserMessage("{command} was sent after a refused login", command=x.name),
        expected="a new login, or nothing",
        observed=x.name,
        at=(x.refused_login.place, x.request.place),
    )
