"""Wait budget: how long the failing cases of a run may wait for missing replies."""

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.wait_budget import WaitBudget

_REQUIREMENT = "4.15/5"


def _outcome(name: str, verdict: Verdict) -> Outcome:
    requirement = _REQUIREMENT if verdict is Verdict.FAIL else ""
    return Outcome(Case(name, (name,), frozenset({Hazard.MOTION})), verdict, requirement)


@pytest.mark.parametrize("verdict", [Verdict.PASS, Verdict.TOLERATED])
@pytest.mark.parametrize(("waited_s", "dependency"), [(100.0, ""), (100.1, "4.8/4")])
def test_budget_is_a_multiple_of_the_passing_cases(
    verdict: Verdict, waited_s: float, dependency: str
) -> None:
    """The budget is four times the duration of the passing cases plus 60 s."""
    budget = WaitBudget()
    budget.end_case(_outcome("4.7/2", verdict), 10, late=False)
    budget.end_case(_outcome("4.8/4", Verdict.FAIL), waited_s, late=True)
    assert not budget.dependency(_REQUIREMENT), "it does not change during a case"
    budget.begin_case()
    assert budget.dependency(_REQUIREMENT) == dependency


def test_budget_counts_only_missing_replies() -> None:
    """A failure without a missing reply uses nothing of the budget."""
    budget = WaitBudget()
    budget.end_case(_outcome("4.8/4", Verdict.FAIL), 1000, late=False)
    budget.begin_case()
    assert not budget.dependency(_REQUIREMENT)


def test_dependency_has_failed_the_same_requirement() -> None:
    """The first case that failed the requirement is named; for other requirements there is none."""
    budget = WaitBudget()
    for name in ("4.8/4", "4.9/2"):
        budget.end_case(_outcome(name, Verdict.FAIL), 1000, late=True)
    budget.begin_case()
    assert budget.dependency(_REQUIREMENT) == "4.8/4"
    assert not budget.dependency("4.16/3")
