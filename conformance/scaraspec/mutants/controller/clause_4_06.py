"""Mutants of clause 4.6: the reported time, and how the clock runs."""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import after
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request


def _separated(data: bytes) -> bytes:
    date = b"-".join((data[:4], data[4:6], data[6:8]))
    return date + b" " + b":".join((data[8:10], data[10:12], data[12:]))


def _without_zeros(data: bytes) -> bytes:
    pairs = (data[i : i + 2] for i in range(4, 14, 2))
    return data[:4] + b"".join(b"%d" % int(pair) for pair in pairs)


def _runs(passed: Callable[[float], float]) -> Core:
    """The clock advances by a function of the seconds since it was set or first read."""

    class Runs(ControllerCore):
        _origin: tuple[datetime, float] | None = None

        def set_time(self, request: Request) -> bool:
            self._origin = request.value, request.now_s
            return super().set_time(request)

        def get_time(self, request: Request) -> datetime:
            if self._origin is None:
                self._origin = super().get_time(request), request.now_s
            start, start_s = self._origin
            return start + timedelta(seconds=passed(request.now_s - start_s))

    return Runs


def _back_at_noon(_core: ControllerCore, request: Request, time: datetime) -> datetime:
    is_late = time.hour >= 12 and request.now_s > 60.0
    return time.replace(hour=time.hour - 12) if is_late else time


row(
    "time-with-separators",
    "4.6/2",
    "The time is written with hyphens, a blank and colons.",
    first_reply("get_time", _separated),
)
row(
    "time-with-two-digits-of-the-year",
    "4.6/2",
    "The time has twelve digits, without the century.",
    first_reply("get_time", lambda data: data[2:]),
)
row(
    "time-without-leading-zeros",
    "4.6/2",
    "Months, days, hours, minutes and seconds below ten have one digit.",
    first_reply("get_time", _without_zeros),
)
row(
    "time-with-milliseconds",
    "4.6/2",
    "The time has seventeen digits, with milliseconds.",
    first_reply("get_time", lambda data: data + b"000"),
)
row(
    "months-from-zero",
    "4.6/3",
    "January is month 00.",
    first_reply("get_time", lambda data: data[:4] + b"%02d" % (int(data[4:6]) - 1) + data[6:]),
)
row(
    "hours-from-one",
    "4.6/3",
    "The first hour of the day is hour 24.",
    first_reply("get_time", lambda data: data[:8] + data[8:10].replace(b"00", b"24") + data[10:]),
)


@mutant("clock-stands-still", "4.6/4")
class StopsClock(ControllerCore):
    """The clock always shows the time at which it was set or switched on."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._shown = self.plant.clock.time(0.0)

    def set_time(self, request: Request) -> bool:
        self._shown = request.value
        return super().set_time(request)

    def get_time(self, request: Request) -> datetime:  # noqa: ARG002 - the time does not matter
        return self._shown


row(
    "clock-runs-fast",
    "4.6/4",
    "The clock runs 5 % too fast.",
    _runs(lambda passed_s: passed_s * 1.05),
)
row(
    "clock-runs-slow",
    "4.6/4",
    "The clock runs 5 % too slow.",
    _runs(lambda passed_s: passed_s * 0.95),
)
row(
    "clock-runs-twice-as-fast",
    "4.6/4",
    "The clock counts each second twice.",
    _runs(lambda passed_s: passed_s * 2),
)


@mutant("clock-loses-long-idle-times", "4.6/4", subtle=True)
class LosesLongIdleTimes(ControllerCore):
    """If the time is not read for more than a minute, the clock advances by only one minute."""

    _requested_s: float | None = None
    _lost_s = 0.0

    def set_time(self, request: Request) -> bool:
        self._requested_s, self._lost_s = request.now_s, 0.0
        return super().set_time(request)

    def get_time(self, request: Request) -> datetime:
        if self._requested_s is not None:
            self._lost_s += max(request.now_s - self._requested_s - 60.0, 0.0)
        self._requested_s = request.now_s
        return super().get_time(request) - timedelta(seconds=self._lost_s)


row(
    "clock-goes-back-at-noon",
    "4.6/4",
    "From one minute after the start on, the hours after noon are those of the morning.",
    after("get_time", _back_at_noon),
    subtle=True,
)
row(
    "days-are-skipped",
    "4.6/4",
    "The clock skips a day after every 24 hours.",
    _runs(lambda passed_s: passed_s + passed_s // 86_400 * 86_400),
    subtle=True,
)


@mutant("every-tenth-time-is-the-one-before", "4.6/4", subtle=True)
class RepeatsFirstTime(ControllerCore):
    """Every tenth reply contains the time of the first reply."""

    _first: datetime | None = None
    _count = 0

    def get_time(self, request: Request) -> datetime:
        self._count += 1
        time = super().get_time(request)
        self._first = self._first or time
        return self._first if self._count % 10 == 0 else time
