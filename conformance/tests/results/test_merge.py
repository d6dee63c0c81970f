"""The sittings of one certification are merged."""

import json
from dataclasses import replace

import pytest
from results_of_run import FAILED, PASSED, SEEN, results_of

from scaraspec.judge.verdicts import Conclusion, Reason, Verdict
from scaraspec.report.model import Case, ReadingSeen, Results, Role
from scaraspec.results.merge import MergeError, merge

_DAY_NS = 86_400_000_000_000
FIRST, SECOND = "2023-11-14T22:13:20+00:00", "2023-11-15T22:13:20+00:00"


def sitting(*cases: Case, day: int = 0, only: str = "") -> Results:
    """The results of a sitting on a day."""
    results = results_of(*cases)
    assert results.run
    return replace(
        results,
        run=replace(
            results.run,
            begun_ns=results.run.begun_ns + day * _DAY_NS,
            ended_ns=results.run.ended_ns + day * _DAY_NS,
            settings={**results.run.settings, "only": only},
        ),
    )


def as_(verdict: Verdict, message: str = "") -> Case:
    """The case 4.8/1 with this verdict."""
    return replace(PASSED, verdict=verdict, message=message or verdict.value)


def test_different_cases() -> None:
    """Each case is listed once, with the date of its sitting, in any order of the files."""
    sittings = [sitting(PASSED), sitting(FAILED, SEEN, day=1)]
    merged = merge(sittings[::-1])
    assert [(case.id, case.date) for case in merged.cases] == [
        ("4.8/1", FIRST),
        ("4.15/3", SECOND),
        ("3/18.seen-1", SECOND),
    ]
    assert merged.verdict is Conclusion.NONCONFORMANT
    assert merged.counts[Verdict.FAIL] == 2
    assert {each.id for each in merged.requirements} == {"4.8/1", "4.15/3", "3/18"}
    assert merged.causes
    assert merged.notices[0] == f"Merged from the sittings of {FIRST}, {SECOND}"
    assert Results.from_json(merged.to_json()) == merged


@pytest.mark.parametrize(
    ("first", "second", "counts", "date"),
    [
        (Verdict.FAIL, Verdict.PASS, Verdict.FAIL, FIRST),
        (Verdict.PASS, Verdict.FAIL, Verdict.FAIL, SECOND),
        (Verdict.FAIL, Verdict.FAIL, Verdict.FAIL, SECOND),
        (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.FAIL, FIRST),
        (Verdict.INCONCLUSIVE, Verdict.PASS, Verdict.PASS, SECOND),
        (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.PASS, FIRST),
        (Verdict.TOLERATED, Verdict.PASS, Verdict.TOLERATED, FIRST),
        (Verdict.ERROR, Verdict.PASS, Verdict.PASS, SECOND),
    ],
)
def test_rule(first: Verdict, second: Verdict, counts: Verdict, date: str) -> None:
    """A failure decides, then a verdict, then the latest result; both are listed."""
    (case,) = merge([sitting(as_(first)), sitting(as_(second), day=1)]).cases
    assert (case.verdict, case.date) == (counts, date)
    assert [(each.date, each.verdict) for each in case.sittings] == [
        (FIRST, first),
        (SECOND, second),
    ]


def test_conflicts_are_named() -> None:
    """A failure that another sitting did not find has a notice, and so has the decision."""
    other = replace(FAILED, verdict=Verdict.INCONCLUSIVE)
    merged = merge(
        [
            sitting(as_(Verdict.FAIL), other),
            sitting(as_(Verdict.PASS), replace(other, verdict=Verdict.PASS), day=1),
        ]
    )
    counts = "the failure counts"
    assert merged.notices[1:] == (
        f"4.8/1 failed in the sitting of {FIRST} and passed in that of {SECOND}: {counts}",
        "1 cases that were inconclusive in one sitting were decided in another",
    )


def test_a_case_that_did_not_run() -> None:
    """The result of a sitting in which the case ran has priority."""
    (case,) = merge([sitting(as_(Verdict.PASS)), sitting(as_(Verdict.NONE), day=1)]).cases
    assert (case.verdict, case.sittings) == (Verdict.PASS, ())
    (case,) = merge([sitting(as_(Verdict.NONE)), sitting(as_(Verdict.NONE), day=1)]).cases
    assert (case.verdict, case.date) == (Verdict.NONE, SECOND)


def test_merged_again() -> None:
    """A merge of a merge keeps each date."""
    merged = merge([sitting(as_(Verdict.FAIL)), sitting(as_(Verdict.PASS), day=1)])
    (case,) = merge([merged, sitting(as_(Verdict.PASS), day=2)]).cases
    assert (case.date, len(case.sittings)) == (FIRST, 3)


def test_findings_are_numbered_again() -> None:
    """Equal findings are listed once."""
    other = replace(SEEN, fingerprint="other")
    merged = merge([sitting(SEEN), sitting(other, replace(SEEN, id="3/18.seen-2"), day=1)])
    assert [case.id for case in merged.cases] == ["3/18.seen-1", "3/18.seen-2"]


def test_readings_and_undecided() -> None:
    """Options of different sittings contradict each other; counts are added."""
    little = ReadingSeen(("little",), default=True, mixed=False, claimed="little")
    big = ReadingSeen(("big",), default=False, mixed=False)
    merged = merge(
        [
            replace(sitting(PASSED), readings={"controller": {"endian": little}}),
            replace(
                sitting(PASSED, day=1),
                readings={"controller": {"endian": big, "jog_byte": big}},
                undecided={"3/31": 2},
            ),
        ]
    )
    mixed = ReadingSeen(("little", "big"), default=False, mixed=True, claimed="little")
    assert merged.readings == {"controller": {"endian": mixed, "jog_byte": big}}
    assert merged.undecided == {"3/31": 2}


def test_an_interruption_completed_by_another_sitting() -> None:
    """An interrupted sitting is no problem if other sittings ran all of its cases."""
    interrupted = replace(
        as_(Verdict.INCONCLUSIVE), id="run.interrupted", requirements=(), reason=Reason.INTERRUPTED
    )
    done = replace(PASSED, id="4.7/2", requirements=("4.7/2",))
    other = replace(PASSED, id="4.8/2", requirements=("4.8/2",))
    first = sitting(done, interrupted, only="4.7/2,4.8/2")
    second = sitting(other, day=1, only="4.8/2")
    more = sitting(replace(other, id="4.8/2.more"), day=2, only="4.8/2")
    merged = merge([first, second])
    assert (merged.verdict, merged.run.settings["only"] if merged.run else "") == (
        Conclusion.CONFORMANT,
        "4.7/2,4.8/2",
    )
    assert merge([first, more]).verdict is Conclusion.INCONCLUSIVE


def test_the_coverage_of_a_sitting_does_not_count() -> None:
    """Another sitting may judge what one sitting did not."""
    coverage = replace(as_(Verdict.INCONCLUSIVE), id="run.coverage", requirements=())
    merged = merge([sitting(coverage), sitting(PASSED, day=1)])
    assert merged.verdict is Conclusion.CONFORMANT


def test_an_operator_may_be_present_in_one_sitting() -> None:
    """An operator of a controller only adds cases; of a client, an operator replaces the driver."""
    first, second = sitting(PASSED), sitting(PASSED, day=1)
    assert second.run
    settings = {**second.run.settings, "attended": "true"}
    attended = replace(second, run=replace(second.run, settings=settings))
    assert merge([first, attended])
    with pytest.raises(MergeError, match="attended was"):
        merge([replace(each, role=Role.CLIENT) for each in (first, attended)])


def test_refusals() -> None:
    """Another build, ICS, option, version or role, and the same sitting twice."""
    first, second = sitting(PASSED), sitting(PASSED, day=1)
    assert second.run
    subject = second.subject
    for other, expected_text in (
        (replace(second, subject=replace(subject, version="1.5")), "version was 1.4 and is 1.5"),
        (replace(second, subject=replace(subject, name="Cell 8")), "was Cell 7 and is Cell 8"),
        (replace(second, subject=replace(subject, claims={"lacks": "jog"})), "lacks was not given"),
        (replace(second, role=Role.CLIENT), "role was controller and is client"),
        (replace(second, tool=replace(second.tool, version="0.3")), "version of scaraspec was"),
        (replace(second, run=replace(second.run, seed=4)), "seed was 0 and is 4"),
        (replace(second, run=replace(second.run, settings={})), "allow was state and is not given"),
        (replace(second, run=None), "schema 1"),
        (first, "the same sitting"),
    ):
        with pytest.raises(MergeError, match=expected_text):
            merge([first, other])
    unnamed = [replace(r, subject=replace(subject, name="", link=r"a")) for r in (first, second)]
    assert merge(unnamed)
    unnamed[1] = replace(unnamed[1], subject=replace(subject, name="", link="b"))
    with pytest.raises(MergeError, match="link was a and is b"):
        merge(unnamed)
    captures = [replace(each, role=Role.CAPTURE) for each in (first, second)]
    with pytest.raises(MergeError, match="results of an audit"):
        merge(captures)


def test_the_file_has_the_dates() -> None:
    """results.json contains the date of each case and the list of sittings."""
    merged = merge([sitting(as_(Verdict.FAIL)), sitting(as_(Verdict.PASS), day=1)])
    (case,) = json.loads(merged.to_json())["cases"]
    assert case["date"] == FIRST
    assert [each["verdict"] for each in case["sittings"]] == ["fail", "pass"]
