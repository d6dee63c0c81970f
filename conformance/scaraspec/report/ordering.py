"""The order in which a reader wants the cases, and the one case that a run as a whole may need.

Every writer takes its cases from here, so that they all tell the same.
"""

from collections.abc import Iterable
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS, Basis, Strength
from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.report.model import SEEN, Case, Results
from scaraspec.user_message import UserMessage

TELLING: Final = (
    Verdict.FAIL,
    Verdict.ERROR,
    Verdict.INCONCLUSIVE,
    Verdict.TOLERATED,
    Verdict.PASS,
    Verdict.NONE,
)
"""The verdicts, those first whose cases a reader wants first."""

UNSETTLED: Final = frozenset({Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE})
"""The verdicts that keep a run from being conformant."""

_STRENGTHS, _BASES = list(Strength), list(Basis)


def most_telling_first(results: Results) -> list[Case]:
    """The cases, failures before all others; what is firm and stated before what is derived.

    Of equals what the judge saw on the wire comes first: a case may fail for what another shows.
    """

    def key(case: Case) -> tuple[int, int, int, bool]:
        judged = () if case.verdict is Verdict.PASS else case.requirements
        known = [REQUIREMENTS[r] for r in judged if r in REQUIREMENTS]
        return (
            TELLING.index(case.verdict),
            min((_STRENGTHS.index(r.strength) for r in known), default=len(_STRENGTHS)),
            min((_BASES.index(r.basis) for r in known), default=len(_BASES)),
            SEEN not in case.id,
        )

    return sorted(results.cases, key=key)


def told_once(cases: Iterable[Case]) -> list[tuple[Case, int]]:
    """Of cases that say the same the first, and how many others say it."""
    alike: dict[tuple[Verdict, str], list[Case]] = {}
    for case in cases:
        alike.setdefault((case.verdict, case.message), []).append(case)
    return [(same[0], len(same) - 1) for same in alike.values()]


def cases_for_machines(results: Results) -> list[Case]:
    """The cases for formats that have no verdict of the whole run: never green where it is not.

    A run that is not conformant though none of its cases says so, such as one that tested nothing,
    gets one case more.
    """
    cases = list(results.cases)
    if results.verdict is Conclusion.CONFORMANT or any(c.verdict in UNSETTLED for c in cases):
        return cases
    message: str = UserMessage(
        "the run as a whole is {verdict_value}, though no case of it says so",
        verdict_value=results.verdict.value,
    )
    if results.verdict is Conclusion.NOTHING_TESTED:
        message = "nothing was tested: no requirement could be judged"
    whole = Case("verdict", (), Verdict.INCONCLUSIVE, Cause.SET_UP, message=message)
    return [whole, *cases]
