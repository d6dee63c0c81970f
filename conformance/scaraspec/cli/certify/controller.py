"""`scaraspec certify controller`: the suite acts as the client."""

from pathlib import Path

import click
from rich.console import Console

from scaraspec.api import certify
from scaraspec.cli.certify.options import (
    calibrated,
    certification_of,
    conclude,
    reproduction,
    selection_of,
    statement_of,
    suite_options,
    user_errors,
)
from scaraspec.cli.certify.running import (
    Display,
    confirm_motion,
    end_on_signals,
    estimate_of,
    show_plan,
)
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.options import DEFAULT_PASSWORD, Duration, Real, password_option
from scaraspec.cli.problems import Problem
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.plan import Options, hazards
from scaraspec.transports.url import Tcp, parse

_GROUPS = {
    "The subject": (
        "password",
        "ics",
        "reply_timeout",
        "transfer_timeout",
        "wait_for",
        "wait_for_lock",
    ),
    "What to try": (
        *(
            "allow",
            "only",
            "require",
            "require_coverage",
            "seed",
            "examples",
            "patience",
            "exhaustive",
            "fail_fast",
            "undefined_opcodes",
        ),
    ),
    "The run": ("out", "certification", "package", "state_dir", "yes", "dry_run"),
}
EXAMPLE = "Example: scaraspec certify controller tcp://192.168.1.2 --allow state --out run-1"


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.argument("url", required=False)
@password_option(DEFAULT_PASSWORD, "Password for the login over TCP")
@click.option(
    "--allow",
    default="",
    metavar="HAZARDS",
    help="Permit more than queries: state, motion, destructive; separated by commas.",
)
@suite_options
@click.option(
    "--reply-timeout",
    type=Duration(),
    metavar="DURATION",
    help="Time that a first reply may take [5s].",
)
@click.option(
    "--patience",
    type=Real(0, 100_000),
    default=10.0,
    show_default=True,
    metavar="S",
    help="Longest wait of one case, for example for the next minute of the clock.",
)
@click.option(
    "--undefined-opcodes",
    is_flag=True,
    help="Send undefined opcodes; never to a robot that can move.",
)
@click.option(
    "--wait-for-lock",
    type=Duration(),
    default=0.0,
    metavar="DURATION",
    help="Time to wait for another run against this controller [0s].",
)
@click.option(
    "--wait-for",
    type=Duration(),
    default=0.0,
    metavar="DURATION",
    help="Time to wait until the controller accepts a connection [0s].",
)
@click.option(
    "--state-dir",
    type=click.Path(path_type=Path),
    envvar="SCARASPEC_STATE",
    metavar="DIR",
    help="Folder of the journals [SCARASPEC_STATE, or the user's state directory].",
)
@click.option("-y", "--yes", is_flag=True, help="Move the robot without a confirmation.")
def command(  # noqa: PLR0913 - one for each option
    url: str | None,
    *,
    password: str,
    ics: Path | None,
    transfer_timeout: float | None,
    reply_timeout: float | None,
    allow: str,
    only: str | None,
    require: str | None,
    require_coverage: float,
    seed: int,
    examples: int,
    patience: float,
    exhaustive: bool,
    undefined_opcodes: bool,
    wait_for_lock: float,
    wait_for: float,
    fail_fast: bool,
    state_dir: Path | None,
    yes: bool,
    out: Path | None,
    dry_run: bool,
    **_: object,  # those of `certification_of`
) -> None:
    """Certify the controller at URL; read-only unless --allow permits more.

    Settings and files are restored at the end, after Ctrl-C, and by the next run after a crash.
    Exit status 0 conformant, 1 nonconformant, 2 usage, 3 inconclusive or something is left on the
    controller, 4 nothing tested.
    """
    with user_errors():
        statement = statement_of(ics, transfer_timeout, reply_timeout)
        where = url or statement.url
        if not where and not dry_run:
            raise Problem(
                "no controller: give its URL, such as tcp://192.168.1.2, or set url in the ICS file"
            )
        if where:
            parse(where)  # an invalid URL is reported before the plan
        selection = selection_of("--only", only, Role.CONTROLLER)
        required = selection_of("--require", require, Role.CONTROLLER)
        options = Options(
            only=selection.requirements,
            cases=selection.cases,
            required=required.requirements or frozenset(),
            required_percent=require_coverage,
            allowed=hazards(allow),
            undefined=undefined_opcodes,
            seed=seed,
            examples=examples,
            exhaustive=exhaustive,
            brief=only is None and not exhaustive,
            fail_fast=fail_fast,
        )
        certification = certification_of(
            click.get_current_context(),
            Role.CONTROLLER,
            statement,
            allowed=options.allowed,
            undefined=undefined_opcodes,
        )
        if certification:
            if where and not isinstance(parse(where), Tcp):
                raise Problem(
                    "--certification needs a TCP link: some requirements are about connections"
                )
            options = certification.options
        cases = certify.plan(options)
        estimate = estimate_of(cases, options, statement)
        show_plan(cases, options, statement, Console(), estimate)
        if dry_run or not where:
            return
        if not yes:
            confirm_motion(cases, options, statement)
        certification = calibrated(certification, Console())
        interruption = Interruption()
        display = Display(Console(), len(cases), estimate)

        def run() -> Results:
            with display.bar:
                end_on_signals(interruption)
                return certify.controller(
                    where,
                    password=password,
                    ics=statement,
                    options=options,
                    patience_s=patience,
                    out=out,
                    certification=certification,
                    state_dir=state_dir,
                    lock_timeout_s=wait_for_lock,
                    wait_for_s=wait_for,
                    reproduction=reproduction(click.get_current_context(), where),
                    progress=display.progress,
                    interruption=interruption,
                )

        conclude(run, out, certification)
