"""Clock: the subject's calendar clock, compared with the time of this machine (4.5, 4.6).

A reading lies between two moments of ours, when it was asked for and when it was answered: a slow
link makes no clock wrong.
"""

from datetime import datetime, timedelta
from typing import Final, NamedTuple

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, expect
from scaraspec.user_message import UserMessage

SLACK_S: Final = 2.0
"""What a clock may be off (4.5/4)."""
_DRIFT: Final = 0.01
_NS: Final = 1e9


class ClockSample(NamedTuple):
    """What the clock showed, and between which moments of ours, in seconds."""

    time: datetime
    asked_s: float
    answered_s: float


def read_clock(subject: ControllerUnderTest, line: OutgoingConnection) -> ClockSample:
    """Ask for the time.

    Raises:
        CaseFailed: The reply is no time of the calendar.
    """
    asked_s = subject.now_ns / _NS
    answer = line.ask("get_time")
    if not isinstance(answer.value, datetime):
        message = "the reply to 0x07 is no time YYYYMMDDHHMMSS of the calendar"
        requirement = "4.6/3" if _has_form(answer) else "4.6/2"
        raise CaseFailed(
            message, expected="YYYYMMDDHHMMSS", observed=f"{answer}", requirement=requirement
        )
    return ClockSample(answer.value, asked_s, answer.time_s)


def _has_form(answer: ReceivedFrame) -> bool:
    return len(answer.frame.data) == len("YYYYMMDDHHMMSS") and answer.frame.data.isdigit()


def shifted_time(time: datetime, by: timedelta) -> datetime:
    """Another time, so much later than the time of a clock.

    Raises:
        CaseInconclusive: The calendar has no such time.
    """
    try:
        return time + by
    except OverflowError:
        raise CaseInconclusive(
            UserMessage("the clock tells {time}, next to an end of the calendar", time=time)
        ) from None


def set_clock(
    subject: ControllerUnderTest, line: OutgoingConnection, time: datetime
) -> ClockSample:
    """Set the clock; what it showed then.

    Raises:
        CaseFailed: It is refused.
    """
    asked_s = subject.now_ns / _NS
    answer = line.ask("set_time", time)
    message = UserMessage("the time {time} was not answered 1", time=time)
    requirement = "4.5/3" if answer.accepted is None else "4.5/6"
    expect(answer.accepted, message, expected="1", observed=f"{answer}", requirement=requirement)
    return ClockSample(time, asked_s, answer.time_s)


def expect_clock_ran(
    subject: ControllerUnderTest,
    first: ClockSample,
    then: ClockSample,
    message: str,
    requirement: str = "",
) -> None:
    """Fail the subject unless its clock ran from one reading to the other.

    Raises:
        CaseFailed: It did not.
    """
    scale = subject.ics.time_scale
    least_s = max(then.asked_s - first.answered_s, 0.0) * scale
    most_s = (then.answered_s - first.asked_s) * scale
    slack_s = SLACK_S + _DRIFT * most_s
    advance_s = (then.time - first.time).total_seconds()
    expect(
        least_s - slack_s <= advance_s <= most_s + slack_s,
        message,
        expected=f"{least_s:.1f} s after {first.time}",
        observed=f"{then.time}, {advance_s:g} s after it",
        requirement=requirement,
    )
