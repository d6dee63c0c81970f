"""`scaraspec record`: the recording proxy between clients and controllers.

This module handles arguments and output. `config` checks the configuration, `recording` records.
"""

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import click
from rich.console import Console

from scaraspec.api.recording import RecordingPlan, record
from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.problems import Problem
from scaraspec.cli.stdio import insists
from scaraspec.cli.viewer import open_viewer
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import kept_awake, on_ending_signals
from scaraspec.translation import localized
from scaraspec.transports.url import (
    Serial,
    UrlError,
    join_host_port,
    parse,
    split_host_port,
)
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec_recorder.config import (
    DEFAULT_LISTEN,
    DEFAULT_OUT,
    MODES,
    ConfigError,
    RobotConfig,
    TimestampSource,
    read_config,
    read_robot,
)
from scaraspec_recorder.monitoring.dashboard import Dashboard, Display, LineDisplay
from scaraspec_recorder.monitoring.health import health_problems
from scaraspec_recorder.monitoring.service_manager import ALIVE, READY, STOPPING, notify
from scaraspec_recorder.monitoring.status import Status, StatusReader
from scaraspec_recorder.recording import Recording
from scaraspec_recorder.recordings.triggers import SIGNAL
from scaraspec_recorder.sinks.file_names import safe_name
from scaraspec_recorder.spool.event_builder import ByteCounts
from scaraspec_recorder.tap.routes import Mode

EXAMPLE = "Example: scaraspec record tcp://192.168.1.2 --listen 0.0.0.0:8877 --live"


_LISTEN: Final = DEFAULT_LISTEN[Mode.EXPLICIT]
_DRAIN_S: Final = 1800.0
"""The last .rrd of a long recording may take minutes; a second Ctrl-C ends the wait."""

_LINES_S: Final = 1.0
_DASHBOARD_S: Final = 0.5

_GROUPS: Final = {
    "The link": ("listen", "mode", "inject", "i_mean_it", "config"),
    "The files": (
        "out",
        "rotate",
        "keep",
        "min_free",
        "archive",
        "archive_rate",
        "keep_until_archived",
        "file_mode",
        "durable",
        "no_rrd",
        "redact",
        "timestamps",
        "trigger",
        "on_trigger",
        "protect",
    ),
    "Watching": ("live", "metrics", "check"),
}
_OF_ALL: Final = ("config", "live", "metrics", "check")  # these do not belong to one robot


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.argument("url", required=False)
@click.option(
    "--listen",
    metavar="HOST:PORT",
    multiple=True,
    help=f"Where clients connect [{_LISTEN}]; repeatable.",
)
@click.option(
    "--mode",
    type=click.Choice(list(MODES)),
    help="How clients reach the recorder [port]; see docs/transparent-proxy.md.",
)
@click.option("--config", metavar="FILE", help="Record the robots of a TOML file.")
@click.option("--out", metavar="DIR", help=f"Folder; nothing is overwritten [{DEFAULT_OUT}].")
@click.option(
    "--rotate",
    metavar="LIMITS",
    help="New file after 1h, 512MB or connection.",
)
@click.option(
    "--keep",
    metavar="LIMITS",
    help="Remove files beyond 30d, 20GB or 30d,20GB.",
)
@click.option("--min-free", metavar="SIZE", help="Remove the oldest files if less is free: 2GB.")
@click.option("--archive", metavar="URL", help="Upload finished files to a folder or s3://….")
@click.option("--archive-rate", metavar="SIZE", help="Upload at most this in a second [10MB].")
@click.option(
    "--keep-until-archived", is_flag=True, help="Let --keep remove only files that are uploaded."
)
@click.option("--file-mode", metavar="MODE", help="Access rights of the files, as 640 [600].")
@click.option("--durable", is_flag=True, help="Lose 1 s at most if the power fails.")
@click.option("--no-rrd", is_flag=True, help="Write no .rrd files; they can be made later.")
@click.option("--redact", is_flag=True, help="Mask passwords in the raw bytes, too.")
@click.option(
    "--timestamps",
    type=click.Choice([clock.value for clock in TimestampSource]),
    help="Source of the time stamps [user].",
)
@click.option(
    "--trigger",
    metavar="COND",
    multiple=True,
    help="Mark the time at refusal, late:500ms or gap …, see docs/record.md; repeatable.",
)
@click.option("--on-trigger", metavar="CMD", help="Run a command, too; see docs/record.md.")
@click.option("--protect", metavar="TIME", help="Keep files within 5m of a mark.")
@click.option(
    "--live",
    is_flag=True,
    help="Show the traffic in a Rerun viewer.",
)
@click.option(
    "--metrics", metavar="HOST:PORT", help="Serve Prometheus metrics, on this machine only."
)
@click.option("--check", metavar="DIR", help="Only check the recorder that writes into a folder.")
@click.option("--inject", metavar="FILE", help="Inject the faults of a TOML file.")
@click.option("--i-mean-it", is_flag=True, help="Inject even if other machines can connect.")
def command(url: str | None, **options: Any) -> None:
    """Relay clients to the controller at URL and record the traffic, until Ctrl-C.

    The link never waits for the recording. The command writes capture.mcap; with --rotate, --keep,
    --min-free or --archive several files, named by time and robot, by default one an hour. With the
    extra view it also writes .rrd files. Exit status 3 if anything was lost or is not uploaded.
    """
    if options["check"]:
        if url or [key for key, value in options.items() if value] != ["check"]:
            raise Problem("--check cannot be combined with a URL or with other options")
        _check(Path(options["check"]))
        return
    try:
        robots = _robots(url, options)
        for robot in robots:
            RecordingPlan.of(robot)  # all errors before anything starts
        viewer = open_viewer() if options["live"] else None
        watches: list[StatusReader] = []
        lost = False
        with (
            kept_awake(),
            _metrics(options["metrics"], watches),
            contextlib.suppress(KeyboardInterrupt),
        ):
            asyncio.run(_record(robots, viewer, watches))
    except (ConfigError, UrlError) as error:
        raise Problem(sentence_of(error)) from None
    except MemoryError:
        click.echo(f"scaraspec: {localized('there is not enough memory')}", err=True)
        lost = True
    _print_summary([watch.read_status() for watch in watches], lost=lost)


def _check(out_dir: Path) -> None:
    """Print whether the recorder of a folder records.

    Raises:
        SystemExit: It does not (exit status 3).
    """
    problems = health_problems(out_dir)
    for problem in problems:
        click.echo(localized(problem))
    if problems:
        raise SystemExit(ExitStatus.INCONCLUSIVE)
    click.echo(localized("a recorder writes into {folder}", folder=out_dir))


def _robots(url: str | None, options: dict[str, Any]) -> Sequence[RobotConfig]:
    """Return the robots to record, from the command line or from a file."""
    given = {
        key.replace("_", "-"): list(value) if isinstance(value, tuple) else value
        for key, value in options.items()
        if value and key not in _OF_ALL
    }
    if options["config"]:
        if url or given:
            what = url or f"--{next(iter(given))}"
            raise Problem(
                UserMessage(
                    "{what} cannot be combined with --config: write it into the file", what=what
                )
            )
        return read_config(Path(options["config"]))
    if not url:
        raise Problem("no controller: name its URL, as tcp://192.168.1.2, or a file with --config")
    name = safe_name(str(parse(url)[0]))  # host, device or address
    return (read_robot(name, {"url": url, **given}, "--"),)


def _metrics(
    address: str | None, watches: Sequence[StatusReader]
) -> contextlib.AbstractContextManager[object]:
    """Serve metrics if an address is given."""
    if not address:
        return contextlib.nullcontext()
    try:
        from scaraspec_recorder.monitoring import metrics  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise Problem(sentence_of(error)) from None

    @contextlib.contextmanager
    def offered() -> Any:
        try:
            host, port = split_host_port(address, lowest_port=0)
            with metrics.serve(
                host, port, lambda: [each.read_status() for each in watches]
            ) as found:
                url = f"http://{join_host_port(*found)}/metrics"
                click.echo(localized("metrics at {url}", url=url))
                yield
        except metrics.MetricsError as error:
            raise Problem(sentence_of(error)) from None

    return offered()


async def _record(
    robots: Sequence[RobotConfig], viewer: str | None, watches: list[StatusReader]
) -> None:
    """Record until the first signal; then write the rest, until a second signal."""
    stopped = asyncio.Event()
    loop, whole = asyncio.get_running_loop(), asyncio.current_task()
    assert whole

    def end(number: int) -> None:
        if stopped.is_set() and insists(number):
            whole.cancel()
        stopped.set()
        notify(STOPPING)

    with_signal: list[Recording] = []
    on_ending_signals(loop, end)
    if sys.platform != "win32":
        loop.add_signal_handler(signal.SIGUSR1, _ask, with_signal)
    showing = loop.create_task(_show(watches, len(robots), stopped))
    try:
        async with asyncio.TaskGroup() as group:
            for robot in robots:
                group.create_task(_record_one(robot, viewer, watches, with_signal, stopped))
    except* Problem as problems:
        raise problems.exceptions[0] from None
    except* asyncio.CancelledError:
        pass  # unfinished recordings are reported
    except* MemoryError:
        raise MemoryError from None
    finally:
        showing.cancel()
        await asyncio.gather(showing, return_exceptions=True)


def _ask(with_signal: Sequence[Recording]) -> None:
    """Request a mark in each of these recordings."""
    if not with_signal:
        click.echo(localized("SIGUSR1 has no effect: no recording has --trigger signal"))
    for recording in with_signal:
        try:
            recording.request_mark()
        except OSError as error:
            click.echo(localized("SIGUSR1 has no effect: {error}", error=error))


async def _record_one(
    robot: RobotConfig,
    viewer: str | None,
    watches: list[StatusReader],
    with_signal: list[Recording],
    stopped: asyncio.Event,
) -> None:
    """Record one robot. Append the recording to `asked` if a signal marks it."""
    try:
        async with record(robot, viewer_url=viewer, drain_s=_DRAIN_S) as recording:
            watches.append(StatusReader(robot.name, recording, robot.out))
            if SIGNAL in robot.triggers:
                with_signal.append(recording)
            where = " and ".join(
                [text for text in robot.listen if "://" in text]
                or [join_host_port(*address) for address in recording.addresses]
            )
            text = "recording {where} to {url} in {out}; press Ctrl-C to stop"
            click.echo(localized(text, where=where, url=robot.url, out=robot.out))
            if missing := _missing(robot, recording):
                click.echo(localized(missing))
            await stopped.wait()
    except NotADirectoryError:
        raise Problem(
            UserMessage("{path} is not a folder: name another one with --out", path=robot.out)
        ) from None
    except OSError as error:
        place = f"{' and '.join(robot.listen)} to {robot.out}"
        reason = (error.strerror or sentence_of(error)).partition(" (while")[
            0
        ]  # Python adds the address
        raise Problem(
            UserMessage("cannot record {place}: {reason}", place=place, reason=reason)
        ) from None


def _missing(robot: RobotConfig, recording: Recording) -> str:
    """Return what must happen before clients can be recorded; empty if nothing must."""
    controller = parse(robot.url)
    if (
        isinstance(controller, Serial)
        and os.name == "posix"
        and not Path(controller.device).exists()
    ):
        return UserMessage(
            "waiting for {device}, which does not exist: it is opened when a client connects",
            device=controller.device,
        )
    if robot.mode is not Mode.EXPLICIT:
        return UserMessage(
            "waiting for clients that firewall rules redirect to port {port}: the rules are in "
            "docs/transparent-proxy.md",
            port=recording.address[1],
        )
    return ""


async def _show(watches: Sequence[StatusReader], recordings: int, stopped: asyncio.Event) -> None:
    """Show the status of the recordings until cancelled, and report it to a service manager."""
    ready = False
    console = Console()
    display: Display = Dashboard(console) if console.is_terminal else LineDisplay(click.echo)
    period_s = _DASHBOARD_S if console.is_terminal else _LINES_S
    with display:
        while True:
            with contextlib.suppress(OSError, MemoryError):  # too many open files at the moment
                statuses = [watch.read_status() for watch in watches]
                display.update(statuses, ending=stopped.is_set())
            notify(ALIVE)
            if not ready and len(watches) == recordings:
                ready = True
                notify(READY)
            await asyncio.sleep(period_s)


def _print_summary(statuses: Sequence[Status], *, lost: bool) -> None:
    """Print what was recorded.

    Args:
        statuses: The final status of each recording.
        lost: Whether something was lost that no status shows.

    Raises:
        SystemExit: Something was lost (exit status 3).
    """
    for status in statuses:
        progress = status.progress
        if len(statuses) > 1:
            click.echo(f"{status.name}:")
        for way, count in (
            (localized("from the client"), progress.a2c),
            (localized("from the controller"), progress.c2a),
        ):
            for line in _counts(count):
                click.echo(f"{way}: {line}")
        files = ", ".join(progress.files) or localized("no files")
        if progress.earlier_files:
            count_text = localized("{count} others", count=progress.earlier_files)
            files = f"{count_text}, {files}"
        text = "{connections} connections; files: {files}"
        click.echo(localized(text, connections=progress.connections, files=files))
        for problem in progress.problems:
            click.echo(f"scaraspec: {localized(problem)}", err=True)
        if not progress.finished:
            text = localized(
                "{folder} is incomplete: start the recorder again with this folder to write the "
                "rest",
                folder=status.out_dir,
            )
            click.echo(f"scaraspec: {text}", err=True)
        waiting = _print_uploads(status)
        lost = lost or bool(progress.problems or status.gaps or not progress.finished or waiting)
    if lost:
        raise SystemExit(ExitStatus.INCONCLUSIVE)


def _counts(count: ByteCounts) -> Iterator[str]:
    """Yield what became of the bytes of one direction."""
    template = (
        "at least {received} bytes received and forwarded = {recorded} recorded + {missing} in "
        "{gaps} gaps"
        if count.unknown_gaps
        else "{received} bytes received and forwarded = {recorded} recorded + {missing} in {gaps} "
        "gaps"
    )
    text = localized(
        template,
        received=count.received_bytes,
        recorded=count.recorded_bytes,
        missing=count.gap_bytes,
        gaps=count.gaps,
    )
    if count.spooled_bytes:
        text += localized(" + {count} not written yet", count=count.spooled_bytes)
    yield text
    for reason, dropped_bytes in count.unforwarded_bytes.items():
        yield localized(
            "{count} bytes received and not forwarded: {reason}",
            count=dropped_bytes,
            reason=localized(reason),
        )


def _print_uploads(status: Status) -> int:
    """Print what was uploaded. Return the number of finished files that were not."""
    if not (uploads := status.uploads):
        return 0
    click.echo(localized("files in {url}: {count}", url=uploads.url, count=uploads.archived))
    if uploads.waiting:
        why = f": {uploads.failure}" if uploads.failure else ""
        text = localized(
            "{files} not archived{why}; start the recorder again with this folder to archive the "
            "rest",
            files=uploads.waiting_text,
            why=why,
        )
        click.echo(f"scaraspec: {text}", err=True)
    return uploads.waiting
