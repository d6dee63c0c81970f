"""`scaraspec view`: open a capture in the Rerun viewer."""

import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
from typing import Final

import click

from scaraspec import api
from scaraspec.api.viewer import has_viewer
from scaraspec.cli.options import Instant, capture_port
from scaraspec.cli.problems import Problem, unreadable
from scaraspec.cli.viewer import NO_VIEWER
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.model import Results, ResultsError
from scaraspec.report.root_causes import summary
from scaraspec.report.sanitizing import visible
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError

EXAMPLE = "Example: scaraspec view captures/capture.mcap"

_RRD_MAGIC: Final = b"RRF2"
_NS: Final = 1_000_000_000
_OPENING_S: Final = 60.0
_AGAIN_S: Final = 0.2


@click.command(epilog=EXAMPLE)
@click.argument("file", type=click.Path(path_type=Path))
@capture_port
@click.option(
    "--at",
    "at_ns",
    type=Instant(),
    help="Move the cursor to this time: 2026-11-21T08:15:30.5 (UTC) or Unix seconds.",
)
@click.option(
    "--finding",
    type=click.IntRange(min=1),
    help="Move the cursor to this finding: its place in the list that audit prints.",
)
def command(file: Path, port: int | None, at_ns: int | None, finding: int | None) -> None:
    """Open FILE in the Rerun viewer: a recording (.mcap, .rrd), or a pcap or pcapng.

    A missing .rrd is written first: for an intact recording beside it, for other captures into a
    temporary file. With results.json beside the capture of a certification, a lane shows the case
    that runs. FILE is never changed. A recording in progress is shown as far as it has been
    written. The command ends when the viewer is closed. Exit status 3 if FILE is incomplete.
    """
    if not has_viewer():
        raise Problem(NO_VIEWER)
    with tempfile.TemporaryDirectory(prefix="scaraspec-") as scratch:
        try:
            if finding is not None:
                at_ns = _moment(file, port, finding)
            drawn, whole = _drawn(file, port, Path(scratch) / f"{file.stem}.rrd")
        except CaptureError as error:
            raise unreadable(error) from None
        except OSError as error:
            raise Problem(
                UserMessage(
                    "{file} cannot be shown: {value}", file=file, value=error.strerror or error
                )
            ) from None
        _show(drawn, at_ns)
    if not whole:
        raise SystemExit(ExitStatus.INCONCLUSIVE)


def _moment(file: Path, port: int | None, number: int) -> int:
    """Return the time of a finding of an audit."""
    lines = summary(api.audit(file, port=port)[0])
    moment = lines[number - 1].case.moment if number <= len(lines) else None
    if moment is None:
        raise Problem(
            UserMessage(
                "{file} has no finding {number} with a time: see scaraspec audit",
                file=file,
                number=number,
            )
        )
    return moment.time_ns


def _drawn(file: Path, port: int | None, scratch: Path) -> tuple[Path, bool]:
    """Return the .rrd of a capture, written to `scratch` if necessary, and whether it is whole."""
    from scaraspec_recorder.recordings.capture import write_rrd  # noqa: PLC0415 - slow to import
    from scaraspec_recorder.recordings.recovery import (  # noqa: PLC0415 - slow to import
        has_complete_rrd,
        locked_folder,
        rebuild_rrd,
    )
    from scaraspec_recorder.recordings.repair import inspect  # noqa: PLC0415 - slow to import
    from scaraspec_recorder.sources.capture import (  # noqa: PLC0415 - slow to import
        McapCapture,
        open_capture,
    )

    with suppress(OSError), file.open("rb") as opened:
        if opened.read(len(_RRD_MAGIC)) == _RRD_MAGIC:
            return file, True
    capture, cases = open_capture(file, port=port), [*_cases(file)]
    if isinstance(capture, McapCapture) and not cases:
        try:
            with locked_folder(file.resolve().parent):
                drawn, summary = file.with_suffix(".rrd"), inspect(file)
                if summary.whole:
                    return (drawn if has_complete_rrd(drawn) else rebuild_rrd(file)), True
        except OSError as error:
            why = error.strerror or error
            click.echo(localized("{file} is drawn elsewhere: {why}", file=file, why=why), err=True)
    write_rrd(capture, scratch, needs_login=capture.needs_login, cases=cases)
    for note in capture.summary.notes:
        click.echo(visible(f"{file}: {localized(note)}"), err=True)
    return scratch, capture.summary.complete


def _cases(file: Path) -> Iterator[tuple[int, str]]:
    """Yield when each case began, with its id, and when it ended, if a certification made FILE."""
    try:
        results = Results.read(file.with_name("results.json"))
    except ResultsError:
        return
    if results.subject.file != file.name:
        return
    cases = sorted((case for case in results.cases if case.begin_ns), key=attrgetter("begin_ns"))
    following_ns = (*(case.begin_ns for case in cases[1:]), math.inf)
    for case, next_ns in zip(cases, following_ns, strict=False):
        yield case.begin_ns, case.id
        end_ns = case.begin_ns + round(case.duration_s * _NS)
        if end_ns < next_ns:
            yield end_ns, ""


def _show(drawn: Path, at_ns: int | None) -> None:
    """Open the viewer, move to a time if one is given, and wait until the viewer is closed."""
    click.echo(localized("{file} is open in the viewer; close the viewer to end", file=drawn))
    port = _free_port()
    arguments = ("--bind", "127.0.0.1", "--port", f"{port}", str(drawn))
    viewer = subprocess.Popen(  # noqa: S603 - our own interpreter and arguments
        [sys.executable, "-P", "-m", "rerun", *arguments],  # not a rerun.py in the current folder
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        if at_ns is not None:
            _seek(viewer, f"rerun+http://127.0.0.1:{port}/proxy", at_ns)
        if viewer.wait():
            raise Problem(
                "the Rerun viewer did not start: is there a screen?", ExitStatus.INCONCLUSIVE
            )
    except KeyboardInterrupt:
        if sys.platform != "win32":  # there, Ctrl-C ends the viewer, too
            os.killpg(viewer.pid, signal.SIGTERM)  # the started process starts the viewer
        viewer.wait()


def _free_port() -> int:
    """Return a free port, so that no other viewer is used."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _seek(viewer: subprocess.Popen[bytes], url: str, at_ns: int) -> None:
    """Move the cursor of the viewer once it has loaded the recording."""
    import numpy as np  # noqa: PLC0415 - part of the same extra as the viewer
    from rerun.experimental import ViewerClient  # noqa: PLC0415 - it needs the viewer

    deadline_s = time.monotonic() + _OPENING_S
    while viewer.poll() is None and time.monotonic() < deadline_s:
        with suppress(Exception):  # the bindings raise any error of gRPC
            client = ViewerClient.connect(url)
            if client.get_state().recordings:
                moment = np.datetime64(at_ns, "ns")
                client.set_time("time", timestamp=moment, play_state="paused")
                return
        time.sleep(_AGAIN_S)
    if not viewer.poll():  # otherwise it did not start
        click.echo(localized("the viewer cannot be reached: move to the time by hand"), err=True)
