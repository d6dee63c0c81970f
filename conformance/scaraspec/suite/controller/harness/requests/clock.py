"""Clock: the calendar clock of the subject, compared with the clock of this machine (4.5, 4.6).

A reported time lies between the request and the reply, so a slow link causes no failure.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import datetime, timedelta
from random import Random
from typing import Final, NamedTuple

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, expect
from scaraspec.user_message import UserMessage

SLACK_S: Final = 2.0
"""The tolerance of the clock, in seconds (4.5/4)."""
_DRIFT: Final = 0.01
_NS: Final = 1e9
_BEGIN, _END = datetime(2001, 1, 2), datetime(2099, 1, 1)  # noqa: DTZ001 - the document names no zone
_DAY_S: Final = 86400


class ClockSample(NamedTuple):
    """A reported time, and when it was requested and answered, in seconds since the Unix epoch."""

    time: datetime
    sent_s: float
    answered_s: float


def read_clock(subject: ControllerUnderTest, line: OutgoingConnection) -> ClockSample:
    """Query the time.

    Raises:
        CaseFailed: The reply is not a valid time.
    """
    sent_s = subject.now_ns / _NS
    answer = line.ask("get_time")
    if not isinstance(answer.value, datetime):
        message = "the reply to 0x07 is not a valid time YYYYMMDDHHMMSS"
        requirement = "4.6/3" if _has_form(answer) else "4.6/2"
        raise CaseFailed(
            message, expected="YYYYMMDDHHMMSS", observed=f"{answer}", requirement=requirement
        )
    return ClockSample(answer.value, sent_s, answer.time_s)


def _has_form(answer: ReceivedFrame) -> bool:
    return len(answer.frame.data) == len("YYYYMMDDHHMMSS") and answer.frame.data.isdigit()


def shifted_time(time: datetime, by: timedelta) -> datetime:
    """Return the time of a clock plus a difference.

    Raises:
        CaseInconclusive: The result is outside of the calendar.
    """
    try:
        return time + by
    except OverflowError:
        raise CaseInconclusive(
            UserMessage("the clock shows {time}, too close to an end of the calendar", time=time)
        ) from None


def random_time(random: Random) -> datetime:
    """Return any time of this century."""
    days = random.randrange((_END - _BEGIN).days)
    return _BEGIN + timedelta(days=days, seconds=random.randrange(_DAY_S))


def rollovers(time: datetime) -> tuple[datetime, ...]:
    """Return the begin of its minute, hour, day, month, of March and of its year."""
    day = time.replace(hour=0, minute=0, second=0)
    return (
        time.replace(second=0),
        time.replace(minute=0, second=0),
        day,
        day.replace(day=1),
        day.replace(month=3, day=1),
        day.replace(month=1, day=1),
    )


def has_clock(subject: ControllerUnderTest) -> bool:
    """Whether the clock can be read and set."""
    return subject.ics.unsupported.isdisjoint(("get_time", "set_time"))


def rollover_if_possible(
    subject: ControllerUnderTest, line: OutgoingConnection, time: datetime
) -> AbstractContextManager[object]:
    """Return the context `clock_rolls_over`, or one without effect if there is no clock."""
    return clock_rolls_over(subject, line, time) if has_clock(subject) else nullcontext()


@contextmanager
def clock_rolls_over(
    subject: ControllerUnderTest, line: OutgoingConnection, time: datetime
) -> Iterator[ClockSample]:
    """Set the clock to a second before `time`; require that it ran on when the context ends.

    The context must last a second. It yields the set time.

    Raises:
        CaseFailed: The request is refused, or the clock shows another time.
    """
    first = set_clock(subject, line, time - timedelta(seconds=1))
    yield first
    message = UserMessage("the clock does not roll over to {time}", time=time)
    expect_clock_ran(subject, first, read_clock(subject, line), message, "4.5/6")


def set_clock(
    subject: ControllerUnderTest, line: OutgoingConnection, time: datetime
) -> ClockSample:
    """Set the clock, and return the set time with the time of the request and the reply.

    Raises:
        CaseFailed: The request is refused.
    """
    sent_s = subject.now_ns / _NS
    answer = line.ask("set_time", time)
    message = UserMessage("setting the time {time} was not answered with 1", time=time)
    requirement = "4.5/3" if answer.accepted is None else "4.5/6"
    expect(answer.accepted, message, expected="1", observed=f"{answer}", requirement=requirement)
    return ClockSample(time, sent_s, answer.time_s)


def expect_clock_ran(
    subject: ControllerUnderTest,
    first: ClockSample,
    then: ClockSample,
    message: str,
    requirement: str = "",
) -> None:
    """Require that the clock ran correctly between two samples.

    Raises:
        CaseFailed: The clock advanced too little or too much.
    """
    scale = subject.ics.time_scale
    min_s = max(then.sent_s - first.answered_s, 0.0) * scale
    max_s = (then.answered_s - first.sent_s) * scale
    slack_s = SLACK_S + _DRIFT * max_s
    advance_s = (then.time - first.time).total_seconds()
    expect(
        min_s - slack_s <= advance_s <= max_s + slack_s,
        message,
        expected=UserMessage(
            "{elapsed_s} s after {time}", elapsed_s=f"{min_s:.1f}", time=first.time
        ),
        observed=UserMessage(
            "{time}, {elapsed_s} s after it", time=then.time, elapsed_s=f"{advance_s:g}"
        ),
        requirement=requirement,
    )
