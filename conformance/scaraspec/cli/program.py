"""`scaraspec program`: list, check and convert user program files (clause 6)."""

from pathlib import Path

import click

from scaraspec.cli.problems import Problem
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.protocol.program_files import (
    LAYOUTS,
    MAX_FILE_BYTES,
    LintFinding,
    PointMeaning,
    Program,
    ProgramError,
    Severity,
    build,
    detect,
    lint,
    listing_lines,
    parse,
)
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec program check pick-and-place.rob"

_FILE = click.Path(path_type=Path)


def _read(file: Path) -> bytes:
    try:
        with file.open("rb") as stream:
            return stream.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise Problem(
            UserMessage("{file} cannot be read: {strerror}", file=file, strerror=error.strerror)
        ) from None


def _parse(file: Path) -> tuple[bytes, Program]:
    data = _read(file)
    try:
        return data, parse(data)
    except ProgramError as error:
        raise Problem(
            UserMessage("{file} is not a user program: {error}", file=file, error=error),
            ExitStatus.NONCONFORMANT,
        ) from None


def _finding(finding: LintFinding) -> UserMessage:
    """Return severity, code, requirement, position and message of a finding."""
    places = (
        ("node {number}", finding.node),
        ("variable {number}", finding.variable),
        ("byte {number}", finding.offset_bytes),
    )
    known = [UserMessage(text, number=number) for text, number in places if number is not None]
    heading = UserMessage(
        "{severity} {code}", severity=UserMessage(finding.severity.value), code=finding.code
    )
    if finding.requirements:
        first = finding.requirements[0]
        heading = UserMessage("{heading} ({requirement})", heading=heading, requirement=first)
    if not known:
        return UserMessage("{heading} {message}", heading=heading, message=finding.message)
    return UserMessage(
        "{heading} {place}: {message}",
        heading=heading,
        place=UserMessage.listed(known),
        message=finding.message,
    )


@click.group(epilog=EXAMPLE)
def command() -> None:
    """List, check or convert user program files."""


@command.command(epilog="Example: scaraspec program show pick-and-place.rob")
@click.argument("file", type=_FILE)
@click.option(
    "--points",
    type=click.Choice([m.value for m in PointMeaning]),
    default=PointMeaning.JOINTS.value,
    show_default=True,
    help="Meaning of the four numbers of a coordinate node (reading point_meaning).",
)
def show(file: Path, points: str) -> None:
    """Print a listing of FILE."""
    _, program = _parse(file)
    for line in listing_lines(program, PointMeaning(points)):
        click.echo(localized(line))


@command.command(epilog="Example: scaraspec program check pick-and-place.rob")
@click.argument("file", type=_FILE)
def check(file: Path) -> None:
    """Check FILE against all rules of clause 6. Exit status 1 if a rule is violated."""
    data = _read(file)
    findings = lint(data)
    for finding in findings:
        click.echo(localized("{file}: {finding}", file=file, finding=_finding(finding)))
    layouts = detect(data)
    if layouts:
        click.echo(localized("{file}: layout {layout}", file=file, layout=layouts[0].name))
    if any(finding.severity is Severity.ERROR for finding in findings):
        raise SystemExit(ExitStatus.NONCONFORMANT)


@command.command(epilog="Example: scaraspec program convert old.rob new.rob --layout packed")
@click.argument("file", type=_FILE)
@click.argument("target", type=_FILE)
@click.option(
    "--layout",
    type=click.Choice(list(LAYOUTS)),
    required=True,
    metavar="LAYOUT",
    help="ilp32, packed, pack2, lp64, outer-packed, packed-long8 or pack2-long8, optionally "
    "followed by -header13, -header14 or -header16, and by -big.",
)
def convert(file: Path, target: Path, layout: str) -> None:
    """Convert FILE to TARGET, in another layout or byte order."""
    _, program = _parse(file)
    try:
        with target.open("xb") as stream:
            stream.write(build(program, LAYOUTS[layout]))
    except FileExistsError:
        raise Problem(
            UserMessage("{target} exists; name a file that does not", target=target)
        ) from None
    except ProgramError as error:
        target.unlink()
        raise Problem(
            UserMessage(
                "{file} does not fit the layout {layout}: {error}",
                file=file,
                layout=layout,
                error=error,
            )
        ) from None
    except OSError as error:
        raise Problem(
            UserMessage(
                "{target} cannot be written: {strerror}", target=target, strerror=error.strerror
            )
        ) from None
