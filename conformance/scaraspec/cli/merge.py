"""`scaraspec merge`: join the sittings of one certification."""

from pathlib import Path

import click
from rich.console import Console

from scaraspec.cli.problems import Problem
from scaraspec.cli.results import results_in, user_errors
from scaraspec.report import terminal
from scaraspec.user_message import sentence_of

EXAMPLE = "Example: scaraspec merge run-1 run-2 --out merged"

_PATH = click.Path(path_type=Path)


@click.command(epilog=EXAMPLE)
@click.argument("paths", metavar="A B...", nargs=-1, required=True, type=_PATH)
@click.option(
    "--out", required=True, type=_PATH, metavar="DIR", help="New folder for results and reports."
)
def command(paths: tuple[Path, ...], *, out: Path) -> None:
    """Join the results A, B...: sittings with the same build, ICS, options and scaraspec.

    A failure counts although the case passes in another sitting; the report lists both. Exit
    status as for certify; 2 if the results cannot be merged.
    """
    from scaraspec.api.results import MergeError, merge  # noqa: PLC0415 - imports the suite
    from scaraspec.api.run_folder import RunFolderError, write_results  # noqa: PLC0415 - reports

    if len(paths) == 1:
        raise Problem("name the results of at least two sittings")
    with user_errors():
        try:
            results = merge([results_in(path) for path in paths])
            write_results(results, out)
        except (MergeError, RunFolderError) as error:
            raise Problem(sentence_of(error)) from None
    terminal.show(results, Console())
    click.echo(f"{out}/report.html")
    raise SystemExit(results.verdict.exit_status)
