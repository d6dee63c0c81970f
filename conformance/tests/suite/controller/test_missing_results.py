"""Missing results: a run ends soon although the controller sends no final results."""

import pytest
from fast_simulator import FastSimulator

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Cause, Conclusion, Reason, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import PASSWORD, Robot, prove_controller
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run

_CASES = "4.8/4,4.15/5,6.5/20"
_LONG_CASE = "5.4/5"


def _results(clauses: str, fault: str = "") -> Results:
    only = frozenset(requirement.id for requirement in select(clauses))
    options = Options(only=only, allowed=ALL, examples=1)
    return prove_controller(options, mutants()[fault] if fault else None)


def _duration_s(results: Results) -> float:
    """Return the simulated duration of a run."""
    return (results.run.ended_ns - results.run.begun_ns) / 1e9


@pytest.mark.parametrize(
    "fault", ["run-has-no-result", "run-ends-untagged", "tag-behind-the-opcode"]
)
def test_run_without_final_results_ends_soon(fault: str) -> None:
    """A run takes at most a minute more than five times the duration of a good one.

    The status shows that the program of the right layout has waited, so no other layout is tried.
    """
    cases = f"{_CASES},{_LONG_CASE}"
    results = _results(cases, fault)
    verdicts = {each.id: each.verdict for each in results.requirements}
    assert verdicts["4.15/5"] is Verdict.FAIL
    assert results.readings["controller"]["prog_layout"].options == ("ilp32",)
    assert _duration_s(results) < 60 + 5 * _duration_s(_results(cases))


def test_a_fast_simulator_without_final_results() -> None:
    """Its status is queried as often in its own time, so no other layout is tried."""

    wrong = mutants()["run-ends-under-its-neighbour"].wrong
    fast = type("Fast", (FastSimulator, wrong), {})
    options = Options(frozenset({"4.15/5"}), allowed=ALL, examples=1)
    ics = Ics(time_scale=FastSimulator.SCALE)
    access = MemoryAccess(Robot(fast, DEFAULT).network)
    results = Run(ControllerAdapter(access, ics, PASSWORD, options)).results()
    (verdict,) = (each.verdict for each in results.requirements if each.id == "4.15/5")
    assert verdict is Verdict.FAIL
    assert _duration_s(results) < 60


def test_cases_are_inconclusive_after_the_wait_budget() -> None:
    """A case that needs a final result then names the case that has shown that there is none."""
    results = _results(_CASES, "run-has-no-result")
    failed = [
        case.id
        for case in results.cases
        if "4.15/5" in case.requirements and case.verdict is Verdict.FAIL
    ]
    later = [case for case in results.cases if case.id.startswith("6.5/20")]
    assert {(case.verdict, case.cause, case.reason) for case in later} == {
        (Verdict.INCONCLUSIVE, Cause.DEPENDENCY, Reason.DEPENDENCY)
    }
    assert all(f"failed already in case {failed[0]}" in case.message for case in later)
    assert results.verdict is Conclusion.NONCONFORMANT
