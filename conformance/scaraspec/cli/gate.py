"""`scaraspec gate`: compare the results of a run with what is accepted."""

import os
from datetime import date
from pathlib import Path

import click

from scaraspec.cli.problems import Problem, require_replaceable
from scaraspec.cli.results import append_summary, results_in, user_errors
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report import ctrf, junit
from scaraspec.report.files import write_whole
from scaraspec.report.model import Results
from scaraspec.report.sanitizing import visible, visible_line
from scaraspec.results import gate_report
from scaraspec.results.baseline import Baseline
from scaraspec.results.gate import GateResult, gate
from scaraspec.results.waivers import read_waivers
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec gate out --baseline baseline.json --waivers waivers.toml"

_PATH = click.Path(path_type=Path)


@click.command(epilog=EXAMPLE)
@click.argument("results_path", metavar="RESULTS", type=_PATH)
@click.option(
    "--baseline",
    "baseline_path",
    type=_PATH,
    metavar="FILE",
    help="What is accepted: a baseline, or the results.json of an earlier run.",
)
@click.option(
    "--waivers", "waivers_path", type=_PATH, metavar="FILE", help="Accepted failures, TOML."
)
@click.option("--update", is_flag=True, help="Write these results to --baseline.")
@click.option(
    "--summary",
    type=_PATH,
    metavar="FILE",
    envvar="GITHUB_STEP_SUMMARY",
    help="Append a summary in Markdown [GITHUB_STEP_SUMMARY].",
)
@click.option("--junit", "junit_path", type=_PATH, metavar="FILE", help="Write junit.xml here.")
@click.option("--ctrf", "ctrf_path", type=_PATH, metavar="FILE", help="Write ctrf.json here.")
@click.option(
    "--code-quality", type=_PATH, metavar="FILE", help="Write a code quality report of GitLab."
)
def command(  # noqa: PLR0913 - one for each option
    results_path: Path,
    *,
    baseline_path: Path | None,
    waivers_path: Path | None,
    update: bool,
    summary: Path | None,
    junit_path: Path | None,
    ctrf_path: Path | None,
    code_quality: Path | None,
) -> None:
    """Compare RESULTS, a results.json or the folder of a run, with what is accepted.

    Exit status 1 for a new or changed failure, a lost case or requirement, a stale or expired
    waiver, an unknown id, or other settings; 0 for none of these, 3 inconclusive, 4 nothing tested.
    """
    if update and not baseline_path:
        raise Problem("--update needs --baseline FILE, the file to write")
    for path, mark in (
        (junit_path, junit.MARK),
        (ctrf_path, ctrf.MARK),
        (code_quality, gate_report.CODE_QUALITY_MARK),
    ):
        require_replaceable(path, mark)
    with user_errors():
        results = results_in(results_path)
        waivers = read_waivers(waivers_path) if waivers_path else ()
        if update and baseline_path:
            _update(results, baseline_path)
        result = gate(
            results,
            baseline=Baseline.read(baseline_path) if baseline_path else None,
            waivers=waivers,
            today=date.today(),  # noqa: DTZ011 - a waiver expires on the user's calendar
        )
    _show(result)
    with user_errors(worse=bool(result.problems)):
        _write(junit_path, junit.MARK, junit.render(results, result.accepted))
        _write(ctrf_path, ctrf.MARK, ctrf.render(results, result.accepted))
        _write(code_quality, gate_report.CODE_QUALITY_MARK, gate_report.code_quality(result))
        append_summary(summary, gate_report.markdown(result))
    raise SystemExit(result.exit_status)


def _update(results: Results, path: Path) -> None:
    """Write the baseline.

    Raises:
        Problem: The results are inconclusive, so that a baseline of them would accept less tests.
    """
    if results.verdict.exit_status in (ExitStatus.INCONCLUSIVE, ExitStatus.NOTHING_TESTED):
        raise Problem(
            UserMessage(
                "{path} is not updated: the results are {verdict}; repeat the run",
                path=path,
                verdict=results.label,
            ),
            results.verdict.exit_status,
        )
    Baseline.of(results).write(path)
    click.echo(localized("{path} is updated", path=visible(f"{path}")))


def _write(path: Path | None, mark: str, text: str) -> None:
    require_replaceable(path, mark)  # again: two options may name one file
    if path:
        write_whole(path, text)


def _show(result: GateResult) -> None:
    for line in gate_report.lines(result):
        click.echo(visible_line(localized(line)))
    if os.environ.get("GITHUB_ACTIONS") == "true":
        for line in gate_report.annotations(result):
            click.echo(line)
