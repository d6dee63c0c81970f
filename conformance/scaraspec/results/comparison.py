"""Comparison of two results by meaning: findings, verdicts, coverage, readings and latency.

Times, ports, connections and the numbers of findings do not count. A pure function.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.model import SEEN, Case, Results, Timing
from scaraspec.results.baseline import settings_of
from scaraspec.results.findings import failures, place, stable_values


@dataclass(frozen=True, slots=True)
class Change:
    """A value that differs; an empty text stands for none."""

    name: str
    before: str
    after: str


@dataclass(frozen=True, slots=True)
class LatencyChange:
    """The latency of the first replies of a command in both results; None if it was not used."""

    command: str
    before: Timing | None
    after: Timing | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """What differs between two results.

    Attributes:
        before: The first results.
        after: The second results.
        new: Failures of the second results only.
        gone: Failures of the first results only.
        changed: Failures of the same case with another message or other values, in both results.
        verdicts: Cases with another verdict that is no failure in either.
        lost: Requirements that only the first results have judged.
        gained: Requirements that only the second results have judged.
        readings: Observed readings that differ, as ``controller.endian``.
        settings: Settings and claims that differ. They are no difference of behaviour.
        latency: The latency of each command.
    """

    before: Results
    after: Results
    new: tuple[Case, ...]
    gone: tuple[Case, ...]
    changed: tuple[tuple[Case, Case], ...]
    verdicts: tuple[Change, ...]
    lost: tuple[str, ...]
    gained: tuple[str, ...]
    readings: tuple[Change, ...]
    settings: tuple[Change, ...]
    latency: tuple[LatencyChange, ...]

    @property
    def differs(self) -> bool:
        """Whether the behaviour or what was judged of it differs; latency does not count."""
        found = (self.new, self.gone, self.changed, self.verdicts, self.readings)
        return any(map(bool, (*found, self.lost, self.gained)))


def compare(before: Results, after: Results) -> Comparison:
    """Compare two results of the same role.

    Raises:
        OldResultsError: A result has no fingerprints.
    """
    first, second = failures(before), failures(after)
    new, gone = _without(second, first), _without(first, second)
    changed = tuple((a, b) for a in gone for b in new if place(a) == place(b))
    return Comparison(
        before,
        after,
        new=tuple(case for case in new if case not in [b for _, b in changed]),
        gone=tuple(case for case in gone if case not in [a for a, _ in changed]),
        changed=changed,
        verdicts=tuple(_verdicts(before, after)),
        lost=tuple(_judged(before, after)),
        gained=tuple(_judged(after, before)),
        readings=tuple(_changes(_readings(before), _readings(after))),
        settings=tuple(_changes(settings_of(before), settings_of(after))),
        latency=tuple(_latency(before, after)),
    )


def _without(cases: tuple[Case, ...], others: tuple[Case, ...]) -> list[Case]:
    """Return the cases that do not equal any of the others."""
    known = [(other.fingerprint, stable_values(other)) for other in others]
    return [case for case in cases if (case.fingerprint, stable_values(case)) not in known]


def _verdicts(before: Results, after: Results) -> Iterator[Change]:
    cases = {case.id: case for case in after.cases}
    for case in before.cases:
        other = cases.get(case.id)
        if other is None or SEEN in case.id or other.verdict is case.verdict:
            continue
        if Verdict.FAIL not in (case.verdict, other.verdict):
            yield Change(case.id, case.verdict.value, other.verdict.value)


def _judged(results: Results, other: Results) -> Iterator[str]:
    """Yield the requirements that only the first one has judged, in the order of the document."""
    judged = {each.id for each in other.requirements if each.decided}
    return (each.id for each in results.requirements if each.decided and each.id not in judged)


def _readings(results: Results) -> dict[str, str]:
    return {
        f"{side}.{key}": "+".join(reading.options)
        for side, seen in results.readings.items()
        for key, reading in seen.items()
        if reading.options
    }


def _changes(before: Mapping[str, str], after: Mapping[str, str]) -> Iterator[Change]:
    for name in sorted(before.keys() | after.keys()):
        if (old := before.get(name, "")) != (new := after.get(name, "")):
            yield Change(name, old, new)


def _latency(before: Results, after: Results) -> Iterator[LatencyChange]:
    first, second = (
        {each.name: each.latency for each in (r.session.exchanges if r.session else ())}
        for r in (before, after)
    )
    for command in sorted(first | second):
        old, new = first.get(command), second.get(command)
        if old or new:
            yield LatencyChange(command, old, new)
