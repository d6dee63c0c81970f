"""The dashboard: status of recordings as a terminal table or as plain lines.

Belongs here: presentation only. The data comes from `status`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Final, Protocol, Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from scaraspec.user_message import UserMessage
from scaraspec_recorder.monitoring.status import Status
from scaraspec_recorder.recordings.recording_stats import RERUN_SUFFIX
from scaraspec_recorder.tap.tcp import address_text

MIN_INTERVAL_S: Final = 10.0
"""Minimum interval of plain lines about the same recording, in seconds."""

_NUMBERS: Final = ("connections", "client/s", "robot/s", "recorded", "gaps", "waiting", "free")
_MOST_PROBLEMS: Final = 5
_UNREACHED: Final = "the robot cannot be reached"
_CONNECTING: Final = "connecting to the robot …"
_ENDING: Final = (
    "stopping: the remaining data is written; press Ctrl-C again to leave it to the next start"
)


class Display(Protocol):
    """Shows recordings while its context is active."""

    def __enter__(self) -> Self:
        """Start."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop."""

    def update(self, statuses: Sequence[Status], *, ending: bool) -> None:
        """Show the status of the recordings, and whether they are stopping."""


class LineDisplay:
    """Prints plain lines when problems start or end, and while recordings stop.

    Args:
        say: Prints a line.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._reported: dict[str, tuple[float, _Problems]] = {}
        self._ending_s: float | None = None

    def __enter__(self) -> Self:
        """Start."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""

    def update(self, statuses: Sequence[Status], *, ending: bool) -> None:
        """Print changes, at most one per `MIN_INTERVAL_S` and recording."""
        for status in statuses:
            reported_s, reported = self._reported.get(status.name, (-math.inf, _Problems()))
            problems = _Problems.of(status)
            if problems != reported and not 0 <= status.time_s - reported_s < MIN_INTERVAL_S:
                self._reported[status.name] = status.time_s, problems
                for line in problems.since(reported):
                    self._say(f"{status.name}: {line}")
        if ending:
            self._end(statuses)

    def _end(self, statuses: Sequence[Status]) -> None:
        open_ones = [
            status
            for status in statuses
            if not status.progress.finished or (status.uploads and status.uploads.waiting)
        ]
        if not open_ones:
            return
        now_s = open_ones[0].time_s
        if self._ending_s is None:
            self._say(_ENDING)
        elif 0 <= now_s - self._ending_s < MIN_INTERVAL_S:
            return
        else:
            for status in open_ones:
                if not status.progress.finished:
                    self._say(
                        UserMessage(
                            "{name}: still writing, {size} remaining",
                            name=status.name,
                            size=_size(status.waiting_bytes),
                        )
                    )
                elif status.uploads:
                    self._say(
                        UserMessage(
                            "{name}: still archiving, {files} remaining",
                            name=status.name,
                            files=status.uploads.waiting_text,
                        )
                    )
        self._ending_s = now_s


@dataclass(frozen=True, slots=True)
class _Problems:
    """The current problems of a recording."""

    problems: tuple[str, ...] = ()
    gaps: int = 0
    stalled: bool = False
    reason: str = ""
    unreached: str = ""
    connecting: bool = False
    status: Status | None = field(default=None, compare=False)

    @classmethod
    def of(cls, status: Status) -> "_Problems":
        progress, reason = status.progress, status.stall.reason if status.stall else ""
        return cls(
            tuple(progress.problems),
            status.gaps,
            status.stalled,
            reason,
            progress.unreached,
            bool(status.connecting_s),
            status,
        )

    def since(self, before: "_Problems") -> list[str]:
        """Return a line for each problem that is new or has changed."""
        assert self.status
        lines = list(self.problems[len(before.problems) :])
        if self.gaps != before.gaps:
            lines.append(
                UserMessage(
                    "{gaps} gaps so far, {size} not recorded",
                    gaps=self.gaps,
                    size=_size(self.status.lost_bytes),
                )
            )
        if (self.stalled, self.reason) != (before.stalled, before.reason):
            waiting = UserMessage(
                "writing is stalled, {size} waiting", size=_size(self.status.waiting_bytes)
            )
            why = UserMessage(": {reason}", reason=self.reason) if self.reason else ""
            lines.append(f"{waiting}{why}" if self.stalled else "writing continues")
        if self.connecting and not before.connecting:
            lines.append(_CONNECTING)
        if self.unreached != before.unreached:
            why = self.unreached
            lines.append(f"{_UNREACHED}: {why}" if why else "the robot can be reached again")
        return lines


class Dashboard:
    """A table on a terminal of at least 80 columns, redrawn at each update.

    Args:
        console: The terminal.
    """

    def __init__(self, console: Console) -> None:
        self._live = Live(console=console, auto_refresh=False)
        self._before: dict[str, Status] = {}

    def __enter__(self) -> Self:
        """Start drawing."""
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop drawing; the last table remains."""
        self._live.stop()

    def update(self, statuses: Sequence[Status], *, ending: bool) -> None:
        """Redraw the table."""
        table = Table("robot", box=None, pad_edge=False, collapse_padding=True)
        for heading in _NUMBERS:
            table.add_column(heading, justify="right", no_wrap=True)
        notes: list[RenderableType] = []
        for status in statuses:
            table.add_row(*self._row(status))
            notes.append(Text(f"{status.name}: {_place(status)}", overflow="fold"))
            notes += [Text(f"{status.name}: {each}", "red") for each in _problems(status)]
            self._before[status.name] = status
        if ending:
            notes.append(Text(_ENDING, "bold"))
        self._live.update(Group(table, *notes), refresh=True)

    def _row(self, status: Status) -> tuple[str, ...]:
        progress, before = status.progress, self._before.get(status.name, status)
        span_s = status.time_s - before.time_s
        was = before.progress

        def rate(now_bytes: int, before_bytes: int) -> str:
            return _size((now_bytes - before_bytes) / span_s if span_s > 0 else 0)

        return (
            status.name,
            str(progress.connections),
            rate(progress.a2c.received_bytes, was.a2c.received_bytes),
            rate(progress.c2a.received_bytes, was.c2a.received_bytes),
            _size(progress.a2c.recorded_bytes + progress.c2a.recorded_bytes),
            str(status.gaps),
            _size(status.waiting_bytes),
            _size(status.free_bytes),
        )


def _place(status: Status) -> str:
    """Return the listening addresses and the current file."""
    files = status.progress.files
    captures = [name for name in files if not name.endswith(RERUN_SUFFIX)] or ["no file yet"]
    listen = " and ".join(map(address_text, status.listen))
    return UserMessage("clients at {listen}, {captures}", listen=listen, captures=captures[-1])


def _problems(status: Status) -> list[str]:
    """Return the current problems, the latest last."""
    problems = list(status.progress.problems[-_MOST_PROBLEMS:])
    if status.connecting_s:
        problems.append(f"{_CONNECTING} {status.connecting_s:.0f} s")
    if status.progress.unreached:
        problems.append(f"{_UNREACHED}: {status.progress.unreached}")
    if status.upload_problem:
        problems.append(status.upload_problem)
    if status.gaps:
        problems.append(
            UserMessage(
                "{size} not recorded in {gaps} gaps",
                size=_size(status.lost_bytes),
                gaps=status.gaps,
            )
        )
    if status.stalled:
        why = UserMessage(": {reason}", reason=status.stall.reason) if status.stall else ""
        problems.append(
            UserMessage(
                "writing is stalled for {silent_s:.0f} s{why}", silent_s=status.silent_s, why=why
            )
        )
    return problems


def _size(size_bytes: float) -> str:
    """Return a size in three digits."""
    for unit in ("B", "kB", "MB", "GB"):
        if size_bytes < 1000:  # noqa: PLR2004 - the step from unit to unit
            return f"{size_bytes:.3g} {unit}"
        size_bytes /= 1000
    return f"{size_bytes:.3g} TB"
