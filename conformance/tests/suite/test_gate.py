"""A gate leaves out what takes long, and no requirement."""

from scaraspec.cli.prove.controller import Robot, certified
from scaraspec.controller.brain import Brain
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import collect
from scaraspec.suite.statement import Statement


def test_every_requirement_is_judged_by_a_case_that_is_not_slow() -> None:
    """So is each of those that are judged without a hook."""
    unhooked = [case for case in collect(Options()) if not case.needs]
    everything = {requirement for case in unhooked for requirement in case.requirements}
    quick = {requirement for case in unhooked if not case.slow for requirement in case.requirements}
    assert quick == everything
    assert any(case.slow for case in unhooked)


def test_what_is_slow_is_not_run() -> None:
    """It is told as not run, and why; what judges the same is run."""
    options = Options(frozenset({"4.5/6"}), ALL, gate=True)
    results = certified(Robot(Brain, DEFAULT), Statement(), options)
    cases = {case.id: case for case in results.cases}
    assert cases["4.5/6.new-year"].verdict is Verdict.NONE
    assert "--gate" in cases["4.5/6.new-year"].message
    assert cases["4.5/6"].verdict is Verdict.PASS
