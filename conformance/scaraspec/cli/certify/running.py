"""Plan, progress, signals and output files of `scaraspec certify`."""

import math
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from types import FrameType, TracebackType
from typing import Final, Self

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from scaraspec.cli.problems import Problem
from scaraspec.cli.stdio import insists
from scaraspec.cli.viewer import has_viewer
from scaraspec.judge.verdicts import Cause, Verdict
from scaraspec.operating_system import ending_signals
from scaraspec.protocol.hazard import Hazard
from scaraspec.report import ctrf, html, junit
from scaraspec.report.model import Results
from scaraspec.report.sanitizing import visible
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.case_runner import Outcome
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.plan import Options, why_not
from scaraspec.traffic.wire import WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks.background_recorder import BackgroundRecorder
from scaraspec_recorder.sinks.sink import SinkFailed

RESULTS: Final = ("results.json", "report.html", "junit.xml", "ctrf.json")
CAPTURE: Final = "capture.mcap"

_RISKS: Final = {
    Hazard.READ_ONLY: "send queries only",
    Hazard.STATE: "change the clock, settings, sessions and stored files, and restore them",
    Hazard.MOTION: "MOVE the arm, its brakes or its outputs, and stop what the robot is doing",
    Hazard.DESTRUCTIVE: "DELETE files, change password and network, or shut the robot down",
}


def show_plan(cases: Sequence[Case], options: Options, statement: Ics, console: Console) -> None:
    """Print how many cases run, by hazard, and why the others are skipped."""
    runs = [case for case in cases if not why_not(case, options, statement)]
    skipped = Counter(why for case in cases if (why := why_not(case, options, statement)))
    console.print(f"{len(runs)} of {len(cases)} cases will run:", soft_wrap=True)
    counts = Counter(case.hazard for case in runs)
    for hazard in Hazard:
        if counts[hazard]:
            console.print(
                f"  {counts[hazard]:4}  {_RISKS[hazard]}", soft_wrap=True, highlight=False
            )
    for why, count in skipped.most_common():
        console.print(Text(f"  {count:4}  skipped: {visible(why)}"), soft_wrap=True)


def confirm_motion(cases: Sequence[Case], options: Options, statement: Ics) -> None:
    """On a terminal, ask before a run that moves the robot.

    Raises:
        Problem: The user declines.
    """
    runs = [case for case in cases if not why_not(case, options, statement)]
    if not any(Hazard.MOTION in case.hazards for case in runs) or not sys.stdin.isatty():
        return
    motion = statement.motion
    box = f", within {motion.box_mm}" if motion.box_mm else ""
    click.echo(
        "This run moves the robot along x, y, z and its rotation: steps of at most "
        f"{motion.step_mm:g} mm or degrees from where it stands{box}, and jogs of at most "
        f"{motion.jog_s:g} s, at {motion.speed_percent} % of full speed."
    )
    if not click.confirm("Is the area clear, and a hardware emergency stop within reach?"):
        raise Problem("nothing was sent: the run was not confirmed")


class Display:
    """A progress bar on a terminal, plain lines elsewhere.

    Args:
        console: The output.
        count: Number of cases.
        ticks: Print a line for each case instead of a bar.
    """

    def __init__(self, console: Console, count: int, *, ticks: bool = False) -> None:
        self._console, self._ticks = console, ticks
        self._count, self._number = count, 0
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            disable=ticks or not console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("certifying", total=count)
        self._dependency_message = ""

    def __enter__(self) -> Self:
        """Show the bar."""
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Remove the bar."""
        self._bar.stop()

    def announce(self, case: Case) -> None:
        """Print what a case tries before it begins, if each case has a line."""
        if self._ticks:
            text = f"\ncase {self._number + 1} of {self._count}, {case.id}: {case.sentence}"
            self._console.print(Text(text), soft_wrap=True)

    def say(self, sentence: str) -> None:
        """Print a sentence at once."""
        self._console.print(Text(visible(sentence)), soft_wrap=True)

    def tell(self, outcome: Outcome, _count: int) -> None:
        """Report a finished case. The reason why all later cases are skipped is printed once."""
        self._number += 1
        self._bar.update(self._task, advance=1, description=outcome.case.id)
        shown = outcome.verdict not in (Verdict.PASS, Verdict.NONE)
        if outcome.cause is Cause.DEPENDENCY:
            shown = outcome.message != self._dependency_message
            self._dependency_message = outcome.message
        if self._ticks or shown:
            text = f"{outcome.verdict.value} {outcome.case.id}: {outcome.message}"
            self._console.print(Text(visible(text)), soft_wrap=True)


_AT_ONCE_S: Final = 0.5
"""Two signals within this time count as one: `timeout` signals a process and then its group."""


def end_in_order(interruption: Interruption) -> None:
    """Let SIGTERM and a lost terminal end a run as Ctrl-C does: everything is restored.

    A second signal ends the run at once.
    """
    last_s = -math.inf

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal last_s
        before_s, last_s = last_s, time.monotonic()
        if not interruption.asked:
            interruption.ask()
        elif last_s - before_s > _AT_ONCE_S and insists(number):
            signal.default_int_handler(number, frame)

    for number in ending_signals():
        signal.signal(number, end)


class Files:
    """The output folder of a run: the recording, and the reports at the end.

    Args:
        out: The folder; None to write nothing.
        sittings: Continue an earlier run in this folder instead of refusing it. The new recording
            goes into a subfolder ``sitting-2`` and so on.
        needs_login: False for a serial link (L83).

    Attributes:
        earlier: The results of the earlier run.

    Raises:
        Problem: The folder holds the results of an earlier run.
        ResultsError: The results to continue cannot be read.
        OSError: The folder cannot be created.
    """

    def __init__(
        self, out: Path | None, *, sittings: bool = False, needs_login: bool = True
    ) -> None:
        self._out = out
        self._recording: BackgroundRecorder | None = None
        self.earlier: Results | None = None
        if out is None:
            return
        out.mkdir(parents=True, exist_ok=True)
        there = [name for name in RESULTS if (out / name).exists()]
        if there and not sittings:
            raise Problem(
                UserMessage(
                    "{out} contains {there} of an earlier run: name another folder",
                    out=out,
                    there=there[0],
                )
            )
        folder = out
        if there:
            self.earlier = Results.read(out / RESULTS[0])
            folder = out / f"sitting-{len(list(out.glob('sitting-*'))) + 2}"
            folder.mkdir()
        sink = partial(capture_sink, draw=has_viewer(), needs_login=needs_login)
        self._recording = BackgroundRecorder(folder, [sink])

    @property
    def capture(self) -> str:
        """The recording, relative to the results; empty if there are several."""
        return CAPTURE if self._out and not self.earlier else ""

    def take(self, event: WireEvent) -> None:
        """Record an event."""
        if self._recording:
            self._recording.write(event)

    def write(self, results: Results) -> None:
        """Write all reports."""
        if self._out is None:
            return
        results.write(self._out / "results.json")
        html.write(results, self._out / "report.html")
        junit.write(results, self._out / "junit.xml")
        ctrf.write(results, self._out / "ctrf.json")

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the recording.

        Raises:
            Problem: The recording could not be written.
        """
        if self._recording:
            try:
                self._recording.close()
            except SinkFailed as error:
                raise Problem(
                    UserMessage(
                        "{out}: the recording is incomplete: {error}", out=self._out, error=error
                    )
                ) from None
