"""`scaraspec compare`: what differs between the results of two runs, or between two captures."""

from pathlib import Path
from typing import NoReturn

import click

from scaraspec.cli.options import capture_port
from scaraspec.cli.problems import Problem
from scaraspec.cli.results import append_summary, results_in, user_errors
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible_line
from scaraspec.results import comparison_report
from scaraspec.results.comparison import compare
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec_recorder.errors import CaptureError

EXAMPLE = "Example: scaraspec compare monday.mcap tuesday.mcap"

_PATH = click.Path(path_type=Path)


@click.command(epilog=EXAMPLE)
@click.argument("before_path", metavar="A", type=_PATH)
@click.argument("after_path", metavar="B", type=_PATH)
@click.option("--summary", type=_PATH, metavar="FILE", help="Append the comparison in Markdown.")
@capture_port
def command(before_path: Path, after_path: Path, port: int | None, *, summary: Path | None) -> None:
    """Compare A and B: results.json files, the folders of runs, or captures.

    Of results, failures, verdicts, readings, what was judged, settings and latency are compared. Of
    captures, how the same requests were answered and in which order they were sent, findings,
    readings and latency. Times, temperatures within 5 °C and poses within 0.2 mm are equal. Exit
    status 0 if the behaviour is equal, 1 if it differs; settings and latency do not count. Without
    a difference, 3 if a capture is incomplete, and 4 if one has no traffic of this protocol.
    """
    if _is_capture(before_path) and _is_capture(after_path):
        _compare_captures(before_path, after_path, port, summary)
    with user_errors():
        before, after = results_in(before_path), results_in(after_path)
        if before.role is not after.role:
            raise Problem(
                UserMessage(
                    "{before} is about a {first} and {after} about a {second}: compare results of "
                    "the same role",
                    before=before_path,
                    first=UserMessage(before.role.value),
                    after=after_path,
                    second=UserMessage(after.role.value),
                )
            )
        comparison = compare(before, after)
    for line in comparison_report.lines(comparison):
        click.echo(visible_line(localized(line)))
    with user_errors(worse=comparison.differs):
        append_summary(summary, comparison_report.markdown(comparison))
    raise SystemExit(ExitStatus.NONCONFORMANT if comparison.differs else ExitStatus.CONFORMANT)


def _is_capture(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() != ".json"


def _compare_captures(
    before: Path, after: Path, port: int | None, summary: Path | None
) -> NoReturn:
    """Compare two captures, and end the command.

    Raises:
        Problem: A capture cannot be read, or the summary cannot be written.
        SystemExit: Always, with the exit status.
    """
    from scaraspec.api.captures import compare_captures  # noqa: PLC0415 - --help needs no readers

    try:
        comparison = compare_captures(before, after, port=port)
    except CaptureError as error:
        raise Problem(sentence_of(error)) from None
    for line in comparison_report.capture_lines(comparison):
        click.echo(visible_line(localized(line)))
    with user_errors(worse=comparison.differs):
        append_summary(summary, comparison_report.capture_markdown(comparison))
    raise SystemExit(comparison.exit_status)
