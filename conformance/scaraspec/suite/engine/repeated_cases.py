"""Repeated cases: which cases the reproduction command of a finding runs.

A fault may depend on what was sent before, such as the thirtieth setting. Then its case alone does
not fail on a robot that was switched on again, and the cases that sent the same before must run,
too. This module knows no command line.
"""

from collections.abc import Sequence
from typing import Final

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.engine.outcome import Outcome

MAX_S: Final = 20.0
"""How long the earlier cases may have taken together, in seconds."""

_PASSED: Final = (Verdict.PASS, Verdict.TOLERATED)


def repeated_cases(found: str, requirement: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Return the ids of the cases to repeat: earlier ones with the same requirement, and the case.

    The earlier ones have passed, although they judge the requirement, so the fault may depend on
    them. The last of them are named, until `MAX_S` is used up. None is more hazardous, or needs an
    operator.

    Args:
        found: The id of the case in which something was found.
        requirement: The requirement that is violated.
        outcomes: All outcomes of the run, in its order.
    """
    ids, left_s = [found], MAX_S
    index = next((at for at, each in enumerate(outcomes) if each.case.id == found), 0)
    for each in reversed(outcomes[:index]):
        judged = each.verdict in _PASSED and requirement in each.case.requirements
        excluded = each.case.last or each.operator or _rank(each) > _rank(outcomes[index])
        if judged and not excluded:
            left_s -= each.duration_s
            if left_s < 0:
                break
            ids.append(each.case.id)
    return tuple(reversed(ids))


def _rank(outcome: Outcome) -> int:
    return [*Hazard].index(outcome.case.hazard)
