"""`scaraspec record`: the recording proxy between clients and controllers.

Arguments only: what is recorded is checked in `config`, who does it stands in `recording`.
"""

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import click
from rich.console import Console

from scaraspec.cli.help import GroupedCommand
from scaraspec.cli.problems import Problem, make_folder
from scaraspec.cli.stdio import insists
from scaraspec.cli.viewer import has_viewer, open_viewer
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import ending_signals
from scaraspec.transports.url import (
    Rfcomm,
    Serial,
    Tcp,
    UrlError,
    join_host_port,
    parse,
    split_host_port,
)
from scaraspec.user_message import UserMessage
from scaraspec_recorder.config import (
    DEFAULT_LISTEN,
    DEFAULT_OUT,
    MODES,
    Clock,
    ConfigError,
    RobotConfig,
    read_config,
    read_robot,
)
from scaraspec_recorder.monitoring.dashboard import Dashboard, Display, Lines
from scaraspec_recorder.monitoring.status import Status, Watch
from scaraspec_recorder.recording import Recording, record
from scaraspec_recorder.recordings.triggers import SIGNAL
from scaraspec_recorder.sinks.rerun.live import live_sink
from scaraspec_recorder.sinks.restarts import safe_name
from scaraspec_recorder.sinks.sinks import SinkFactory
from scaraspec_recorder.tap import relay
from scaraspec_recorder.tap.routes import Mode, Route, route
from scaraspec_recorder.tap.tcp import is_loopback

EXAMPLE = "Example: scaraspec record tcp://192.168.1.2 --listen 0.0.0.0:8877 --live"


_LISTEN: Final = DEFAULT_LISTEN[Mode.EXPLICIT]
_DRAIN_S: Final = 1800.0
"""After weeks the last file may take minutes to be drawn; a second Ctrl-C ends the waiting."""

_LINES_S: Final = 1.0
_DASHBOARD_S: Final = 0.5

_GROUPS: Final = {
    "The link": ("listen", "mode", "inject", "i_mean_it", "config"),
    "The files": ("out", "rotate", "keep", "min_free", "redact", "timestamps", "trigger"),
    "Watching": ("live", "metrics"),
}
_OF_ALL: Final = ("config", "live", "metrics")  # these say nothing of one robot


@click.command(cls=GroupedCommand, groups=_GROUPS, epilog=EXAMPLE)
@click.argument("url", required=False)
@click.option("--listen", metavar="HOST:PORT", help=f"Where clients connect [{_LISTEN}].")
@click.option(
    "--mode",
    type=click.Choice(list(MODES)),
    help="How they come there [port]; the others need the rules of docs/transparent-proxy.md.",
)
@click.option("--config", metavar="FILE", help="Several robots, from TOML; no URL then.")
@click.option("--out", metavar="DIR", help=f"Folder; nothing is overwritten [{DEFAULT_OUT}].")
@click.option(
    "--rotate",
    metavar="LIMITS",
    help="Next file after 1h, 512MB, 1h,512MB or connection; of several [1h].",
)
@click.option("--keep", metavar="LIMITS", help="Remove what is beyond 30d, 20GB or 30d,20GB.")
@click.option("--min-free", metavar="SIZE", help="Remove the oldest where less is free, as 2GB.")
@click.option("--redact", is_flag=True, help="Mask passwords in the raw bytes too.")
@click.option(
    "--timestamps",
    type=click.Choice([clock.value for clock in Clock]),
    help="Who says when bytes came in [user].",
)
@click.option(
    "--trigger",
    metavar="COND",
    multiple=True,
    help="Mark the moment in the recording's log at code:12, refusal, finding:4.15/3,"
    " finding:fail, silence:30s, late:500ms, malformed, disconnect or signal (SIGUSR1);"
    " repeatable.",
)
@click.option("--live", is_flag=True, help="Draw in a Rerun viewer; a slow one costs drawing only.")
@click.option("--metrics", metavar="HOST:PORT", help="For Prometheus, on this machine alone.")
@click.option("--inject", metavar="FILE", help="Disturb the link by this TOML file of faults.")
@click.option("--i-mean-it", is_flag=True, help="Inject even where other machines connect.")
def command(url: str | None, **options: Any) -> None:
    """Relay clients to the controller at URL and record what passes, until Ctrl-C.

    Forward first: the link never waits for the recording. Writes capture.mcap, or files named by
    time and robot where --rotate, --keep or --min-free ask for several, and .rrd files where the
    extra view is installed. Exit status 3 if anything was lost.
    """
    try:
        plans = [_plan(robot) for robot in _robots(url, options)]
        viewer = open_viewer() if options["live"] else None
        watches: list[Watch] = []
        with _metrics(options["metrics"], watches), contextlib.suppress(KeyboardInterrupt):
            asyncio.run(_record(plans, viewer, watches))
    except (ConfigError, UrlError) as error:
        raise Problem(str(error)) from None
    _tell([watch.look() for watch in watches])


@dataclass(frozen=True, slots=True)
class _Plan:
    """A robot, and its link.

    Attributes:
        robot: What is recorded of it.
        controller: Its link.
        listen: Where the tap listens.
        caller: The serial line that the client is on; None where clients connect.
    """

    robot: RobotConfig
    controller: Tcp | Serial | Rfcomm
    listen: tuple[str, int]
    caller: relay.End | None = None

    @property
    def way(self) -> Route:
        """Where clients are led."""
        if isinstance(self.controller, Tcp):
            return route(self.robot.mode, *self.controller)
        return relay.LineRoute(_line(self.controller))

    def sinks(self, viewer: str | None) -> tuple[SinkFactory, ...]:
        """What takes the recording."""
        needs_login = isinstance(self.controller, Tcp)  # L83
        session = {"controller": str(self.controller)}
        files = self.robot.sink(session, draw=has_viewer(), needs_login=needs_login)
        live = partial(live_sink, url=viewer, needs_login=needs_login) if viewer else None
        return (files, live) if live else (files,)

    @contextlib.asynccontextmanager
    async def calling(self, address: tuple[str, int]) -> AsyncIterator[str]:
        """Let the client in, and say where it comes in."""
        if not self.caller:
            yield join_host_port(*address)
            return
        async with relay.calling(self.caller, address):
            yield str(self.caller)


def _line(link: Serial | Rfcomm) -> relay.End:
    return relay.Serial(*link) if isinstance(link, Serial) else relay.Rfcomm(*link)


def _robots(url: str | None, options: dict[str, Any]) -> Sequence[RobotConfig]:
    """What is to be recorded: of the command line, or of a file."""
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
                    "{what} and --config do not go together: write it into the file", what=what
                )
            )
        return read_config(Path(options["config"]))
    if not url:
        raise Problem("no controller: name its URL, as tcp://192.168.1.2, or a file with --config")
    name = safe_name(str(parse(url)[0]))  # the host, the device or the address
    return (read_robot(name, {"url": url, **given}, "--"),)


def _plan(robot: RobotConfig) -> _Plan:
    controller, caller = parse(robot.url), None
    if "://" in robot.listen:
        client = parse(robot.listen)
        if isinstance(client, Tcp):
            raise Problem(
                UserMessage(
                    "{listen} is no place to listen: write {value}",
                    listen=robot.listen,
                    value=join_host_port(*client),
                )
            )
        caller, listen = _line(client), ("127.0.0.1", 0)
    else:
        listen = split_host_port(robot.listen, lowest_port=0)
    if robot.mode is not Mode.EXPLICIT and (caller or not isinstance(controller, Tcp)):
        raise Problem(
            UserMessage(
                "the mode {mode} leads TCP connections aside, and no serial lines", mode=robot.mode
            )
        )
    if robot.injection and not robot.i_mean_it and not is_loopback(listen[0]):
        risk = "other machines can connect to it: add --i-mean-it if they may be disturbed"
        raise Problem(
            UserMessage(
                "faults are injected at {listen}, and {risk}", listen=robot.listen, risk=risk
            )
        )
    return _Plan(robot, controller, listen, caller)


def _metrics(
    address: str | None, watches: Sequence[Watch]
) -> contextlib.AbstractContextManager[object]:
    """Offer metrics, if that is asked for."""
    if not address:
        return contextlib.nullcontext()
    try:
        from scaraspec_recorder.monitoring import metrics  # noqa: PLC0415 - an optional extra
    except ImportError as error:
        raise Problem(str(error)) from None

    @contextlib.contextmanager
    def offered() -> Any:
        try:
            host, port = split_host_port(address, lowest_port=0)
            with metrics.serve(host, port, lambda: [each.look() for each in watches]) as found:
                click.echo(f"metrics at http://{join_host_port(*found)}/metrics")
                yield
        except metrics.MetricsError as error:
            raise Problem(str(error)) from None

    return offered()


async def _record(plans: Sequence[_Plan], viewer: str | None, watches: list[Watch]) -> None:
    """Record until the first signal, and wait for what is left until another one insists."""
    stopped = asyncio.Event()
    loop, whole = asyncio.get_running_loop(), asyncio.current_task()
    assert whole

    def end(number: int) -> None:
        if stopped.is_set() and insists(number):
            whole.cancel()
        stopped.set()

    asked: list[Recording] = []
    with contextlib.suppress(NotImplementedError, AttributeError):  # not on every system
        for number in ending_signals():
            loop.add_signal_handler(number, end, number)
        loop.add_signal_handler(signal.SIGUSR1, _ask, asked)
    showing = loop.create_task(_show(watches, stopped))
    try:
        async with asyncio.TaskGroup() as group:
            for plan in plans:
                group.create_task(_record_one(plan, viewer, watches, asked, stopped))
    except* Problem as problems:
        raise problems.exceptions[0] from None
    except* asyncio.CancelledError:
        pass  # what is not finished is told
    finally:
        showing.cancel()
        await asyncio.gather(showing, return_exceptions=True)


def _ask(asked: Sequence[Recording]) -> None:
    """Ask each of these recordings for a mark."""
    if not asked:
        click.echo("SIGUSR1 does nothing: no recording is under way with --trigger signal")
    for recording in asked:
        try:
            recording.ask()
        except OSError as error:
            click.echo(f"SIGUSR1 does nothing: {error}")


async def _record_one(
    plan: _Plan,
    viewer: str | None,
    watches: list[Watch],
    asked: list[Recording],
    stopped: asyncio.Event,
) -> None:
    """Record one robot; `asked` takes the recording if a signal marks it."""
    robot = plan.robot
    make_folder(robot.out)
    try:
        async with (
            record(
                plan.way,
                plan.listen,
                robot.out,
                plan.sinks(viewer),
                injection=robot.injection,
                kernel_time=robot.timestamps is Clock.KERNEL,
            ) as recording,
            plan.calling(recording.address) as where,
        ):
            recording.drain_s = _DRAIN_S
            watches.append(Watch(robot.name, recording, robot.out))
            if SIGNAL in robot.triggers:
                asked.append(recording)
            click.echo(f"recording {where} to {robot.url} in {robot.out}; Ctrl-C ends it")
            await stopped.wait()
    except OSError as error:
        place = f"what comes to {robot.listen} into {robot.out}"
        reason = (error.strerror or f"{error}").partition(" (while")[0]  # what Python adds to it
        raise Problem(
            UserMessage("cannot record {place}: {reason}", place=place, reason=reason)
        ) from None


async def _show(watches: Sequence[Watch], stopped: asyncio.Event) -> None:
    """Show how the recordings are, until cancelled."""
    console = Console()
    display: Display = Dashboard(console) if console.is_terminal else Lines(click.echo)
    period_s = _DASHBOARD_S if console.is_terminal else _LINES_S
    with display:
        while True:
            statuses = [watch.look() for watch in watches]
            display.update(statuses, ending=stopped.is_set())
            await asyncio.sleep(period_s)


def _tell(statuses: Sequence[Status]) -> None:
    """Say what was recorded; anything lost is exit status 3."""
    lost = False
    for status in statuses:
        progress = status.progress
        if len(statuses) > 1:
            click.echo(f"{status.name}:")
        for way, count in (("client", progress.a2c), ("controller", progress.c2a)):
            click.echo(
                f"from the {way}: {count.received_bytes} bytes received and forwarded = "
                f"{count.recorded_bytes} recorded + {count.gap_bytes} in {count.gaps} gaps"
            )
        files = ", ".join(progress.files) or "none"
        if progress.earlier_files:
            files = f"{progress.earlier_files} others, {files}"
        click.echo(f"{progress.connections} connections; files: {files}")
        for problem in progress.problems:
            click.echo(f"scaraspec: {problem}", err=True)
        if not progress.finished:
            rest = "the next recorder into it writes the rest"
            click.echo(f"scaraspec: {status.out_dir} is not finished: {rest}", err=True)
        lost = lost or bool(progress.problems or status.gaps or not progress.finished)
    if lost:
        raise SystemExit(ExitStatus.INCONCLUSIVE)
