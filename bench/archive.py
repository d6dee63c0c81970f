"""Cost of an archive: of a build, relative to `audit`, and of queries over many robot-days.

The captures are pcapng files of a client that polls its robot. The robot-days are synthetic rows:
their queries are real, their traffic is not.
"""

import argparse
import random
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final

import pyarrow as pa  # type: ignore[import-untyped]  # it ships no types
from bench import traffic
from bench.captures import PER_SECOND, write_polling
from bench.stage import spread

from scaraspec.tables import arrow
from scaraspec.tables.archive.query import query
from scaraspec.tables.archive.store import ARCHIVED, PartName, Source, Store
from scaraspec.tables.schema import FileRow, FindingRow

_START_NS: Final = 1_795_215_517_000_000_000
_DAY_NS: Final = 86_400 * traffic.SECOND_NS
_SCARASPEC: Final = (sys.executable, "-m", "scaraspec")
_ROBOTS: Final = 50
_REFUSED_SHARE: Final = 0.01
_QUERIES: Final = {
    "verdicts": "FROM verdicts",
    "findings by requirement": "FROM requirements",
    "latency of one command by robot and day": "FROM latency WHERE command = 'get_status'",
    "refusals by robot since a date": "SELECT robot, code, count(*) FROM exchanges "
    "WHERE accepted = false AND day >= '2026-12-01' GROUP BY ALL",
    "one robot, one day": "SELECT command, count(*) FROM exchanges "
    "WHERE robot = 'line-7' AND day = '2026-12-01' GROUP BY ALL",
}


def main() -> None:
    """Print the cost of building, then of querying."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10, help="traffic of each capture")
    parser.add_argument("--captures", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--robot-days", type=int, default=1_500)
    parser.add_argument("--exchanges", type=int, default=20_000, help="rows of each robot-day")
    chosen = parser.parse_args()
    with TemporaryDirectory() as folder:
        _measure_builds(Path(folder), chosen)
    with TemporaryDirectory() as folder:
        _measure_queries(Path(folder), chosen.robot_days, chosen.exchanges)


def _measure_builds(folder: Path, chosen: argparse.Namespace) -> None:
    captures = folder / "captures"
    captures.mkdir()
    for number in range(chosen.captures):
        write_polling(captures / f"{number}.pcapng", int(chosen.minutes * 60 * PER_SECOND))
    one = captures / "0.pcapng"
    costs, speeds = [], []
    for number in range(chosen.rounds):
        store = folder / f"store-{number}"
        _, audit_s = _timed("audit", str(one))
        _, build_s = _timed("archive", "build", str(one), "--to", f"{store}-one", "--jobs", "1")
        costs.append(build_s / audit_s)
        alone, two = (
            _timed("archive", "build", str(captures), "--to", f"{store}-{jobs}", "--jobs", jobs)[0]
            for jobs in ("1", "2")
        )
        speeds.append(alone / two)
    print(f"captures of {chosen.minutes:g} minutes with {PER_SECOND} exchanges a second:")
    print(f"  processor time of a build / of audit: {spread(costs)}")
    print(f"  {chosen.captures} captures, one process / two processes: {spread(speeds)}")


def _timed(*arguments: str) -> tuple[float, float]:
    """Run scaraspec; return the elapsed time and the processor time, in seconds."""
    before, begun_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    command = [*_SCARASPEC, *arguments]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, check=False)  # noqa: S603 - ourselves
    assert done.returncode in (0, 3), arguments
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.monotonic() - begun_s, used_s


def _measure_queries(folder: Path, robot_days: int, exchanges: int) -> None:
    store = Store(f"{folder / 'store'}", create=True)
    dice = random.Random(0)  # noqa: S311 - synthetic rows, no secret
    for number in range(robot_days):
        _store_day(store, folder / "day", number, exchanges, dice)
    size_bytes = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    print(f"{robot_days} robot-days of {exchanges} exchanges, simulated:")
    print(f"  size: {size_bytes / 2**20:.0f} MiB")
    for name, sql in _QUERIES.items():
        times_s = [*_query_times(store, sql)]
        print(f"  {name}: {median(times_s):.2f} s")


def _query_times(store: Store, sql: str) -> Iterator[float]:
    for _ in range(3):
        begun_s = time.monotonic()
        query(store, sql)
        yield time.monotonic() - begun_s


def _store_day(store: Store, day: Path, number: int, count: int, dice: random.Random) -> None:
    """Store the tables of a robot-day with this number of exchanges, mostly polling."""
    day.mkdir(exist_ok=True)
    robot, days = f"line-{number % _ROBOTS}", number // _ROBOTS
    begun_ns = _START_NS - _START_NS % _DAY_NS + days * _DAY_NS
    url = f"/captures/{robot}/{days}.mcap"
    file = FileRow(
        file=url,
        begun_ns=begun_ns,
        ended_ns=begun_ns + _DAY_NS - 1,
        whole=True,
        notes="",
        verdict="nonconformant" if number % 20 == 0 else "no-violation-found",
    )
    tables: dict[str, Any] = {name: arrow.table(name, []) for name in ARCHIVED}
    tables["files"] = arrow.table("files", [file])
    tables["exchanges"] = _exchanges(url, begun_ns, count, dice)
    if number % 20 == 0:
        tables["findings"] = arrow.table("findings", [_finding(url, begun_ns)])
    for name, table in tables.items():
        with (day / f"{name}.parquet").open("wb") as out, arrow.parquet_writer(out, name) as writer:
            writer.write_table(table)
    store.put(PartName(Source(url, 1, "1"), "0" * 16, robot), file, day)


def _exchanges(url: str, begun_ns: int, count: int, dice: random.Random) -> Any:
    schema = arrow.arrow_schema("exchanges")
    commands = ("get_status", "get_joint_angles", "get_tool_coordinates", "set_tool_coordinates")
    names = [commands[3 if number % 200 == 0 else number % 3] for number in range(count)]
    refused = [name == commands[3] and dice.random() < _REFUSED_SHARE for name in names]
    values: dict[str, Sequence[object]] = {
        "file": [url] * count,
        "number": range(1, count + 1),
        "connection": ["1"] * count,
        "time": [begun_ns + number * (_DAY_NS // count) for number in range(count)],
        "side": ["client"] * count,
        "command": names,
        "arguments": [""] * count,
        "reply": [f"{dice.randrange(10**6)}" for _ in range(count)],
        "result": [None] * count,
        "accepted": [not each for each in refused],
        "code": ["01" if each else None for each in refused],
        "ending": ["answered"] * count,
        "latency_s": [dice.lognormvariate(-6, 0.3) for _ in range(count)],
        "duration_s": [None] * count,
        "offset_bytes": [12 * number for number in range(count)],
        "certain": [True] * count,
    }
    return pa.table([pa.array(values[f.name], type=f.type) for f in schema], schema=schema)


def _finding(url: str, begun_ns: int) -> FindingRow:
    return FindingRow(
        file=url,
        connection="1",
        time_ns=begun_ns,
        side="controller",
        requirement="4.17/6",
        verdict="fail",
        cause="subject",
        message="the arm moved after the stop",
        reading=None,
        direction="C2A",
        offset_bytes=0,
        length_bytes=5,
    )


if __name__ == "__main__":
    main()
