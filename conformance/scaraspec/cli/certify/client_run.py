"""The run of `scaraspec certify client`, from its parameters to the exit status."""

from pathlib import Path
from typing import Final

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
from scaraspec.cli.certify.running import Display, end_on_signals, estimate_of, say
from scaraspec.cli.problems import Problem
from scaraspec.report.model import Results, Role
from scaraspec.suite.client.harness.attended import HELP, Attended
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.plan import Options
from scaraspec.translation import localized
from scaraspec.transports.url import split_host_port
from scaraspec.user_message import UserMessage

_DRIVER_S: Final = 10.0
_OPERATOR_S: Final = 600.0


def run(  # noqa: PLR0913 - one for each option
    *,
    driver: str | None,
    listen: str | None,
    attended: bool,
    answer_timeout: float | None,
    ics: Path | None,
    transfer_timeout: float | None,
    only: str | None,
    rerun_from: Results | None,
    require: str | None,
    require_coverage: float,
    seed: int,
    examples: int,
    exhaustive: bool,
    fail_fast: bool,
    out: Path | None,
    dry_run: bool,
    **_: object,  # those of `certification_of`
) -> None:
    """Certify a client; the help texts of the options explain the parameters.

    Raises:
        Problem: The user has made a mistake.
        SystemExit: The run has ended.
    """
    if attended != bool(listen) or bool(driver) + attended > 1:
        raise Problem("name a client: either --driver COMMAND, or --listen HOST:PORT --attended")
    with user_errors():
        statement = statement_of(ics, transfer_timeout)
        selection = selection_of("--only", only, Role.CLIENT)
        required = selection_of("--require", require, Role.CLIENT)
        options = Options(
            only=selection.requirements,
            cases=selection.cases,
            required=required.requirements or frozenset(),
            required_percent=require_coverage,
            seed=seed,
            examples=examples,
            exhaustive=exhaustive,
            fail_fast=fail_fast,
            attended=attended,
        )
        if rerun_from:
            options = rerun_of(rerun_from, options, statement, Role.CLIENT, driver or listen or "")
        certification = certification_of(click.get_current_context(), Role.CLIENT, statement)
        if certification:
            options = certification.options
        cases = certify.plan(options, Role.CLIENT)
        estimate = estimate_of(cases, options, statement)
        text = "{count} cases will run, in {estimate}"
        click.echo(localized(text, count=len(cases), estimate=estimate))
        if dry_run:
            return
        subject: str | Attended
        if driver:
            subject = driver
        elif listen:
            subject = _attended(listen, answer_timeout or _OPERATOR_S)
        else:
            raise Problem("no client: name its driver, such as --driver 'scaraspec client-driver'")
        certification = calibrated(certification, Console())
        interruption = Interruption()
        display = Display(Console(), len(cases), estimate, ticks=attended)

        def run_suite() -> Results:
            with display.bar:
                end_on_signals(interruption)
                return certify.client(
                    subject,
                    answer_timeout_s=answer_timeout or _DRIVER_S,
                    ics=statement,
                    options=options,
                    out=out,
                    certification=certification,
                    reproduction=reproduction(click.get_current_context()),
                    progress=display.progress,
                    interruption=interruption,
                )

        run_and_exit(run_suite, out, certification)


def _attended(listen: str, answer_timeout_s: float) -> Attended:
    """Listen for a client that an operator works with.

    Raises:
        Problem: The address cannot be used.
    """
    host, port = split_host_port(listen, lowest_port=0)
    try:
        access = Attended(host, port, say, answer_timeout_s=answer_timeout_s)
    except OSError as error:
        raise Problem(
            UserMessage(
                "cannot listen on {listen}: {strerror}", listen=listen, strerror=error.strerror
            )
        ) from None
    address = f"{access.host}:{access.port}"
    click.echo(localized("listening at {address}. {help}", address=address, help=localized(HELP)))
    click.echo(
        localized(
            "Switch off automatic reconnection in the client. Polling does not disturb the test."
        )
    )
    return access
