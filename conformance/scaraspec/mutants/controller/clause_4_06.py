"""Faults of clause 4.6: the clock as it is told, and how it runs."""

from abc import ABC, abstractmethod
from datetime import datetime, timedelta
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_GET_TIME: Final = 0x07
_TWELVE: Final = 12
_LOST_COUNT_S: Final = 60.0


@mutant("time-with-separators", "4.6/2")
class TimeWithSeparators(AltersReplies):
    """The time is told as people write it."""

    opcode = _GET_TIME

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        date = b"-".join((data[:4], data[4:6], data[6:8]))
        return date + b" " + b":".join((data[8:10], data[10:12], data[12:]))


@mutant("time-with-two-digits-of-the-year", "4.6/2")
class TimeWithTwoDigitsOfTheYear(AltersReplies):
    """The time has twelve digits: the century is missing."""

    opcode = _GET_TIME

    def altered(self, data: bytes) -> bytes:
        """Leave it away."""
        return data[2:]


@mutant("time-without-leading-zeros", "4.6/2")
class TimeWithoutLeadingZeros(AltersReplies):
    """Numbers below ten have one digit."""

    opcode = _GET_TIME

    def altered(self, data: bytes) -> bytes:
        """Leave the zeros away."""
        pairs = (data[i : i + 2] for i in range(4, 14, 2))
        return data[:4] + b"".join(b"%d" % int(pair) for pair in pairs)


@mutant("time-with-milliseconds", "4.6/2")
class TimeWithMilliseconds(AltersReplies):
    """The time has seventeen digits."""

    opcode = _GET_TIME

    def altered(self, data: bytes) -> bytes:
        """Add three."""
        return data + b"000"


@mutant("months-from-zero", "4.6/3")
class MonthsFromZero(AltersReplies):
    """January is month 00, as programs count."""

    opcode = _GET_TIME

    def altered(self, data: bytes) -> bytes:
        """Count from 0."""
        return data[:4] + b"%02d" % (int(data[4:6]) - 1) + data[6:]


@mutant("hours-from-one", "4.6/3")
class HoursFromOne(AltersReplies):
    """The first hour of the day is told as hour 24."""

    opcode = _GET_TIME

    def altered(self, data: bytes) -> bytes:
        """Count from 1."""
        return data[:8] + (b"24" if data[8:10] == b"00" else data[8:10]) + data[10:]


@mutant("clock-stands-still", "4.6/4")
class ClockStandsStill(ControllerCore):
    """The clock shows when it was set or switched on, and no other time."""

    def get_time(self, request: Request) -> datetime:
        """Show that."""
        return self.plant.clock.time(request.now_s) if self._first is None else self._first

    _first: datetime | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._first = self.plant.clock.time(0.0)

    def set_time(self, request: Request) -> bool:
        """Take another one."""
        self._first = request.value
        return super().set_time(request)


class _RunsOtherwise(ControllerCore, ABC):
    """The clock runs at another rate than time."""

    _origin: tuple[datetime, float] | None = None

    @abstractmethod
    def wrong_s(self, passed_s: float) -> float:
        """How much the clock gains in so much time."""

    def set_time(self, request: Request) -> bool:
        """Begin anew."""
        self._origin = request.value, request.now_s
        return super().set_time(request)

    def get_time(self, request: Request) -> datetime:
        """Show that."""
        if self._origin is None:
            self._origin = super().get_time(request), request.now_s
        begun, begun_s = self._origin
        return begun + timedelta(seconds=self.wrong_s(request.now_s - begun_s))


@mutant("clock-runs-fast", "4.6/4")
class ClockRunsFast(_RunsOtherwise):
    """The clock gains a twentieth."""

    def wrong_s(self, passed_s: float) -> float:
        """Run faster."""
        return passed_s * 1.05


@mutant("clock-runs-slow", "4.6/4")
class ClockRunsSlow(_RunsOtherwise):
    """The clock loses a twentieth."""

    def wrong_s(self, passed_s: float) -> float:
        """Run slower."""
        return passed_s * 0.95


@mutant("clock-runs-twice-as-fast", "4.6/4")
class ClockRunsTwiceAsFast(_RunsOtherwise):
    """Each second is counted twice."""

    def wrong_s(self, passed_s: float) -> float:
        """Count twice."""
        return passed_s * 2


@mutant("clock-loses-long-idle-times", "4.6/4", subtle=True)
class ClockLosesLongIdleTimes(_RunsOtherwise):
    """Where nobody asks for a minute, the clock counts that minute alone."""

    _asked_s = _lost_s = 0.0

    def wrong_s(self, passed_s: float) -> float:
        """Lose what is longer."""
        self._lost_s += max(passed_s - self._asked_s - _LOST_COUNT_S, 0.0)
        self._asked_s = passed_s
        return passed_s - self._lost_s

    def set_time(self, request: Request) -> bool:
        """Begin anew."""
        self._asked_s = self._lost_s = 0.0
        return super().set_time(request)


@mutant("clock-goes-back-at-noon", "4.6/4", subtle=True)
class ClockGoesBackAtNoon(_RunsOtherwise):
    """The hours are those of twelve: behind noon the day begins again."""

    def get_time(self, request: Request) -> datetime:
        """Show the hour modulo twelve."""
        time = super().get_time(request)
        late = time.hour >= _TWELVE and request.now_s > _LOST_COUNT_S
        return time.replace(hour=time.hour - _TWELVE) if late else time

    def wrong_s(self, passed_s: float) -> float:
        """Run as it should."""
        return passed_s


@mutant("days-are-skipped", "4.6/4", subtle=True)
class DaysAreSkipped(_RunsOtherwise):
    """At each midnight two days pass in place of one."""

    def wrong_s(self, passed_s: float) -> float:
        """Count them twice."""
        return passed_s + passed_s // 86_400 * 86_400


@mutant("every-tenth-time-is-the-one-before", "4.6/4", subtle=True)
class EveryTenthTimeIsTheOneBefore(ControllerCore):
    """Every tenth reply tells the time that was told first: a buffer is not refreshed."""

    _told: datetime | None = None
    _count = 0

    def get_time(self, request: Request) -> datetime:
        """Count them."""
        self._count += 1
        time = super().get_time(request)
        self._told = self._told or time
        return self._told if self._count % 10 == 0 else time
