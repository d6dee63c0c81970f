"""`scaraspec archive`: the tables of many captures in one store, queried with SQL."""

import csv
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import click
from rich.console import Console
from rich.table import Table

from scaraspec.cli.options import capture_port, language_option
from scaraspec.cli.problems import require_replaceable, unreadable, unwritable
from scaraspec.cli.progress_bar import shown_share
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible_line
from scaraspec.tables.archive.errors import ArchiveError
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec archive build captures --to archive"

_FILE_WIDTH: Final = 400
"""Width of a table that is not printed on a terminal."""
_HTML_MARK: Final = '<meta name="generator" content="scaraspec archive">'


@click.group(name="archive", epilog=EXAMPLE)
def command() -> None:
    """Keep the traffic of many robots in one archive, and query it."""


@command.command()
@click.argument("sources", nargs=-1, required=True, metavar="SOURCE...")
@click.option("--to", "store", required=True, metavar="STORE", help="The archive.")
@click.option("--robot", default="", metavar="NAME", help="The robot of all these captures.")
@capture_port
@click.option("--jobs", type=click.IntRange(1), help="Processes; default: one per processor.")
@click.option(
    "--scheduler", default="", metavar="URL", help="A Dask scheduler whose workers do the work."
)
def build(  # noqa: PLR0913 - one for each option
    sources: tuple[str, ...],
    store: str,
    *,
    robot: str,
    port: int | None,
    jobs: int | None,
    scheduler: str,
) -> None:
    """Judge the captures in each SOURCE, and add their tables to STORE.

    SOURCE is a file, a folder or a pattern. SOURCE and STORE may be URLs such as
    s3://bucket/captures. Captures that are in the archive already are not judged again, unless
    they or the version of scaraspec have changed. Exit status 3 if a capture could not be judged.
    """
    with _user_errors():
        from scaraspec.api.archives import UNREADABLE, build_archive  # noqa: PLC0415 - an extra

        work = build_archive(
            sources, store, robot=robot, port=port, jobs=jobs or 0, scheduler=scheduler
        )
        verdicts: Counter[str] = Counter()
        due = work.total - work.unchanged
        with (
            suppress(KeyboardInterrupt),
            shown_share(localized("judging"), localized("captures")) as progress,
        ):
            for number, each in enumerate(work.archived, 1):
                progress(number, due)
                verdicts[each.verdict if each.stored else "not stored"] += 1
                if each.reason:
                    click.echo(visible_line(f"{each.url}: {localized(each.reason)}"), err=True)
    if left := due - verdicts.total():
        verdicts["interrupted"] = left
    counts = [
        UserMessage("{count} {verdict}", count=count, verdict=UserMessage.word(verdict))
        for verdict, count in sorted(verdicts.items())
    ]
    click.echo(
        localized(
            "1 capture: {counts}" if work.total == 1 else "{total} captures: {counts}",
            total=work.total,
            counts=UserMessage.listed(
                [UserMessage("{count} unchanged", count=work.unchanged), *counts]
            ),
        )
    )
    if verdicts[UNREADABLE] or verdicts["not stored"] or left:
        raise SystemExit(ExitStatus.INCONCLUSIVE)


@command.command()
@click.argument("store")
@click.argument("sql")
@click.option("--csv", "as_csv", is_flag=True, help="Print CSV.")
def query(store: str, sql: str, *, as_csv: bool) -> None:
    """Run the query SQL (DuckDB) on the archive STORE.

    Tables: files, sessions, exchanges, transfers, findings, losses, with the columns robot and day.
    Views: verdicts, requirements, latency, firmware, readings, lost.
    """
    with _user_errors():
        from scaraspec.api.archives import query_archive  # noqa: PLC0415 - an optional extra

        columns, rows = query_archive(store, sql)
    if as_csv:
        csv.writer(sys.stdout).writerows([columns, *(map(_plain, row) for row in rows)])
        return
    console = Console()
    if not console.is_terminal:
        console = Console(width=_FILE_WIDTH)
    table = Table(*columns, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*map(_cell, row))
    console.print(table)


@command.command()
@click.argument("store")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The page to write.")
@click.option(
    "--since",
    type=click.DateTime(["%Y-%m-%d"]),
    help="Kinds of findings are new from this day on; default: the last seven days.",
)
@language_option
def report(store: str, *, out: Path, since: datetime | None) -> None:
    """Write a page about all robots in the archive STORE.

    It has the verdicts by robot and day, new kinds of findings, the latency by week, the versions
    of the firmware, and captures that could not be read.
    """
    require_replaceable(out, _HTML_MARK)
    with _user_errors():
        from scaraspec.api.archives import archive_report  # noqa: PLC0415 - an optional extra

        archive_report(store, out, since=since.date() if since else None)


def _cell(value: Any) -> str:
    plain = _plain(value)
    return visible_line(f"{plain:.3f}" if isinstance(plain, float) else f"{plain}")


def _plain(value: Any) -> Any:
    """Return a time (UTC) as text, NULL as an empty text, and other values as they are."""
    if isinstance(value, datetime):
        return f"{value:%Y-%m-%dT%H:%M:%S.%f}Z"
    return "" if value is None else value


@contextmanager
def _user_errors() -> Iterator[None]:
    """Report errors that the user can cause.

    Raises:
        Problem: Instead of these errors.
    """
    try:
        yield
    except (ArchiveError, ImportError) as error:
        raise unreadable(error) from None
    except OSError as error:
        raise unwritable(error) from None
