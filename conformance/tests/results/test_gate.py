"""A gate passes results that are as good as the baseline, and fails for each single change."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from results_of_run import FAILED, PASSED, SEEN, failed, results_of

from scaraspec.judge.verdicts import ExitStatus, Reason, Verdict
from scaraspec.report.model import Case, Results, RunInfo
from scaraspec.results.baseline import Baseline, BaselineError
from scaraspec.results.findings import OldResultsError
from scaraspec.results.gate import ProblemKind, gate
from scaraspec.results.waivers import Waiver, WaiverError, read_waivers

TODAY = date(2026, 11, 26)
NAMES = {"case": FAILED.id, "fingerprint": ""}


def waiver(**changes: Any) -> Waiver:
    """Return a valid waiver of the failed case, with changes."""
    texts = {"reason": "a known limit", "issue": "FW-12", "approver": "firmware lead"}
    return Waiver(**{**NAMES, **texts, "expires": TODAY, **changes})


def kinds(results: Results, *waivers: Waiver, baseline: Results | None = None) -> list[str]:
    """Return the kinds and ids of the problems."""
    accepted = Baseline.of(baseline) if baseline else None
    found = gate(results, baseline=accepted, waivers=waivers, today=TODAY)
    assert (found.exit_status is ExitStatus.NONCONFORMANT) == bool(found.problems)
    return [f"{problem.kind.value} {problem.id}" for problem in found.problems]


def test_results_pass_their_own_baseline(results: Results, good: Results) -> None:
    """Results pass a gate with the baseline that was made of them."""
    assert kinds(results, baseline=results) == []
    assert kinds(good, baseline=good) == []
    assert kinds(good) == []


def test_without_a_baseline_each_failure_is_new(results: Results) -> None:
    """No failure is accepted."""
    assert kinds(results) == ["new-failure 4.15/3", "new-failure 3/18.seen-1"]


NOT_RUN = replace(PASSED, verdict=Verdict.NONE, reason=Reason.HOOK, message="no hook")
CHANGES: dict[str, tuple[Callable[[Results], Results], list[str]]] = {
    "failure added": (
        lambda r: results_of(*r.cases, failed("4.9/1", "wrong")),
        ["new-failure 4.9/1"],
    ),
    "other message": (
        lambda _: results_of(PASSED, failed("4.15/3", "no code"), SEEN),
        ["changed-failure 4.15/3"],
    ),
    "other value": (
        lambda _: results_of(
            PASSED,
            failed("4.15/3", "the code is {code} after {time_s:.1f} s", code="08", time_s=1.2),
            SEEN,
        ),
        ["changed-failure 4.15/3"],
    ),
    "second finding": (
        lambda r: results_of(*r.cases, failed("3/18.seen-2", "another")),
        ["changed-failure 3/18.seen-2"],
    ),
    "case lost": (
        lambda _: results_of(FAILED, SEEN),
        ["lost-case 4.8/1", "lost-requirement 4.8/1"],
    ),
    "case skipped": (
        lambda _: results_of(NOT_RUN, FAILED, SEEN),
        ["lost-case 4.8/1", "lost-requirement 4.8/1"],
    ),
    "requirement lost": (
        lambda r: replace(r, requirements=r.requirements[1:]),
        ["lost-requirement 4.8/1"],
    ),
    "other setting": (
        lambda r: replace(r, run=RunInfo(0, 1, 0, {"allow": "motion"})),
        ["other-settings allow"],
    ),
    "other claim": (
        lambda r: replace(r, subject=replace(r.subject, claims={"lacks": "jog"})),
        ["other-settings lacks"],
    ),
    "other subject": (
        lambda r: replace(r, subject=replace(r.subject, name="Cell 8")),
        ["other-settings subject"],
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_each_single_change_fails(results: Results, change: str) -> None:
    """Each change is compared with the baseline of the unchanged results."""
    changed, expected = CHANGES[change]
    assert kinds(changed(results), baseline=results) == expected


_VERDICTS = st.sampled_from([Verdict.PASS, Verdict.TOLERATED, Verdict.FAIL])
_JUDGED = ("4.8/1", "4.8/2", "4.8/2.other", "4.15/3", "5.4/5")
_IDS = (*_JUDGED, "3/18.seen-1", "3/18.seen-2")
_RUNS = st.builds(
    lambda verdicts, seed: results_of(
        *(
            failed(name, "the code is {code}", code="07")
            if verdict is Verdict.FAIL
            else Case(name, (name,), verdict)
            for name, verdict in verdicts.items()
        ),
        seed=seed,
    ),
    st.dictionaries(st.sampled_from(_IDS), _VERDICTS, min_size=1),
    st.integers(0, 3),
)


def _with(results: Results, case: Case, *others: Case) -> Results:
    """Return the results with other cases in place of one."""
    cases = [new for each in results.cases for new in (others if each is case else (each,))]
    return results_of(*cases, seed=results.run.seed if results.run else 0)


def _worse(results: Results) -> Iterator[tuple[str, Results, tuple[Waiver, ...]]]:
    """Yield the problem of each single change, with the changed results and the waivers."""
    for case in results.cases:
        judged = case.id in _JUDGED
        if judged:
            yield f"lost-case {case.id}", _with(results, case), ()
            yield f"lost-case {case.id}", _with(results, case, replace(NOT_RUN, id=case.id)), ()
        if case.verdict is Verdict.FAIL:
            other = failed(case.id, "another message")
            yield f"changed-failure {case.id}", _with(results, case, other), ()
            other = failed(case.id, "the code is {code}", code="08")
            yield f"changed-failure {case.id}", _with(results, case, other), ()
            old = waiver(case=case.id, expires=TODAY - timedelta(1))
            yield f"expired-waiver {case.id}", results, (old,)
        else:
            if judged:
                other = failed(case.id, "the code is {code}", code="07")
                yield f"new-failure {case.id}", _with(results, case, other), ()
            yield f"stale-waiver {case.id}", results, (waiver(case=case.id),)
    for each in results.requirements:
        if {*each.cases} <= {*_JUDGED}:
            left = tuple(other for other in results.requirements if other is not each)
            yield f"lost-requirement {each.id}", replace(results, requirements=left), ()
            undecided = tuple(
                replace(other, verdict=Verdict.NONE) if other is each else other
                for other in results.requirements
            )
            yield f"lost-requirement {each.id}", replace(results, requirements=undecided), ()
    added = failed("9/9", "wrong")
    yield "new-failure 9/9", _with(results, results.cases[-1], results.cases[-1], added), ()
    yield "unknown-id 9/9", results, (waiver(case="9/9"),)
    for settings in ({}, {"allow": "motion"}, {"allow": "state", "only": "4"}):
        assert results.run
        changed = replace(results, run=replace(results.run, settings=settings))
        name = "only" if "only" in settings else "allow"
        yield f"other-settings {name}", changed, ()


@given(_RUNS)
def test_each_change_of_any_results_fails(results: Results) -> None:
    """The results pass with their own baseline. After each single change they do not."""
    assert kinds(results, baseline=results) == []
    for problem, changed, waivers in _worse(results):
        assert problem in kinds(changed, *waivers, baseline=results)


def test_what_may_change(results: Results) -> None:
    """Times, the version of the subject, the number of a finding, values with another seed."""
    slower = failed("4.15/3", "the code is {code} after {time_s:.1f} s", code="07", time_s=9.5)
    assert kinds(results_of(PASSED, slower, SEEN), baseline=results) == []
    renumbered = replace(SEEN, id="3/18.seen-7")
    assert kinds(results_of(PASSED, FAILED, renumbered), baseline=results) == []
    newer = replace(results, subject=replace(results.subject, version="1.5"))
    assert kinds(newer, baseline=results) == []
    drawn = failed("4.15/3", "the code is {code} after {time_s:.1f} s", code="08", time_s=1.2)
    assert kinds(results_of(PASSED, drawn, SEEN, seed=7), baseline=results) == []


def test_skipped_after_a_known_failure(results: Results) -> None:
    """A case that did not run because its requirement had failed is not missing."""
    skipped = replace(PASSED, verdict=Verdict.NONE, reason=Reason.FAILED_BEFORE)
    assert kinds(results_of(skipped, FAILED, SEEN), baseline=results) == []


def test_a_fixed_failure_is_reported(results: Results, good: Results) -> None:
    """It is no problem, but the baseline should be updated."""
    found = gate(good, baseline=Baseline.of(results), today=TODAY)
    assert not found.problems
    assert [failure.case for failure in found.fixed] == ["3/18.seen-", "4.15/3"]


def test_waived(results: Results) -> None:
    """A failure is accepted by case or by fingerprint, until the last day."""
    by_fingerprint = waiver(case="", fingerprint=SEEN.fingerprint)
    found = gate(results, waivers=(waiver(), by_fingerprint), today=TODAY)
    assert found.exit_status is ExitStatus.CONFORMANT
    assert found.accepted == {case.id: waiver().note for case in (FAILED, SEEN)}


def test_problems_of_waivers(results: Results, good: Results) -> None:
    """Expired, stale or for an unknown case."""
    expired = waiver(expires=TODAY - timedelta(1))
    assert kinds(results, expired, baseline=results) == ["expired-waiver 4.15/3"]
    assert kinds(good, waiver()) == ["stale-waiver 4.15/3"]
    assert kinds(good, waiver(case="", fingerprint="0" * 16)) == [f"stale-waiver {'0' * 16}"]
    assert kinds(good, waiver(case="4.15/9")) == ["unknown-id 4.15/9"]
    assert kinds(good, waiver(case="3/18.seen-1")) == ["unknown-id 3/18.seen-1"]


def test_flaky(good: Results) -> None:
    """The failure of a flaky waiver may occur, may not occur, or may occur once."""
    flaky = waiver(flaky=True)
    assert kinds(results_of(PASSED, FAILED), flaky) == []
    assert kinds(good, flaky) == []
    once = replace(FAILED, verdict=Verdict.INCONCLUSIVE, reason=Reason.INTERMITTENT)
    found = gate(results_of(PASSED, once), waivers=(flaky,), today=TODAY)
    assert (found.problems, found.undecided) == ((), ())
    strict = gate(results_of(PASSED, once), waivers=(waiver(),), today=TODAY)
    assert strict.exit_status is ExitStatus.INCONCLUSIVE


def test_prevented_by_an_accepted_failure(results: Results) -> None:
    """Such a case is no problem, unless the baseline has judged it."""
    prevented = Case("4.9/2", ("4.9/2",), Verdict.INCONCLUSIVE, reason=Reason.DEPENDENCY)
    run = results_of(PASSED, FAILED, SEEN, prevented)
    known = gate(run, baseline=Baseline.of(results), today=TODAY)
    assert known.exit_status is ExitStatus.CONFORMANT
    judged = results_of(PASSED, FAILED, SEEN, replace(prevented, verdict=Verdict.PASS))
    lost = gate(run, baseline=Baseline.of(judged), today=TODAY)
    assert lost.exit_status is ExitStatus.INCONCLUSIVE
    alone = gate(results_of(PASSED, prevented), today=TODAY)
    assert alone.exit_status is ExitStatus.INCONCLUSIVE


def test_fail_fast_is_incomplete() -> None:
    """Cases after an accepted failure that ended the run are missing."""
    skipped = replace(PASSED, verdict=Verdict.NONE, reason=Reason.FAIL_FAST)
    run = results_of(skipped, FAILED)
    assert gate(run, waivers=(waiver(),), today=TODAY).exit_status is ExitStatus.INCONCLUSIVE
    before = results_of(PASSED, FAILED)
    assert kinds(run, baseline=before) == ["lost-case 4.8/1", "lost-requirement 4.8/1"]


def test_exit_status_without_a_problem(good: Results) -> None:
    """3 if something is inconclusive, 4 if nothing was tested."""
    unsure = Case("4.9/2", ("4.9/2",), Verdict.INCONCLUSIVE, message="the link was lost")
    assert gate(results_of(PASSED, unsure), today=TODAY).exit_status is ExitStatus.INCONCLUSIVE
    assert gate(results_of(), today=TODAY).exit_status is ExitStatus.NOTHING_TESTED
    assert gate(good, today=TODAY).exit_status is ExitStatus.CONFORMANT


def test_old_results() -> None:
    """Failures without fingerprints cannot be compared."""
    with pytest.raises(OldResultsError, match="repeat the run"):
        gate(results_of(replace(FAILED, fingerprint="")), today=TODAY)


def test_baseline_file(results: Results, tmp_path: Path) -> None:
    """A written baseline is read unchanged; results can be used as one; other files are not
    overwritten."""
    path, run = tmp_path / "baseline.json", tmp_path / "results.json"
    baseline = Baseline.of(results)
    baseline.write(path)
    baseline.write(path)
    assert Baseline.read(path) == baseline
    results.write(run)
    assert Baseline.read(run) == baseline
    before = run.read_bytes()
    with pytest.raises(BaselineError, match="is not a baseline"):
        baseline.write(run)
    assert run.read_bytes() == before


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"schema": "scaraspec.baseline/1"}', '{"schema": "other"}', "\0"]
)
def test_invalid_baseline(tmp_path: Path, text: str) -> None:
    """The error names the file."""
    path = tmp_path / "baseline.json"
    path.write_text(text, "utf-8")
    with pytest.raises(BaselineError, match=r"baseline\.json"):
        Baseline.read(path)


VALID = """[[waiver]]
case = "4.15/3"
reason = "a known limit"
issue = "FW-12"
approver = "firmware lead"
expires = 2026-11-26
"""


def test_waivers_file(tmp_path: Path) -> None:
    """All keys except `flaky` are required."""
    path = tmp_path / "waivers.toml"
    path.write_text(VALID, "utf-8")
    assert read_waivers(path) == (waiver(),)
    path.write_text("", "utf-8")
    assert read_waivers(path) == ()


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("[[waiver]]", "[[waver]]", "must contain only"),
        ("[[waiver]]", "[waiver]", "must contain only"),
        ('case = "4.15/3"', "", "either case or fingerprint"),
        ('case = "4.15/3"', 'case = "x"\nfingerprint = "y"', "either case or fingerprint"),
        ("issue", "ticket", "unknown key ticket"),
        ('"a known limit"', '" "', "needs reason"),
        ("2026-11-26", '"2026-11-26"', "needs expires"),
        ("2026-11-26", "2026-11-26T00:00:00", "needs expires"),
        ("expires", "flaky = 1\nexpires", "needs flaky"),
        ('case = "4.15/3"', 'fingerprint = "y"\nflaky = true', "must name its case"),
        ("expires = ", "expires =", ""),
        ("[[waiver]]", "[[waiver", "not valid TOML"),
        ("[[waiver]]", "a = " + "9" * 5000, "not valid TOML"),
        ("[[waiver]]", "a = " + "[" * 5000, "not valid TOML"),
    ],
)
def test_invalid_waivers(tmp_path: Path, old: str, new: str, problem: str) -> None:
    """The message states the mistake and the waiver."""
    path = tmp_path / "waivers.toml"
    path.write_text(VALID.replace(old, new), "utf-8")
    if not problem:
        assert read_waivers(path) == (waiver(),)
        return
    with pytest.raises(WaiverError, match=problem):
        read_waivers(path)


def test_kinds_are_public() -> None:
    """CI scripts may search for these words."""
    assert {kind.value for kind in ProblemKind} == {
        *("new-failure", "changed-failure", "lost-case", "lost-requirement"),
        *("stale-waiver", "expired-waiver", "unknown-id", "other-settings"),
    }
