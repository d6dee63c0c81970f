"""What `scaraspec certify` shows while it runs, and the files that it leaves behind."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from scaraspec.cli.problems import Problem
from scaraspec.cli.viewer import has_viewer
from scaraspec.judgement.verdicts import Verdict
from scaraspec.judgement.wire import WireEvent
from scaraspec.protocol.hazard import Hazard
from scaraspec.report import ctrf, html, junit
from scaraspec.report.model import Results
from scaraspec.report.visible import visible
from scaraspec.suite.bracket import Outcome
from scaraspec.suite.case import Case
from scaraspec.suite.plan import Options, why_not
from scaraspec.suite.statement import Statement
from scaraspec_recorder.capture import capture_sink, draw_capture
from scaraspec_recorder.sinks import TICK_NS, Folder
from scaraspec_recorder.source import open_capture

if TYPE_CHECKING:
    from scaraspec_recorder.deriver import Deriver

RESULTS: Final = ("results.json", "report.html", "junit.xml", "ctrf.json")
STATE: Final = "state.json"

_RISKS: Final = {
    Hazard.READ_ONLY: "ask only",
    Hazard.STATE: "change the clock, settings, sessions and stored files, and put them back",
    Hazard.MOTION: "MOVE the arm, its brakes or its outputs",
    Hazard.DESTRUCTIVE: "DELETE files, change password and network, or shut the robot down",
}


def show_plan(
    cases: Sequence[Case], options: Options, statement: Statement, console: Console
) -> None:
    """Say what will be tried, what may move or be lost, and what is left out, and why."""
    runs = [case for case in cases if not why_not(case, options, statement)]
    left_out = Counter(why for case in cases if (why := why_not(case, options, statement)))
    console.print(f"{len(runs)} of {len(cases)} cases will be tried:", soft_wrap=True)
    counts = Counter(case.hazard for case in runs)
    for hazard in Hazard:
        if counts[hazard]:
            console.print(
                f"  {counts[hazard]:4}  {_RISKS[hazard]}", soft_wrap=True, highlight=False
            )
    for why, count in left_out.most_common():
        console.print(Text(f"  {count:4}  not run: {visible(why)}"), soft_wrap=True)


class Display:
    """A bar on a terminal, plain lines elsewhere."""

    def __init__(self, console: Console, count: int) -> None:
        self._console = console
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            disable=not console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("certifying", total=count)

    def __enter__(self) -> Self:
        """Show it."""
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take it away."""
        self._bar.stop()

    def tell(self, outcome: Outcome, _count: int) -> None:
        """A case is over."""
        self._bar.update(self._task, advance=1, description=outcome.case.id)
        if outcome.verdict not in (Verdict.PASS, Verdict.NONE):
            said = f"{outcome.verdict.value} {outcome.case.id}: {outcome.message}"
            self._console.print(Text(visible(said)), soft_wrap=True)


class Files:
    """The folder of a run: what is recorded while it lasts, and the reports at its end.

    Raises:
        Problem: The folder holds the results of an earlier run.
        OSError: It cannot be made.
    """

    def __init__(self, out: Path | None) -> None:
        self._out = out
        self._sink: Deriver | None = None
        self._ticked_ns = 0
        if out is None:
            return
        out.mkdir(parents=True, exist_ok=True)
        if there := [name for name in RESULTS if (out / name).exists()]:
            raise Problem(f"{out} holds {there[0]} of an earlier run: name another folder")
        self._sink = capture_sink(Folder(out, []), draw=False)

    @property
    def state_file(self) -> Path | None:
        """Where the subject's state is kept until it is put back."""
        return self._out / STATE if self._out else None

    def take(self, event: WireEvent) -> None:
        """Record what passed."""
        if self._sink is None:
            return
        self._sink.write(event)
        if event.time_ns - self._ticked_ns > TICK_NS:
            self._sink.tick(event.time_ns)
            self._ticked_ns = event.time_ns

    def write(self, results: Results) -> None:
        """Write every report."""
        if self._out is None:
            return
        results.write(self._out / "results.json")
        html.write(results, self._out / "report.html")
        junit.write(results, self._out / "junit.xml")
        ctrf.write(results, self._out / "ctrf.json")

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the recording, and draw it."""
        if self._sink is None or self._out is None:
            return
        self._sink.close()
        if has_viewer():
            draw_capture(
                open_capture(self._out / "capture.mcap", port=None), self._out / "capture.rrd"
            )
