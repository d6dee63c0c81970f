"""`scaraspec verify`: verify the result package of a certification."""

from pathlib import Path

import click

from scaraspec.api.certificates import (
    PackageError,
    Verification,
    verify_package,
    write_certificate,
)
from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.sanitizing import visible_line
from scaraspec.translation import localized, translated_error
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec verify robot.scaraspec.zip --signer laboratory.pub"

_PATH = click.Path(path_type=Path)


@click.command(epilog=EXAMPLE)
@click.argument("package", metavar="PACKAGE", type=_PATH)
@click.option(
    "--signer",
    type=_PATH,
    metavar="KEY",
    help="Public key of the signer, or a file of allowed signers (ssh-keygen).",
)
@click.option(
    "--certificate",
    type=_PATH,
    metavar="FILE",
    help="Write the certificate of a verified package, or its test report, as HTML to print.",
)
def command(package: Path, *, signer: Path | None, certificate: Path | None) -> None:
    """Verify PACKAGE, the result package of a certification.

    Exit status 0 verified and conformant, 1 refused or nonconformant, 2 not a package, 3 it cannot
    be decided, for example because this version does not know the list of mandatory cases.
    """
    if certificate and certificate.exists():
        raise Problem(UserMessage("{file} exists: name another file", file=certificate))
    try:
        verification = verify_package(package, signer=signer)
    except PackageError as error:
        raise Problem(
            UserMessage("{package}: {error}", package=package, error=error), error.exit_status
        ) from None
    show(package, verification)
    if certificate:
        _write(certificate, verification)
    raise SystemExit(verification.exit_status)


def _write(path: Path, verification: Verification) -> None:
    try:
        write_certificate(verification, path)
    except PackageError as error:
        click.echo(visible_line(translated_error(error)))
    except OSError as error:
        raise Problem(
            UserMessage("{path} cannot be written: {reason}", path=path, reason=error.strerror),
            ExitStatus.INCONCLUSIVE,
        ) from None
    else:
        click.echo(visible_line(localized("{path}: written", path=path)))


def show(package: Path, verification: Verification) -> None:
    """Print one line for each check, its problems, and the conclusion."""
    for check in verification.checks:
        mark = _mark(check.status, genuine=verification.genuine)
        click.echo(
            visible_line(f"{localized(check.name):11} {mark}  {localized(check.note)}").rstrip()
        )
        for problem in check.problems:
            click.echo(visible_line(f"  {localized(problem)}"))
    click.echo(visible_line(localized(_conclusion(package, verification))))


def _mark(status: ExitStatus, *, genuine: bool) -> str:
    """Return the result of a check. In a genuine package only the conclusion can fail."""
    if status is ExitStatus.CONFORMANT:
        return localized("ok")
    if status is ExitStatus.INCONCLUSIVE:
        return localized("undecided")
    return localized("FAILED" if genuine else "REFUSED")


def _conclusion(package: Path, verification: Verification) -> str:
    results = verification.results
    if not verification.genuine or results is None:
        if verification.exit_status is ExitStatus.NONCONFORMANT:
            return UserMessage("{package}: refused", package=package)
        return UserMessage("{package}: it cannot be decided", package=package)
    return UserMessage(
        "{package}: verified, {signed}: {subject}: {label}",
        package=package,
        signed=verification.signed,
        subject=f"{results.subject.title} {results.subject.version}".rstrip(),
        label=results.label,
    )
