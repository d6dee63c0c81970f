"""Faults of clause 4.5: setting the clock."""

from abc import ABC, abstractmethod
from datetime import datetime, timedelta
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies, Mends
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_MONTHS: Final = 12
_HOUR: Final = timedelta(hours=1)
_DAY: Final = timedelta(days=1)
_END_OF_32_BITS: Final = datetime(2038, 1, 19, 3, 14, 7)  # noqa: DTZ001 - the document names no zone
_DIGITS: Final = 14


class _SetsOtherwise(ControllerCore, ABC):
    """The clock is set to another time than was sent."""

    @abstractmethod
    def wrong(self, time: datetime) -> datetime:
        """What it is set to."""

    def set_time(self, request: Request) -> bool:
        """Set it to that."""
        self.plant.clock.set(self.wrong(request.value), request.now_s)
        return True


@mutant("time-is-forgotten", "4.5/4")
class TimeIsForgotten(ControllerCore):
    """A new time is answered 1 and not set."""

    def set_time(self, request: Request) -> bool:
        """Do nothing."""
        return request.value is not None


@mutant("time-is-an-hour-off", "4.5/4")
class TimeIsAnHourOff(_SetsOtherwise):
    """The clock is set by a zone that nobody spoke of."""

    def wrong(self, time: datetime) -> datetime:
        """Add an hour."""
        return time + _HOUR


@mutant("day-and-month-are-mixed-up", "4.5/4")
class DayAndMonthAreMixedUp(_SetsOtherwise):
    """Day and month are set in each other's place, where both can be months."""

    def wrong(self, time: datetime) -> datetime:
        """Swap them."""
        return time.replace(day=time.month, month=time.day) if time.day <= _MONTHS else time


@mutant("seconds-are-not-set", "4.5/4")
class SecondsAreNotSet(_SetsOtherwise):
    """The clock begins with second 0, whatever second was sent."""

    def wrong(self, time: datetime) -> datetime:
        """Leave the seconds out."""
        return time.replace(second=0)


@mutant("time-is-forgotten-during-arun", "4.5/4", subtle=True)
class TimeIsForgottenDuringARun(ControllerCore):
    """While a program runs a new time is answered 1 and not set."""

    def set_time(self, request: Request) -> bool:
        """Do nothing then."""
        return self.robot.task is not None or super().set_time(request)


@mutant("only-the-time-of-day-is-set", "4.5/4")
class OnlyTheTimeOfDayIsSet(ControllerCore):
    """The date remains what it was."""

    def set_time(self, request: Request) -> bool:
        """Keep the date."""
        date = self.plant.clock.time(request.now_s).date()
        self.plant.clock.set(datetime.combine(date, request.value.time()), request.now_s)
        return True


@mutant("clock-stops-once-set", "4.5/4")
class ClockStopsOnceSet(ControllerCore):
    """The clock shows the time that was set, and no other one from then on."""

    _stopped: datetime | None = None

    def set_time(self, request: Request) -> bool:
        """Stop it."""
        self._stopped = request.value
        return super().set_time(request)

    def get_time(self, request: Request) -> datetime:
        """Show it."""
        return self._stopped or super().get_time(request)


@mutant("time-answered-with-the-time", "4.5/3")
class TimeAnsweredWithTheTime(AltersReplies):
    """A new time is answered with the time."""

    opcode = 0x06

    def altered(self, data: bytes) -> bytes:
        """Say more than a flag."""
        return b"1|20240615120000" if data == b"1" else data


@mutant("time-answered-in-binary", "4.5/3")
class TimeAnsweredInBinary(AltersReplies):
    """A new time is answered with an empty frame, as a sign that it arrived."""

    opcode = 0x06

    def altered(self, data: bytes) -> bytes:
        """Say nothing."""
        return b"" if data == b"1" else data


@mutant("leap-days-are-refused", "4.5/6")
class LeapDaysAreRefused(ControllerCore):
    """29 February is answered 0 in every year."""

    def set_time(self, request: Request) -> bool:
        """Know no such day."""
        time: datetime = request.value
        return (time.month, time.day) != (2, 29) and super().set_time(request)


@mutant("century-is-no-leap-year", "4.5/6", subtle=True)
class CenturyIsNoLeapYear(ControllerCore):
    """29 February 2000 is answered 0: the rule of the fourth century is missing."""

    def set_time(self, request: Request) -> bool:
        """Know no such day in it."""
        time: datetime = request.value
        leap = time.year % 100 != 0 or (time.month, time.day) != (2, 29)
        return leap and super().set_time(request)


@mutant("times-behind2038-are-refused", "4.5/6", subtle=True)
class TimesBehind2038AreRefused(ControllerCore):
    """What 32 bits of seconds cannot hold is answered 0."""

    def set_time(self, request: Request) -> bool:
        """Bound it."""
        return request.value <= _END_OF_32_BITS and super().set_time(request)


@mutant("years-have-two-digits", "4.5/6", "4.5/4", subtle=True)
class YearsHaveTwoDigits(_SetsOtherwise):
    """Years from 2070 on are taken for 1970 and those behind it."""

    def wrong(self, time: datetime) -> datetime:
        """Read two digits."""
        return time.replace(year=time.year - 100) if time.year >= 2070 else time


class _RollsOtherwise(ControllerCore, ABC):
    """The clock runs from the time that was set, and goes over into another day than it should."""

    _set_to = _shown = datetime.min  # noqa: DTZ901 - the document names no zone

    def set_time(self, request: Request) -> bool:
        """Remember it."""
        self._set_to = request.value
        return super().set_time(request)

    @abstractmethod
    def wrong(self, was: datetime, time: datetime) -> datetime:
        """What is shown at a time, where the clock was set to another one."""

    def get_time(self, request: Request) -> datetime:
        """Show that."""
        time = super().get_time(request)
        return time if self._set_to == datetime.min else self.wrong(self._set_to, time)  # noqa: DTZ901 - as above


@mutant("midnight-is-skipped", "4.5/6", subtle=True)
class MidnightIsSkipped(_RollsOtherwise):
    """At midnight the time of day begins anew, and the date remains."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Keep the date."""
        return datetime.combine(was.date(), time.time())


@mutant("new-year-is-skipped", "4.5/6", subtle=True)
class NewYearIsSkipped(_RollsOtherwise):
    """Behind December comes January of the same year."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Keep the year."""
        return time.replace(year=was.year)


@mutant("leap-day-is-skipped", "4.5/6", subtle=True)
class LeapDayIsSkipped(_RollsOtherwise):
    """Behind 28 February comes 1 March in every year."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Skip the day."""
        skipped = (time.month, time.day) == (2, 29) and was.day != time.day
        return time + _DAY if skipped else time


@mutant("leap-day-every-year", "4.5/6", subtle=True)
class LeapDayEveryYear(_RollsOtherwise):
    """Behind 28 February one day more passes than there is, in common years too."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Show that day as the one before."""
        extra = (was.month, was.day, time.month, time.day) == (2, 28, 3, 1)
        return time - _DAY if extra else time


@mutant("months-of-thirty-days", "4.5/6", subtle=True)
class MonthsOfThirtyDays(_RollsOtherwise):
    """Behind the 30th of every month comes the 1st of the next one."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Skip the 31st."""
        return time + _DAY if time.day == 31 and was.day != time.day else time


@mutant("thirty-one-days-in-every-month", "4.5/6", subtle=True)
class ThirtyOneDaysInEveryMonth(_RollsOtherwise):
    """Behind the 30th of every month comes another day of it, shown as the 30th."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Show the last day again."""
        extra = was.day == 30 and time.day == 1
        return time - _DAY if extra else time


@mutant("hours-do-not-carry", "4.5/6", subtle=True)
class HoursDoNotCarry(_RollsOtherwise):
    """Behind minute 59 the minutes begin anew, and the hour remains."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Keep the hour."""
        same = was.date() == time.date()
        return time.replace(hour=was.hour) if same else time


@mutant("tens-of-hours-do-not-carry", "4.5/6", subtle=True)
class TensOfHoursDoNotCarry(_RollsOtherwise):
    """Behind 19 o'clock comes 10 o'clock."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Keep the tens."""
        carried = was.date() == time.date() and (was.hour, time.hour) == (19, 20)
        return time.replace(hour=10) if carried else time


@mutant("minutes-do-not-carry", "4.5/6", subtle=True)
class MinutesDoNotCarry(_RollsOtherwise):
    """Behind second 59 the seconds begin anew, and the minute remains."""

    def wrong(self, was: datetime, time: datetime) -> datetime:
        """Keep the minute."""
        same = (was.date(), was.hour) == (time.date(), time.hour)
        return time.replace(minute=was.minute) if same else time


class _TakesMore(Mends):
    """Times that no calendar has are taken for others."""

    command = "set_time"

    def field(self, data: bytes, at: int, limit: int, instead: bytes) -> bytes:
        """The data, with two digits replaced that are above a limit."""
        digits = data[at : at + 2]
        wrong = len(data) == _DIGITS and digits.isdigit() and int(digits) > limit
        return data[:at] + instead + data[at + 2 :] if wrong else data


@mutant("thirteenth-month-is-taken", "4.5/5")
class ThirteenthMonthIsTaken(_TakesMore):
    """A month above 12 is taken for December."""

    def mended(self, data: bytes) -> bytes:
        """Bound it."""
        return self.field(data, 4, 12, b"12")


@mutant("hour-twenty-four-is-taken", "4.5/5")
class HourTwentyFourIsTaken(_TakesMore):
    """An hour above 23 is taken for midnight."""

    def mended(self, data: bytes) -> bytes:
        """Begin anew."""
        return self.field(data, 8, 23, b"00")


@mutant("minute-sixty-is-taken", "4.5/5")
class MinuteSixtyIsTaken(_TakesMore):
    """A minute above 59 is taken for 59."""

    def mended(self, data: bytes) -> bytes:
        """Bound it."""
        return self.field(data, 10, 59, b"59")


@mutant("thirtieth-of-february-is-taken", "4.5/5")
class ThirtiethOfFebruaryIsTaken(Mends):
    """Any day up to 31 is taken in every month, and becomes its 28th."""

    command = "set_time"

    def mended(self, data: bytes) -> bytes:
        """Look at the day alone."""
        day = data[6:8]
        late = len(data) == _DIGITS and data.isdigit() and b"28" < day < b"32"
        return data[:6] + b"28" + data[8:] if late else data


@mutant("zeroth-month-is-taken", "4.5/5")
class ZerothMonthIsTaken(Mends):
    """Month 00 is taken for January, as programs count."""

    command = "set_time"

    def mended(self, data: bytes) -> bytes:
        """Count from 0."""
        return data[:4] + b"01" + data[6:] if data[4:6] == b"00" else data


@mutant("short-times-are-filled-up", "4.5/5")
class ShortTimesAreFilledUp(Mends):
    """A time that is too short is filled up with zeros."""

    command = "set_time"

    def mended(self, data: bytes) -> bytes:
        """Fill it up."""
        return data.ljust(_DIGITS, b"0") if data else data


@mutant("long-times-are-cut", "4.5/5")
class LongTimesAreCut(Mends):
    """What stands behind the fourteenth digit is not looked at."""

    command = "set_time"

    def mended(self, data: bytes) -> bytes:
        """Cut it."""
        return data[:_DIGITS]


@mutant("signs-in-times-are-digits", "4.5/5")
class SignsInTimesAreDigits(Mends):
    """A character that is no digit is taken for 0."""

    command = "set_time"

    def mended(self, data: bytes) -> bytes:
        """Replace each."""
        return bytes(c if chr(c) in "0123456789" else ord("0") for c in data)


@mutant("refused-time-resets-the-clock", "4.5/5")
class RefusedTimeResetsTheClock(ControllerCore):
    """A time that is refused sets the clock to the year 2000."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = super()._value(command, frame)
        if command.name == "set_time" and value is None:
            self.plant.clock.set(datetime(2000, 1, 1), self._now_s)  # noqa: DTZ001 - the document names no zone
        return value

    _now_s = 0.0

    def _process_due(self, now_s: float) -> None:
        self._now_s = now_s
        super()._process_due(now_s)


@mutant("refused-time-sets-the-date", "4.5/5")
class RefusedTimeSetsTheDate(RefusedTimeResetsTheClock):
    """Of a time that is refused for its time of day the date is set all the same."""

    def _value(self, command: Command, frame: Frame) -> Any:
        value = ControllerCore._value(self, command, frame)  # noqa: SLF001 - its own
        whole = len(frame.data) == _DIGITS and frame.data.isdigit()
        if command.name == "set_time" and value is None and whole:
            day = frame._replace(data=frame.data[:8] + b"000000")
            date = ControllerCore._value(self, command, day)  # noqa: SLF001 - its own
            if date is not None:
                self.plant.clock.set(date, self._now_s)
        return value
