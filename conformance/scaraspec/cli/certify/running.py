"""Plan, progress and signals of `scaraspec certify`."""

import math
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from types import FrameType
from typing import Final

import click
from rich.console import Console
from rich.progress import TextColumn
from rich.text import Text

from scaraspec.api.certify import Progress
from scaraspec.cli.certify.time_estimate import TimeEstimate
from scaraspec.cli.problems import Problem
from scaraspec.cli.progress_bar import ProgressBar
from scaraspec.cli.stdio import insists
from scaraspec.judge.verdicts import Cause, Verdict
from scaraspec.operating_system import ending_signals
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.sanitizing import visible, visible_line
from scaraspec.report.terminal import verdict_name
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.case_sheet import operator_requests
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.interruption import Interruption
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.plan import Options, asks_operator, skip_reason
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

_RISKS: Final = {
    Hazard.READ_ONLY: UserMessage("send queries only"),
    Hazard.STATE: UserMessage(
        "change the clock, settings, sessions and stored files, and restore them"
    ),
    Hazard.MOTION: UserMessage(
        "MOVE the arm, its brakes or its outputs, and stop what the robot is doing"
    ),
    Hazard.DESTRUCTIVE: UserMessage(
        "DELETE files, change password and network, or shut the robot down"
    ),
}


def estimate_of(cases: Sequence[Case], options: Options, statement: Ics) -> TimeEstimate:
    """Return an estimate of the time of a run."""
    runs = [case for case in cases if not skip_reason(case, options, statement)]
    asks = partial(asks_operator, options=options, ics=statement)
    return TimeEstimate(runs, statement.transfer_s, asks=asks)


def show_plan(
    cases: Sequence[Case],
    options: Options,
    statement: Ics,
    console: Console,
    estimate: TimeEstimate,
) -> None:
    """Print how many cases run, in what time, by hazard, and why the others are skipped."""
    runs = [case for case in cases if not skip_reason(case, options, statement)]
    skips = [skip for case in cases if (skip := skip_reason(case, options, statement))]
    skipped = Counter(skip.message for skip in skips)
    text = localized(
        "{count} of {total} cases will run, in {estimate}:",
        count=len(runs),
        total=len(cases),
        estimate=estimate,
    )
    console.print(text, soft_wrap=True)
    counts = Counter(case.hazard for case in runs)
    for hazard in Hazard:
        if counts[hazard]:
            console.print(
                f"  {counts[hazard]:4}  {localized(_RISKS[hazard])}",
                soft_wrap=True,
                highlight=False,
            )
    if requests := operator_requests(c for c in runs if asks_operator(c, options, statement)):
        text = localized("the operator is asked about {count} times", count=requests)
        console.print(f"  {text}", soft_wrap=True, highlight=False)
    for why, count in skipped.most_common():
        text = localized("skipped: {reason}", reason=localized(why))
        console.print(Text(f"  {count:4}  {visible(text)}"), soft_wrap=True)


def confirm_motion(cases: Sequence[Case], options: Options, statement: Ics) -> None:
    """On a terminal, ask before a run that moves the robot.

    Raises:
        Problem: The user declines.
    """
    runs = [case for case in cases if not skip_reason(case, options, statement)]
    if not any(Hazard.MOTION in case.hazards for case in runs) or not sys.stdin.isatty():
        return
    motion = statement.motion
    click.echo(
        localized(
            "This run moves the robot along x, y, z and its rotation: steps of at most {step_mm:g} "
            "mm or degrees from where it stands{box}, and jogs of at most {jog_s:g} s, at "
            "{speed_percent} % of full speed.",
            step_mm=motion.step_mm,
            box=localized(", within {box_mm}", box_mm=motion.box_mm) if motion.box_mm else "",
            jog_s=motion.jog_s,
            speed_percent=motion.speed_percent,
        )
    )
    if not click.confirm(
        localized("Is the area clear, and a hardware emergency stop within reach?")
    ):
        raise Problem("nothing was sent: the run was not confirmed")


def say(sentence: str) -> None:
    """Show a sentence to an operator."""
    click.echo(localized(sentence))


def require_terminal() -> None:
    """Require that an operator can answer.

    Raises:
        Problem: The input is not a terminal.
    """
    if sys.stdin is None or not sys.stdin.isatty():
        raise Problem("--attended: nothing was sent, because stdin is no terminal")


class Display:
    """A progress bar on a terminal, plain lines elsewhere; both have the time that is left.

    Args:
        console: The output.
        count: Number of cases.
        estimate: The time that is left.
        ticks: Print a line for each case instead of a bar.
        clock: Returns the current time in seconds.

    Attributes:
        bar: The bar; a context that shows it.
    """

    def __init__(
        self,
        console: Console,
        count: int,
        estimate: TimeEstimate,
        *,
        ticks: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console, self._ticks = console, ticks
        self._count, self._number = count, 0
        self._estimate, self._clock = estimate, clock
        self._line_s = clock()
        left = TextColumn(localized("{time} left", time="{task.fields[left]}"))
        self.bar = ProgressBar(
            console,
            localized("certifying"),
            count,
            left,
            hidden=ticks,
            transient=True,
            left=f"{estimate}",
        )
        self._dependency_message = ""

    def begin_case(self, case: Case) -> None:
        """Print what a case tries before it begins, if each case has a line."""
        if self._ticks:
            where = localized(
                "case {number} of {count}, {estimate} left",
                number=self._number + 1,
                count=self._count,
                estimate=self._estimate,
            )
            sentence = localized(case.sentence)
            self._console.print(Text(f"\n{where}, {case.id}: {sentence}"), soft_wrap=True)
        self._estimate.begin()

    def say(self, sentence: str) -> None:
        """Print a sentence at once."""
        self._console.print(Text(visible(localized(sentence))), soft_wrap=True)

    @property
    def progress(self) -> Progress:
        """The callbacks that feed this display."""
        return Progress(self.begin_case, self.end_case, self.say, self.begin_run)

    def begin_run(self, round_trip_s: float) -> None:
        """Print the measured round trip, and the time of the run that follows from it."""
        self._estimate.set_round_trip(round_trip_s)
        self.bar.set_fields(left=f"{self._estimate}")
        self.say(
            localized(
                "a reply takes {round_trip_ms:.1f} ms: the run will take {estimate}",
                round_trip_ms=round_trip_s * 1000,
                estimate=self._estimate,
            )
        )

    def end_case(self, outcome: Outcome, _count: int) -> None:
        """Report a finished case. The reason why all later cases are skipped is printed once."""
        self._number += 1
        self._estimate.end(outcome.case)
        self.bar.count_one(outcome.case.id, left=f"{self._estimate}")
        shown = outcome.verdict not in (Verdict.PASS, Verdict.NONE)
        if outcome.cause is Cause.DEPENDENCY:
            failed_start = self._number == 1  # reported at the end
            shown = outcome.message != self._dependency_message and not failed_start
            self._dependency_message = outcome.message
        if self._ticks or shown:
            text = localized(
                "{verdict} {requirement}: {message}",
                verdict=verdict_name(outcome.verdict),
                requirement=outcome.case.id,
                message=outcome.message,
            )
            self._console.print(Text(visible_line(text)), soft_wrap=True)
        if not (self._ticks or self._console.is_terminal):
            self._print_time_left()

    def _print_time_left(self) -> None:
        """Print the progress, at most once in a minute."""
        now_s = self._clock()
        if now_s - self._line_s >= _LINE_S:
            self._line_s = now_s
            text = localized(
                "{number} of {count} cases have ended, {estimate} left",
                number=self._number,
                count=self._count,
                estimate=self._estimate,
            )
            self._console.print(Text(text), soft_wrap=True)


_LINE_S: Final = 60.0
"""The time between two lines about the progress."""

_AT_ONCE_S: Final = 0.5
"""Two signals within this time count as one: `timeout` signals a process and then its group."""


def end_on_signals(interruption: Interruption) -> None:
    """Let SIGTERM and a lost terminal end a run as Ctrl-C does: everything is restored.

    A second signal ends the run at once.
    """
    last_s = -math.inf

    def end(number: int, frame: FrameType | None) -> None:
        nonlocal last_s
        before_s, last_s = last_s, time.monotonic()
        if not interruption.requested:
            interruption.ask()
        elif last_s - before_s > _AT_ONCE_S and insists(number):
            signal.default_int_handler(number, frame)

    for number in ending_signals():
        signal.signal(number, end)
