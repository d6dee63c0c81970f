"""A robot that executes one two-stage command: its status, and its replies to further requests."""

from collections.abc import Collection, Iterable
from functools import wraps
from itertools import pairwise
from math import ceil
from typing import Final

from scaraspec.judge.rules.rule import (
    PASSED,
    Check,
    RuleResult,
    failed,
    places_of,
    rule,
    tolerated,
)
from scaraspec.judge.rules.two_stage import NOT_STOP
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol import errors
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.fields import show
from scaraspec.traffic.events import Ending, Exchange
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import SETTLE_NS, SETTLES, STATE_LAG_NS, RobotState
from scaraspec.traffic.wire import WireRange
from scaraspec.user_message import UserMessage

STATE_OF: Final = {
    "run_program": "01",
    "simulate_program": "02",
    "reset": "03",
    "set_tool_coordinates": "04",
    "jog": "04",
}
"""The status during each command that has one (L1018-1021); release and lock have none (A-4-5)."""

_STATUS: Final = ("get_status",)
_SECOND_NS: Final = 1_000_000_000
"""An unrecorded client cannot begin and end a command unnoticed within this time. It is also a
safe margin for frames of two connections, which a capture may reorder."""
_MAX_POLL_NS: Final = 5_000_000_000
"""Maximum time between two statuses that show a robot which was never idle between them."""
_MAX_REPLY_NS: Final = 5_000_000_000
"""Maximum time from a request to its first reply (A-3-15)."""


def certainly_executes(y: Exchange, x: Exchange, robot: RobotState) -> bool:
    """Return whether a command `y` of `x.concurrent` certainly executed when `x` was answered.

    On one connection the order of the frames is certain. On two connections the final result of
    `y` must arrive clearly after the reply to `x`; one that is still missing may be on its way, or
    not captured. If a status 00 came in between, `y` has ended or that status is wrong; another
    rule reports it.
    """
    if y.idle_status:
        return False
    if y.request.place.connection == x.request.place.connection:
        return True
    now = next((z for z in robot.history.accepted if z.request is y.request), y)
    return now.result is not None and now.result.begun_ns - answered_ns(x) > _SECOND_NS


# Further requests


def _not_accepted(x: Exchange, robot: RobotState, during: Iterable[Exchange]) -> RuleResult | None:
    executing = [y for y in during if certainly_executes(y, x, robot)]
    if not executing or x.concurrent_uncertain:
        return None
    if x.accepted is False:
        return PASSED
    if not x.accepted:
        if x.ending is not Ending.UNANSWERED:
            return None
        return tolerated(
            "busy_reply",
            "silence",
            UserMessage("{command} was not answered by the busy robot", command=x.name),
        )
    first = executing[0]
    if first.name == "release_joints":
        return tolerated(
            "A-4.25-2", "at lock", "the release had not ended when the next command was accepted"
        )
    if first.name == x.name == "jog":
        return tolerated("A-4.28-5", "replace", "a second jog replaced the first one")
    return failed(
        UserMessage(
            "{command} was accepted while {executing} executed",
            command=x.name,
            executing=first.name,
        ),
        expected="0|code",
        observed="1",
        at=(*_begun(first), *places_of(x)),
    )


def _begun(y: Exchange) -> tuple[WireRange, ...]:
    """Return the places of its request and its first reply."""
    return tuple(seen.place for seen in (y.request, y.reply) if seen)


@rule("4/6", on=Exchange, names=NOT_STOP)
def no_second_command(x: Exchange, robot: RobotState) -> RuleResult | None:
    """While one two-stage command executes no other is answered "1" (L399; A-4-2)."""
    return _not_accepted(x, robot, x.concurrent)


@rule("4.15/8", on=Exchange, names=("run_program",))
def no_second_run(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A second run during a run is not answered "1" (L1018)."""
    return _not_accepted(x, robot, (y for y in x.concurrent if y.name == "run_program"))


@rule("4.25/5", on=Exchange, names=("release_joints",))
def no_release_in_motion(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Release is not answered "1" while a program or a move executes (A-4.25-1)."""
    return _not_accepted(x, robot, (y for y in x.concurrent if y.name in STATE_OF))


@rule("4.18/2", on=Exchange, names=("reset",))
@rule("4.35/4", on=Exchange, names=("shutdown",))
def refused_during_a_program(x: Exchange, robot: RobotState) -> RuleResult | None:
    """While a program runs the refusal is "0|01" (L394-399, L706); a fault may win (A-4.8-2)."""
    if [y.name for y in x.concurrent] != ["run_program"] or x.concurrent_uncertain or not x.reply:
        return None
    refusal = x.reply.text
    code = errors.lookup(x.reply_value.code) if x.reply_value and x.reply_value.code else None
    if refusal == b"0|01" or (code and code.kind is errors.Kind.FAULT):
        return PASSED
    if not certainly_executes(x.concurrent[0], x, robot):
        return None
    return failed(
        UserMessage("{command} was not refused with 01 while a program ran", command=x.name),
        expected="0|01",
        observed=show(refusal),
        at=(*_begun(x.concurrent[0]), *places_of(x)),
    )


@rule("4/15", on=Exchange, names=(*NOT_STOP, "shutdown"))
def busy_code_is_status(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The code of a busy refusal is the state that 0x09 reports then (A-4-2)."""
    code = x.reply_value.code if x.accepted is False else None
    if code not in BUSY or len(x.concurrent) != 1 or x.concurrent_uncertain:
        return None
    executing = x.concurrent[0]
    expected = STATE_OF.get(executing.name)
    if code == expected:
        return PASSED
    if expected is None or not certainly_executes(executing, x, robot):
        return None
    return failed(
        UserMessage(
            "{command} was refused with {code} while {executing} executed",
            command=x.name,
            code=code,
            executing=executing.name,
        ),
        expected=expected,
        observed=code,
        at=(*_begun(executing), *places_of(x)),
    )


def _before_its_end(names: Collection[str], check: Check) -> Check:
    """Return the check of the commands on other connections that were answered while one executed.

    Only its final result, which arrives after them, shows that it still executed.
    """

    @wraps(check)
    def check_others(y: Exchange, robot: RobotState) -> RuleResult | None:
        if not y.reply or not y.result:
            return None
        for name in names:
            for x in robot.history.between(name, answered_ns(y), y.result.begun_ns):
                same = x.request.place.connection == y.request.place.connection
                if not same and any(z.request is y.request for z in x.concurrent):
                    result = check(x, robot)
                    if result and result.verdict is Verdict.FAIL:
                        return result
        return None

    return check_others


for _requirement, _names, _check in (
    ("4/6", NOT_STOP, no_second_command),
    ("4.15/8", ("run_program",), no_second_run),
    ("4.25/5", ("release_joints",), no_release_in_motion),
    ("4.18/2", ("reset",), refused_during_a_program),
    ("4.35/4", ("shutdown",), refused_during_a_program),
    ("4/15", (*NOT_STOP, "shutdown"), busy_code_is_status),
):
    rule(_requirement, on=Exchange, names=STATE_OF)(_before_its_end(_names, _check))


@rule("4/15", on=Exchange, names=_STATUS)
def idle_robot_is_not_busy(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot whose status is 00 before and after is not refused as busy between (L1017-1021)."""
    begin_ns = robot.history.idle_seen_ns
    idle = robot.history.idle_since_ns is not None and not robot.busy and x.reply_value == "00"
    if not idle or x.time_ns - begin_ns > _SECOND_NS:
        return None
    ended = robot.history.accepted[-1].result if robot.history.accepted else None
    if ended is not None:  # the robot may settle (A-4-9)
        begin_ns = max(begin_ns, ended.place.time_ns + STATE_LAG_NS)
    for name in (*NOT_STOP, "shutdown"):
        for y in robot.history.between(name, begin_ns, x.time_ns):
            if y.accepted is False and y.reply_value.code in BUSY:
                return failed(
                    UserMessage(
                        "{command} was refused with {code} although the robot was idle",
                        command=name,
                        code=y.reply_value.code,
                    ),
                    expected="1, or another code",
                    observed=f"0|{y.reply_value.code}",
                    at=(*places_of(y), *places_of(x)),
                )
    return None


# The status


@rule("4/8", on=Exchange, names=_STATUS, by_bytes=True)
def busy_while_executing(x: Exchange, _: RobotState) -> RuleResult | None:
    """Between first reply and final result the status is not 00 (L318)."""
    return PASSED if x.concurrent and not x.concurrent_uncertain and x.reply_value in BUSY else None


@rule("4/8", on=Exchange, names=STATE_OF)
def never_idle_while_executing(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A status 00 that came before the final result contradicts it (L318; A-4-9)."""
    if not x.idle_status or not x.result:
        return None
    same = x.idle_status.place.connection == x.request.place.connection
    early_ns = x.result.begun_ns - x.idle_status.place.time_ns
    if early_ns < (robot.result_lag_ns if same else _SECOND_NS):
        return None
    return failed(
        UserMessage("the status is 00 (idle) while {command} executes", command=x.name),
        expected=STATE_OF[x.name],
        observed="00",
        at=(*_begun(x), x.idle_status.place, x.result.place),
    )


@rule("4/8", on=Exchange, names=STATE_OF)
def status_lags(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A status 00 right after the first reply may be that from before it (A-4.8-3)."""
    if not x.lag_ns or not x.result or x.idle_status:
        return None
    begun_ns = answered_ns(x)
    statuses = robot.history.between("get_status", begun_ns, x.result.begun_ns)
    changed_ns = (answered_ns(y) for y in statuses if y.reply_value in BUSY)
    return _lagging(
        x.lag_ns,
        UserMessage("the status was still 00 (idle) after the first reply to {name}", name=x.name),
        most_ns=next(changed_ns, begun_ns) - begun_ns,
    )


def _lagging(lag_ns: int, message: UserMessage, *, most_ns: int = 0) -> RuleResult:
    """Return the toleration of an old status; the next one shows how long it was old at most."""
    least, most = (UserMessage("{ms} ms", ms=ceil(ns / 1e6)) for ns in (lag_ns, most_ns))
    lag = UserMessage("{least} to {most}", least=least, most=most) if most_ns else least
    text = UserMessage("{message}, for {lag}", message=message, lag=lag)
    return tolerated("status_lag", f"{lag_ns / 1e9:.3f}", text)


@rule("4/7", on=Exchange, names=_STATUS)
def idle_after_success(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After a successful final result the status returns to 00 (L318).

    The document does not state the moment: a robot may not change both at once, and a capture may
    reorder frames of two connections. A command of another client may have begun although its first
    reply "1" has not arrived yet.
    """
    ended = _ended_before(x, robot)
    if ended is None or not ended.result:
        return None
    since_ns = x.time_ns - ended.result.place.time_ns
    if since_ns > _SECOND_NS:
        return None  # `idle_at_last` judges it
    if x.reply_value == "00":
        return PASSED
    if x.reply_value not in BUSY or _may_have_begun(x, robot):
        return None
    message = UserMessage(
        "the status is still {status} although {command} has ended",
        status=x.reply_value,
        command=ended.name,
    )
    if since_ns < STATE_LAG_NS:
        same = ended.request.place.connection == x.request.place.connection
        return _lagging(since_ns, message) if same and robot.status_lag_ns else None
    if robot.transferring:
        return tolerated("A-5-17", "status", "the status is that of a busy robot in a transfer")
    if ended.name in SETTLES and since_ns <= SETTLE_NS:
        return tolerated("A-4-9", "settles", message)
    return _still_busy(x, ended, message)


@rule("4/7", on=Exchange, names=_STATUS)
def idle_at_last(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot whose status was never 00 since a successful final result still executes (L318)."""
    ended = _still_busy_command(x, robot) if x.reply_value in BUSY else None
    if ended is None or ended.name == "emergency_stop":
        return None
    message = UserMessage(
        "the status is still {status} although {command} has ended {since_s:.1f} s before",
        status=x.reply_value,
        command=ended.name,
        since_s=_since_s(x, ended),
    )
    return _still_busy(x, ended, message)


@rule("4.17/6", "4.17/7", on=Exchange, names=_STATUS)
def stopped_at_last(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot that still executes long after a successful stop was not stopped (L363, L373)."""
    stop = _still_busy_command(x, robot) if x.reply_value in BUSY else None
    if stop is None or stop.name != "emergency_stop":
        return None
    message = UserMessage(
        "the status is still {status} {since_s:.1f} s after the emergency stop had succeeded",
        status=x.reply_value,
        since_s=_since_s(x, stop),
    )
    return _still_busy(x, stop, message)


@rule("4/15", on=Exchange, names=(*NOT_STOP, "shutdown"))
def stopped_robot_is_not_busy(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot that has been stopped does not refuse a command as busy (L399; A-4-9)."""
    code = x.reply_value.code if x.accepted is False else None
    stop = _still_busy_command(x, robot) if code in BUSY else None
    if stop is None or stop.name != "emergency_stop":
        return None
    message = UserMessage(
        "{command} was refused with {code} {since_s:.1f} s after the emergency stop had succeeded",
        command=x.name,
        code=code,
        since_s=_since_s(x, stop),
    )
    return _still_busy(x, stop, message, expected="1, or another code")


def _ended_before(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the last two-stage command, if it succeeded before `x` and nothing else executes."""
    ended = robot.history.accepted[-1] if robot.history.accepted else None
    if ended is None or not ended.result or not ended.outcome or not ended.outcome.done:
        return None
    stopped = ended.name == "emergency_stop" and not robot.busy
    if (robot.executing or x.concurrent_uncertain) and not stopped:
        return None
    if x.concurrent or ended.result.place.time_ns >= x.time_ns:
        return None
    return ended


def _may_have_begun(x: Exchange, robot: RobotState) -> bool:
    """Whether a command of another client may have begun before its first reply "1" arrives."""
    since_ns, others = x.time_ns - _MAX_REPLY_NS, (name for name in STATE_OF if name != x.name)
    return any(robot.history.is_pending(name, since_ns) for name in others)


def _still_busy_command(x: Exchange, robot: RobotState) -> Exchange | None:
    """Return the last command if it succeeded, but the robot never became idle since.

    The first status came so soon after the final result that no client which is not recorded can
    have begun another command, and none of the statuses since then was 00.
    """
    ended = _ended_before(x, robot)
    if ended is None or not ended.result or _may_have_begun(x, robot) or robot.transferring:
        return None
    ended_ns = ended.result.place.time_ns
    if x.time_ns - ended_ns <= max(_SECOND_NS, SETTLE_NS):
        return None
    statuses = [*robot.history.between("get_status", ended_ns, x.time_ns), x]
    if any(y.name == "get_status" and y.reply_value not in BUSY for y in statuses):
        return None
    times_ns = [ended_ns, *(y.time_ns for y in statuses)]
    gaps_ns = [after - before for before, after in pairwise(times_ns)]
    first_ns = 2 * _SECOND_NS if ended.name == "emergency_stop" else _SECOND_NS
    return ended if gaps_ns[0] <= first_ns and max(gaps_ns) <= _MAX_POLL_NS else None


def _since_s(x: Exchange, ended: Exchange) -> float:
    assert ended.result
    return (x.time_ns - ended.result.place.time_ns) / 1e9


def _still_busy(
    x: Exchange, ended: Exchange, message: UserMessage, *, expected: str = "00"
) -> RuleResult:
    observed = show(x.reply.frame.data) if x.reply else ""
    at = (*places_of(ended), *places_of(x))
    return failed(message, expected=expected, observed=observed, at=at)


@rule("4.18/6", on=Exchange, names=("reset",))
def reset_from_error(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot in error can be reset (A-4.18-2)."""
    status = robot.history.last("get_status", before_ns=x.time_ns)
    code = errors.lookup(status.reply_value) if status and status.reply_value else None
    if code is None or code.kind is not errors.Kind.FAULT or x.accepted is None or x.concurrent:
        return None
    if x.accepted:
        return PASSED
    return tolerated("reset_from_error", "idle-only", "a robot in error refused the reset")
