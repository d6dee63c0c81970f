"""What a certification does around the run: the settings, the calibration, the exit status."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final

import click
from click.core import ParameterSource
from rich.console import Console
from rich.progress import TimeRemainingColumn

from scaraspec.api import certificates
from scaraspec.api.calibration import MUTANTS
from scaraspec.api.certificates import (
    CalibrationError,
    Certification,
    CertificationError,
    PackageError,
    certification,
    verify_package,
)
from scaraspec.api.certify import IncompleteFilesError, StartError
from scaraspec.api.run_folder import RunFolderError, require_unused
from scaraspec.certificate.package import SUFFIX
from scaraspec.cli.problems import Problem, unwritable
from scaraspec.cli.progress_bar import ProgressBar
from scaraspec.cli.verify import show
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import ReadingError
from scaraspec.report import terminal
from scaraspec.report.model import Results, ResultsError, Role
from scaraspec.report.sanitizing import visible
from scaraspec.suite.client.harness.driver import DriverError
from scaraspec.suite.controller.harness.state.recovery import RecoveryError
from scaraspec.suite.engine.collection import SuiteError, collect
from scaraspec.suite.engine.earlier_sitting import cases_to_repeat, rerun_difference
from scaraspec.suite.engine.ics import Ics, IcsError
from scaraspec.suite.engine.journal import ControllerBusyError, JournalError
from scaraspec.suite.engine.plan import HazardError, Options
from scaraspec.suite.engine.selection import Selection, SelectionError, parse_selection
from scaraspec.translation import localized, translated_error
from scaraspec.transports.link import LinkError
from scaraspec.user_message import UserMessage, sentence_of


def statement_of(
    ics: Path | None, transfer_timeout: float | None, reply_timeout: float | None = None
) -> Ics:
    """Return the ICS from the file and the command line, which has priority.

    Args:
        ics: The file; None for no claims.
        transfer_timeout: The silence that ends a transfer, in seconds; None for the claim.
        reply_timeout: The longest time of a first reply, in seconds; None for the claim.

    Raises:
        IcsError: The file cannot be read or has an unknown key.
        ReadingError: A time is too short or too long.
    """
    statement = Ics.read(ics) if ics else Ics()
    times = {"xfer_timeout": transfer_timeout, "reply_timeout": reply_timeout}
    claims = {key: f"{time_s:g}" for key, time_s in times.items() if time_s is not None}
    return statement.with_claims(**claims)


def selection_of(option: str, text: str | None, role: Role) -> Selection:
    """Parse the list of ``--only`` or ``--require``.

    Raises:
        Problem: The list names nothing that can be run.
    """
    try:
        return parse_selection(text, role)
    except SelectionError as error:
        raise Problem(UserMessage("{option}: {error}", option=option, error=error)) from None


def rerun_of(earlier: Results, options: Options, statement: Ics, role: Role, link: str) -> Options:
    """Return the options of a run that repeats cases of an earlier one.

    Args:
        earlier: The results of the earlier run.
        options: The options of the run; their selection is what the run is about.
        statement: The ICS.
        role: The role of the subject.
        link: Its link.

    Raises:
        Problem: The run makes no sense as a repetition, or nothing needs to be repeated.
    """
    if differs := rerun_difference(earlier, statement, link):
        raise Problem(
            UserMessage(
                "--rerun-from: {difference}; give the same --ics and subject, or certify without "
                "--rerun-from",
                difference=differs,
            )
        )
    repeated = cases_to_repeat(earlier, collect(options, role))
    if not repeated:
        raise Problem(
            "--rerun-from: nothing to repeat, because all cases have passed",
            ExitStatus.NOTHING_TESTED,
        )
    before, now = earlier.subject.version, statement.version
    if before != now:
        click.echo(
            localized(
                "The version was {before!r} and is {now!r}: `scaraspec merge` refuses results of "
                "both.",
                before=before,
                now=now,
            )
        )
    return replace(options, only=frozenset(), cases=repeated)


_FIXED: Final = {
    "only": "--only",
    "require": "--require",
    "require_coverage": "--require-coverage",
    "examples": "--examples",
    "fail_fast": "--fail-fast",
    "patience": "--patience",
    "attended": "--attended",
    "rerun_from": "--rerun-from",
}
"""Parameters that a certification fixes, and their options."""


def certification_of(
    context: click.Context,
    role: Role,
    ics: Ics,
    *,
    allowed: frozenset[Hazard] = frozenset(),
    undefined: bool = False,
) -> Certification | None:
    """Return the certification that the options request; None if they request none.

    Raises:
        Problem: An option cannot be combined with it, or is missing.
        RunFolderError: The output folder contains the results of another run.
        CertificationError: The ICS or the options lack something, or the package cannot be written.
    """
    given = context.params
    package, out = given["package"], given["out"]
    if not given["certification"]:
        if package:
            raise Problem("--package needs --certification")
        return None
    for name, option in _FIXED.items():
        source = context.get_parameter_source(name)
        if source not in (None, ParameterSource.DEFAULT):
            raise Problem(
                UserMessage("--certification fixes the options: leave out {option}", option=option)
            )
    if out is None:
        raise Problem("--certification needs --out DIR, the folder for results and capture")
    require_unused(out)
    return certification(
        role,
        ics,
        package or out.with_name(f"{out.name}{SUFFIX}"),
        allowed=allowed,
        seed=given["seed"],
        undefined=undefined,
    )


def calibrated(certified: Certification | None, console: Console) -> Certification | None:
    """Calibrate the tester before a certification, with a bar on a terminal.

    Raises:
        CalibrationError: The tester is not fit for a certification.
    """
    if certified is None:
        return None
    console.print(
        localized("calibration: {count} mutants must be killed on this machine", count=MUTANTS)
    )
    bar = ProgressBar(
        console, localized("calibrating"), MUTANTS, TimeRemainingColumn(), transient=True
    )
    with bar:
        return certificates.calibrated(
            certified,
            jobs=os.cpu_count() or 1,
            mutant_ends=lambda proof: bar.count_one(proof.fault),
        )


def run_and_exit(
    run: Callable[[], Results], out: Path | None, certified: Certification | None = None
) -> None:
    """Run a certification, print its results and exit with its status.

    Args:
        run: Runs it.
        out: The output folder; None if nothing is written.
        certified: What a run with ``--certification`` writes; it is verified at once.

    Raises:
        SystemExit: Always. If a file could not be written, or the package is refused, the status is
            3, or 1 for a violation.
    """
    problem = ""
    try:
        results = run()
    except IncompleteFilesError as error:
        results, problem = error.results, sentence_of(error)
    terminal.show(results, Console())
    status = results.verdict.exit_status
    if problem:
        click.echo(f"scaraspec: {visible(localized(problem))}", err=True)
        if status is not ExitStatus.NONCONFORMANT:
            status = ExitStatus.INCONCLUSIVE
    elif out:
        click.echo(f"{out}/report.html")
        if certified:
            status = _verify(certified.package, status)
    raise SystemExit(status)


def _verify(package: Path, status: ExitStatus) -> ExitStatus:
    """Verify the package of this run; return the exit status of the run."""
    click.echo(localized("verifying {package}", package=visible(f"{package}")))
    try:
        verification = verify_package(package)
    except PackageError as error:
        click.echo(f"scaraspec: {visible(f'{package}: {translated_error(error)}')}", err=True)
        return ExitStatus.INCONCLUSIVE if status is ExitStatus.CONFORMANT else status
    show(package, verification)
    if status is ExitStatus.CONFORMANT and verification.exit_status is not status:
        return ExitStatus.INCONCLUSIVE
    return status


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn errors that a user can cause into one sentence."""
    try:
        yield
    except (
        IcsError,
        LinkError,
        ReadingError,
        DriverError,
        ResultsError,
        RunFolderError,
        CertificationError,
    ) as error:
        raise Problem(sentence_of(error)) from None
    except HazardError as error:
        raise Problem(UserMessage("--allow: {error}", error=error)) from None
    except (
        CalibrationError,
        ControllerBusyError,
        PackageError,
        RecoveryError,
        StartError,
    ) as error:
        raise Problem(sentence_of(error), ExitStatus.INCONCLUSIVE) from None
    except JournalError as error:
        raise Problem(sentence_of(error)) from None
    except SuiteError as error:
        raise Problem(
            UserMessage("the suite is broken: {error}", error=error), ExitStatus.INCONCLUSIVE
        ) from None
    except OSError as error:
        raise unwritable(error) from None
