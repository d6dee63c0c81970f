"""`scaraspec view`: a capture in the Rerun viewer."""

import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

import click

from scaraspec.cli.options import capture_port
from scaraspec.cli.problems import Problem
from scaraspec.cli.viewer import NO_VIEWER, has_viewer
from scaraspec.judgement.verdicts import ExitStatus
from scaraspec_recorder.capture import draw_capture
from scaraspec_recorder.leftovers import hold, is_drawn, redraw
from scaraspec_recorder.problems import CaptureError
from scaraspec_recorder.recover import recover
from scaraspec_recorder.source import McapCapture, open_capture

EXAMPLE = "Example: scaraspec view captures/capture.mcap"

_RRD_MAGIC: Final = b"RRF2"


@click.command(epilog=EXAMPLE)
@click.argument("file", type=click.Path(path_type=Path))
@capture_port
def command(file: Path, port: int | None) -> None:
    """Open FILE in the Rerun viewer: a recording (.mcap, .rrd), or a pcap or pcapng.

    What is not drawn yet is drawn first: a recording into the .rrd file beside it, all else for
    this once. A recording whose recorder was killed is repaired before, one that is being made is
    shown as far as it has come. Ends when the viewer is closed.
    """
    if not has_viewer():
        raise Problem(NO_VIEWER)
    with tempfile.TemporaryDirectory(prefix="scaraspec-") as scratch:
        try:
            drawn = _drawn(file, port, Path(scratch) / f"{file.stem}.rrd")
        except CaptureError as error:
            raise Problem(f"{error}") from None
        except OSError as error:
            raise Problem(f"{file} cannot be drawn: {error.strerror or error}") from None
        _show(drawn)


def _drawn(file: Path, port: int | None, scratch: Path) -> Path:
    """Return a drawing of a capture, made in `scratch` where there is no better place."""
    with suppress(OSError), file.open("rb") as opened:
        if opened.read(len(_RRD_MAGIC)) == _RRD_MAGIC:
            return file
    capture = open_capture(file, port=port)
    if isinstance(capture, McapCapture):
        try:
            with hold(file.resolve().parent):
                report = recover(file)
                for note in report.notes:
                    click.echo(f"{file}: {note}", err=True)
                drawn = file.with_suffix(".rrd")
                whole = is_drawn(drawn) and not report.repaired
                return drawn if whole else redraw(file)
        except OSError as error:
            click.echo(f"{file} is shown as it is: {error.strerror or error}", err=True)
    draw_capture(capture, scratch)
    for note in capture.summary.notes:
        click.echo(f"{file}: {note}", err=True)
    return scratch


def _show(drawn: Path) -> None:
    """Open the viewer, and wait until it is closed."""
    click.echo(f"{drawn} in the viewer; close it to end")
    arguments = ("--new", "--bind", "127.0.0.1", str(drawn))
    with suppress(KeyboardInterrupt):
        done = subprocess.run(  # noqa: S603 - our own interpreter and arguments
            [sys.executable, "-m", "rerun", *arguments], stderr=subprocess.DEVNULL, check=False
        )
        if done.returncode:
            raise Problem(
                "the Rerun viewer does not open: is there a screen?", ExitStatus.INCONCLUSIVE
            )
