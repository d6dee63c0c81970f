"""The report of an archive: one page about many robots. The layout is in the template."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from typing import Any, Final, NamedTuple

from scaraspec.operating_system import join_command
from scaraspec.report.html import environment
from scaraspec.tables.archive.query import opened
from scaraspec.tables.archive.store import Store
from scaraspec.translation import Language, display_language

_SHOWN_DAYS: Final = 62
_NEW_DAYS: Final = 7
_SHOWN_KINDS: Final = 200
_PLOT: Final = (160.0, 24.0)
_BY_GRAVITY: Final = (
    "nonconformant",
    "unreadable",
    "inconclusive",
    "nothing-tested",
    "no-violation-found",
    "conformant",
)
_SIGNS: Final = dict(zip(_BY_GRAVITY, "✕!?·✓✓", strict=True))
_USED: Final = "files findings exchanges losses verdicts firmware"

_FAULTS: Final = "verdict IN ('fail', 'inconclusive', 'error')"


class DayCell(NamedTuple):
    """A robot's day: its gravest verdict, the sign for it, and the numbers of captures."""

    verdict: str
    sign: str
    files: int
    failures: int


@dataclass(frozen=True, slots=True)
class FindingKind:
    """Equal findings of all robots.

    Attributes:
        requirement: The requirement.
        verdict: The verdict.
        side: The side that the findings are about.
        message: The message of the first one.
        count: The number of findings.
        robots: The robots.
        first: The time (UTC) of the first one; None if it is not known.
        file: The capture of the first one.
    """

    requirement: str
    verdict: str
    side: str
    message: str
    count: int
    robots: list[str]
    first: datetime | None
    file: str

    @property
    def view(self) -> str:
        """The command that shows the moment in the viewer."""
        at = ["--at", f"{self.first:%Y-%m-%dT%H:%M:%S.%f}"] if self.first else []
        return join_command(["scaraspec", "view", self.file, *at])


@dataclass(frozen=True, slots=True)
class CommandLatency:
    """The latency of a command, week by week.

    Attributes:
        command: The command.
        exchanges: The number of exchanges.
        weeks: The Mondays of the first and the last week.
        p95_ms: The 95th percentile in the first and the last week.
        points: The points of a curve of all weeks, for SVG.
    """

    command: str
    exchanges: int
    weeks: tuple[date, date]
    p95_ms: tuple[float, float]
    points: str


def render(store: Store, since: date | None, language: Language | None) -> str:
    """Return the page. It contains both languages.

    Args:
        store: The archive.
        since: Kinds of findings that first occurred on this day (UTC) or later are new. None for
            the last seven days of the archive.
        language: The language that is shown first; None for the display language.

    Raises:
        ArchiveError: The archive has no capture yet.
    """
    with opened(store, _USED) as db:
        files, robots, first, last, bytes_lost = db.execute(
            "SELECT count(*), count(DISTINCT robot), min(begun), max(ended), "
            "(SELECT sum(length_bytes) FROM losses) FROM files"
        ).fetchone()
        newest = _day_of(last)
        since = since or newest - timedelta(days=_NEW_DAYS - 1)
        days = [newest - timedelta(days=ago) for ago in reversed(range(_SHOWN_DAYS))]
        calendar = _calendar(db, days[0])
        shown = [day for day in days if any(day in cells for cells in calendar.values())]
        kinds = [*_kinds(db)]
        return (
            environment()
            .get_template("archive.html")
            .render(
                url=store.url,
                language=language or display_language(),
                files=files,
                robots=robots,
                begun=first,
                ended=last,
                bytes_lost=bytes_lost or 0,
                since=since,
                days=shown,
                calendar=calendar,
                new_kinds=[k for k in kinds if k.first is None or _day_of(k.first) >= since],
                old_kinds=[k for k in kinds if k.first and _day_of(k.first) < since],
                latency=[*_latency(db)],
                plot=_PLOT,
                firmware=db.execute("FROM firmware").fetchall(),
                unreadable=db.execute(
                    "SELECT robot, file, notes FROM files WHERE verdict = 'unreadable' ORDER BY ALL"
                ).fetchall(),
                verdict_signs=_SIGNS,
            )
        )


def _day_of(time: datetime | None) -> date:
    return (time or datetime.now(UTC)).date()


def _calendar(db: Any, first_day: date) -> dict[str, dict[date, DayCell]]:
    """Return the cells of each robot by day."""
    cells: dict[str, dict[date, DayCell]] = {}
    rows = db.execute("SELECT robot, day, verdict, files, failures FROM verdicts").fetchall()
    for robot, day, verdict, files, failures in rows:
        of_robot = cells.setdefault(robot, {})
        if day is None or day < first_day:
            continue
        found = of_robot.get(day, DayCell(verdict, "", 0, 0))
        gravest = min(verdict, found.verdict, key=_BY_GRAVITY.index)
        of_robot[day] = DayCell(
            gravest, _SIGNS[gravest], found.files + files, found.failures + int(failures)
        )
    return dict(sorted(cells.items()))


def _kinds(db: Any) -> Iterator[FindingKind]:
    """Yield the kinds of findings, the most recently begun first."""
    rows = db.execute(
        f"""
        SELECT requirement, verdict, side, arg_min(message, time) AS message, count(*),
            list_sort(list(DISTINCT robot)), min(time) AS first, arg_min(file, time)
        FROM findings WHERE {_FAULTS}
        GROUP BY requirement, verdict, side
        ORDER BY first DESC NULLS FIRST, requirement LIMIT {_SHOWN_KINDS}"""  # noqa: S608 - constants
    ).fetchall()
    for row in rows:
        yield FindingKind(*row)


def _latency(db: Any) -> Iterator[CommandLatency]:
    """Yield the latency of each command over the weeks."""
    rows = db.execute("""
        SELECT command, date_trunc('week', time)::DATE AS week, count(*),
            1000 * quantile_cont(latency_s, 0.95)
        FROM exchanges WHERE certain AND latency_s IS NOT NULL GROUP BY ALL ORDER BY ALL
        """).fetchall()
    by_command: dict[str, list[tuple[date, int, float]]] = {}
    for command, week, count, p95_ms in rows:
        by_command.setdefault(command, []).append((week, count, p95_ms))
    for command, weeks in by_command.items():
        yield CommandLatency(
            command,
            sum(count for _, count, _ in weeks),
            (weeks[0][0], weeks[-1][0]),
            (weeks[0][2], weeks[-1][2]),
            _points([(week, p95_ms) for week, _, p95_ms in weeks]),
        )


def _points(values: list[tuple[date, float]]) -> str:
    """Return the points of a curve, from zero to the maximum."""
    width, height = _PLOT
    first, last = values[0][0], values[-1][0]
    span_days, top = max((last - first).days, 1), max(value for _, value in values) or 1
    return " ".join(
        f"{width * (week - first).days / span_days:.1f},{height * (1 - value / top):.1f}"
        for week, value in values
    )
