"""Clause 4.5: set the clock (0x06, L167-177)."""

from datetime import datetime, timedelta
from random import Random
from typing import Final

from hypothesis import Phase, example, settings
from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_NAME
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    ClockSample,
    clock_rolls_over,
    expect_clock_ran,
    random_time,
    read_clock,
    rollovers,
    set_clock,
    shifted_time,
)
from scaraspec.suite.controller.harness.state.preserve import patient, settings_preserved
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.engine.strategies import payload_values
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage

_NS_PER_S: Final = 1e9


def _datetime(text: str) -> datetime:
    return datetime.strptime(text, "%Y%m%d%H%M%S")  # noqa: DTZ007 - the document has no time zone


_NOON: Final = _datetime("20240615120000")
_EDGES: Final = tuple(
    map(
        _datetime,
        (
            "20000101000000",
            "20000229123456",
            "20280229235959",
            "20241231120000",  # the 366th day
            "20380119031408",  # does not fit 32 bits of seconds
            "20960229000000",
            "20991231235959",
            *(f"2026{month:02}31120000" for month in (1, 3, 5, 7, 8, 10, 12)),
        ),
    )
)
_MAIN_ROLLOVERS: Final = tuple(
    map(_datetime, ("20250101000000", "20240229000000", "20230301000000"))
)
"""Rollovers to try first if time is short: the new year and leap days."""
_OTHER_ROLLOVERS: Final = tuple(
    map(
        _datetime,
        (
            "20240615120100",
            "20240615200000",
            "20240616000000",
            "20240501000000",
            "20240731000000",
            "20240801000000",
            "20241010100000",
            "20240301000000",
            "20000229000000",
            "20000301000000",
            "20960229000000",
            "20380119031408",
        ),
    )
)
_FEWEST_ROLLOVERS: Final = 4
_ROLLOVER_S: Final = 1.1
"""Wait from one second before a rollover until after it."""
_DRIFT_CHECK_S: Final = 2.1
"""Wait after which a stopped clock exceeds the tolerance."""


@case("4.5/4", "4.5/3")
def test_set(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The clock shows the time that was set, regardless of the time before."""
    with settings_preserved(subject, line, "clock"):
        for time in examples((_NOON, _NOON - timedelta(days=400))):
            first = set_clock(subject, line, time)
            message = "the clock does not show the time that was set"
            expect_clock_ran(subject, first, read_clock(subject, line), message)


@case("4.5/4", "4.5/3", name="while-running", hazards=PROGRAMS)
def test_set_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting the clock while a program runs is answered "1" and works, or "0" without a change."""
    with settings_preserved(subject, line, "clock"), running(subject, line):
        first, requested_s = read_clock(subject, line), subject.now_ns / _NS_PER_S
        day = shifted_time(first.time, timedelta(days=1))  # later, so that a wait by the clock ends
        time = day.replace(hour=12)  # an hour that exists on every day
        reply = line.ask("set_time", time)
        if reply.accepted:
            first = ClockSample(time, requested_s, reply.time_s)
        message = UserMessage(
            "setting the clock while a program ran was answered {reply}, but the clock differs",
            reply=reply,
        )
        expect_clock_ran(subject, first, read_clock(subject, line), message, "4.5/4")


@case("4.5/6", "4.5/4")
def test_every_moment(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every time from 2000 to 2099 can be set, and the clock then reports it."""

    @given(payload_values(BY_NAME["set_time"].request))
    def set_and_check(time: datetime) -> None:
        first = set_clock(subject, line, time)
        message = "the clock does not show the time that was set"
        expect_clock_ran(subject, first, read_clock(subject, line), message, "4.5/4")

    for time in _EDGES:
        set_and_check = example(time)(set_and_check)
    with settings_preserved(subject, line, "clock"):
        set_and_check()


def _expect_rollover(
    subject: ControllerUnderTest, line: OutgoingConnection, time: datetime
) -> ClockSample:
    with clock_rolls_over(subject, line, time) as first:
        line.wait(_ROLLOVER_S / subject.ics.time_scale)
    return first


@case("4.5/6", "4.5/4", name="new-year", slow=True)
def test_new_year(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The clock rolls over to a new year, to 29 February and from 28 February, and continues."""
    with settings_preserved(subject, line, "clock"):
        for time in examples(_MAIN_ROLLOVERS):
            first = _expect_rollover(subject, line, time)
        line.wait((_DRIFT_CHECK_S - _ROLLOVER_S) / subject.ics.time_scale)
        message = "the clock did not continue from the time that was set"
        expect_clock_ran(subject, first, read_clock(subject, line), message, "4.5/4")


@case("4.5/6", name="month")
def test_month(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The clock rolls over to a new month at midnight."""
    with settings_preserved(subject, line, "clock"):
        _expect_rollover(subject, line, _datetime("20240501000000"))


@case("4.5/6", name="rollovers", slow=True)
def test_rollovers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The clock rolls over to minutes, hours, days, months and years, listed and random ones.

    If time is short, fewer of them are tried.
    """
    patient(subject, (_FEWEST_ROLLOVERS + 1) * _ROLLOVER_S)
    count = max(1, settings().max_examples // 4)
    most = subject.access.wait_limit_s * subject.ics.time_scale / _ROLLOVER_S
    fitting = int(min(most, len(_OTHER_ROLLOVERS) + count))
    count = min(count, fitting - _FEWEST_ROLLOVERS)
    with settings_preserved(subject, line, "clock"):
        for time in examples(_OTHER_ROLLOVERS[: fitting - count]):
            _expect_rollover(subject, line, time)

        @settings(max_examples=count, phases=(Phase.generate,))
        @given(st.integers(0, 2**64))
        def roll_over(seed: int) -> None:
            drawn = Random(seed)  # noqa: S311 - it must be reproducible
            _expect_rollover(subject, line, drawn.choice(rollovers(random_time(drawn))))

        roll_over()


@case("4.5/5")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An invalid time is not answered 1, and the clock continues."""
    with settings_preserved(subject, line, "clock"):
        first = set_clock(subject, line, _NOON)
        for wrong in examples(malformed("set_time", _NOON + timedelta(days=700), subject.dialect)):
            result = send_malformed(subject, line, "set_time", wrong)
            line = result.line
            expect(
                not (result.accepted and wrong.firm),
                UserMessage("{wrong} was accepted as a time", wrong=wrong),
                expected="0",
                observed=f"{result}",
            )
            if result.accepted:
                first = set_clock(subject, line, _NOON)
            message = UserMessage(
                "the clock did not continue after {wrong} was refused", wrong=wrong
            )
            expect_clock_ran(subject, first, read_clock(subject, line), message)
