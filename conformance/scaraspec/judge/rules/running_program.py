"""Clause 4.9: the running program as the robot reports it."""

from typing import Final

from scaraspec.judge.rules.clock import contradicted, deviation_s, elapsed_s
from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    rule,
    tolerated,
)
from scaraspec.judge.rules.text import observed
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.fields import NAME_MAX_BYTES, Defect, show
from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_INFO: Final = ("get_running_program",)
_STATUS: Final = ("get_status",)
_RUN, _SIMULATE = "run_program", "simulate_program"
_SECOND_NS: Final = 1_000_000_000
_RIGHT_AFTER_NS: Final = 200_000_000
"""Within this time after a status 00 no client that is not recorded can have begun a program."""
_BEGIN_NS: Final = 5_000_000_000
"""Maximum time from a request to its first reply (A-3-15)."""


def _program(x: Exchange) -> Exchange | None:
    """Return the only program that certainly ran when `x` was answered; None if uncertain."""
    if (
        x.concurrent_uncertain
        or len(x.concurrent) != 1
        or x.concurrent[0].name not in (_RUN, _SIMULATE)
    ):
        return None
    same = x.concurrent[0].request.place.connection == x.request.place.connection
    return x.concurrent[0] if same else None


def _reports_none(x: Exchange) -> bool:
    return x.reply is not None and x.reply.frame.data[:1] in (b"0", b"\0")


@rule("4.9/2", on=Exchange, names=_INFO, by_bytes=True)
def program_is_reported(x: Exchange, _: RobotState) -> RuleResult | None:
    """While a program runs the reply is "1", its name and its run time (L226-232).

    Whether a simulation counts is open (A-4.9-4).
    """
    if not x.reply or not x.reply.parsed:
        return None
    program = _program(x)
    if _reports_none(x):
        if program is None or program.name != _RUN:
            return None
        return failed(
            UserMessage(
                "the reply reports no running program while {program} runs",
                program=show(program.request_value or b""),
            ),
            expected="1|name|DDHHMMSS",
            observed=observed(x.reply),
            at=(*places_of(program), *places_of(x)),
        )
    for issue in x.reply.parsed.decoded.issues:
        if issue.defect in (Defect.FLAG, Defect.FIELD_COUNT, Defect.SPACE_FOR_BAR):
            return failed(issue.text, expected="1|name|DDHHMMSS", observed=observed(x.reply))
    return PASSED if x.reply_value else None


@rule("4.9/4", on=Exchange, names=_INFO, by_bytes=True)
def name_of_the_program(x: Exchange, _: RobotState) -> RuleResult | None:
    """The name is that of the program that was requested to run or to be simulated (L226)."""
    program = _program(x)
    if program is None or x.reply_value is None or not isinstance(program.request_value, bytes):
        return None
    if x.reply_value.name == program.request_value:
        return PASSED
    if (
        len(program.request_value) > NAME_MAX_BYTES
        and x.reply_value.name == program.request_value[:NAME_MAX_BYTES]
    ):
        return tolerated("A-4.9-5", "cut", "the name of the running program is cut to 30 bytes")
    return failed(
        "the reply names a program that is not the running one",
        expected=show(program.request_value),
        observed=show(x.reply_value.name),
        at=(*places_of(program), *places_of(x)),
    )


@rule("4.9/5", on=Exchange, names=_INFO)
def run_time_runs(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The run time advances one second per second (L226); a simulation may differ."""
    program = _program(x)
    if program is None or program.name != _RUN or x.reply_value is None:
        return None
    run_time_s, most_s = x.reply_value.run_time_s, elapsed_s(program, x)[1]
    if run_time_s > most_s and deviation_s(run_time_s, program, x):
        return _counts_from_elsewhere(x, program)
    earlier = [
        y
        for y in robot.history.recent.get(x.name, ())
        if y.reply_value and y.concurrent == x.concurrent and answered_ns(y) < x.time_ns
    ]
    if not earlier:
        return None
    contradiction = contradicted(
        earlier, x, lambda y, z: float(z.reply_value.run_time_s - y.reply_value.run_time_s)
    )
    if contradiction is None:
        return PASSED
    y, step = contradiction
    if step:
        return inconclusive(
            "the run time or the clock of the recorder was set between two requests"
        )
    return failed(
        "the run time does not advance by one second per second",
        expected=UserMessage(
            "{increase_s} s more than {time_s} s",
            increase_s=f"{(x.time_ns - y.time_ns) / 1e9:.1f}",
            time_s=y.reply_value.run_time_s,
        ),
        observed=f"{x.reply_value.run_time_s} s",
        at=(*places_of(program), *places_of(y), *places_of(x)),
    )


def _counts_from_elsewhere(x: Exchange, program: Exchange) -> RuleResult:
    return failed(
        UserMessage(
            "the run time is longer than this run: {program} has begun {elapsed_s:.1f} s before",
            program=show(program.request_value or b""),
            elapsed_s=elapsed_s(program, x)[1],
        ),
        expected=UserMessage("at most {limit_s} s", limit_s=f"{elapsed_s(program, x)[1]:.1f}"),
        observed=f"{x.reply_value.run_time_s} s",
        at=(*places_of(program), *places_of(x)),
    )


@rule("4.9/6", on=Exchange, names=_INFO)
def no_name_without_program(x: Exchange, robot: RobotState) -> RuleResult | None:
    """Without a program the reply begins with "0" and gives no name and no time (L226, L237)."""
    if not x.reply or not x.reply.parsed or not _reports_none(x):
        return None
    issues = x.reply.parsed.decoded.issues
    surplus = next((c.text for c in issues if c.defect is Defect.FLAG), "")
    if surplus:
        return failed(surplus, expected="0", observed=observed(x.reply))
    return PASSED if not robot.busy else None


@rule("4.9/6", on=Exchange, names=_STATUS)
def no_program_when_idle(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot that is idle before and after reports no running program in between."""
    begin_ns = robot.history.idle_seen_ns
    idle = robot.history.idle_since_ns is not None and not robot.busy and x.reply_value == "00"
    if not idle or x.time_ns - begin_ns > _SECOND_NS:
        return None
    for y in robot.history.between("get_running_program", begin_ns, x.time_ns):
        if y.reply_value and not _may_be_late(y, robot):
            return _runs_although_idle(y, x)
    return None


@rule("4.9/6", on=Exchange, names=_INFO)
def no_program_after_idle(x: Exchange, robot: RobotState) -> RuleResult | None:
    """A robot whose status is 00 right before, after all results, runs no program (L226, L237)."""
    status = robot.history.last("get_status", before_ns=x.time_ns)
    idle = robot.history.idle_since_ns is not None and not robot.executing
    if status is None or status.reply_value != "00" or not idle or not x.reply_value:
        return None
    if x.time_ns - answered_ns(status) > _RIGHT_AFTER_NS:
        return None
    if _may_be_late(x, robot):
        return None
    begun = any(robot.history.is_pending(name, x.time_ns - _BEGIN_NS) for name in (_RUN, _SIMULATE))
    return None if begun else _runs_although_idle(x, status)


def _may_be_late(x: Exchange, robot: RobotState) -> bool:
    """Whether the reply may report the state before the last final result (A-4.8-3)."""
    ended = robot.history.accepted[-1] if robot.history.accepted else None
    if ended is None:
        return False
    return ended.result is None or ended.result.place.time_ns > x.time_ns - robot.status_lag_ns


def _runs_although_idle(x: Exchange, status: Exchange) -> RuleResult:
    return failed(
        UserMessage(
            "the reply reports {program} as running although the robot is idle",
            program=show(x.reply_value.name),
        ),
        expected="0",
        observed=observed(x.reply) if x.reply else "",
        at=(*places_of(x), *places_of(status)),
    )


@rule("4.9/7", on=FrameSeen, names=_INFO, sender=C2A)
def none_in_one_character(seen: FrameSeen, _: RobotState) -> RuleResult | None:
    """Without a program the reply is the single character "0" (L237; A-4.9-2)."""
    form = dict(seen.parsed.decoded.readings).get("runinfo_none") if seen.parsed else None
    if form is None:
        return None
    return (
        PASSED
        if form == "0"
        else tolerated("runinfo_none", form, "the reply 0|| is used for no running program")
    )


@rule("4.9/8", on=Exchange, names=_INFO, by_bytes=True)
def short_name(x: Exchange, _: RobotState) -> RuleResult | None:
    """The program name has at most 30 bytes (L226; A-4.9-5)."""
    if not x.reply_value:
        return None
    if len(x.reply_value.name) <= NAME_MAX_BYTES:
        return PASSED
    return tolerated(
        "A-4.9-5",
        "longer",
        UserMessage(
            "the program's name has {byte_count} bytes", byte_count=len(x.reply_value.name)
        ),
    )


@rule("4.9/10", on=Exchange, names=_STATUS)
def flag_agrees_with_status(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The flag is "1" while the status is 01, or 02 if a simulation counts (A-4.9-4).

    Judged only if the statuses before and after are equal and no command was accepted in between.
    """
    before = robot.history.last("get_status", before_ns=x.time_ns)
    near = before is not None and x.time_ns - before.time_ns <= _SECOND_NS
    if (
        before is None
        or not near
        or before.reply_value != x.reply_value
        or x.reply_value not in ("01", "02")
    ):
        return None
    if any(answered_ns(y) > before.time_ns for y in robot.history.accepted):
        return None
    for y in robot.history.between("get_running_program", answered_ns(before), x.time_ns):
        if y.reply_value:
            return PASSED
        if not _reports_none(y) or _program(y):  # 4.9/2 judges a known program
            continue
        if x.reply_value == "02":
            return tolerated(
                "A-4.9-4", "no", "the reply does not report a simulated program as running"
            )
        return failed(
            "the reply reports no running program although the status is 01",
            expected="1|name|DDHHMMSS",
            observed=observed(y.reply) if y.reply else "",
            at=(*places_of(y), *places_of(x)),
        )
    return None
