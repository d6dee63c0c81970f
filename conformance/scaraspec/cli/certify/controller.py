"""`scaraspec certify controller`: the suite acts as the client."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from scaraspec.api import certify
from scaraspec.cli.certify.options import (
    PATH,
    calibrated,
    certification_of,
    option,
    reproduction,
    rerun_of,
    run_and_exit,
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
    require_terminal,
    say,
    show_plan,
)
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.options import Duration, Real
from scaraspec.cli.problems import Problem
from scaraspec.cli.vocabulary import DEFAULT_PASSWORD
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.operator import TerminalOperator
from scaraspec.suite.engine.plan import Options, hazards
from scaraspec.transports.url import parse

_GROUPS = {
    "The subject": (
        "password",
        "ics",
        "attended",
        "reply_timeout",
        "transfer_timeout",
        "wait_for",
        "wait_for_lock",
    ),
    "What to try": (
        *(
            "allow",
            "only",
            "rerun_from",
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The parameters of the command, as click has converted them; the help texts explain them."""

    url: str | None
    password: str
    ics: Path | None
    transfer_timeout: float | None
    attended: bool
    reply_timeout: float | None
    allow: str
    only: str | None
    rerun_from: Results | None
    require: str | None
    require_coverage: float
    seed: int
    examples: int
    patience: float
    exhaustive: bool
    undefined_opcodes: bool
    wait_for_lock: float
    wait_for: float
    fail_fast: bool
    state_dir: Path | None
    yes: bool
    out: Path | None
    certification: bool
    package: Path | None
    dry_run: bool

    def read_statement(self) -> Ics:
        """Return the claims of the controller.

        Raises:
            IcsError: The file cannot be read or has an unknown key.
            ReadingError: A time is too short or too long.
        """
        return statement_of(self.ics, self.transfer_timeout, self.reply_timeout)

    def options(self) -> Options:
        """Return what a run tries.

        Raises:
            Problem: A list names nothing that can be run.
            HazardError: The name of a hazard does not exist.
        """
        selection = selection_of("--only", self.only, Role.CONTROLLER)
        required = selection_of("--require", self.require, Role.CONTROLLER)
        return Options(
            only=selection.requirements,
            cases=selection.cases,
            required=required.requirements or frozenset(),
            required_percent=self.require_coverage,
            allowed=hazards(self.allow),
            undefined=self.undefined_opcodes,
            seed=self.seed,
            examples=self.examples,
            exhaustive=self.exhaustive,
            brief=self.only is None and not self.exhaustive,
            fail_fast=self.fail_fast,
            attended=self.attended,
        )


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.argument("url", required=False)
@option("password", envvar="SCARASPEC_PASSWORD", default=DEFAULT_PASSWORD)
@option("allow", default="")
@suite_options
@click.option(
    "--attended", is_flag=True, help="Ask an operator to do what the ICS has no hook for."
)
@option("reply-timeout", type=Duration())
@option("patience", type=Real(0, 100_000))
@option("undefined-opcodes")
@option("wait-for-lock", type=Duration(), default=0.0)
@option("wait-for", type=Duration(), default=0.0)
@option("state-dir", type=PATH, envvar="SCARASPEC_STATE")
@option("yes", "-y")
def command(**given: Any) -> None:
    """Certify the controller at URL; read-only unless --allow permits more.

    Settings and files are restored at the end, after Ctrl-C, and by the next run after a crash.
    Exit status 0 conformant, 1 nonconformant, 2 usage, 3 inconclusive or something is left on the
    controller, 4 nothing tested.
    """
    settings = Settings(**given)
    if settings.attended and not settings.dry_run:
        require_terminal()
    with user_errors():
        statement = settings.read_statement()
        earlier = settings.rerun_from
        where = settings.url or statement.url or (earlier.subject.link if earlier else "")
        if not where and not settings.dry_run:
            raise Problem(
                "no controller: give its URL, such as tcp://192.168.1.2, or set url in the ICS file"
            )
        if where:
            parse(where)  # an invalid URL is reported before the plan
        options = settings.options()
        if earlier:
            options = rerun_of(earlier, options, statement, Role.CONTROLLER, where)
        certification = certification_of(
            click.get_current_context(),
            Role.CONTROLLER,
            statement,
            allowed=options.allowed,
            undefined=settings.undefined_opcodes,
        )
        if certification:
            if where and not parse(where).needs_login:
                raise Problem(
                    "--certification needs a TCP link: some requirements are about connections"
                )
            options = certification.options
        cases = certify.plan(options)
        estimate = estimate_of(cases, options, statement)
        show_plan(cases, options, statement, Console(), estimate)
        if settings.dry_run or not where:
            return
        if not settings.yes:
            confirm_motion(cases, options, statement)
        certification = calibrated(certification, Console())
        interruption = Interruption()
        display = Display(Console(), len(cases), estimate, ticks=settings.attended)

        def run() -> Results:
            with display.bar:
                end_on_signals(interruption)
                return certify.controller(
                    where,
                    password=settings.password,
                    ics=statement,
                    options=options,
                    patience_s=settings.patience,
                    out=settings.out,
                    certification=certification,
                    state_dir=settings.state_dir,
                    lock_timeout_s=settings.wait_for_lock,
                    wait_for_s=settings.wait_for,
                    reproduction=reproduction(click.get_current_context(), where),
                    progress=display.progress,
                    interruption=interruption,
                    operator=TerminalOperator(say) if settings.attended else None,
                )

        run_and_exit(run, settings.out, certification)
