"""`scaraspec recover`: repair recordings whose recorder was killed."""

import errno
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scaraspec.api.viewer import has_viewer
from scaraspec.cli.problems import Problem
from scaraspec.cli.viewer import NO_VIEWER
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.translation import localized, translated_error
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError

if TYPE_CHECKING:
    from scaraspec_recorder.recordings.repair import RepairReport

EXAMPLE = "Example: scaraspec recover captures/*.mcap"


@click.command(epilog=EXAMPLE)
@click.argument(
    "files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
def command(files: tuple[Path, ...]) -> None:
    """Repair recordings (.mcap) in place, and write missing or incomplete .rrd files.

    Prints for each FILE what was kept and what was lost. If more than the end of FILE was damaged,
    the damaged file is kept as FILE.damaged. An intact file is not changed. Exit status 0 if all
    files were intact, 3 if anything was lost. An incomplete .rrd file whose .mcap file was removed
    can be named too.
    """
    from scaraspec_recorder.recordings.recovery import (  # noqa: PLC0415 - slow to import
        lacks_recording,
        locked_folder,
    )
    from scaraspec_recorder.recordings.repair import repair  # noqa: PLC0415 - slow to import

    whole = True
    for file in files:
        if not file.is_file():
            raise Problem(
                UserMessage("{file} is not a file: name the .mcap files to repair", file=file)
            )
        try:
            with locked_folder(file.resolve().parent) as unwritten_bytes:
                if lacks_recording(file):
                    whole = _repair_rrd(file) and whole
                    continue
                report = repair(file)
                _print_summary(report)
                whole = whole and not (report.repaired or unwritten_bytes)
                if unwritten_bytes:
                    text = localized(
                        "a killed recorder left up to {count} bytes unwritten: scaraspec record "
                        "--out {folder} writes them",
                        count=unwritten_bytes,
                        folder=file.parent,
                    )
                    click.echo(f"  {text}")
                _draw(report)
        except CaptureError as error:
            whole = False
            click.echo(f"scaraspec: {translated_error(error)}", err=True)
        except OSError as error:
            advice = "; free some disk space" if error.errno == errno.ENOSPC else ""
            why = UserMessage("{value}{advice}", value=error.strerror or error, advice=advice)
            raise Problem(
                UserMessage(
                    "{file} cannot be repaired and was not changed: {why}", file=file, why=why
                )
            ) from None
    if not whole:
        raise SystemExit(ExitStatus.INCONCLUSIVE)


def _print_summary(report: "RepairReport") -> None:
    template = "repaired, {count} events" if report.repaired else "whole, {count} events"
    text = localized(template, count=report.events)
    if report.last_ns:
        last = f"{datetime.fromtimestamp(report.last_ns / 1e9, UTC):%F %T.%f} UTC"
        text += localized(", the last of {time}", time=last)
    click.echo(f"{report.path}: {text}")
    for note in report.notes:
        click.echo(f"  {localized(note)}")
    if report.original:
        text = localized("the damaged file is kept as {file}", file=report.original)
        click.echo(f"  {text}")


def _repair_rrd(file: Path) -> bool:
    """Repair an .rrd file without its .mcap file. Return whether it was complete.

    Raises:
        CaptureError: It cannot be repaired.
        OSError: It cannot be read.
    """
    from scaraspec_recorder.recordings.recovery import repair_rrd  # noqa: PLC0415 - slow to import

    if not has_viewer():
        raise Problem(NO_VIEWER)
    repaired = repair_rrd(file)
    text = localized("repaired, what followed its last part is lost" if repaired else "whole")
    click.echo(f"{file}: {text}")
    return not repaired


def _draw(report: "RepairReport") -> None:
    """Write the .rrd again if it or the recording was incomplete."""
    from scaraspec_recorder.recordings.recovery import (  # noqa: PLC0415 - slow to import
        has_complete_rrd,
        rebuild_rrd,
    )

    drawn = report.path.with_suffix(".rrd")
    if has_complete_rrd(drawn) and not report.repaired:
        return
    if not has_viewer():
        text = localized("{file} was not written: {why}", file=drawn, why=localized(NO_VIEWER))
        click.echo(f"  {text}")
        return
    try:
        text = localized("{file} written again", file=rebuild_rrd(report.path))
        click.echo(f"  {text}")
    except OSError as error:  # the recording itself is repaired
        why = error.strerror or error
        text = localized("{file} was not written: {why}", file=drawn, why=why)
        click.echo(f"  {text}")
