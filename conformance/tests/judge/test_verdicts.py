"""Verdicts only rise, a cause is always stated, and a run that tested nothing does not pass."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.judge.verdicts import (
    Cause,
    Conclusion,
    ExitStatus,
    Finding,
    Verdict,
    conclude,
    worst,
)

NONE, PASS, TOLERATED, INCONCLUSIVE, FAIL, ERROR = Verdict

verdicts = st.lists(st.sampled_from(Verdict))
counts = st.dictionaries(st.sampled_from(Verdict), st.integers(min_value=0, max_value=500))


@pytest.mark.parametrize(
    ("lesser", "graver"),
    [
        (NONE, PASS),
        (PASS, TOLERATED),
        (TOLERATED, INCONCLUSIVE),
        (INCONCLUSIVE, FAIL),
        (FAIL, ERROR),
    ],
)
def test_order_of_verdicts(lesser: Verdict, graver: Verdict) -> None:
    """None < pass < tolerated < inconclusive < fail < error, in any order."""
    assert worst([lesser, graver]) is graver
    assert worst([graver, lesser]) is graver


def test_nothing_judged_is_none() -> None:
    """No evidence gives no pass."""
    assert worst([]) is NONE


@given(verdicts, verdicts)
def test_more_evidence_never_lowers_a_verdict(seen: list[Verdict], more: list[Verdict]) -> None:
    """Judging in parts gives the same result as judging at once."""
    whole = worst(seen + more)
    assert worst([worst(seen), worst(more)]) is whole
    assert worst([whole, worst(seen)]) is whole
    assert whole in [*seen, *more, NONE]


@pytest.mark.parametrize(
    ("counted", "conclusion", "status"),
    [
        ({PASS: 3}, Conclusion.CONFORMANT, 0),
        ({TOLERATED: 1, NONE: 9}, Conclusion.CONFORMANT, 0),
        ({PASS: 300, FAIL: 1}, Conclusion.NONCONFORMANT, 1),
        ({FAIL: 1, ERROR: 1, INCONCLUSIVE: 1}, Conclusion.NONCONFORMANT, 1),
        ({PASS: 300, INCONCLUSIVE: 1}, Conclusion.INCONCLUSIVE, 3),
        ({PASS: 300, ERROR: 1}, Conclusion.INCONCLUSIVE, 3),
        ({NONE: 401}, Conclusion.NOTHING_TESTED, 4),
        ({PASS: 0, FAIL: 0}, Conclusion.NOTHING_TESTED, 4),
        ({}, Conclusion.NOTHING_TESTED, 4),
    ],
)
def test_conclusion_of_a_run(
    counted: dict[Verdict, int], conclusion: Conclusion, status: int
) -> None:
    """A proven failure outweighs an error of the suite; a run that tested nothing is not
    conformant."""
    assert conclude(counted) is conclusion
    assert conclusion.exit_status == status


def test_exit_status_2_is_left_to_wrong_arguments() -> None:
    """No conclusion of a run has the exit status for wrong arguments."""
    concluded = {conclusion.exit_status for conclusion in Conclusion}
    assert set(ExitStatus) - concluded == {ExitStatus(2)} == {ExitStatus.USAGE}


@given(counts)
def test_conformant_runs_have_passes_and_nothing_undecided(counted: dict[Verdict, int]) -> None:
    """Every conformant run has a pass and no inconclusive verdict or error."""
    green = conclude(counted) is Conclusion.CONFORMANT
    judged = counted.get(PASS, 0) + counted.get(TOLERATED, 0)
    unsettled = sum(counted.get(verdict, 0) for verdict in (INCONCLUSIVE, FAIL, ERROR))
    assert green == (judged > 0 and unsettled == 0)


def test_a_toleration_names_its_reading() -> None:
    """A tolerated finding without a reading is an error."""
    with pytest.raises(ValueError, match=r"4\.9/7 must name the reading"):
        Finding("4.9/7", TOLERATED, Cause.SUBJECT, "The reply is 0||.")
    found = Finding(
        "4.9/7", TOLERATED, Cause.SUBJECT, "The reply is 0||.", reading=("runinfo_none", "0||")
    )
    assert found.reading == ("runinfo_none", "0||")


@pytest.mark.parametrize("cause", [Cause.SET_UP, Cause.DEPENDENCY, Cause.SUITE])
def test_only_the_subject_can_fail(cause: Cause) -> None:
    """Other causes give inconclusive or error, never fail."""
    with pytest.raises(ValueError, match=f"not the {cause.value}"):
        Finding("4.1/2", FAIL, cause, "The login was not answered.")
    assert Finding("4.1/2", INCONCLUSIVE, cause, "No answer was seen.").cause is cause
