"""Earlier sitting: the results of a run that a later run with the same subject continues.

Its completed cases do not run again. So both runs must test the same build, with the same claims
and with the same settings.
"""

from collections.abc import Mapping
from typing import Any, Final

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import Case, ReadingSeen, Results, Tool
from scaraspec.suite.engine.role_adapter import RoleAdapter
from scaraspec.user_message import UserMessage

_LONGEST: Final = 60


def difference(earlier: Results, this: RoleAdapter[Any]) -> str:
    """Return the first difference between an earlier run and this one; empty if it can continue.

    Only what can change a verdict counts: the build, its claims, the suite and the settings.
    """
    own, run = Tool.own(), earlier.run
    before = {
        "role": earlier.role.value,
        f"version of {own.name}": earlier.tool.version,
        "subject.name": earlier.subject.name,
        "subject.version": earlier.subject.version,
        **earlier.subject.claims,
        **(run.settings if run else {}),
        "seed": f"{run.seed}" if run else "",
    }
    now = {
        "role": this.role.value,
        f"version of {own.name}": own.version,
        "subject.name": this.ics.name,
        "subject.version": this.ics.version,
        **this.ics.summary,
        **this.settings,
        "seed": f"{this.options.seed}",
    }
    for name in now | before:
        if (old := before.get(name, "")) != (new := now.get(name, "")):
            return UserMessage(
                "{name} was {before} and is {now}", name=name, before=_shown(old), now=_shown(new)
            )
    return ""


def _shown(value: str) -> str:
    """Return a value for a sentence: not empty, and not long."""
    if len(value) > _LONGEST:
        return f"{value[:_LONGEST]}…"
    return value or "not given"


class EarlierSitting:
    """What a run takes over from the results of an earlier one.

    Args:
        results: The results of the earlier run; None if there was none.

    Attributes:
        cases: The cases to take over, by id: those that were judged, and the wrong claims.
        undecided: The number of undecided findings of the judge by requirement.
    """

    def __init__(self, results: Results | None) -> None:
        self._results = results
        self.cases: dict[str, Case] = {
            case.id: case
            for case in (results.cases if results else ())
            if case.verdict is not Verdict.NONE
            and (case.requirements or case.verdict is Verdict.FAIL)
        }
        self.undecided: Mapping[str, int] = results.undecided if results else {}

    def with_readings(self, seen: Mapping[str, ReadingSeen]) -> dict[str, ReadingSeen]:
        """Return the observed readings of both runs; those of this run have priority."""
        results = self._results
        before = results.readings.get(results.role.value, {}) if results else {}
        observed = {key: reading for key, reading in before.items() if reading.options}
        return observed | {k: each for k, each in seen.items() if each.options or k not in observed}
