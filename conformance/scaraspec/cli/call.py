"""`scaraspec call`: send one command to a controller.

The commands, their arguments and the form of results are derived from the command table.
"""

import difflib
import json
import textwrap
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import Progress

from scaraspec.cli.options import Real, password_option
from scaraspec.cli.problems import Problem
from scaraspec.cli.vocabulary import DEFAULT_PASSWORD
from scaraspec.client import Client, ClientError, LinkLost, ReplyTimeout
from scaraspec.client.text_interface import (
    OPERATIONS,
    TRANSFERS,
    error_to_json,
    format_result,
    name_text,
    parse_arguments,
    to_json,
)
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.readings import Dialect, ReadingError, parse_settings
from scaraspec.suite.engine.ics import Ics, IcsError
from scaraspec.translation import localized
from scaraspec.transports.connect import CONNECT_TIMEOUT_S
from scaraspec.transports.link import LinkError
from scaraspec.transports.url import parse
from scaraspec.user_message import UserMessage, sentence_of

EXAMPLE = "Example: scaraspec call tcp://127.0.0.1:8877 set_digital_output 8 1"

_SILENT = (ReplyTimeout, LinkLost)
_USAGE = (PayloadError, LinkError, OSError, IcsError, ReadingError)


def _catalogue() -> str:
    """Return each command with its arguments, none split over two lines."""
    items = ["\xa0".join((name, *map(str.upper, takes))) for name, takes in OPERATIONS.items()]
    return textwrap.fill(", ".join(items), 78).replace("\xa0", " ")


@click.command(
    epilog=f"\b\nCommands:\n{_catalogue()}\n\n{EXAMPLE}",
    context_settings={"ignore_unknown_options": True},  # so that -1 and -y are arguments
)
@click.argument("url")
@click.argument("name", metavar="COMMAND")
@click.argument("texts", metavar="[ARGS]...", nargs=-1)
@password_option(None, "Password for the login over TCP")
@click.option(
    "--timeout",
    "timeout_s",
    metavar="S",
    type=Real(0.001, 1e6),
    help="Time to wait for a reply [5] and for a final result [no limit].",
)
@click.option(
    "--reading",
    "readings",
    multiple=True,
    metavar="KEY=OPTION",
    help="A reading of the controller, such as endian=big; repeatable.",
)
@click.option(
    "--ics",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Conformance statement of the controller, TOML: its readings are used.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(  # noqa: PLR0913, PLR0917 - a command line's options are its arguments
    url: str,
    name: str,
    texts: tuple[str, ...],
    password: str | None,
    timeout_s: float | None,
    readings: tuple[str, ...],
    ics: Path | None,
    as_json: bool,  # noqa: FBT001 - a flag of the command line
) -> None:
    """Send COMMAND with ARGS to the controller at URL, and print the result.

    A two-stage command, such as run_program, is waited for until its final result. Ctrl-C ends only
    the wait: the robot continues, and emergency_stop stops it.

    Exit status: 0 done, 1 refused or failed, 2 usage error, 3 no reply, link lost or wait ended.
    """
    name = name.replace("-", "_")
    if name not in OPERATIONS:
        near = difflib.get_close_matches(name, OPERATIONS, n=1)
        hint: str = UserMessage("scaraspec call --help lists them")
        if near:
            hint = UserMessage("did you mean {name}?", name=near[0])
        raise Problem(UserMessage("there is no command {name!r}: {hint}", name=name, hint=hint))
    try:
        dialect = _dialect(ics, readings, timeout_s)
        result = _carry_out(url, name, texts, password, timeout_s, dialect, announce=not as_json)
    except (ClientError, *_USAGE) as error:
        status = _status(error)
        if not as_json:
            raise Problem(_sentence(error), status) from None
        answer = {"ok": False, "command": name, "error": error_to_json(error)}
        click.echo(json.dumps(answer, ensure_ascii=False))
        raise SystemExit(status) from None
    if as_json:
        answer = {"ok": True, "command": name, "result": to_json(result, name_text)}
        click.echo(json.dumps(answer, ensure_ascii=False))
    else:
        for line in format_result(name, result):
            click.echo(localized(line) if isinstance(line, UserMessage) else line)


def _carry_out(  # noqa: PLR0913, PLR0917 - the options of the command line
    url: str,
    name: str,
    texts: tuple[str, ...],
    password: str | None,
    timeout_s: float | None,
    dialect: Dialect,
    *,
    announce: bool,
) -> Any:
    values = parse_arguments(name, texts)
    if name == "login":
        password = None  # it logs in itself
    elif password is None and parse(url).needs_login:
        password = DEFAULT_PASSWORD
    with Client(
        url,
        password=password,
        dialect=dialect,
        connect_timeout_s=timeout_s or CONNECT_TIMEOUT_S,
    ) as client:
        if name in TRANSFERS:
            return _transfer(client, name, values)
        if not BY_NAME[name].two_stage:
            return getattr(client, name)(*values)
        pending = getattr(client, f"start_{name}")(*values)
        if announce and pending.accepted and not pending.done:
            text = "accepted, waiting for the final result; Ctrl-C ends the wait"
            click.echo(localized(text), err=True)
        try:
            return pending.wait(timeout_s)
        except KeyboardInterrupt:
            raise Problem(
                UserMessage(
                    "{name} continues on the robot: only the wait ended; emergency_stop stops it",
                    name=name,
                ),
                ExitStatus.INCONCLUSIVE,
            ) from None


def _dialect(ics: Path | None, readings: tuple[str, ...], timeout_s: float | None) -> Dialect:
    """Return the readings of the controller.

    Raises:
        IcsError: The ICS cannot be read.
        ReadingError: A reading does not exist.
    """
    claims = Ics.read(ics) if ics else Ics()
    dialect = claims.with_claims(**parse_settings(readings)).dialect
    if timeout_s is not None:
        dialect = dialect.replace(reply_timeout=f"{timeout_s:.3f}")
    return dialect


def _transfer(client: Client, name: str, values: list[str]) -> Any:
    """Upload or download, with a progress bar on a terminal."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(name, total=None)

        def progress(moved_bytes: int, total_bytes: int | None) -> None:
            bar.update(task, completed=moved_bytes, total=total_bytes)

        return getattr(client, name)(*values, progress=progress)


def _status(error: Exception) -> ExitStatus:
    if isinstance(error, _SILENT):
        return ExitStatus.INCONCLUSIVE
    return ExitStatus.NONCONFORMANT if isinstance(error, ClientError) else ExitStatus.USAGE


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"{error.filename}: {error.strerror}"
    return sentence_of(error)
