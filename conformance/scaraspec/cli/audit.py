"""`scaraspec audit`: judge a capture."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from rich.console import Console

from scaraspec.cli.options import (
    capture_port,
    given_options,
    language_option,
    selection_options,
)
from scaraspec.cli.problems import Problem, require_replaceable, unreadable, unwritable
from scaraspec.cli.progress_bar import shown_share
from scaraspec.judge.requirements import UnknownRequirementError, select
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import join_command
from scaraspec.protocol.readings import ReadingError, parse_settings
from scaraspec.report import terminal
from scaraspec.report.model import Role
from scaraspec.report.sanitizing import visible, visible_line
from scaraspec.suite.engine.ics import Ics, IcsError
from scaraspec.traffic.selection import Selection
from scaraspec.translation import localized
from scaraspec.transports.link import LinkError
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError

if TYPE_CHECKING:
    from scaraspec.api.audits import AuditedCapture

EXAMPLE = "Example: scaraspec audit capture.mcap --html report.html"

_PATH = click.Path(path_type=Path)
_ROLES = {"controller": Role.CONTROLLER, "client": Role.CLIENT, "both": Role.CAPTURE, None: None}
_JSON_MARK = ' "run": null,\n "schema": "scaraspec.results/'
_HTML_MARK = '<meta name="generator" content="scaraspec audit">'
_OUTPUT = ("json_file", "html_file", "jobs")


@click.command(epilog=EXAMPLE)
@click.argument("paths", metavar="PATH...", nargs=-1, required=True, type=_PATH)
@capture_port
@click.option(
    "--serial",
    is_flag=True,
    help="The link was serial (clause 2), even if the capture does not state it.",
)
@click.option(
    "--subject",
    type=click.Choice(["controller", "client", "both"]),
    help="The side to judge [the subject of the certification that wrote it, else both].",
)
@click.option(
    "--ics",
    type=_PATH,
    metavar="ICS",
    help="Conformance statement of the subject, TOML [what the capture states].",
)
@click.option(
    "--reading",
    "readings",
    multiple=True,
    metavar="KEY=OPTION",
    help="A further reading that the subject claims, such as xfer_timeout=60; repeatable.",
)
@click.option("--only", metavar="LIST", help="Judge only these requirements: 4.11,5.2/12.")
@selection_options
@click.option(
    "--jobs", type=click.IntRange(1), help="Processes for several captures [one per processor]."
)
@click.option("--json", "json_file", type=_PATH, help="Write results.json here.")
@click.option("--html", "html_file", type=_PATH, help="Write the report here.")
@language_option
def command(  # noqa: PLR0913 - one for each option
    paths: tuple[Path, ...],
    port: int | None,
    *,
    serial: bool,
    subject: str | None,
    ics: Path | None,
    readings: tuple[str, ...],
    only: str | None,
    commands: frozenset[str],
    connection: str | None,
    since: int | None,
    until: int | None,
    jobs: int | None,
    json_file: Path | None,
    html_file: Path | None,
) -> None:
    """Judge captures: MCAP recordings, or pcap and pcapng of any client and controller.

    PATH is a file, a folder or a pattern. The files of one recording are judged together. Several
    captures are listed with the gravest first. Violations by the side that is not the subject do
    not count. Exit status 0 conformant, 1 nonconformant, 3 inconclusive, 4 nothing to judge.
    """
    from scaraspec.api.auditing import audit  # noqa: PLC0415 - --help does not need the judge
    from scaraspec.api.audits import find_captures  # noqa: PLC0415 - for the same reason

    require_replaceable(json_file, _JSON_MARK)
    require_replaceable(html_file, _HTML_MARK)
    context = click.get_current_context()
    try:
        captures = find_captures(paths)
        options: dict[str, Any] = {
            "subject": _ROLES.get(subject),
            "ics": Ics.read(ics) if ics else None,
            "readings": parse_settings(readings),
            "port": port,
            "serial": serial,
            "only": frozenset(r.id for r in select(only)) if only else None,
            "selection": Selection(since, until, connection or "", commands),
        }
        words = [*given_options(context, without=_OUTPUT)]
        if len(captures) > 1:
            _audit_several(captures, jobs, words, options, outputs=(json_file, html_file))
        files = captures[0]
        with shown_share(localized("judging")) as progress:
            results, notes = audit(
                files,
                **options,
                reproduction=join_command(["scaraspec", "audit", *map(str, paths), *words]),
                progress=progress,
            )
        if json_file:
            results.write(json_file)
        if html_file:
            from scaraspec.report import html  # noqa: PLC0415 - only this option needs it

            html.write(results, html_file)
    except (CaptureError, IcsError, LinkError, ReadingError, UnknownRequirementError) as error:
        raise unreadable(error) from None
    except OSError as error:
        raise unwritable(error) from None
    for note in notes:
        click.echo(visible(f"{files[0]}: {localized(note)}"), err=True)
    terminal.show(results, Console())
    raise SystemExit(results.verdict.exit_status)


def _audit_several(
    captures: Sequence[tuple[Path, ...]],
    jobs: int | None,
    words: Sequence[str],
    options: dict[str, Any],
    outputs: Sequence[Path | None],
) -> NoReturn:
    """Judge several captures and print a summary.

    Raises:
        Problem: A file to write was named: it would have the results of one capture only.
        SystemExit: Always, with the exit status.
    """
    from scaraspec.api.audits import audit_all  # noqa: PLC0415 - --help does not need the judge

    if any(outputs):
        raise Problem(
            UserMessage(
                "--json and --html write the results of one capture, but there are {count}: "
                "audit the capture alone",
                count=len(captures),
            )
        )
    audited: list[AuditedCapture] = []
    with shown_share(localized("judging"), localized("captures")) as progress:
        progress(0, len(captures))
        for each in audit_all(captures, jobs=jobs or 0, arguments=words, **options):
            audited.append(each)
            progress(len(audited), len(captures))
    for each in audited:
        for note in each.notes:
            click.echo(visible_line(f"{each.title}: {localized(note)}"), err=True)
    terminal.show_captures(((a.title, a.results, a.error) for a in audited), Console())
    raise SystemExit(_exit_status(audited))


def _exit_status(audited: "Sequence[AuditedCapture]") -> ExitStatus:
    """Return the status of several captures: 1 wins over 3, 3 over 0; 4 if nothing was judged."""
    found = {
        each.results.verdict.exit_status if each.results else ExitStatus.INCONCLUSIVE
        for each in audited
    }
    for status in (ExitStatus.NONCONFORMANT, ExitStatus.INCONCLUSIVE, ExitStatus.CONFORMANT):
        if status in found:
            return status
    return ExitStatus.NOTHING_TESTED
