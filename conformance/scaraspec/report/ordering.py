"""Ordering of cases by importance, and an additional case for the verdict of the whole run.

All writers use this module, so that they show the same cases.
"""

from collections.abc import Iterable
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS, Basis, Strength
from scaraspec.judge.verdicts import Cause, Conclusion, Verdict
from scaraspec.report.model import SEEN, Case, Results
from scaraspec.user_message import UserMessage

VERDICTS_BY_IMPORTANCE: Final = (
    Verdict.FAIL,
    Verdict.ERROR,
    Verdict.INCONCLUSIVE,
    Verdict.TOLERATED,
    Verdict.PASS,
    Verdict.NONE,
)
"""The verdicts, the most important first."""

UNSETTLED: Final = frozenset({Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE})
"""The verdicts of cases for which a run is not conformant."""

_STRENGTHS, _BASES = list(Strength), list(Basis)


def most_important_first(results: Results) -> list[Case]:
    """Return the cases by importance: failures first, firm and stated requirements first.

    Among equals, findings of the judge on the wire come first, because they may be the cause of a
    failed case.
    """

    def key(case: Case) -> tuple[int, int, int, bool]:
        judged = () if case.verdict is Verdict.PASS else case.requirements
        known = [REQUIREMENTS[r] for r in judged if r in REQUIREMENTS]
        return (
            VERDICTS_BY_IMPORTANCE.index(case.verdict),
            min((_STRENGTHS.index(r.strength) for r in known), default=len(_STRENGTHS)),
            min((_BASES.index(r.basis) for r in known), default=len(_BASES)),
            SEEN not in case.id,
        )

    return sorted(results.cases, key=key)


def group_equal_cases(cases: Iterable[Case]) -> list[tuple[Case, int]]:
    """Group cases with equal verdict and message; return the first case and the count of others."""
    groups: dict[tuple[Verdict, str], list[Case]] = {}
    for case in cases:
        groups.setdefault((case.verdict, case.message), []).append(case)
    return [(group[0], len(group) - 1) for group in groups.values()]


def cases_for_machines(results: Results) -> list[Case]:
    """Return the cases for formats that have no verdict of the whole run.

    If the run is not conformant but no case shows this, such as in a run that tested nothing, an
    additional case is added, so that the run does not pass.
    """
    cases = list(results.cases)
    if results.verdict.good or any(c.verdict in UNSETTLED for c in cases):
        return cases
    message: str = UserMessage(
        "the run is {verdict}, although no case shows a reason",
        verdict=UserMessage.word(results.verdict.value),
    )
    if results.verdict is Conclusion.NOTHING_TESTED:
        message = "nothing was tested: no requirement could be judged"
    whole = Case("verdict", (), Verdict.INCONCLUSIVE, Cause.SET_UP, message=message)
    return [whole, *cases]
