"""Clauses 4.5 and 4.6: the robot's clock, compared with the time of the recording."""

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final

from scaraspec.judge.rules.rule import (
    PASSED,
    RuleResult,
    failed,
    inconclusive,
    places_of,
    rule,
    tolerated,
)
from scaraspec.judge.rules.settings import in_force
from scaraspec.traffic.events import Exchange
from scaraspec.traffic.exchange_history import answered_ns
from scaraspec.traffic.robot_state import RobotState
from scaraspec.user_message import UserMessage

_TOLERANCE_S: Final = 2.0
_DRIFT: Final = 0.01
_MAX_AGE_NS: Final = 60_000_000_000
"""After this time 4.6/4 judges the rate of the clock."""

_NIGHT_END: Final = timedelta(hours=4)

_SUMMER_TIME: Final = tolerated(
    "A-4.5-1",
    "local time",
    "the clock changed by one hour early on a Sunday, as local summer time does",
)

_NS_PER_S: Final = 1_000_000_000


def elapsed_s(first: Exchange, then: Exchange) -> tuple[float, float]:
    """Return the minimum and the maximum time between the execution of two requests, in s."""
    least_ns = then.time_ns - answered_ns(first)
    return max(least_ns, 0) / _NS_PER_S, (answered_ns(then) - first.time_ns) / _NS_PER_S


def deviation_s(advance_s: float, first: Exchange, then: Exchange) -> float:
    """Return by how many seconds an advance is off the recording's clock, beyond the tolerance."""
    least_s, most_s = elapsed_s(first, then)
    tolerance_s = _TOLERANCE_S + _DRIFT * most_s
    return max(least_s - tolerance_s - advance_s, advance_s - most_s - tolerance_s, 0.0)


def contradicted(
    earlier: Sequence[Exchange], x: Exchange, advance_s: Callable[[Exchange, Exchange], float]
) -> tuple[Exchange, bool] | None:
    """Return the earlier reply that `x` contradicts, and whether a single step explains it.

    `x` is compared with the previous reply and, to find slow errors, with the first one. A clock
    that suddenly lags may mean that the recorder's clock was set ahead; this is reported once. The
    recording itself shows if its clock was set back.
    """
    for y in (earlier[-1], earlier[0]):
        if advance_s(y, x) < 0:
            return y, False
        if deviation_s(advance_s(y, x), y, x):
            break
    else:
        return None
    legs = list(pairwise((*earlier, x)))
    steps = [leg for leg in legs if deviation_s(advance_s(*leg), *leg)]
    runs = any(advance_s(*leg) > 0 for leg in legs if leg not in steps)
    lags = all(advance_s(*leg) < elapsed_s(*leg)[0] for leg in steps)
    if len(steps) != 1 or not runs or not lags:
        return y, False
    return (y, True) if steps[0] is legs[-1] else None


@rule("4.5/4", on=Exchange, names=("get_time",))
def clock_as_set(x: Exchange, robot: RobotState) -> RuleResult | None:
    """After "1" 0x07 returns the set time plus the elapsed time, within 2 s (L169, L186)."""
    setting = in_force("set_time", x, robot)
    if setting is None or x.reply_value is None or x.time_ns - setting.time_ns > _MAX_AGE_NS:
        return None
    advance_s = (x.reply_value - setting.request_value).total_seconds()
    if not deviation_s(advance_s, setting, x):
        return PASSED
    if _is_summer_time(setting.request_value, setting, x):
        reported = any(_comparable(y, x, robot) for y in robot.history.recent.get("get_time", ()))
        return None if reported else _SUMMER_TIME  # by 4.6/4
    return failed(
        "the clock does not show the time that was set plus the elapsed time",
        expected=UserMessage(
            "{time} plus {elapsed_s} s",
            time=setting.request_value,
            elapsed_s=f"{elapsed_s(setting, x)[0]:.0f}",
        ),
        observed=str(x.reply_value),
        at=(*places_of(setting), *places_of(x)),
    )


@rule("4.6/4", on=Exchange, names=("get_time",))
def clock_runs(x: Exchange, robot: RobotState) -> RuleResult | None:
    """The time never goes back on one connection, and advances one second per second (L186)."""
    earlier = [y for y in robot.history.recent.get("get_time", ()) if _comparable(y, x, robot)]
    if not earlier or x.reply_value is None:
        return None
    contradiction = contradicted(
        earlier, x, lambda y, z: (z.reply_value - y.reply_value).total_seconds()
    )
    if contradiction is None:
        return PASSED
    y, step = contradiction
    if _is_summer_time(y.reply_value, y, x):
        return _SUMMER_TIME
    if step:
        return inconclusive(
            "the clock of the robot or of the recorder was set between two requests"
        )
    advance_s = (x.reply_value - y.reply_value).total_seconds()
    if advance_s < 0:
        message = "the clock went back"
    elif advance_s:
        message = "the clock does not advance by one second per second"
    else:
        message = "the clock does not advance"
    least_s, most_s = elapsed_s(y, x)
    return failed(
        message,
        expected=UserMessage(
            "{least_s} to {most_s} s later than {time}",
            least_s=f"{least_s:.1f}",
            most_s=f"{most_s:.1f}",
            time=y.reply_value,
        ),
        observed=f"{advance_s:.0f} s",
        at=(*places_of(y), *places_of(x)),
    )


def _is_summer_time(time: datetime, y: Exchange, x: Exchange) -> bool:
    """Whether the clock is one hour off, and a Sunday began between the two or just before them.

    Local time changes so; whether the clock shows local time or UTC is open (A-4.5-1).

    Args:
        time: The time of the robot at `y`.
        y: An earlier exchange.
        x: A query of the time.
    """
    advance_s = (x.reply_value - time).total_seconds()
    if all(deviation_s(advance_s + hour_s, y, x) for hour_s in (-3600, 3600)):
        return False
    midnight = x.reply_value.replace(hour=0, minute=0, second=0)
    night_ends = timedelta(days=-((midnight.weekday() + 1) % 7)) + _NIGHT_END
    return bool(time - midnight < night_ends)  # a sum could exceed the range of datetime


def _comparable(y: Exchange, x: Exchange, robot: RobotState) -> bool:
    """Whether nothing set or stopped the clock between the two requests."""
    changes = (robot.history.last_requests.get(name) for name in ("set_time", "shutdown"))
    return (
        y.reply_value is not None
        and y.request.place.connection == x.request.place.connection
        and answered_ns(y) < x.time_ns
        and all(c is None or c.place.time_ns < y.time_ns for c in changes)
    )
