"""`scaraspec ics`: write an implementation conformance statement, and check one."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scaraspec import api
from scaraspec.cli.options import password_option, state_dir_option
from scaraspec.cli.problems import Problem
from scaraspec.cli.vocabulary import DEFAULT_PASSWORD
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible_line
from scaraspec.suite.engine.ics import UnreadableIcsError
from scaraspec.suite.engine.journal import ControllerBusyError, JournalError
from scaraspec.translation import localized
from scaraspec.transports.link import LinkError
from scaraspec.user_message import UserMessage, sentence_of

if TYPE_CHECKING:
    from scaraspec.api import CheckedIcs

EXAMPLE = "Example: scaraspec ics new tcp://192.168.1.2 --out ics.toml"

_PATH = click.Path(path_type=Path)


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLE)
def command() -> None:
    """Write or check an implementation conformance statement (ICS)."""


@command.command(epilog=EXAMPLE)
@click.argument("url", required=False, default="")
@click.option("--out", type=_PATH, metavar="FILE", help="Write a new file [standard output].")
@password_option(DEFAULT_PASSWORD, "Password for the login over TCP")
@state_dir_option
def new(url: str, *, out: Path | None, password: str, state_dir: Path | None) -> None:
    """Write a statement with every question, filled in from the controller at URL.

    Only logins and queries are sent, on several connections: nothing is changed. Exit status 2
    usage, 3 the controller does not answer or FILE cannot be written.
    """
    if out and out.exists():
        raise Problem(UserMessage("{path} exists: name a new file with --out", path=out))
    with _user_errors():
        text = api.new_ics(url, password=password, state_dir=state_dir)
        if not out:
            click.echo(text, nl=False)
            return
        try:
            with out.open("x", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise Problem(
                UserMessage("{path} cannot be written: {reason}", path=out, reason=error.strerror),
                ExitStatus.INCONCLUSIVE,
            ) from None
    click.echo(f"{out}")


@command.command(epilog="Example: scaraspec ics check ics.toml tcp://192.168.1.2")
@click.argument("path", metavar="FILE", type=_PATH)
@click.argument("url", required=False, default="")
@password_option(DEFAULT_PASSWORD, "Password for the login over TCP")
@state_dir_option
def check(path: Path, url: str, *, password: str, state_dir: Path | None) -> None:
    """Find mistakes and contradictions in the statement FILE.

    With URL, also verify the claims that logins and queries show; nothing is changed. Exit status 0
    no problem, 1 a problem, 2 FILE cannot be read, 3 the controller does not answer.
    """
    with _user_errors():
        checked = api.check_ics(path, url, password=password, state_dir=state_dir)
    for problem in checked.problems:
        click.echo(visible_line(localized(problem)))
    for line in _summary(checked) if url and not checked.problems else ():
        click.echo(localized(line))
    if checked.problems:
        raise SystemExit(ExitStatus.NONCONFORMANT)
    click.echo(localized("{path}: no contradiction", path=path))


def _summary(checked: "CheckedIcs") -> Iterator[str]:
    if checked.verified:
        yield UserMessage("verified: {keys}", keys=", ".join(checked.verified))
    if checked.unverified:
        yield UserMessage(
            "not visible in queries, so `certify` verifies it: {keys}",
            keys=", ".join(checked.unverified),
        )


@contextmanager
def _user_errors() -> Iterator[None]:
    from scaraspec.api.certify import StartError  # noqa: PLC0415 - imports the harnesses

    try:
        yield
    except (UnreadableIcsError, LinkError, JournalError) as error:
        raise Problem(sentence_of(error)) from None
    except (ControllerBusyError, StartError) as error:
        raise Problem(sentence_of(error), ExitStatus.INCONCLUSIVE) from None
