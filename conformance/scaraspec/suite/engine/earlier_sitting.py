"""Earlier sitting: the results of a run that a later run continues or repeats.

The completed cases of a run that is continued do not run again. So both runs must test the same
build, with the same claims and with the same settings.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Final

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import SEEN, Case, ReadingSeen, Results, Tool
from scaraspec.suite.engine import case as cases
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.role_adapter import RoleAdapter
from scaraspec.user_message import UserMessage

_LONGEST: Final = 60
_NS: Final = 1e9
_SETTLED: Final = (Verdict.PASS, Verdict.TOLERATED)


def difference(earlier: Results, this: RoleAdapter[Any]) -> str:
    """Return the first difference between an earlier run and this one; empty if it can continue.

    Only what can change a verdict counts: the build, its claims, the suite and the settings.
    """
    own = Tool.own()
    now = {
        "role": this.role.value,
        f"version of {own.name}": own.version,
        "subject.name": this.ics.name,
        "subject.version": this.ics.version,
        **this.ics.summary,
        **this.settings,
        "seed": f"{this.options.seed}",
    }
    return first_difference(conditions_of(earlier), now)


def conditions_of(results: Results) -> dict[str, str]:
    """Return what can change a verdict of a run, by name: subject, claims, suite and settings."""
    run = results.run
    return {
        "role": results.role.value,
        f"version of {results.tool.name}": results.tool.version,
        "subject.name": results.subject.name,
        "subject.version": results.subject.version,
        **results.subject.claims,
        **(run.settings if run else {}),
        "seed": f"{run.seed}" if run else "",
    }


def date_of(results: Results) -> str:
    """Return the start of a run in UTC, as ISO 8601; empty if it is not known."""
    if results.run is None:
        return ""
    return datetime.fromtimestamp(results.run.begun_ns / _NS, UTC).isoformat(timespec="seconds")


def first_difference(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return the first value that differs, as a sentence; empty if none does."""
    for name in {**now, **before}:
        if (old := before.get(name, "")) != (new := now.get(name, "")):
            return UserMessage(
                "{name} was {before} and is {now}", name=name, before=_shown(old), now=_shown(new)
            )
    return ""


def rerun_difference(earlier: Results, ics: Ics, link: str) -> str:
    """Return why a run makes no sense as a repetition of an earlier one; empty if it does.

    A repaired build may have another version. Another product, or other claims, need a whole run.

    Args:
        earlier: The results of the earlier run.
        ics: The claims of the subject of this run.
        link: Its link.
    """
    named = ics.name and ics.name == earlier.subject.name
    before = {"subject.name": earlier.subject.name, **earlier.subject.claims}
    now = {"subject.name": ics.name, **ics.summary}
    if not named:
        before["link"], now["link"] = earlier.subject.link, link
    return first_difference(before, now)


def cases_to_repeat(earlier: Results, planned: Iterable[cases.Case]) -> frozenset[str]:
    """Return the ids of planned cases that failed, were inconclusive or did not run earlier.

    A failure that the judge found repeats the cases of its requirement, and the first case in whose
    traffic it was found.

    Args:
        earlier: The results of the earlier run.
        planned: The cases that the run is about.
    """
    settled = {case.id for case in earlier.cases if case.verdict in _SETTLED}
    found = [case for case in earlier.cases if SEEN in case.id and case.verdict not in _SETTLED]
    requirements = {requirement for case in found for requirement in case.requirements}
    first = set(_first_cases(found))
    return frozenset(
        case.id
        for case in planned
        if case.id not in settled or case.id in first or requirements & {*case.requirements}
    )


def _first_cases(found: Iterable[Case]) -> Iterator[str]:
    for case in found:
        if isinstance(case.message, UserMessage) and "first_case" in case.message.values:
            yield case.message.values["first_case"]


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
        cases: The cases to take over with their date, by id: those that were judged, and the wrong
            claims.
        undecided: The number of undecided findings of the judge by requirement.
    """

    def __init__(self, results: Results | None) -> None:
        self._results = results
        date = date_of(results) if results else ""
        self.cases: dict[str, Case] = {
            case.id: replace(case, date=case.date or date)
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
