"""Plots: coordinates for the templates, which only draw them.

Every plot is `WIDTH` wide; heights are from 0 to 1. This module does not count or judge.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final, NamedTuple

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.formatting import duration
from scaraspec.report.model import CommandSeen, Results, Session, Timing

WIDTH: Final = 400.0
_MIN_WIDTH: Final = 1.5
_MARKS_PER_LANE: Final = 1000
_GOOD_OUTCOMES: Final = ("done", "interrupted", "refused")
"""Outcomes of a run that are not an error on the wire."""
_AXIS_MIN_MS: Final = 0.001
_BIN_RATIO: Final = 2 ** (1 / 4)
"""Ratio of the limits of a bin of `Timing`: four bins double the time."""


class Tick(NamedTuple):
    """A labelled position on an axis."""

    x: float
    label: str


class Bar(NamedTuple):
    """One bin of a histogram; `height` grows with the square root, so that small counts show."""

    x: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Distribution:
    """A timing and its histogram on the shared axis."""

    timing: Timing
    of_result: bool
    bars: tuple[Bar, ...]
    p50_x: float
    p99_x: float


class LatencyPlot:
    """The timings of all commands on one logarithmic axis of whole decades."""

    def __init__(self, commands: Iterable[CommandSeen]) -> None:
        commands = tuple(commands)
        timings = [t for command in commands for t in (command.latency, command.duration) if t]
        fastest_ms = min((t.min_ms for t in timings), default=1.0)
        slowest_ms = max((t.max_ms for t in timings), default=1.0)
        self._low = math.floor(math.log10(max(fastest_ms, _AXIS_MIN_MS)))
        self._high = max(math.ceil(math.log10(max(slowest_ms, _AXIS_MIN_MS))), self._low + 1)
        decades_ms = [10.0**exponent for exponent in range(self._low, self._high + 1)]
        self.ticks = [Tick(self._x(ms), duration(ms)) for ms in decades_ms]
        self.rows = [(command, list(self._distributions(command))) for command in commands]

    def _distributions(self, command: CommandSeen) -> Iterator[Distribution]:
        if command.latency:
            yield self._distribution(command.latency, of_result=False)
        if command.duration:
            yield self._distribution(command.duration, of_result=True)

    def _x(self, time_ms: float) -> float:
        decades = math.log10(max(time_ms, _AXIS_MIN_MS)) - self._low
        return round(WIDTH * min(max(decades / (self._high - self._low), 0), 1), 2)

    def _distribution(self, timing: Timing, *, of_result: bool) -> Distribution:
        tallest = max((count for _, count in timing.bins), default=1)
        bars = []
        for from_ms, count in timing.bins:
            x, end = self._x(from_ms), self._x(from_ms * _BIN_RATIO)
            height = round(math.sqrt(max(count, 0) / max(tallest, 1)), 3)
            bars.append(Bar(x, round(max(end - x, _MIN_WIDTH), 2), height))
        p50_x, p99_x = self._x(timing.p50_ms), self._x(timing.p99_ms)
        return Distribution(timing, of_result, tuple(bars), p50_x, p99_x)


class Mark(NamedTuple):
    """An item on the timeline: position, whether it is good, and its tooltip."""

    x: float
    width: float
    good: bool
    title: str


def timeline(results: Results, session: Session) -> dict[str, list[Mark]]:
    """Return the items of the timeline by lane, without empty lanes."""
    mark = _marker(session)
    lanes = {
        "connections": (
            mark(c.begun_ns, c.ended_ns, good=c.ending != "reset", title=f"{c.name} {c.note}")
            for c in session.connections
        ),
        "transfers": (
            mark(t.begun_ns, t.begun_ns + t.duration_ms * 1e6, good=t.state == "done", title=t.name)
            for t in session.transfers
        ),
        "runs": (
            mark(
                r.begun_ns,
                r.begun_ns + (r.duration_ms or 0) * 1e6,
                good=r.outcome in _GOOD_OUTCOMES,
                title=f"{r.name}: {r.outcome}",
            )
            for r in session.runs
        ),
        "losses": (
            mark(loss.time_ns, loss.time_ns, good=False, title=loss.note) for loss in session.losses
        ),
        "findings": (
            mark(e.time_ns, e.time_ns, good=case.verdict is Verdict.TOLERATED, title=case.id)
            for case in results.cases
            if case.verdict is not Verdict.PASS
            for e in case.wire
        ),
    }
    bounded = {name: list(islice(marks, _MARKS_PER_LANE)) for name, marks in lanes.items()}
    return {name: marks for name, marks in bounded.items() if marks}


def _marker(session: Session) -> Callable[..., Mark]:
    length_ns = max(session.ended_ns - session.begun_ns, 1)

    def x(time_ns: float) -> float:
        return round(WIDTH * min(max((time_ns - session.begun_ns) / length_ns, 0), 1), 2)

    def mark(begun_ns: int, ended_ns: float, *, good: bool, title: str) -> Mark:
        at = min(x(begun_ns), WIDTH - _MIN_WIDTH)
        return Mark(at, max(round(x(ended_ns) - at, 2), _MIN_WIDTH), good, title)

    return mark
