"""Order of cases, and the additional case for the verdict of a run."""

from dataclasses import replace

import pytest

from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.report.model import Case, Results
from scaraspec.report.ordering import cases_for_machines, group_equal_cases, most_important_first


def test_failures_come_first_and_passes_last(full: Results) -> None:
    """The most important cases are first."""
    assert [case.verdict for case in most_important_first(full)] == [
        Verdict.FAIL,
        Verdict.ERROR,
        Verdict.INCONCLUSIVE,
        Verdict.TOLERATED,
        Verdict.PASS,
        Verdict.NONE,
    ]


def test_stated_requirements_come_before_derived_ones(full: Results) -> None:
    """The order of failures is firm and stated, firm and derived, tolerant, unknown."""
    ids = ("9/9", "5.2/17", "3/18", "3/1")
    cases = tuple(Case(i, (i,), Verdict.FAIL, Cause.SUBJECT) for i in ids)
    printed = most_important_first(replace(full, cases=cases))
    assert [case.id for case in printed] == ["3/1", "3/18", "5.2/17", "9/9"]


def test_findings_on_the_wire_come_before_failed_cases(full: Results) -> None:
    """Among failures of equal importance; equal messages are listed once."""
    ids = ("5.3/4.a", "5.3/4.b", "5.3/4.seen-1")
    cases = tuple(Case(i, ("5.3/4",), Verdict.FAIL, message=i[:7]) for i in ids)
    printed = most_important_first(replace(full, cases=cases))
    assert [case.id for case in printed] == ["5.3/4.seen-1", "5.3/4.a", "5.3/4.b"]
    alike = [replace(case, message="so") for case in printed[1:]]
    assert group_equal_cases([printed[0], *alike]) == [(printed[0], 0), (alike[0], 1)]


def test_passes_keep_the_order_of_the_document(full: Results) -> None:
    """They have equal importance."""
    cases = tuple(Case(i, (i,), Verdict.PASS) for i in ("3/18", "3/1", "9/9"))
    printed = most_important_first(replace(full, cases=cases))
    assert [case.id for case in printed] == ["3/18", "3/1", "9/9"]


@pytest.mark.parametrize("verdict", [Conclusion.NOTHING_TESTED, Conclusion.INCONCLUSIVE])
def test_a_run_that_is_not_conformant_has_such_a_case(full: Results, verdict: Conclusion) -> None:
    """Programs that count failures and errors find at least one."""
    passes = (Case("3/1", ("3/1",), Verdict.PASS),)
    for cases in ((), passes):
        first, *others = cases_for_machines(replace(full, verdict=verdict, cases=cases))
        assert (first.id, first.verdict) == ("verdict", Verdict.INCONCLUSIVE)
        assert tuple(others) == cases


def test_no_additional_case(full: Results) -> None:
    """If there are failures, or the run is conformant."""
    passes = (Case("3/1", ("3/1",), Verdict.PASS),)
    conformant = replace(full, verdict=Conclusion.CONFORMANT, cases=passes)
    assert cases_for_machines(full) == list(full.cases)
    assert cases_for_machines(conformant) == list(passes)
