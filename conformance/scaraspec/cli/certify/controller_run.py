"""The run of `scaraspec certify controller`, from its parameters to the exit status."""

from dataclasses import dataclass
from pathlib import Path

import click
from rich.console import Console

from scaraspec.api import certify
from scaraspec.cli.certify.options import reproduction
from scaraspec.cli.certify.preparation import (
    calibrated,
    certification_of,
    rerun_of,
    run_and_exit,
    selection_of,
    statement_of,
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
from scaraspec.cli.problems import Problem
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.operator import TerminalOperator
from scaraspec.suite.engine.plan import Options, hazards
from scaraspec.transports.url import parse


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


def run(settings: Settings) -> None:
    """Certify a controller.

    Raises:
        Problem: The user has made a mistake, or declines.
        SystemExit: The run has ended.
    """
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

        def run_suite() -> Results:
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

        run_and_exit(run_suite, settings.out, certification)
