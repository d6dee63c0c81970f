"""The estimated time of a certification: from typical durations, then from measured ones."""

import io
from dataclasses import dataclass, field

import pytest
from rich.console import Console

from scaraspec.cli.certify.running import Display, estimate_of, show_plan
from scaraspec.cli.certify.time_estimate import TimeEstimate
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Role
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.plan import ALL, Options, asks_operator

READS = frozenset({Hazard.READ_ONLY})
MOVES = frozenset({Hazard.READ_ONLY, Hazard.MOTION})


@dataclass
class Clock:
    """A clock that a test sets."""

    now_s: float = 0.0

    def __call__(self) -> float:
        """The current time."""
        return self.now_s


@dataclass
class Trial:
    """A run of cases that each take the same time."""

    moving: bool = False
    count: int = 100
    clock: Clock = field(default_factory=Clock)

    def __post_init__(self) -> None:
        hazards = MOVES if self.moving else READS
        self.cases = [Case(f"4.8/2.{n}", ("4.8/2",), hazards) for n in range(self.count)]
        self.estimate = TimeEstimate(self.cases, 30.0, clock=self.clock)

    def run(self, display: Display, case: Case, duration_s: float) -> None:
        """Run one case."""
        display.begin_case(case)
        self.clock.now_s += duration_s
        display.end_case(Outcome(case, Verdict.PASS), self.count)


@pytest.fixture
def output() -> io.StringIO:
    return io.StringIO()


def test_measured_durations_replace_the_typical_ones() -> None:
    """After some cases of ten seconds, the remaining ones are expected to take ten seconds."""
    trial = Trial()
    before_s = trial.estimate.remaining_s
    for case in trial.cases[:50]:
        trial.estimate.begin()
        trial.clock.now_s += 10
        trial.estimate.end(case)
    assert before_s < 30
    assert 450 < trial.estimate.remaining_s <= 500
    assert str(trial.estimate) == "about 8 min"


def test_slow_replies_make_the_run_longer(output: io.StringIO) -> None:
    """The round trip is measured before the first case, and the new estimate is printed."""
    trial = Trial(moving=True, count=400)
    display = Display(Console(file=output), 400, trial.estimate, clock=trial.clock)
    before_s = trial.estimate.remaining_s
    display.progress.begun(0.0003)
    assert trial.estimate.remaining_s == before_s
    display.progress.begun(0.2)
    assert trial.estimate.remaining_s == pytest.approx(before_s + 400 * 55 * 0.2, rel=0.01)
    assert output.getvalue().splitlines() == [
        "a reply takes 0.3 ms: the run will take about 2 min",
        "a reply takes 200.0 ms: the run will take about 1 h 15 min",
    ]


def test_a_case_that_does_not_run() -> None:
    """It takes no time and is not measured; other outcomes change nothing."""
    trial = Trial(count=2)
    each_s = trial.estimate.remaining_s / 2
    trial.clock.now_s += 1000
    trial.estimate.end(trial.cases[0])
    trial.estimate.end(Case("run.emergency-stop", ("4.17/6",), MOVES))
    assert trial.estimate.remaining_s == pytest.approx(each_s)


def test_kinds_are_measured_separately() -> None:
    """A slow motion does not make queries slower."""
    moving, reading = Case("4.28/4", ("4.28/4",), MOVES), Case("4.8/2", ("4.8/2",), READS)
    clock = Clock()
    estimate = TimeEstimate([moving, reading], 30.0, clock=clock)
    estimate.begin()
    clock.now_s += 1000
    estimate.end(moving)
    assert estimate.remaining_s < 1


@pytest.mark.parametrize(
    ("count", "message"), [(1, "about 10 s"), (3, "about 2 min"), (240, "about 2 h 0 min")]
)
def test_in_words(count: int, message: str) -> None:
    """The time is rounded; an operator needs half a minute for a case."""
    cases = [Case(f"4.8/1.{n}", ("4.8/1",), READS) for n in range(count)]
    assert str(TimeEstimate(cases, 30.0, asks=lambda _: count > 1)) == message


def test_the_plan(output: io.StringIO) -> None:
    """A shorter transfer timeout makes the run shorter."""
    options = Options(allowed=ALL)
    cases = collect(options)
    for ics in (Ics(), Ics().with_claims(xfer_timeout="1")):
        show_plan(cases, options, ics, Console(file=output), estimate_of(cases, options, ics))
    first, second = (line for line in output.getvalue().splitlines() if "will run" in line)
    assert first.endswith("cases will run, in about 4 min:")
    assert second.endswith("cases will run, in about 2 min:")
    attended = Options(attended=True)
    operated = collect(attended, Role.CLIENT)
    assert estimate_of(operated, attended, Ics()).remaining_s == 30 * len(operated)


def test_the_plan_of_an_attended_run(output: io.StringIO) -> None:
    """It shows the number of requests; only cases with requests need the time of an operator."""
    options = Options(allowed=ALL, attended=True)
    cases = collect(options)
    estimate = estimate_of(cases, options, Ics())
    show_plan(cases, options, Ics(), Console(file=output), estimate)
    asking = sum(asks_operator(case, options, Ics()) for case in cases)
    assert 10 < asking < 20
    unattended_s = estimate_of(cases, Options(allowed=ALL), Ics()).remaining_s
    assert estimate.remaining_s == pytest.approx(unattended_s + 30 * asking, rel=0.02)
    assert "the operator is asked about 51 times" in output.getvalue()


def test_lines_without_a_terminal(output: io.StringIO) -> None:
    """At most one line is printed per minute."""
    trial = Trial()
    display = Display(Console(file=output), 100, trial.estimate, clock=trial.clock)
    for case in trial.cases[:7]:
        trial.run(display, case, 20)
    assert output.getvalue().splitlines() == [
        "3 of 100 cases have ended, about 16 min left",
        "6 of 100 cases have ended, about 21 min left",
    ]


def test_a_terminal(output: io.StringIO) -> None:
    """The progress bar shows the remaining time, and no line is printed."""
    trial = Trial()
    console = Console(file=output, force_terminal=True, width=120)
    display = Display(console, 100, trial.estimate, clock=trial.clock)
    with display.bar:
        for case in trial.cases[:7]:
            trial.run(display, case, 20)
    assert "7/100" in output.getvalue()
    assert "about 22 min left" in output.getvalue()
    assert "have ended" not in output.getvalue()


def test_the_line_of_an_operator(output: io.StringIO) -> None:
    """The remaining time is in the line of each case."""
    trial = Trial(count=1)
    display = Display(Console(file=output), 1, trial.estimate, ticks=True, clock=trial.clock)
    trial.run(display, trial.cases[0], 5)
    assert "case 1 of 1, about 10 s left, 4.8/2.0:" in output.getvalue()
    assert "pass 4.8/2.0" in output.getvalue()
