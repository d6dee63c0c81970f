"""Plots are within their axes for any numbers."""

from dataclasses import replace

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.histogram import Histogram
from scaraspec.report.model import CommandSeen, Results, RunSeen, Session, Timing
from scaraspec.report.plots import WIDTH, LatencyPlot, timeline


def command(*durations_ns: int, name: str = "get_status") -> CommandSeen:
    """Return a command with these latencies."""
    histogram = Histogram()
    for duration_ns in durations_ns:
        histogram.add(duration_ns)
    return CommandSeen(name, len(durations_ns), 0, {}, histogram.timing())


def test_the_axis_spans_whole_decades() -> None:
    """The axis begins with the decade of the fastest command and ends with that of the slowest."""
    plot = LatencyPlot([command(30_000), command(2_000_000_000)])
    assert [tick.label for tick in plot.ticks] == [
        *("10 µs", "100 µs", "1 ms", "10 ms", "100 ms", "1 s", "10 s"),
    ]
    assert [plot.ticks[0].x, plot.ticks[-1].x] == [0, WIDTH]


def test_position_of_a_bar() -> None:
    """1 ms is in the middle of 100 µs to 10 ms."""
    plot = LatencyPlot([command(100_000, 1_000_000, 10_000_000)])
    ((_, (distribution,)),) = plot.rows
    assert abs(distribution.p50_x - WIDTH / 2) < WIDTH / 100
    middle = distribution.bars[1]
    assert middle.x <= WIDTH / 2 <= middle.x + middle.width


def test_height_of_a_rare_duration() -> None:
    """One in a hundred has a tenth of the height."""
    ((_, (distribution,)),) = LatencyPlot([command(*[1_000_000] * 100, 50_000_000)]).rows
    assert [bar.height for bar in distribution.bars] == [1, 0.1]


def test_commands_without_a_reply_have_no_plot() -> None:
    plot = LatencyPlot([CommandSeen("get_status", 1, 0, {"unanswered": 1})])
    ((silent, distributions),) = plot.rows
    assert (silent.name, distributions) == ("get_status", [])
    assert LatencyPlot([]).rows == []


def test_latency_and_execution_are_separate() -> None:
    """A two-stage command has two distributions."""
    latency, duration = command(1_000_000).latency, command(1_000_000).latency
    ((_, drawn),) = LatencyPlot([CommandSeen("run_program", 1, 0, {}, latency, duration)]).rows
    assert [distribution.of_result for distribution in drawn] == [False, True]


def test_impossible_durations() -> None:
    """Results of other writers may contain any numbers."""
    odd = Timing(1, -5.0, 0.0, 1e300, 1e300, ((-1.0, -3), (1e300, 5)))
    plot = LatencyPlot([CommandSeen("x", 1, 0, {}, odd)])
    ((_, (distribution,)),) = plot.rows
    assert all(0 <= bar.x <= WIDTH and 0 <= bar.height <= 1 for bar in distribution.bars)


def test_lanes_of_the_timeline(full: Results) -> None:
    """Empty lanes are omitted."""
    assert full.session
    assert list(timeline(full, full.session)) == [
        *("connections", "transfers", "runs", "losses", "findings"),
    ]
    bare = Session(full.session.begun_ns, full.session.ended_ns, {}, 0, 0)
    assert timeline(replace(full, cases=()), bare) == {}


def test_marks_are_within_the_axis(full: Results) -> None:
    """A time before or after the session is shown at the end of the axis."""
    assert full.session
    runs = tuple(
        RunSeen(name="a", simulated=False, begun_ns=at, duration_ms=1e12, outcome="done")
        for at in (-(2**63), full.session.begun_ns, 2**63 - 1)
    )
    marks = timeline(full, replace(full.session, runs=runs))["runs"]
    assert all(mark.x >= 0 and mark.x + mark.width <= WIDTH + 0.01 for mark in marks)


def test_an_interrupted_run_is_good(full: Results) -> None:
    """The document requires that an emergency stop interrupts a run."""
    assert full.session
    runs = tuple(
        RunSeen(name="a", simulated=False, begun_ns=0, duration_ms=1, outcome=outcome)
        for outcome in ("done", "interrupted", "refused", "failed", "unanswered")
    )
    marks = timeline(full, replace(full.session, runs=runs))["runs"]
    assert [mark.good for mark in marks] == [True, True, True, False, False]


def test_a_lane_is_bounded(full: Results) -> None:
    """Of thousands of findings 1000 are shown."""
    assert full.session
    failing = [case for case in full.cases if case.verdict is Verdict.FAIL]
    many = replace(full, cases=tuple(failing * 2000))
    assert len(timeline(many, full.session)["findings"]) == 1000
