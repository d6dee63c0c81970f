"""`scaraspec certify controller`: the suite acts as the client."""

from pathlib import Path

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
from scaraspec.cli.certify.running import (
    Display,
    Files,
    confirm_motion,
    end_in_order,
    show_plan,
)
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.options import DEFAULT_PASSWORD, Duration, Real, password_option
from scaraspec.cli.problems import Problem
from scaraspec.operating_system import state_directory
from scaraspec.suite.controller.harness.access import UrlAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.journal import Journal
from scaraspec.suite.engine.plan import Options, hazards
from scaraspec.suite.engine.run import Run, collect
from scaraspec.suite.engine.stall_detector import StallDetector
from scaraspec.transports.connect import resolve_url

_GROUPS = {
    "The subject": ("password", "ics", "transfer_timeout", "wait_for_lock"),
    "What to try": (
        *(
            "allow",
            "only",
            "seed",
            "examples",
            "patience",
            "exhaustive",
            "undefined_opcodes",
        ),
    ),
    "The run": ("out", "state_dir", "yes", "dry_run"),
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
    allow: str,
    only: str | None,
    seed: int,
    examples: int,
    patience: float,
    exhaustive: bool,
    undefined_opcodes: bool,
    wait_for_lock: float,
    state_dir: Path | None,
    yes: bool,
    out: Path | None,
    dry_run: bool,
) -> None:
    """Certify the controller at URL; read-only unless --allow permits more.

    Settings and files are restored at the end, after Ctrl-C, and by the next run after a crash.
    Exit status 0 conformant, 1 nonconformant, 2 usage, 3 inconclusive or something is left on the
    controller, 4 nothing tested.
    """
    with told():
        statement = statement_of(ics, transfer_timeout)
        where = url or statement.url
        if not where and not dry_run:
            raise Problem(
                "no controller: give its URL, such as tcp://192.168.1.2, or set url in the ICS file"
            )
        access = UrlAccess(where, patience) if where else None
        options = Options(
            only=requirements_of(only),
            allowed=hazards(allow),
            undefined=undefined_opcodes,
            seed=seed,
            examples=examples,
            exhaustive=exhaustive,
            brief=only is None and not exhaustive,
        )
        cases = collect(options)
        show_plan(cases, options, statement, Console())
        if dry_run or access is None:
            return
        if not yes:
            confirm_motion(cases, options, statement)
        given = again(allow=allow, ics=ics, seed=seed, examples=examples)
        replay = f"scaraspec certify controller {where}{given}"
        with (
            Journal.of(
                resolve_url(where), state_dir or state_directory(), wait_s=wait_for_lock
            ) as journal,
            Files(out, needs_login=access.needs_login) as files,
            Display(Console(), len(cases)) as display,
            StallDetector() as pulse,
        ):
            setting = ControllerAdapter(
                access,
                statement,
                password.encode(),
                options,
                link=where,
                capture=files.capture,
                replay=replay,
                journal=journal,
                say=display.say,
            )
            run = Run(setting, take=files.take, report=display.tell, stall_s=pulse.stood_still_s)
            end_in_order(run.interruption)
            results = run.results()
            with run.interruption:  # a signal now takes effect after the report
                files.write(results)
    conclude(results, out)
