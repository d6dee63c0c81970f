"""`scaraspec certify`: the suite against a real subject, with a report that can be signed.

Arguments only: what is tried stands in `suite`, what is said about it in `report`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from rich.console import Console

from scaraspec.cli.certifying import Display, Files, show_plan
from scaraspec.cli.grouped import GroupedCommand
from scaraspec.cli.problems import Problem
from scaraspec.judgement.requirements import UnknownRequirementError, select
from scaraspec.judgement.verdicts import ExitStatus
from scaraspec.links.link import LinkError
from scaraspec.links.url import parse
from scaraspec.protocol.readings import ReadingError
from scaraspec.report import terminal
from scaraspec.suite.as_client.access import UrlAccess
from scaraspec.suite.plan import HazardError, Options, hazards
from scaraspec.suite.run import Run, Setting, SuiteError, collect
from scaraspec.suite.statement import Statement, StatementError

_PATH = click.Path(path_type=Path)
_GROUPS = {
    "The subject": ("password", "ics", "transfer_timeout"),
    "What to try": (
        *("allow", "only", "seed", "examples", "patience", "exhaustive", "undefined_opcodes"),
    ),
    "The run": ("out", "dry_run"),
}
EXAMPLE = "Example: scaraspec certify controller tcp://192.168.1.2 --allow state --out run-1"


@click.group(context_settings={"help_option_names": ["-h", "--help"]}, epilog=EXAMPLE)
def command() -> None:
    """Certify an implementation against the document.

    scaraspec is no safety function: keep a hardware emergency stop within reach.
    """


@command.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.argument("url", required=False)
@click.option("--password", default="password", show_default=True, help="What opens it.")
@click.option("--ics", type=_PATH, metavar="FILE", help="Its statement of conformance, TOML.")
@click.option(
    "--transfer-timeout",
    type=click.FloatRange(0.1, 3600),
    metavar="S",
    help="It abandons a transfer after this silence [30].",
)
@click.option(
    "--allow",
    default="",
    metavar="HAZARDS",
    help="Beyond reading: state, motion, destructive; separated by commas.",
)
@click.option("--only", metavar="LIST", help="Clauses or requirements, as 4.15,3/31.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of what is drawn.")
@click.option(
    "--examples",
    type=click.IntRange(1, 100_000),
    default=20,
    show_default=True,
    help="How many values a drawn case tries.",
)
@click.option(
    "--patience",
    type=click.FloatRange(0, 100_000),
    default=10.0,
    show_default=True,
    metavar="S",
    help="How long one case may wait for what only time brings, as the clock's next minute.",
)
@click.option("--exhaustive", is_flag=True, help="Go on with a requirement that has failed.")
@click.option(
    "--undefined-opcodes", is_flag=True, help="Send them; never to a robot that can move."
)
@click.option("--out", type=_PATH, metavar="DIR", help="Write results, reports and capture here.")
@click.option("--dry-run", is_flag=True, help="Show the plan, and send nothing.")
def controller(  # noqa: PLR0913 - one for each option
    url: str | None,
    *,
    password: str,
    ics: Path | None,
    transfer_timeout: float | None,
    allow: str,
    only: str | None,
    seed: int,
    examples: int,
    patience: float,
    exhaustive: bool,
    undefined_opcodes: bool,
    out: Path | None,
    dry_run: bool,
) -> None:
    """Certify the controller at URL; read-only unless --allow names more.

    Its state is saved before and put back after, also after Ctrl-C. Exit status 0 conformant,
    1 nonconformant, 2 usage, 3 inconclusive, 4 nothing tested.
    """
    with _told():
        statement = Statement.read(ics) if ics else Statement()
        if transfer_timeout is not None:
            statement = statement.claiming(xfer_timeout=f"{transfer_timeout:g}")
        options = Options(
            only=frozenset(r.id for r in select(only)) if only else None,
            allowed=hazards(allow),
            undefined=undefined_opcodes,
            seed=seed,
            examples=examples,
            exhaustive=exhaustive,
        )
        cases = collect(options)
        show_plan(cases, options, statement, Console())
        if dry_run:
            return
        where = url or statement.url
        if not where:
            raise Problem("no controller: name its URL, as tcp://192.168.1.2, or in the ICS file")
        parse(where)
        replay = f"scaraspec certify controller {where}{_again(allow, ics, seed, examples)}"
        with Files(out) as files, Display(Console(), len(cases)) as display:
            setting = Setting(
                UrlAccess(where, patience),
                statement,
                password.encode(),
                options,
                link=where,
                replay=replay,
                state_file=files.state_file,
            )
            results = Run(setting, take=files.take, tell=display.tell).results()
            files.write(results)
    terminal.show(results, Console())
    if out:
        click.echo(f"{out}/report.html")
    raise SystemExit(results.verdict.exit_status)


def _again(allow: str, ics: Path | None, seed: int, examples: int) -> str:
    """The options that make a run the same again."""
    given = {"--allow": allow, "--ics": ics, "--seed": seed, "--examples": examples}
    return "".join(f" {option} {value}" for option, value in given.items() if value)


@contextmanager
def _told() -> Iterator[None]:
    """Tell what a user got wrong in one sentence."""
    try:
        yield
    except (StatementError, LinkError, ReadingError) as error:
        raise Problem(f"{error}") from None
    except UnknownRequirementError as error:
        raise Problem(f"--only: {error}") from None
    except HazardError as error:
        raise Problem(f"--allow: {error}") from None
    except SuiteError as error:
        raise Problem(f"the suite is broken: {error}", ExitStatus.INCONCLUSIVE) from None
    except OSError as error:
        raise Problem(f"{error.filename} cannot be written: {error.strerror}") from None
