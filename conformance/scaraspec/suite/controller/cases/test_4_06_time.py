"""Clause 4.6: read the clock (0x07, L179-189)."""

from typing import Final

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    ClockSample,
    expect_clock_ran,
    read_clock,
)
from scaraspec.suite.controller.harness.state.preserve import ensure_open, patient
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_STEPS: Final = 6
_STEP_S: Final = 0.35
_READS: Final = 3
_MINUTES_S: Final = 150.0
_HOURS_S: Final = 8 * 3600.0
_INTERVALS: Final = 9  # three days in total


def _expect_not_earlier(first: ClockSample, later: ClockSample) -> None:
    expect(
        later.time >= first.time,
        "the clock went back",
        expected=UserMessage("{time} or later", time=first.time),
        observed=f"{later.time}",
        requirement="4.6/4",
    )


@case("4.6/2", "4.6/3", "4.6/4")
def test_time(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The time is 14 digits of a valid date, never goes back, and advances at the right rate."""
    first = before = read_clock(subject, line)
    for _ in range(_STEPS):
        line.wait(_STEP_S / subject.ics.time_scale)
        for _ in range(_READS):
            current = read_clock(subject, line)
            _expect_not_earlier(before, current)
            message = "the clock does not advance one second per second"
            expect_clock_ran(subject, first, current, message, "4.6/4")
            before = current


@case("4.6/4", name="minutes")
def test_minutes(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The clock keeps its rate over minutes without being read."""
    patient(subject, _MINUTES_S)
    first = read_clock(subject, line)
    line.wait(_MINUTES_S / subject.ics.time_scale)
    line = ensure_open(subject, line)
    message = "the clock is fast or slow over some minutes"
    expect_clock_ran(subject, first, read_clock(subject, line), message, "4.6/4")


@case("4.6/4", name="days")
def test_days(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The clock runs through every hour of several days."""
    patient(subject, _INTERVALS * _HOURS_S)
    first = before = read_clock(subject, line)
    for _ in range(_INTERVALS):
        line.wait(_HOURS_S / subject.ics.time_scale)
        line = ensure_open(subject, line)
        current = read_clock(subject, line)
        _expect_not_earlier(before, current)
        expect_clock_ran(
            subject, before, current, "the clock does not run through the hours of a day", "4.6/4"
        )
        before = current
    expect_clock_ran(subject, first, before, "the clock does not run through days", "4.6/4")
