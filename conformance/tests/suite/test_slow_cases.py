"""Without --exhaustive, slow cases are skipped, and every requirement is still judged."""

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import Robot, certified
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options, skip_reason
from scaraspec.virtual_controller.core import ControllerCore


@pytest.mark.parametrize("undefined", [False, True])
@pytest.mark.parametrize("hazard_count", range(1, len(Hazard) + 1))
def test_every_requirement_is_still_judged(hazard_count: int, *, undefined: bool) -> None:
    """For each set of allowed hazards, other cases judge the requirements of the slow cases."""
    options = Options(allowed=frozenset(list(Hazard)[:hazard_count]), undefined=undefined)
    cases = [case for case in collect(options) if not skip_reason(case, options, Ics())]
    everything = {requirement for case in cases for requirement in case.requirements}
    quick = {requirement for case in cases if not case.slow for requirement in case.requirements}
    assert quick == everything
    assert any(case.slow for case in cases)


def test_slow_cases_are_skipped() -> None:
    """A slow case is reported as skipped with a reason; other cases of its requirement run."""
    options = Options(frozenset({"4.5/6"}), ALL, brief=True)
    results = certified(Robot(ControllerCore, DEFAULT), Ics(), options)
    cases = {case.id: case for case in results.cases}
    assert cases["4.5/6.new-year"].verdict is Verdict.NONE
    assert "--exhaustive" in cases["4.5/6.new-year"].message
    assert cases["4.5/6"].verdict is Verdict.PASS
