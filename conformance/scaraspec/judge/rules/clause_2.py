"""Clause 2: who connects to whom, plain text, and what is served without a login."""

import re

from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, rule, tolerated
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, InvalidBytes, LinkChange
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import Kind, WireRange
from scaraspec.user_message import UserMessage

_TLS_RECORD = re.compile(rb"[\x14-\x17]\x03[\x00-\x04]")
_COMPRESSED = re.compile(rb"\x1f\x8b\x08|\x28\xb5\x2f\xfd")
_STOP = "emergency_stop"


@rule("2/1", on=LinkChange)
def client_opens(change: LinkChange, _: RobotState) -> RuleResult | None:
    """The client opens the connection, the controller listens (L79)."""
    event = change.event
    if event.kind is not Kind.OPENED:
        return None
    if event.direction is A2C:
        return PASSED
    return failed(
        "the controller opened the connection",
        expected="opened by the client",
        observed=event.note,
        at=(WireRange(event.connection, event.direction, 0, 0, event.time_ns),),
    )


@rule("2/3", on=LinkChange)
def default_port(change: LinkChange, _: RobotState) -> RuleResult | None:
    """The client connects to port 8877 (L79); the user may choose another port."""
    opened = change.event.kind is Kind.OPENED
    return PASSED if opened and change.event.note.endswith(f":{DEFAULT_PORT}") else None


@rule("2/4", on=FrameSeen)
def readable_frame(_seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """A valid frame is plain text (L79)."""
    return PASSED


@rule("2/4", on=InvalidBytes)
def readable_bytes(invalid: InvalidBytes, _: RobotState) -> RuleResult | None:
    """A stream that begins as TLS or as compressed data is not plain (L79)."""
    if invalid.place.offset_bytes:
        return None
    tls, compressed = _TLS_RECORD.match(invalid.data), _COMPRESSED.match(invalid.data)
    if not tls and not compressed:
        return None
    return failed(
        "the stream begins as TLS" if tls else "the stream begins with compressed data",
        expected="plain frames",
        observed=invalid.data[:8].hex(" "),
    )


@rule("2/10", on=Exchange, sender=A2C, by_bytes=True)
def login_first(x: Exchange, _: RobotState) -> RuleResult | None:
    """The client logs in before any other command (L79, L104); an emergency stop is tolerated."""
    if x.name == "login" or x.logged_in is None or x.refused_login:
        return None  # after a refused login 4.1/5 judges it
    if x.logged_in or x.login_sent_before:  # only the reply to the login was missing
        return PASSED
    if x.name == _STOP:
        return None
    return failed(
        UserMessage("{command} was sent before a login", command=x.name),
        expected="login",
        observed=x.name,
    )


@rule("2/11", on=Exchange, sender=A2C, by_bytes=True)
def nothing_done_without_login(x: Exchange, _: RobotState) -> RuleResult | None:
    """Without a login the controller changes, moves and deletes nothing (L83, L104)."""
    if x.logged_in is not False or x.command is None or x.name == "login":
        return None
    if not x.refused_login and x.login_sent_before:
        return None  # the login may have been accepted by then
    if not x.reply:
        return PASSED if x.ending in (Ending.UNANSWERED, Ending.HUNG_UP) else None
    if x.accepted is False:
        return PASSED
    if x.command.hazard is Hazard.READ_ONLY:
        return _served_reading(x)
    if x.name == _STOP:
        return tolerated("A-4-4", "stop served", "an emergency stop was served without a login")
    if not x.accepted:
        return None
    return failed(
        UserMessage(
            "{command} was accepted on a connection that had not logged in", command=x.name
        ),
        expected="silence, a refusal or the end of the connection",
        observed="1",
    )


def _served_reading(x: Exchange) -> RuleResult:
    if x.reply and x.reply.text == b"0":  # the failure form of a query
        return PASSED
    return tolerated(
        "prelogin", "reads", UserMessage("{command} was answered without a login", command=x.name)
    )
