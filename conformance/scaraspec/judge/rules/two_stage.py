"""Two-stage commands (4/… and 4.15 to 4.18, 4.24 to 4.28, 4.35): replies and results.

The module `busy` checks the replies of a busy robot, `stop` the emergency stop.
"""

from typing import Final

from scaraspec.judge.requirements import SUCCESS
from scaraspec.judge.rules.rule import PASSED, RuleResult, failed, inconclusive, rule, tolerated
from scaraspec.protocol import errors
from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import Defect, show
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, UnsolicitedReply
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

TWO_STAGE: Final = tuple(c.name for c in COMMANDS if c.two_stage)
NOT_STOP: Final = tuple(name for name in TWO_STAGE if name != "emergency_stop")
_LASTING_COMMANDS: Final = tuple(n for n in NOT_STOP if n not in ("release_joints", "lock_joints"))

_QUERIES: Final = ("get_status", "get_time", "get_version")
_IMMEDIATE_NS: Final = 50_000_000
_LONG_NS: Final = 1_000_000_000
_SLOWER_FACTOR: Final = 10
_REPEATED_NS: Final = 60_000_000_000
"""A client that repeats a request by itself after a lost link does so within this time."""


def _misses_its_form(seen: FrameSeen) -> bool:
    issues = seen.parsed.decoded.issues if seen.parsed else ()
    return any(c.defect in (Defect.FLAG, Defect.FIELD_COUNT) for c in issues)


# First replies


def _without_code(x: Exchange) -> RuleResult | None:
    """Judge a refusal without a code; None if it has one.

    The document prints the length of such a refusal only for 0x39 (A-4.24-3). How a controller
    refuses a client that has not logged in is open (A-4-4).
    """
    assert x.reply
    assert x.reply.parsed
    decoded = x.reply.parsed.decoded
    message = UserMessage("the refusal of {command} has no code", command=x.name)
    if ("err_bare0", "0") in decoded.readings:
        return tolerated("err_bare0", "0", message)
    if any(issue.defect is Defect.NO_CODE for issue in decoded.issues):
        if x.logged_in is False:
            return tolerated(
                "A-4-4",
                "0",
                UserMessage(
                    "the refusal of {command} has no code: the client has not logged in",
                    command=x.name,
                ),
            )
        return failed(message, expected="0|code", observed=show(x.reply.frame.data))
    return None


@rule("4/1", on=Exchange, names=TWO_STAGE)
def first_reply(x: Exchange, _: RobotState) -> RuleResult | None:
    """The first reply is "1", or "0|code"; for 0x32 "1" or "0" (L311 and similar)."""
    if not x.reply or not x.command:
        return None
    # 4.17/2 judges the other bytes of a refused stop.
    stop_refused = x.name == "emergency_stop" and x.accepted is False
    if _misses_its_form(x.reply) and not stop_refused:
        return failed(
            UserMessage(
                "the first reply to {command} is neither an acceptance nor a refusal",
                command=x.name,
            ),
            expected=x.command.reply.form,
            observed=show(x.reply.frame.data),
        )
    if x.accepted is False:
        return _without_code(x) or PASSED
    return PASSED if x.accepted else None


@rule("4.15/3", on=Exchange, names=("run_program",))
@rule("4.24/3", on=Exchange, names=("set_tool_coordinates",))
@rule("4.35/3", on=Exchange, names=("shutdown",))
def refusal(x: Exchange, _: RobotState) -> RuleResult | None:
    """A command that cannot be executed is answered "0|code" (L314, L490-497, L701-706)."""
    if not x.reply or x.accepted is not False:
        return None
    if x.reply_value.code:
        return PASSED
    return _without_code(x) or failed(
        UserMessage("the refusal of {command} has no code of table 8-1", command=x.name),
        expected="0|code",
        observed=show(x.reply.frame.data),
    )


@rule("4.16/2", on=Exchange, names=("simulate_program",))
@rule("4.25/2", on=Exchange, names=("release_joints",))
@rule("4.26/2", on=Exchange, names=("lock_joints",))
@rule("4.28/4", on=Exchange, names=("jog",))
def reason(x: Exchange, _: RobotState) -> RuleResult | None:
    """A refusal contains the reason (L342, L530, L563, L615)."""
    if not x.reply or not x.reply.parsed or x.accepted is not False:
        return None
    return _without_code(x) or PASSED


@rule("4.15/4", on=Exchange, names=("run_program",))
@rule("4.18/3", on=Exchange, names=("reset",))
@rule("4.24/5", on=Exchange, names=("set_tool_coordinates",))
@rule("4.35/2", on=Exchange, names=("shutdown",))
def acceptance(x: Exchange, _: RobotState) -> RuleResult | None:
    """A command that can be executed is answered "1" (L316, L401-404, L499-502, L696-699)."""
    if not x.reply or x.reply.frame.data[:1] != b"1":
        return None
    if x.reply.text == b"1":
        return PASSED
    return failed(
        "the reply contains more than the flag 1", expected="1", observed=show(x.reply.frame.data)
    )


@rule("4.15/2", on=Exchange, names=("run_program",))
def checked_before_replying(x: Exchange, _: RobotState) -> RuleResult | None:
    """The conditions are checked before the reply (L311); a missing file may show later."""
    if x.accepted and x.outcome and x.outcome.code == "20":
        return tolerated("A-4.15-1", "00|20", "the missing program was found after the reply 1")
    return PASSED if x.accepted is not None else None


@rule("4/14", on=Exchange, names=_LASTING_COMMANDS)
def reply_before_execution(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The first reply comes before the execution, not at its end (L311, L363, L392, L490).

    The first reply came at the end if it took long, the final result arrived with it, and queries
    are answered faster. If the command was requested again, the reply may belong to the second
    request. A single case is inconclusive: a packet may have been lost. Releasing and locking
    joints takes no time (A-4.25-2), so these commands are not judged.
    """
    if not x.result or x.latency_ns is None or x.duration_ns is None or x.concurrent_uncertain:
        return None  # another command may have delayed it (A-4-2)
    if robot.history.last_requests.get(x.name) is not x.request:
        return None
    if not _comes_at_its_end(x):
        return PASSED
    queries = [
        y for name in _QUERIES if (y := robot.history.last(name)) and y.latency_ns is not None
    ]
    if not any((y.latency_ns or 0) * _SLOWER_FACTOR < x.latency_ns for y in queries):
        return None
    values = {"command": x.name, "latency_s": x.latency_ns / 1e9}
    before = [y for y in reversed(robot.history.recent.get(x.name, [])) if _took_long(y)]
    begun = (y for y in before if not _comes_at_its_end(y))
    if any((y.latency_ns or 0) * 2 > x.latency_ns for y in begun):
        return None  # the reply before a long execution also takes this long
    if not any(map(_comes_at_its_end, before[:1])):
        return inconclusive(
            UserMessage(
                "the first reply to {command} came after {latency_s:.1f} s, together with its "
                "final result; it happened once, and a packet may have been lost",
                **values,
            )
        )
    message = UserMessage(
        "the first reply to {command} came after {latency_s:.1f} s, together with its final result",
        **values,
    )
    return failed(
        message, expected="the first reply before the execution", observed="both at its end"
    )


def _comes_at_its_end(x: Exchange) -> bool:
    return (
        _took_long(x) and (x.duration_ns or 0) <= _IMMEDIATE_NS and (x.latency_ns or 0) >= _LONG_NS
    )


def _took_long(x: Exchange) -> bool:
    """Whether the time from the request to the final result is known and long."""
    if x.latency_ns is None or x.duration_ns is None:
        return False
    return x.latency_ns + x.duration_ns >= _LONG_NS


# Final results


@rule("4/2", on=Exchange, names=TWO_STAGE)
def success(x: Exchange, _: RobotState) -> RuleResult | None:
    """A successful final result is "11" (L318 and similar)."""
    if not x.result or x.result.frame.data[:1] == b"0":
        return None
    if x.outcome:
        return PASSED
    return failed(
        UserMessage("the final result of {command} is neither success nor failure", command=x.name),
        expected="11",
        observed=show(x.result.frame.data),
    )


for _name, _requirement in SUCCESS.items():
    rule(_requirement, on=Exchange, names=(_name,))(success)


@rule("4/3", on=Exchange, names=TWO_STAGE)
@rule("4.15/6", on=Exchange, names=("run_program",))
@rule("4.16/4", on=Exchange, names=("simulate_program",))
@rule("4.17/5", on=Exchange, names=("emergency_stop",))
@rule("4.18/5", on=Exchange, names=("reset",))
@rule("4.24/7", on=Exchange, names=("set_tool_coordinates",))
@rule("4.25/4", on=Exchange, names=("release_joints",))
@rule("4.26/4", on=Exchange, names=("lock_joints",))
@rule("4.28/6", on=Exchange, names=("jog",))
def failure(x: Exchange, _: RobotState) -> RuleResult | None:
    """A failed final result is "00|code", five bytes (L323-328 and similar)."""
    if not x.result or x.result.frame.data[:1] != b"0":
        return None
    if x.outcome and x.outcome.code:
        return PASSED
    return failed(
        UserMessage("the failure of {command} has no code of table 8-1 after 00", command=x.name),
        expected="00|code",
        observed=show(x.result.frame.data),
    )


# Codes


@rule("4/4", on=Exchange, names=NOT_STOP)
def refusal_code(x: Exchange, _: RobotState) -> RuleResult | None:
    """The code of a refusal is one of table 8-1 that can refuse (A-0-7)."""
    code = errors.lookup(x.reply_value.code) if x.accepted is False and x.reply_value.code else None
    if code is None:
        return None
    if code in errors.REFUSALS:
        return PASSED
    return tolerated(
        "A-0-7",
        code.text,
        UserMessage(
            "{command} was refused with {code} ({meaning})",
            command=x.name,
            code=code.text,
            meaning=code.meaning,
        ),
    )


@rule("4/5", on=Exchange, names=TWO_STAGE)
def failure_code(x: Exchange, _: RobotState) -> RuleResult | None:
    """The code of a failure is one of table 8-1 that can fail (A-8-5)."""
    code = errors.lookup(x.outcome.code) if x.outcome and x.outcome.code else None
    if code is None:
        return None
    stopped = code.kind is errors.Kind.IDLE and x.stop_requested
    if code in errors.FAILURES or stopped or code.kind is errors.Kind.MISSING_FILE:
        return PASSED
    return tolerated(
        "A-8-5",
        code.text,
        UserMessage(
            "{command} failed with {code} ({meaning})",
            command=x.name,
            code=code.text,
            meaning=code.meaning,
        ),
    )


# Requests


@rule("4/16", on=Exchange, names=NOT_STOP)
def not_repeated(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The client does not repeat a request whose final result is outstanding (A-4-2).

    A capture does not show whether the client or its user repeated the request.
    """
    same = [y for y in x.concurrent if (y.name, y.request_value) == (x.name, x.request_value)]
    if not same:
        return PASSED
    if login := _login_after(x, same[0], robot):
        since_ns = x.time_ns - login.time_ns
        return _repeated(x, same[0], "a client connected, and the first one is silent", since_ns)
    return tolerated(
        "A-4-2",
        "asked again",
        UserMessage("{command} was requested again before its final result", command=x.name),
    )


@rule("4/16", on=Exchange, names=NOT_STOP)
def not_repeated_after_a_lost_link(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The client does not repeat a request whose final result was lost with the link (L318).

    A capture does not show whether the client or its user repeated the request.
    """
    lost = robot.history.lost.get(x.name)
    if lost is None or x.request_value != lost.exchange.request_value:
        return None
    since_ns = x.time_ns - lost.lost_ns
    if not 0 <= since_ns <= _REPEATED_NS:
        return None
    return _repeated(x, lost.exchange, "its link had ended before its final result", since_ns)


def _login_after(x: Exchange, y: Exchange, robot: RobotState) -> Exchange | None:
    """Return the login of the connection of `x` after `y`, if that of `y` is silent since."""
    here, there = x.request.place.connection, y.request.place.connection
    logins = (z for z in robot.history.recent.get("login", ()) if z.time_ns > answered_ns(y))
    login = next((z for z in logins if z.request.place.connection == here), None)
    if here == there or login is None:
        return None
    requests = robot.history.last_requests.values()
    active = any(z.place.connection == there and z.place.time_ns > login.time_ns for z in requests)
    return None if active else login


def _repeated(x: Exchange, first: Exchange, why: str, since_ns: int) -> RuleResult:
    result = inconclusive(
        UserMessage(
            "{command} was requested again {since_s:.1f} s after {why}: either the client repeated"
            " it by itself, which is a violation, or its user started it again",
            command=x.name,
            since_s=since_ns / 1e9,
            why=why,
        )
    )
    return result._replace(places=(first.request.place, x.request.place))


@rule("4.28/2", on=FrameSeen, names=("jog",), sender=A2C)
def jog_byte(seen: FrameSeen, _robot: RobotState) -> RuleResult | None:
    """The byte is 1 to 4, ASCII or binary (L605-608; A-4.28-1)."""
    if not seen.parsed or len(seen.frame.data) != 1:
        return None
    if seen.value is None:
        return failed(
            seen.parsed.decoded.issues[0].text,
            expected="1 to 4",
            observed=seen.frame.data.hex(),
        )
    if dict(seen.parsed.decoded.readings)["jog_byte"] == "ascii":
        return PASSED
    return tolerated("jog_byte", "binary", "the direction of the jog was sent as a binary byte")


# Shutdown has no second stage


@rule("4.35/2", on=Exchange, names=("shutdown",))
def shutdown_is_answered(x: Exchange, _: RobotState) -> RuleResult | None:
    """The reply "1" comes before the shutdown begins (L696); a link can also fail by itself."""
    if x.reply or x.ending is not Ending.HUNG_UP:
        return None
    return inconclusive(
        "the controller closed the connection without a reply to 0x60: either it shut down without"
        " a reply, which is a violation, or the link failed"
    )


@rule("4.35/5", on=Exchange, names=("shutdown",))
def shutdown_has_no_result(x: Exchange, _: RobotState) -> RuleResult | None:
    """No tagged result follows (L696); one that arrives is an `UnsolicitedReply`."""
    return PASSED if x.accepted else None


@rule("4.35/5", on=UnsolicitedReply)
def result_of_a_shutdown(unsolicited: UnsolicitedReply, _: RobotState) -> RuleResult | None:
    """A tagged result of 0x60 (L696; A-4.35-2)."""
    frame = unsolicited.seen.frame
    if not frame.tagged or frame.opcode != BY_NAME["shutdown"].opcode:
        return None
    return failed(
        "the controller sent a final result for the shutdown",
        expected="no tagged frame",
        observed=show(frame.data),
    )
