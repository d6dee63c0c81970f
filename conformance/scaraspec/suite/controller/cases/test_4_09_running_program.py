"""Clause 4.9: the running program (0x0A, L219-237)."""

from contextlib import suppress
from datetime import datetime
from typing import Final, NamedTuple

from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.fields import NAME_MAX_BYTES, show
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    ClockSample,
    expect_clock_ran,
    has_clock,
    read_clock,
    rollover_if_possible,
)
from scaraspec.suite.controller.harness.requests.motion import stop_motion
from scaraspec.suite.controller.harness.state.defaults import default_program_preserved
from scaraspec.suite.controller.harness.state.preserve import clock_preserved, patient
from scaraspec.suite.controller.harness.two_stage.commands import RUN, begin_or_skip, start_program
from scaraspec.suite.controller.harness.two_stage.executing import (
    ask_while_executing,
    expect_idle,
    skip_if_other_program_runs,
    store_wait_program,
)
from scaraspec.suite.controller.harness.two_stage.results import poll_result, wait_for_result
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    EndedTooSoon,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.suite.program_files.bench import PROGRAMS
from scaraspec.suite.program_files.listed import long_name, program_names, store_program
from scaraspec.user_message import UserMessage

_NO_PROGRAM: Final = (b"0", b"0||", b"\0", b"\0||")
"""No program runs: the possible replies (A-4.9-2, A-T-1)."""
_DEFAULTS: Final = ("get_default_program", "set_default_program")
_WAIT_S: Final = 3
_LEAP_DAY: Final = datetime(2024, 2, 29)  # noqa: DTZ001 - the document names no zone
_READS: Final = 4
_STEP_S: Final = 0.7
_RESULT_WAIT_S: Final = 0.3
_TOLERANCE_S: Final = 1.5  # two times, each truncated to a whole second, plus half a second
_MAX_DRIFT: Final = 0.01
_MINUTE_S, _HOUR_S, _DAY_S = 60, 3600, 86_400
_NS_PER_S: Final = 1e9


def _reports_no_program(reply: ReceivedFrame) -> bool:
    """Whether no program is reported; NULs may follow the flag or be the flag (A-T-1, A-T-3)."""
    flag, rest = reply.frame.data[:1], reply.frame.data[1:]
    return flag + rest.rstrip(b"\0") in _NO_PROGRAM


def _expect_no_program(line: OutgoingConnection, message: str) -> None:
    reply = line.ask("get_running_program")
    expect(
        _reports_no_program(reply), message, expected="0", observed=f"{reply}", requirement="4.9/6"
    )


def _running_program(
    subject: ControllerUnderTest, line: OutgoingConnection, command: str, name: bytes
) -> RunningProgram | None:
    """Request the running program, and return it; None if it has ended.

    Raises:
        CaseFailed: The reply is wrong.
    """
    reply = ask_while_executing(subject, line, "get_running_program", command)
    reported = reply.value
    if not isinstance(reported, RunningProgram):
        if poll_result(line, command, _RESULT_WAIT_S) is not None:
            return None
        if command == "simulate_program" and _reports_no_program(reply):
            message = "a simulated program is not reported as running"
            subject.tolerate("4.9/10", "A-4.9-4", "no", message)
            return None
        message = "the running program is not reported"
        expected = f"1|{name.decode()}|DDHHMMSS"
        raise CaseFailed(message, expected=expected, observed=f"{reply}", requirement="4.9/2")
    expect_equal(
        reported.name, name, "another program is reported than the running one", requirement="4.9/4"
    )
    _expect_format(reply)
    return reported


def _expect_format(reply: ReceivedFrame) -> None:
    """Expect eight digits with valid hours, minutes and seconds (A-4.9-3); T/4 covers the rest."""
    text = reply.frame.data.rstrip(b"\0|").rpartition(b"|")[2]
    valid_parts = text[2:4] < b"24" and text[4:6] < b"60" and text[6:] < b"60"
    expect(
        len(text) == len("DDHHMMSS") and text.isdigit() and valid_parts,
        "the run time is not DDHHMMSS with valid hours, minutes and seconds",
        expected="DDHHMMSS",
        observed=f"{reply}",
        requirement="4.9/3",
    )


class _RunTime(NamedTuple):
    """A run time, and the times of its request and its reply."""

    run_time_s: int
    requested_s: float
    received_s: float


def _read_run_time(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes
) -> _RunTime | None:
    requested_s = _now_s(subject)
    reported = _running_program(subject, line, "run_program", name)
    return reported and _RunTime(reported.run_time_s, requested_s, _now_s(subject))


def _expect_increase(
    subject: ControllerUnderTest, first: _RunTime, later: _RunTime, message: str
) -> None:
    """Compare the increase of the run time with the elapsed time."""
    scale = subject.ics.time_scale
    min_s = (later.requested_s - first.received_s) * scale
    max_s = (later.received_s - first.requested_s) * scale
    increase_s, tolerance_s = later.run_time_s - first.run_time_s, _TOLERANCE_S + _MAX_DRIFT * max_s
    expect(
        min_s - tolerance_s <= increase_s <= max_s + tolerance_s,
        message,
        expected=UserMessage(
            "{increase_s} s more than {time_s} s",
            increase_s=f"{max_s:.1f}",
            time_s=first.run_time_s,
        ),
        observed=f"{later.run_time_s} s",
        requirement="4.9/5",
    )


def _expect_counted_from_start(
    subject: ControllerUnderTest, requested_s: float, first: _RunTime
) -> None:
    """Expect that the run time is not longer than the run, which was requested at this time."""
    max_s = (first.received_s - requested_s) * subject.ics.time_scale
    expect(
        first.run_time_s <= max_s + _TOLERANCE_S + _MAX_DRIFT * max_s,
        "the run time is longer than this run of the program",
        expected=UserMessage("at most {limit_s} s", limit_s=f"{max_s:.1f}"),
        observed=f"{first.run_time_s} s",
        requirement="4.9/5",
    )


def _now_s(subject: ControllerUnderTest) -> float:
    return subject.now_ns / _NS_PER_S


@case("4.9/6", "4.9/7")
def test_none(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """While no program runs, the reply is 0 without name and time, on every connection."""
    with skip_if_other_program_runs(subject):
        _expect_no_program(line, "a running program is reported although none runs")
        line.close()
        message = "a running program is reported on another connection although none runs"
        _expect_no_program(subject.open(), message)


@case(
    *("4.9/2", "4.9/3", "4.9/4", "4.9/5", "4.9/6", "4.9/8", "4.9/9", "4.9/10"),
    *("4.5/6", "4.6/4", "4.8/4", "4.10/11"),
)
def test_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A running program is reported with all 30 bytes of its name, and its run time increases.

    The clock advances, too, into a leap day. Another program is the default program, if the SUT has
    one. A second client gets the same reply. The run time of a second run begins with 0, and does
    not change when the clock is set.
    """
    other = store_program(subject, line)
    name = store_wait_program(subject, line, _WAIT_S, long_name(subject, NAME_MAX_BYTES))
    if not subject.ics.unsupported.isdisjoint(_DEFAULTS):
        _run_into_a_leap_day(subject, line, name, other)
        return
    with default_program_preserved(subject, line):
        line.ask("set_default_program", other)
        _run_into_a_leap_day(subject, line, name, other)


def _run_into_a_leap_day(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, other: bytes
) -> None:
    with clock_preserved(subject, line):
        try:
            with rollover_if_possible(subject, line, _LEAP_DAY):
                _run_and_check(subject, line, name, other)
            _run_again(subject, line, name)
        finally:
            stop_motion(subject, line)


def _run_and_check(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, other: bytes
) -> None:
    second_line = subject.open() if subject.supports_multiple_connections else line
    requested_s = _now_s(subject)
    begin_or_skip(subject, line, "run_program", name)
    first = clock_before = None
    for _ in range(_READS):
        if first:
            line.wait(_STEP_S / subject.ics.time_scale)
        current = _read_run_time(subject, line, name)
        if current is None:
            break
        if first is None:
            _expect_counted_from_start(subject, requested_s, current)
            first, clock_before = current, _read_clock(subject, line)
            _expect_listed(subject, line, other, name)
        message = "the run time does not match the elapsed time"
        _expect_increase(subject, first, current, message)
        _expect_flag_and_status(line, "4.9/10")
        _expect_flag_and_status(second_line, "4.9/2")
        _expect_clock_advances(subject, clock_before, _read_clock(subject, line))
    else:
        line.result("run_program")
    expect_idle(subject, line, "the robot is not idle although run_program has ended")
    _expect_no_program(line, "a program is reported as running although it has ended")
    if first is None:
        raise EndedTooSoon("the program ended before its status could be requested")


def _run_again(subject: ControllerUnderTest, line: OutgoingConnection, name: bytes) -> None:
    """Expect that the run time begins with 0, and that setting the clock does not change it."""
    requested_s = _now_s(subject)
    begin_or_skip(subject, line, "run_program", name)
    first = _read_run_time(subject, line, name)
    if first is None:
        return
    _expect_counted_from_start(subject, requested_s, first)
    if has_clock(subject):
        with suppress(NoReply):  # a robot that executes need not answer (A-4-3)
            line.ask("set_time", _LEAP_DAY)
    if later := _read_run_time(subject, line, name):
        message = "the run time does not match the elapsed time after the clock was set"
        _expect_increase(subject, first, later, message)


def _expect_listed(
    subject: ControllerUnderTest, line: OutgoingConnection, other: bytes, running: bytes
) -> None:
    """Expect that the running program is listed, if the other one is."""
    try:
        names = program_names(subject, line)
    except NoReply:  # a robot that executes need not answer (A-4-3)
        return
    expect(
        running in names or other not in names,
        "a program is not listed while it runs",
        expected=show(running),
        observed=", ".join(map(show, names)),
        requirement="4.10/11",
    )


def _read_clock(subject: ControllerUnderTest, line: OutgoingConnection) -> ClockSample | None:
    """Return the clock's time; None if there is no reply, for example while busy (A-4-3)."""
    if "get_time" in subject.ics.unsupported:
        return None
    try:
        return read_clock(subject, line)
    except NoReply:
        return None


def _expect_clock_advances(
    subject: ControllerUnderTest, first: ClockSample | None, later: ClockSample | None
) -> None:
    if first is None or later is None:
        return
    if first.time.date() == later.time.date():
        message, requirement = "the clock does not advance while a program runs", "4.6/4"
    else:
        message, requirement = "the clock is wrong after midnight", "4.5/6"
    expect_clock_ran(subject, first, later, message, requirement)


def _expect_flag_and_status(line: OutgoingConnection, requirement: str) -> None:
    """Expect the flag 1 between two statuses 01, whichever client started the program."""
    before = line.ask("get_status").value
    reply = line.ask("get_running_program")
    if before == line.ask("get_status").value == "01":
        expect(
            isinstance(reply.value, RunningProgram),
            "no program is reported although the status is 01",
            expected="1|name|DDHHMMSS",
            observed=f"{reply}",
            requirement=requirement,
        )


@case("4.9/4", "4.9/6", "4.9/10", name="simulated", hazards=PROGRAMS)
def test_simulated(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A simulated program is reported with its name or not reported, also after another program."""
    if RUN not in subject.ics.unsupported:
        start_program(subject, line, RUN, seconds=0)
        wait_for_result(subject, line, RUN)
    name = store_wait_program(subject, line, _WAIT_S)
    try:
        begin_or_skip(subject, line, "simulate_program", name)
        _running_program(subject, line, "simulate_program", name)
    finally:
        stop_motion(subject, line)
    _expect_no_program(line, "a program is reported as running although its simulation has ended")


@case("4.9/3", "4.9/5", name="minute", hazards=PROGRAMS)
def test_minute(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The run time rolls over to minutes."""
    _watch_rollovers(subject, line, (_MINUTE_S,))


@case("4.9/3", "4.9/5", name="day", hazards=PROGRAMS)
def test_day(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The run time rolls over to minutes, hours and days."""
    rollovers_s = (_MINUTE_S, 10 * _MINUTE_S, _HOUR_S, 10 * _HOUR_S, _DAY_S, _DAY_S + _HOUR_S)
    _watch_rollovers(subject, line, rollovers_s)


def _watch_rollovers(
    subject: ControllerUnderTest, line: OutgoingConnection, rollovers_s: tuple[int, ...]
) -> None:
    """Run a program beyond these run times, and read its run time shortly before and after each."""
    duration_s = rollovers_s[-1] + 5
    patient(subject, duration_s)
    name = store_wait_program(subject, line, duration_s)
    scale = subject.ics.time_scale
    try:
        start_s = _now_s(subject)
        begin_or_skip(subject, line, "run_program", name)
        first = None
        for at_s in (s for rollover_s in rollovers_s for s in (rollover_s - 2, rollover_s + 2)):
            line.wait(max(start_s + at_s / scale - _now_s(subject), 0.0))
            current = _read_run_time(subject, line, name)
            if current is None:
                raise CaseInconclusive("a program ended although its wait was not over")
            if first is not None:
                message = UserMessage(
                    "the run time does not match the elapsed time after {duration_s} s",
                    duration_s=rollovers_s[-1],
                )
                _expect_increase(subject, first, current, message)
            first = first or current
    finally:
        stop_motion(subject, line)
