"""Two results are compared by meaning."""

from dataclasses import replace

from results_of_run import FAILED, PASSED, SEEN, failed, results_of

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import CommandSeen, ReadingSeen, Results, RunInfo, Session, Timing
from scaraspec.results import comparison_report
from scaraspec.results.comparison import Change, compare


def test_equal(results: Results) -> None:
    """Different times and numbers of findings are no difference."""
    slower = failed("4.15/3", "the code is {code} after {time_s:.1f} s", code="07", time_s=9.5)
    again = results_of(PASSED, slower, replace(SEEN, id="3/18.seen-2"))
    assert not compare(results, results).differs
    assert not compare(results, again).differs


def test_failures(results: Results, good: Results) -> None:
    """New, fixed and changed failures."""
    found = compare(results, good)
    assert ([c.id for c in found.gone], found.new) == (["4.15/3", "3/18.seen-1"], ())
    assert [c.id for c in compare(good, results).new] == ["4.15/3", "3/18.seen-1"]
    other = failed("4.15/3", "the code is {code} after {time_s:.1f} s", code="08", time_s=1.2)
    changed = compare(results, results_of(PASSED, other, SEEN))
    assert [(a.id, b.message) for a, b in changed.changed] == [
        ("4.15/3", "the code is 08 after 1.2 s")
    ]
    assert (changed.new, changed.gone) == ((), ())


def test_verdicts_and_coverage(results: Results) -> None:
    """A case that no longer runs, and its requirement."""
    skipped = results_of(replace(PASSED, verdict=Verdict.NONE), FAILED, SEEN)
    found = compare(results, skipped)
    assert found.verdicts == (Change("4.8/1", "pass", "none"),)
    assert (found.lost, found.gained) == (("4.8/1",), ())
    assert compare(skipped, results).gained == ("4.8/1",)


def test_readings_settings_and_latency(results: Results) -> None:
    """Different readings are a change of behaviour; different settings and latencies are not."""
    read = {"controller": {"endian": ReadingSeen(("big",), default=False, mixed=False)}}
    found = compare(results, replace(results, readings=read))
    assert found.readings == (Change("controller.endian", "", "big"),)
    assert found.differs
    run = RunInfo(0, 1, 0, {"allow": "motion"})
    timing = Timing(3, 0.01, 0.02, 0.04, 0.04, ())
    exchanges = (CommandSeen("get_status", 3, 0, {}, timing),)
    session = Session(0, 1, {}, 6, 0, exchanges=exchanges)
    found = compare(results, replace(results, run=run, session=session))
    assert found.settings == (Change("allow", "state", "motion"),)
    assert not found.differs
    text = "\n".join(comparison_report.lines(found))
    assert "latency · get_status · – -> p50 0.02 ms, p99 0.04 ms, 3 times" in text
    assert "setting · allow · state -> motion" in text
    page = comparison_report.markdown(found)
    assert r"| get\_status | – | p50 0.02 ms, p99 0.04 ms, 3 times |" in page
