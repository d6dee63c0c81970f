"""`scaraspec certify client`: the suite acts as the controller."""

import shlex
from contextlib import closing
from pathlib import Path
from typing import Final

import click
from rich.console import Console

from scaraspec.cli.certify.options import (
    again,
    conclude,
    requirements_of,
    statement_of,
    suite_options,
    told,
)
from scaraspec.cli.certify.running import Display, Files, end_in_order
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.options import Real
from scaraspec.cli.problems import Problem
from scaraspec.report.model import Role
from scaraspec.suite.client.harness.access import DriverAccess
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.client.harness.attended import HELP, Attended
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.run import Run, collect
from scaraspec.suite.engine.stall_detector import StallDetector
from scaraspec.transports.url import split_host_port
from scaraspec.user_message import UserMessage

_GROUPS = {
    "The subject": ("driver", "listen", "attended", "ics", "transfer_timeout", "answer_timeout"),
    "What to try": ("only", "seed", "examples", "exhaustive"),
    "The run": ("out", "dry_run"),
}
_DRIVER_S: Final = 10.0
_OPERATOR_S: Final = 600.0

EXAMPLE: Final = "Example: scaraspec certify client --driver 'scaraspec client-driver' --out run-1"


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.option("--driver", metavar="COMMAND", help="Driver that operates the client by JSON Lines.")
@click.option("--listen", metavar="HOST:PORT", help="Address for a client without a driver.")
@click.option(
    "--attended", is_flag=True, help="Instruct an operator, and ask what the client shows."
)
@click.option(
    "--answer-timeout",
    type=Real(0.1, 3600),
    metavar="S",
    help="Time limit for each operation [10; attended 600].",
)
@suite_options
def command(  # noqa: PLR0913 - one for each option
    *,
    driver: str | None,
    listen: str | None,
    attended: bool,
    answer_timeout: float | None,
    ics: Path | None,
    transfer_timeout: float | None,
    only: str | None,
    seed: int,
    examples: int,
    exhaustive: bool,
    out: Path | None,
    dry_run: bool,
) -> None:
    """Certify a client build: the suite acts as the controller.

    Check a driver first with scaraspec driver-check. Without a driver an operator works with the
    client (--listen, --attended); the same --out continues an earlier session. Exit status 0
    conformant, 1 nonconformant, 2 usage, 3 inconclusive, 4 nothing tested.
    """
    if attended != bool(listen) or bool(driver) + attended > 1:
        raise Problem("name a client: either --driver COMMAND, or --listen HOST:PORT --attended")
    with told():
        statement = statement_of(ics, transfer_timeout)
        options = Options(
            only=requirements_of(only),
            seed=seed,
            examples=examples,
            exhaustive=exhaustive,
            attended=attended,
        )
        cases = collect(options, Role.CLIENT)
        click.echo(f"{len(cases)} cases will run")
        if dry_run:
            return
        given = again(driver=driver and shlex.quote(driver), listen=listen, ics=ics, seed=seed)
        with (
            closing(_access(driver, listen, answer_timeout)) as access,
            Files(out, sittings=attended) as files,
            Display(Console(), len(cases), ticks=attended) as display,
            StallDetector() as pulse,
        ):
            setting = ClientAdapter(
                access,
                statement,
                options,
                link=driver or f"{access.host}:{access.port}",
                capture=files.capture,
                replay=f"scaraspec certify client{given}{' --attended' * attended}",
            )
            run = Run(
                setting,
                earlier=files.earlier,
                take=files.take,
                report=display.tell,
                announce=display.announce,
                stall_s=pulse.stood_still_s,
            )
            end_in_order(run.interruption)
            results = run.results()
            with run.interruption:  # a signal now takes effect after the report
                files.write(results)
    conclude(results, out)


def _access(
    driver: str | None, listen: str | None, answer_s: float | None
) -> DriverAccess | Attended:
    """Return the access to the client.

    Raises:
        Problem: Neither a driver nor an address is given.
        DriverError: The driver cannot be started.
    """
    if driver:
        return DriverAccess(driver, answer_s or _DRIVER_S)
    if not listen:
        raise Problem("no client: name its driver, such as --driver 'scaraspec client-driver'")
    where = split_host_port(listen, lowest_port=0)
    try:
        access = Attended(*where, click.echo, answer_timeout_s=answer_s or _OPERATOR_S)
    except OSError as error:
        raise Problem(
            UserMessage(
                "cannot listen on {listen}: {strerror}", listen=listen, strerror=error.strerror
            )
        ) from None
    click.echo(f"listening at {access.host}:{access.port}. {HELP}")
    click.echo(
        "Switch off automatic reconnection in the client. Polling does not disturb the test."
    )
    return access
