"""`scaraspec exchanges`: the dialogue in a capture as text, JSON, CSV or Parquet."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import click
from rich.cells import cell_len, set_cell_size
from rich.console import Console
from rich.table import Table

from scaraspec.cli.options import capture_port, selection_options
from scaraspec.cli.problems import Problem, unreadable, unwritable
from scaraspec.cli.progress_bar import shown_share
from scaraspec.judge.verdicts import ExitStatus, Finding, Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.formatting import duration
from scaraspec.report.model import CommandSeen, Timing
from scaraspec.report.sanitizing import visible_line
from scaraspec.report.session import SessionStats
from scaraspec.report.terminal import comparison
from scaraspec.tables.files import json_line, table_folders, utc_text
from scaraspec.tables.rows import SIDES, RowBuilder
from scaraspec.tables.schema import TABLES, FrameRow, Row
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, TrafficEvent
from scaraspec.traffic.selection import Selection, place_of
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks import text as event_text

if TYPE_CHECKING:
    from scaraspec.api.captures import Capture, Step

EXAMPLE = "Example: scaraspec exchanges capture.mcap --command run_program,get_status"

_PATH = click.Path(path_type=Path)
_POLL_S: Final = 0.25
_STEPS_PER_UPDATE: Final = 1000
_SHOWN: Final = (Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE)


@click.command(epilog=EXAMPLE)
@click.argument("file", type=_PATH)
@capture_port
@selection_options
@click.option("--no-queries", is_flag=True, help="Without answered queries and file chunks.")
@click.option("--frames", is_flag=True, help="Frames, too.")
@click.option("--follow", is_flag=True, help="Continue until a recording in progress is closed.")
@click.option("--latency", is_flag=True, help="Only the reply times of each command.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object for each row.")
@click.option("--csv", "csv_dir", type=_PATH, metavar="DIR", help="Write the tables as CSV.")
@click.option(
    "--parquet", "parquet_dir", type=_PATH, metavar="DIR", help="Write the tables as Parquet."
)
def command(  # noqa: PLR0913 - one for each option
    file: Path,
    port: int | None,
    *,
    commands: frozenset[str],
    connection: str | None,
    since: int | None,
    until: int | None,
    no_queries: bool,
    frames: bool,
    follow: bool,
    latency: bool,
    as_json: bool,
    csv_dir: Path | None,
    parquet_dir: Path | None,
) -> None:
    """Show the dialogue in FILE: an MCAP recording, or a pcap or pcapng.

    Each line has the time (UTC), the connection, who sent the request, the command with its
    arguments, the first reply, the final result, and how long it took. Findings follow the line
    that they are about. Exit status 3 if FILE is incomplete or bytes were not captured, 4 if it has
    no traffic of this protocol.
    """
    from scaraspec.api.captures import open_capture  # noqa: PLC0415 - --help needs no readers

    selection = Selection(since, until, connection or "", commands)
    folders = [(d, suffix) for d, suffix in ((csv_dir, "csv"), (parquet_dir, "parquet")) if d]
    names = [name for name in TABLES if frames or name != "frames"]
    text = None if folders or as_json or latency else _Text(frames=frames)
    hidden = bool(text or as_json)

    def selected(step: "Step") -> bool:
        return selection.includes(step.event) and not (no_queries and _is_routine(step))

    with _user_errors():
        capture = open_capture(file, port=port, wait=_wait if follow else None)
        rows = _Rows(f"{file}", frames=frames)
        takers = (rows.take, text.show) if text else (rows.take,)
        if as_json:
            rows.outputs.append(lambda row: click.echo(json_line(row)))
        with (
            table_folders(folders, names) as tables,
            shown_share(localized("reading the file"), hidden=hidden) as progress,
        ):
            rows.outputs += [each.add for each in tables]
            reading = _read(capture, selected, takers, progress)
            rows.finish(capture, interrupted=reading.interrupted)
    if reading.interrupted:
        raise KeyboardInterrupt
    if latency:
        _print_latencies(rows.stats)
    for note in capture.notes:
        click.echo(visible_line(f"{file}: {localized(note)}"), err=True)
    if not capture.complete:
        raise SystemExit(ExitStatus.INCONCLUSIVE)
    if not reading.steps:
        raise SystemExit(ExitStatus.NOTHING_TESTED)


def _wait() -> bool:
    time.sleep(_POLL_S)
    return True


@contextmanager
def _user_errors() -> Iterator[None]:
    """Report errors that the user can cause.

    Raises:
        Problem: Instead of these errors.
    """
    try:
        yield
    except (CaptureError, ImportError) as error:
        raise unreadable(error) from None
    except FileExistsError as error:
        raise Problem(
            UserMessage("{path} exists: name another folder", path=error.filename)
        ) from None
    except OSError as error:
        raise unwritable(error) from None


class _Rows:
    """Makes rows of steps, and passes them to the outputs.

    Args:
        file: The name of the capture.
        frames: Whether frames have rows.

    Attributes:
        stats: The statistics of the steps.
        outputs: Take the rows.
    """

    def __init__(self, file: str, *, frames: bool) -> None:
        self.stats = SessionStats()
        self.outputs: list[Callable[[Row], None]] = []
        self._builder = RowBuilder(file)
        self._frames = frames

    def take(self, step: "Step") -> None:
        """Take the next step."""
        for item in (step.event, *step.findings):
            self.stats.add(item)
            row = self._builder.take(item) if self.outputs else None
            if row and (self._frames or not isinstance(row, FrameRow)):
                self._pass_on(row)

    def finish(self, capture: "Capture", *, interrupted: bool) -> None:
        """Pass on the rows of the connections and of the file."""
        notes = (*capture.notes, *(["interrupted"] if interrupted else []))
        whole = capture.whole and not interrupted
        session = self.stats.session()
        for row in self._builder.finish(session, whole=whole, notes=notes, verdict=None):
            self._pass_on(row)

    def _pass_on(self, row: Row) -> None:
        for output in self.outputs:
            output(row)


class _Reading(NamedTuple):
    """How many steps were read, and whether Ctrl-C ended it."""

    steps: int
    interrupted: bool


def _read(
    capture: "Capture",
    selected: "Callable[[Step], bool]",
    takers: "Sequence[Callable[[Step], None]]",
    progress: Callable[[int, int], None],
) -> _Reading:
    """Pass the selected steps on, until the end or Ctrl-C."""
    count = 0
    size_bytes = capture.path.stat().st_size
    with suppress(KeyboardInterrupt):
        for count, step in enumerate(capture.steps(), 1):
            if count % _STEPS_PER_UPDATE == 0:
                progress(capture.read_bytes, size_bytes)
            if selected(step):
                for take in takers:
                    take(step)
        return _Reading(count, interrupted=False)
    return _Reading(count, interrupted=True)


def _is_routine(step: "Step") -> bool:
    """Whether a step is an answered query or chunk without a finding."""
    event = step.event
    if not isinstance(event, Exchange) or any(f.verdict in _SHOWN for f in step.findings):
        return False
    query = event.command and event.command.hazard is Hazard.READ_ONLY
    return event.ending is Ending.ANSWERED and bool(query or event.chunk)


class _Text:
    """Prints the dialogue.

    Args:
        frames: Whether to print single frames, too.
    """

    def __init__(self, *, frames: bool) -> None:
        self._frames = frames
        self._day = ""
        sides = {direction: localized(side) for direction, side in SIDES.items()}
        width = max(map(cell_len, sides.values()))
        self._sides = {direction: set_cell_size(side, width) for direction, side in sides.items()}

    def show(self, step: "Step") -> None:
        """Print a line for the event, if it has one, and one for each finding."""
        event, findings = step.event, [f for f in step.findings if f.verdict in _SHOWN]
        if text := self._text(event, always=bool(findings)):
            self._print(event, text)
        for finding in findings:
            click.echo(visible_line(f"    {_finding_text(finding)}"))

    def _text(self, event: TrafficEvent, *, always: bool) -> str:
        """Return the text of an event; empty for a frame unless frames are printed `always`."""
        if isinstance(event, FrameSeen):
            if not (self._frames or always):
                return ""
            return localized(
                "{name} {part}: {data}",
                name=event.name,
                part=event_text.part_of(event),
                data=event_text.frame_text(event),
            ).rstrip()
        line = event_text.log_line(event)
        return localized(line.text) if line else ""

    def _print(self, event: TrafficEvent, text: str) -> None:
        place = place_of(event)
        day, _, clock = utc_text(place.time_ns).partition("T")
        if day != self._day:
            self._day = day
            click.echo(f"{day} (UTC)")
        line = f"{clock[:15]}  {place.connection}  {self._sides[place.direction]}  {text}"
        click.echo(visible_line(line))


def _finding_text(finding: Finding) -> str:
    message = localized(finding.message)
    if compared := comparison(localized(finding.expected), localized(finding.observed)):
        message = localized("{message} ({compared})", message=message, compared=compared)
    return localized(
        "{verdict} {requirement}: {message}",
        verdict=UserMessage(finding.verdict.value),
        requirement=finding.requirement,
        message=message,
    )


def _print_latencies(stats: SessionStats) -> None:
    """Print how long first replies and final results took, for each command."""
    session = stats.session()
    table = Table(box=None, pad_edge=False)
    for heading in map(localized, ("command", "stage")):
        table.add_column(heading)
    for heading in (localized("count"), "p50", "p95", "p99", localized("max")):
        table.add_column(heading, justify="right")
    for seen, stage, timing in _timings(session.exchanges if session else ()):
        times = (timing.p50_ms, timing.p95_ms, timing.p99_ms, timing.max_ms)
        shown = ("" if each is None else duration(each) for each in times)
        table.add_row(visible_line(seen.name), stage, f"{timing.count}", *shown)
    Console().print(table)


def _timings(commands: tuple[CommandSeen, ...]) -> Iterator[tuple[CommandSeen, str, Timing]]:
    for seen in commands:
        for stage, timing in (
            (localized("first reply"), seen.latency),
            (localized("final result"), seen.duration),
        ):
            if timing:
                yield seen, stage, timing
