"""`scaraspec audit`: judge a capture."""

import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console
from rich.progress import Progress, TextColumn, TimeElapsedColumn

from scaraspec.api.auditing import audit
from scaraspec.cli.options import capture_port, given_options
from scaraspec.cli.problems import Problem, require_replaceable
from scaraspec.protocol.readings import ReadingError, parse_settings
from scaraspec.report import html, terminal
from scaraspec.report.model import Role
from scaraspec.report.sanitizing import visible
from scaraspec.report.translations import Language
from scaraspec.suite.engine.ics import Ics, IcsError
from scaraspec.transports.link import LinkError
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError

EXAMPLE = "Example: scaraspec audit capture.mcap --html report.html"

_PATH = click.Path(path_type=Path)
_ROLES = {"controller": Role.CONTROLLER, "client": Role.CLIENT, "both": Role.CAPTURE, None: None}
_JSON_MARK = ' "run": null,\n "schema": "scaraspec.results/'
_HTML_MARK = '<meta name="generator" content="scaraspec audit">'
_OUTPUT = ("json_file", "html_file", "language")


@click.command(epilog=EXAMPLE)
@click.argument("file", type=_PATH)
@capture_port
@click.option(
    "--serial", is_flag=True, help="The link was serial (clause 2), even if FILE does not state it."
)
@click.option(
    "--subject",
    type=click.Choice(["controller", "client", "both"]),
    help="The side to judge [the subject of the certification that wrote FILE, else both].",
)
@click.option(
    "--ics",
    type=_PATH,
    metavar="ICS",
    help="Conformance statement of the subject, TOML [what FILE states].",
)
@click.option(
    "--reading",
    "readings",
    multiple=True,
    metavar="KEY=OPTION",
    help="A further reading that the subject claims, such as xfer_timeout=60; repeatable.",
)
@click.option("--json", "json_file", type=_PATH, help="Write results.json here.")
@click.option("--html", "html_file", type=_PATH, help="Write the report here.")
@click.option(
    "--language",
    type=click.Choice([each.value for each in Language]),
    default=Language.ENGLISH.value,
    help="Language in which the report opens.",
)
def command(  # noqa: PLR0913 - one for each option
    file: Path,
    port: int | None,
    *,
    serial: bool,
    subject: str | None,
    ics: Path | None,
    readings: tuple[str, ...],
    json_file: Path | None,
    html_file: Path | None,
    language: str,
) -> None:
    """Judge FILE: an MCAP recording, or a pcap or pcapng of any client and controller.

    Violations by the side that is not the subject do not count. Exit status 0 conformant,
    1 nonconformant, 3 inconclusive, 4 nothing to judge.
    """
    require_replaceable(json_file, _JSON_MARK)
    require_replaceable(html_file, _HTML_MARK)
    try:
        options = given_options(click.get_current_context(), without=_OUTPUT)
        with _shown_progress() as progress:
            results, notes = audit(
                file,
                subject=_ROLES.get(subject),
                ics=Ics.read(ics) if ics else None,
                readings=parse_settings(readings),
                port=port,
                serial=serial,
                reproduction=shlex.join(["scaraspec", "audit", f"{file}", *options]),
                progress=progress,
            )
        if json_file:
            results.write(json_file)
        if html_file:
            html.write(results, html_file, Language(language))
    except (CaptureError, IcsError, LinkError, ReadingError) as error:
        raise Problem(str(error)) from None
    except OSError as error:
        raise Problem(
            UserMessage(
                "{filename} cannot be written: {strerror}",
                filename=error.filename,
                strerror=error.strerror,
            )
        ) from None
    for note in notes:
        click.echo(visible(f"{file}: {note}"), err=True)
    terminal.show(results, Console())
    raise SystemExit(results.verdict.exit_status)


@contextmanager
def _shown_progress() -> Iterator[Callable[[int], None]]:
    """On a terminal, show the number of events judged so far; yield the callback."""
    console = Console(stderr=True)
    columns = (TextColumn("judging {task.completed} events"), TimeElapsedColumn())
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("judging", total=None)
        yield lambda count: bar.update(task, completed=count)
