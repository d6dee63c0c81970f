"""Mutants of clause 4.5: setting the clock."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, Final

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    answer_when,
    busy,
    decoded,
    executes_first,
    on_request,
    reads,
)
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_DAY: Final = timedelta(days=1)
_END_OF_32_BITS: Final = datetime(2038, 1, 19, 3, 14, 7)  # noqa: DTZ001 - the document names no zone
_DIGITS: Final = 14


def _sets(change: Callable[[datetime], datetime]) -> Core:
    """The clock is set to another time than the sent one."""
    return decoded("set_time", lambda _core, _frame, time: time and change(time))


def _refuses(when: Callable[[datetime], bool]) -> Core:
    return answer_when("set_time", lambda _core, request: when(request.value), value=False)


def _is_leap_day(time: datetime) -> bool:
    return (time.month, time.day) == (2, 29)


def _set_time_of_day(core: ControllerCore, request: Request) -> bool:
    date = core.plant.clock.time(request.now_s).date()
    core.plant.clock.set(datetime.combine(date, request.value.time()), request.now_s)
    return True


def _shows(change: Callable[[datetime, datetime], datetime]) -> Core:
    """Once set, the clock shows a function of the set time and of the correct time."""

    class Shows(ControllerCore):
        _set_to: datetime | None = None

        def set_time(self, request: Request) -> bool:
            self._set_to = request.value
            return super().set_time(request)

        def get_time(self, request: Request) -> datetime:
            time = super().get_time(request)
            return time if self._set_to is None else change(self._set_to, time)

    return Shows


def _limits(at: int, limit: int, instead: bytes) -> Core:
    """Two digits of a new time are replaced if they are above a limit."""

    def limited(data: bytes) -> bytes:
        digits = data[at : at + 2]
        is_above = len(data) == _DIGITS and digits.isdigit() and int(digits) > limit
        return data[:at] + instead + data[at + 2 :] if is_above else data

    return reads("set_time", limited)


def _limit_day(data: bytes) -> bytes:
    is_late = len(data) == _DIGITS and data.isdigit() and b"28" < data[6:8] < b"32"
    return data[:6] + b"28" + data[8:] if is_late else data


row(
    "time-is-forgotten",
    "4.5/4",
    "A new time is answered 1 but not set.",
    on_request("set_time", lambda _core, _request: True),
)
row(
    "time-is-an-hour-off",
    "4.5/4",
    "The clock is set one hour ahead.",
    _sets(lambda time: time + timedelta(hours=1)),
)
row(
    "day-and-month-are-mixed-up",
    "4.5/4",
    "Day and month of a new time are exchanged if the day is 12 or less.",
    _sets(lambda time: time.replace(day=time.month, month=time.day) if time.day <= 12 else time),
)
row(
    "seconds-are-not-set",
    "4.5/4",
    "The clock starts at second 0 of the sent minute.",
    _sets(lambda time: time.replace(second=0)),
)
row(
    "time-is-forgotten-during-arun",
    "4.5/4",
    "While a program runs, a new time is answered 1 but not set.",
    answer_when("set_time", busy, value=True),
    subtle=True,
)
row(
    "only-the-time-of-day-is-set",
    "4.5/4",
    "A new time changes the time of day but not the date.",
    on_request("set_time", _set_time_of_day),
)


@mutant("clock-stops-once-set", "4.5/4")
class StopsClockOnceSet(ControllerCore):
    """Once set, the clock always shows the set time."""

    _stopped: datetime | None = None

    def set_time(self, request: Request) -> bool:
        self._stopped = request.value
        return super().set_time(request)

    def get_time(self, request: Request) -> datetime:
        return self._stopped or super().get_time(request)


row(
    "time-answered-with-the-time",
    "4.5/3",
    "A new time is answered with 1 and a time.",
    first_reply("set_time", {b"1": b"1|20240615120000"}),
)
row(
    "time-answered-in-binary",
    "4.5/3",
    "A new time is answered with a frame without data.",
    first_reply("set_time", {b"1": b""}),
)
row(
    "leap-days-are-refused",
    "4.5/6",
    "29 February is answered 0 in every year.",
    _refuses(_is_leap_day),
)
row(
    "century-is-no-leap-year",
    "4.5/6",
    "29 February 2000 is answered 0.",
    _refuses(lambda time: time.year % 100 == 0 and _is_leap_day(time)),
    subtle=True,
)
row(
    "times-behind2038-are-refused",
    "4.5/6",
    "A time that exceeds 32 bits of seconds is answered 0.",
    _refuses(lambda time: time > _END_OF_32_BITS),
    subtle=True,
)
row(
    "years-have-two-digits",
    "4.5/6 4.5/4",
    "Years from 2070 on are set 100 years earlier.",
    _sets(lambda time: time.replace(year=time.year - 100) if time.year >= 2070 else time),
    subtle=True,
)
row(
    "midnight-is-skipped",
    "4.5/6",
    "The date does not change at midnight.",
    _shows(lambda was, time: datetime.combine(was.date(), time.time())),
    subtle=True,
)
row(
    "new-year-is-skipped",
    "4.5/6",
    "The year does not change after December.",
    _shows(lambda was, time: time.replace(year=was.year)),
    subtle=True,
)
row(
    "leap-day-is-skipped",
    "4.5/6",
    "28 February is followed by 1 March in every year.",
    _shows(lambda was, time: time + _DAY if _is_leap_day(time) and was.day != time.day else time),
    subtle=True,
)
row(
    "leap-day-every-year",
    "4.5/6",
    "The day before 1 March lasts two days if the clock was set on 28 February.",
    _shows(
        lambda was, time: (
            time - _DAY if (was.month, was.day, time.month, time.day) == (2, 28, 3, 1) else time
        )
    ),
    subtle=True,
)
row(
    "months-of-thirty-days",
    "4.5/6",
    "The 30th of every month is followed by the 1st of the next month.",
    _shows(lambda was, time: time + _DAY if time.day == 31 and was.day != time.day else time),
    subtle=True,
)
row(
    "thirty-one-days-in-every-month",
    "4.5/6",
    "The last day of a month is shown again on the next day if the clock was set on a 30th.",
    _shows(lambda was, time: time - _DAY if was.day == 30 and time.day == 1 else time),
    subtle=True,
)
row(
    "hours-do-not-carry",
    "4.5/6",
    "The hour does not change after minute 59.",
    _shows(
        lambda was, time: time.replace(hour=was.hour) if was.date() == time.date() else time,
    ),
    subtle=True,
)
row(
    "tens-of-hours-do-not-carry",
    "4.5/6",
    "Hour 19 is followed by hour 10.",
    _shows(
        lambda was, time: (
            time.replace(hour=10)
            if was.date() == time.date() and (was.hour, time.hour) == (19, 20)
            else time
        )
    ),
    subtle=True,
)
row(
    "minutes-do-not-carry",
    "4.5/6",
    "The minute does not change after second 59.",
    _shows(
        lambda was, time: (
            time.replace(minute=was.minute)
            if (was.date(), was.hour) == (time.date(), time.hour)
            else time
        )
    ),
    subtle=True,
)
row(
    "thirteenth-month-is-taken",
    "4.5/5",
    "A month above 12 is read as December.",
    _limits(4, 12, b"12"),
)
row(
    "hour-twenty-four-is-taken",
    "4.5/5",
    "An hour above 23 is read as 00.",
    _limits(8, 23, b"00"),
)
row(
    "minute-sixty-is-taken",
    "4.5/5",
    "A minute above 59 is read as 59.",
    _limits(10, 59, b"59"),
)
row(
    "thirtieth-of-february-is-taken",
    "4.5/5",
    "The days 29, 30 and 31 are read as the 28th in every month.",
    reads("set_time", _limit_day),
)
row(
    "zeroth-month-is-taken",
    "4.5/5",
    "Month 00 is read as January.",
    reads("set_time", lambda data: data[:4] + b"01" + data[6:] if data[4:6] == b"00" else data),
)
row(
    "short-times-are-filled-up",
    "4.5/5",
    "A time that is too short is extended with zeros.",
    reads("set_time", lambda data: data.ljust(_DIGITS, b"0") if data else data),
)
row(
    "long-times-are-cut",
    "4.5/5",
    "Data after the fourteenth digit are ignored.",
    reads("set_time", lambda data: data[:_DIGITS]),
)
row(
    "signs-in-times-are-digits",
    "4.5/5",
    "A character that is not a digit is read as 0.",
    reads("set_time", lambda data: bytes(c if chr(c) in "0123456789" else ord("0") for c in data)),
)


@mutant("refused-time-resets-the-clock", "4.5/5")
class ResetsClockOnRefusal(ControllerCore):
    """A refused time sets the clock to the year 2000."""

    _now_s = 0.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._now_s = now_s
        super().handle(session, frame, now_s)

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == "set_time" and value is None:
            time = self._set_instead(command, frame)
            if time is not None:
                self.plant.clock.set(time, self._now_s)
        return value

    def _set_instead(self, _command: Command, _frame: Frame) -> datetime | None:
        return datetime(2000, 1, 1)  # noqa: DTZ001 - the document names no zone


@mutant("refused-time-sets-the-date", "4.5/5")
class SetsDateOfRefusedTime(ResetsClockOnRefusal):
    """A time that is refused because of its time of day sets the date."""

    def _set_instead(self, command: Command, frame: Frame) -> Any:
        if len(frame.data) != _DIGITS or not frame.data.isdigit():
            return None
        midnight = frame._replace(data=frame.data[:8] + b"000000")
        return ControllerCore._value(self, command, midnight)  # noqa: SLF001 - its own


row(
    "two-times-per-connection",
    "4.5/4",
    "Only the first two times of a connection are set; later ones are answered 1.",
    executes_first("set_time", 2),
    subtle=True,
)
