"""Repeated cases: which cases the reproduction command of a finding runs."""

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.repeated_cases import MAX_S, repeated_cases


def _outcome(
    name: str,
    *requirements: str,
    verdict: Verdict = Verdict.PASS,
    hazard: Hazard = Hazard.STATE,
    duration_s: float = 1.0,
) -> Outcome:
    case = Case(name, requirements, frozenset({hazard}))
    return Outcome(case, verdict, duration_s=duration_s)


_FOUND = _outcome("4.20/3.decimals", "4.20/3", verdict=Verdict.FAIL)


def test_earlier_cases_of_the_requirement_precede_the_case() -> None:
    """Cases that passed the requirement are repeated in their order, and no later ones."""
    outcomes = (
        _outcome("4.20/3", "4.20/3"),
        _outcome("4.20/4", "4.20/4"),
        _outcome("4.20/5.tolerated", "4.20/5", "4.20/3", verdict=Verdict.TOLERATED),
        _outcome("4.20/3.skipped", "4.20/3", verdict=Verdict.NONE),
        _FOUND,
        _outcome("4.20/3.later", "4.20/3"),
    )
    repeated = repeated_cases("4.20/3.decimals", "4.20/3", outcomes)
    assert repeated == ("4.20/3", "4.20/5.tolerated", "4.20/3.decimals")


def test_case_alone_is_repeated_if_nothing_precedes_it() -> None:
    """The command of the first case of a requirement names only this case."""
    outcomes = (_outcome("4.20/4", "4.20/4"), _FOUND)
    assert repeated_cases("4.20/3.decimals", "4.20/3", outcomes) == ("4.20/3.decimals",)
    assert repeated_cases("4.1/2", "4.1/2", ()) == ("4.1/2",)


def test_repeated_cases_are_short_and_no_more_hazardous() -> None:
    """The last ones are repeated that take 20 s together, without those that endanger more."""
    outcomes = (
        _outcome("4.20/3.first", "4.20/3"),
        _outcome("4.20/3.long", "4.20/3", duration_s=MAX_S),
        _outcome("4.20/3.moves", "4.20/3", hazard=Hazard.MOTION),
        _outcome("4.20/3.reads", "4.20/3", hazard=Hazard.READ_ONLY),
        _FOUND,
    )
    repeated = repeated_cases("4.20/3.decimals", "4.20/3", outcomes)
    assert repeated == ("4.20/3.reads", "4.20/3.decimals")
