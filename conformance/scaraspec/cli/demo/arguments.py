"""`scaraspec demo`: record and judge a session of a client and the virtual controller."""

import asyncio
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

import click
from rich.console import Console

from scaraspec.api.viewer import has_viewer
from scaraspec.cli.demo import session
from scaraspec.cli.problems import Problem, make_folder
from scaraspec.cli.viewer import NO_VIEWER, open_viewer
from scaraspec.client import Client, ClientError
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import join_command
from scaraspec.report import terminal
from scaraspec.translation import localized
from scaraspec.transports.url import join_host_port, split_host_port
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.tap.routes import Upstream

EXAMPLE: Final = "Example: scaraspec demo --out demo"

_FILES: Final = ("capture.mcap", "capture.rrd", "results.json", "report.html", session.PROGRAM)
_READY_S: Final = 30.0
_POLL_S: Final = 0.05


@click.command(epilog=EXAMPLE)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("scaraspec-demo"),
    show_default=True,
    help="Folder for the four files.",
)
@click.option("--live", is_flag=True, help="Show the session in the Rerun viewer.")
def command(out: Path, *, live: bool) -> None:
    """Record and judge a complete session of a client and the virtual controller.

    Through the recording proxy the client logs in, changes settings, uploads a program, runs it,
    stops a second run, resets, moves and downloads. The demo takes about ten seconds and writes
    capture.mcap, capture.rrd, results.json and report.html.
    """
    from scaraspec.api.auditing import audit  # noqa: PLC0415 - --help does not need the judge
    from scaraspec.report import html  # noqa: PLC0415 - for the same reason

    make_folder(out)
    if there := [name for name in _FILES if (out / name).exists()]:
        raise Problem(
            UserMessage(
                "{out} contains {there} of an earlier run: name another folder with --out",
                out=out,
                there=there[0],
            )
        )
    viewer = open_viewer() if live else None
    try:
        asyncio.run(_play(out, viewer))
        results, notes = audit(out / "capture.mcap")
        results.write(out / "results.json")
        html.write(results, out / "report.html")
    except (ClientError, CaptureError, ValueError) as error:
        raise Problem(
            UserMessage("the demo failed: {error}", error=error), ExitStatus.INCONCLUSIVE
        ) from None
    except OSError as error:
        raise Problem(
            UserMessage("the demo failed: {error}", error=error), ExitStatus.INCONCLUSIVE
        ) from None
    for note in notes:
        click.echo(note, err=True)
    terminal.show(results, Console())
    _next_steps(out)
    raise SystemExit(results.verdict.exit_status)


async def _play(out: Path, viewer: str | None) -> None:
    """Start controller and proxy, run the client in a thread, and stop everything."""
    from scaraspec_recorder.recording import record  # noqa: PLC0415 - --help needs no recorder
    from scaraspec_recorder.recordings.capture import capture_sink  # noqa: PLC0415 - no files
    from scaraspec_recorder.sinks.rerun.live import live_sink  # noqa: PLC0415 - no viewer

    sinks = (
        partial(capture_sink, draw=has_viewer()),
        *((partial(live_sink, url=viewer),) if viewer else ()),
    )
    async with (
        _controller() as (host, port),
        record(Upstream(host, port), [("127.0.0.1", 0)], out, sinks) as recording,
    ):
        url = f"tcp://{join_host_port(*recording.address)}"
        text = "client → recording proxy {url} → virtual controller {controller}"
        click.echo(localized(text, url=url, controller=f"tcp://{host}:{port}"))
        await asyncio.to_thread(_work, url, out)
    if not recording.progress.finished or recording.progress.problems:
        problems = "; ".join(recording.progress.problems) or "the recording was not written in time"
        raise Problem(
            UserMessage("the recording is incomplete: {problems}", problems=problems),
            ExitStatus.INCONCLUSIVE,
        )


def _work(url: str, out: Path) -> None:
    now = datetime.now(UTC).replace(tzinfo=None)
    with Client(url, password="password") as robot:  # noqa: S106 - the virtual controller's own
        session.run(robot, out, now, lambda step: click.echo(f"  {localized(step)}"))


@asynccontextmanager
async def _controller() -> AsyncIterator[tuple[str, int]]:
    """Run the virtual controller in a process; yield its address."""
    with tempfile.TemporaryDirectory() as folder:
        ready = Path(folder) / "ready"
        arguments = ("controller", "--listen", "127.0.0.1:0", "--ready-file", str(ready))
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "scaraspec", *arguments), stdout=subprocess.DEVNULL
        )
        try:
            async with asyncio.timeout(_READY_S):
                while not ready.exists():
                    if process.returncode is not None:
                        raise Problem(
                            "the virtual controller did not start", ExitStatus.INCONCLUSIVE
                        )
                    await asyncio.sleep(_POLL_S)
            yield split_host_port(ready.read_text().strip())
        finally:
            if process.returncode is None:
                process.terminate()
            await process.wait()


def _next_steps(out: Path) -> None:
    """Print what can be done with the files."""
    recorded = join_command([str(out / "capture.mcap")])
    click.echo(localized("\n{path}  the report; open it in a browser", path=out / "report.html"))
    if (out / "capture.rrd").exists():
        text = "scaraspec view {path}  shows the session in the viewer"
        click.echo(localized(text, path=recorded))
    else:
        click.echo(localized("capture.rrd was not written: {why}", why=localized(NO_VIEWER)))
    click.echo(localized("scaraspec audit {path}  judges the recording again", path=recorded))
