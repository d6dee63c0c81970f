"""`scaraspec compare`: what differs between the results of two runs."""

from pathlib import Path

import click

from scaraspec.api.results import compare
from scaraspec.cli.problems import Problem
from scaraspec.cli.results import append_summary, results_in, user_errors
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible_line
from scaraspec.results import comparison_report
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec compare run-1.4 run-1.5"

_PATH = click.Path(path_type=Path)


@click.command(epilog=EXAMPLE)
@click.argument("before_path", metavar="A", type=_PATH)
@click.argument("after_path", metavar="B", type=_PATH)
@click.option("--summary", type=_PATH, metavar="FILE", help="Append the comparison in Markdown.")
def command(before_path: Path, after_path: Path, *, summary: Path | None) -> None:
    """Compare the results A and B: results.json files, or the folders of runs.

    Compared are failures, verdicts, readings, what was judged, settings and latency. Exit status 0
    if the behaviour is equal, 1 if it differs; settings and latency do not count.
    """
    with user_errors():
        before, after = results_in(before_path), results_in(after_path)
        if before.role is not after.role:
            raise Problem(
                UserMessage(
                    "{before} is about a {first} and {after} about a {second}: compare results of "
                    "the same role",
                    before=before_path,
                    first=before.role.value,
                    after=after_path,
                    second=after.role.value,
                )
            )
        comparison = compare(before, after)
    for line in comparison_report.lines(comparison):
        click.echo(visible_line(line))
    with user_errors(worse=comparison.differs):
        append_summary(summary, comparison_report.markdown(comparison))
    raise SystemExit(ExitStatus.NONCONFORMANT if comparison.differs else ExitStatus.CONFORMANT)
