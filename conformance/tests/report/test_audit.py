"""Conversion of the findings of a judge to results."""

from collections import Counter
from collections.abc import Callable

import pytest

from scaraspec.judge.judge import Judge
from scaraspec.judge.requirements import REQUIREMENTS, Method
from scaraspec.judge.verdicts import Cause, Conclusion, Finding, Verdict
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.audit import from_audit
from scaraspec.report.model import ReadingSeen, Results, Role, Subject
from scaraspec.report.session import SessionStats
from scaraspec.traffic.wire import WireRange

SUBJECT = Subject(Role.CAPTURE, file="x.pcapng")


def failure(message: str, at: int = 0) -> Finding:
    """Return a failure of 3/18 at one position."""
    place = WireRange("1", C2A, at, 5, at)
    return Finding("3/18", Verdict.FAIL, Cause.SUBJECT, message, "one", "two", (place,))


def results_of(*findings: Finding, passes: int = 0, failures: int | None = None) -> Results:
    """Return the results of a judge with these findings for 3/18."""
    judge = Judge()
    tally = judge.tallies["3/18"]
    tally.passes = passes
    tally.findings.extend(findings)
    tally.others.update(finding.verdict for finding in findings)
    if failures is not None:
        tally.others[Verdict.FAIL] = failures
    return from_audit(judge, SessionStats(), subject=SUBJECT, replay="scaraspec audit x.pcapng")


@pytest.mark.parametrize(
    ("capture", "requirement", "frame_hex"),
    [
        ("complaint-1", "3/18", "CC9030023131AA"),
        ("complaint-4", "5.1/4", None),
    ],
)
def test_field_complaints(
    audited: Callable[[str], Results], capture: str, requirement: str, frame_hex: str | None
) -> None:
    """The requirement fails, and the frame is in the evidence."""
    results = audited(capture)
    case = next(case for case in results.cases if case.id == requirement)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert (case.verdict, case.requirements, case.cause) == (
        Verdict.FAIL,
        (requirement,),
        Cause.SUBJECT,
    )
    assert case.expected
    assert case.observed
    frames = [evidence.frame_hex for evidence in case.wire]
    assert frame_hex in frames if frame_hex else all(frames)
    assert case.replay == f"scaraspec audit {capture}.pcapng"


def test_a_conforming_capture(
    audited: Callable[[str], Results],
) -> None:
    """Each judged requirement has a case, and the counts are those of the cases."""
    results = audited("plant-b-other-dialect")
    assert results.verdict is Conclusion.NO_VIOLATION
    assert results.label.startswith("no violation found (2")
    assert results.counts[Verdict.TOLERATED] >= 2
    assert Counter(case.verdict for case in results.cases) == +Counter(results.counts)
    judged = {r.id for r in results.requirements if r.verdict is not Verdict.NONE}
    assert judged == {r for case in results.cases for r in case.requirements}
    assert all(case.hazard is Hazard.READ_ONLY for case in results.cases)


def test_the_scope_of_a_capture(audited: Callable[[str], Results]) -> None:
    """Requirements that were not judged are listed as such."""
    ids = [r.id for r in audited("complaint-2").requirements]
    assert ids == [r.id for r in REQUIREMENTS.values() if Method.PASSIVE in r.testable]


def test_requirements_list_their_cases(audited: Callable[[str], Results]) -> None:
    """Every case belongs to its requirement, which has the worst verdict."""
    results = audited("complaint-1")
    cases = {case.id: case for case in results.cases}
    named = [case for requirement in results.requirements for case in requirement.cases]
    assert named == list(cases)
    for requirement in results.requirements:
        verdicts = {cases[case].verdict for case in requirement.cases} or {Verdict.NONE}
        assert requirement.verdict in verdicts


def test_readings_of_each_side(audited: Callable[[str], Results]) -> None:
    """The options, and whether they are the default."""
    readings = audited("plant-b-other-dialect").readings
    assert readings["client"]["endian"] == ReadingSeen(("big",), default=False, mixed=False)
    assert readings["controller"]["err_bare0"] == ReadingSeen(
        ("0|code",), default=True, mixed=False
    )


def test_claimed_readings() -> None:
    """A claim without evidence is listed, too."""
    judge = Judge()
    results = from_audit(judge, SessionStats(), subject=SUBJECT, claims={"loop_iter": "counts"})
    assert results.readings["controller"] == {
        "loop_iter": ReadingSeen((), default=False, mixed=False, claimed="counts")
    }
    assert results.readings["client"] == {}


def test_a_pass_has_a_count() -> None:
    """A pass is a case, so that a run without cases is never a pass."""
    (case,) = results_of(passes=12).cases
    assert (case.id, case.verdict, case.message) == ("3/18", Verdict.PASS, "met 12 times")
    assert (case.cause, case.wire) == (None, ())


def test_equal_findings_are_one_case() -> None:
    """A frequent fault is listed once, with all positions."""
    (case,) = results_of(*(failure("twice", at) for at in range(3)), passes=5).cases
    assert case.message == "twice (3 times)"
    assert [evidence.offset_bytes for evidence in case.wire] == [0, 1, 2]


def test_different_findings_are_separate_cases() -> None:
    """The worst has the id of the requirement, the others have a suffix."""
    tolerated = [
        Finding("3/18", Verdict.TOLERATED, Cause.SUBJECT, m, reading=("endian", "big"))
        for m in ("57 bytes", "58 bytes")
    ]
    results = results_of(*tolerated, failure("run ended twice"), failure("reset ended twice"))
    printed = [(case.id, case.verdict, case.message, case.observed) for case in results.cases]
    assert printed == [
        ("3/18", Verdict.FAIL, "run ended twice", "two"),
        ("3/18.2", Verdict.FAIL, "reset ended twice", "two"),
        ("3/18.3", Verdict.TOLERATED, "57 bytes (2 times)", "endian = big"),
    ]
    requirement = next(r for r in results.requirements if r.id == "3/18")
    assert requirement.cases == ("3/18", "3/18.2", "3/18.3")


def test_findings_beyond_the_limit_are_counted() -> None:
    """A judge stores the first fifty; the message states "at least"."""
    findings = [failure("twice", at) for at in range(50)]
    (case,) = results_of(*findings, failures=70).cases
    assert case.message == "twice (at least 50 times)"
    assert len(case.wire) < 50


def test_no_judged_requirement_is_nothing_tested() -> None:
    """Without a case there is no conformance."""
    results = from_audit(Judge(), SessionStats(), subject=SUBJECT)
    assert results.verdict is Conclusion.NOTHING_TESTED
    assert set(results.counts.values()) == {0}
    assert results.session is None
    assert results.tool.name == "scaraspec"
