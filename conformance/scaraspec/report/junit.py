"""junit.xml: the cases for continuous integration, one test suite for each clause.

A failure is a ``<failure>``. Inconclusive cases and errors of the suite are an ``<error>``, so that
they never pass. Tolerated cases pass, with the reason as output. A failure that a gate accepts is
``<skipped>``. The attributes are those that the xUnit plugin of Jenkins allows.
"""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.files import write_whole
from scaraspec.report.model import Case, Results
from scaraspec.report.ordering import cases_for_machines
from scaraspec.report.sanitizing import visible

MARK: Final = '<testsuites name="scaraspec '
"""What every file contains."""

_OUTCOMES: Final = {
    Verdict.FAIL: "failure",
    Verdict.ERROR: "error",
    Verdict.INCONCLUSIVE: "error",
    Verdict.NONE: "skipped",
}


def write(results: Results, path: Path) -> None:
    """Write junit.xml atomically.

    Raises:
        OSError: The file cannot be written.
    """
    write_whole(path, render(results))


def render(results: Results, accepted: Mapping[str, str] | None = None) -> str:
    """Return the text of junit.xml.

    Args:
        results: The results.
        accepted: Why a gate accepts a failed case, by case id.
    """
    accepted = accepted or {}
    cases = cases_for_machines(results)
    sums = _sums(cases, accepted)
    del sums["skipped"]  # not allowed here
    root = _element("testsuites", name=f"{results.tool.name} {results.role.value}", **sums)
    for clause, of_clause in groupby(cases, key=_clause):
        suite = list(of_clause)
        suite_element = _element(
            "testsuite", name=clause, timestamp=_begun(results), **_sums(suite, accepted)
        )
        suite_element.append(_properties(results))
        suite_element.extend(
            _testcase(case, clause, results, accepted.get(case.id, "")) for case in suite
        )
        root.append(suite_element)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _clause(case: Case) -> str:
    return case.id.partition("/")[0]


def _element(tag: str, text: str = "", **attributes: str) -> ET.Element:
    """Return an element with sanitized text: XML forbids some characters."""
    element = ET.Element(tag, {name: visible(value) for name, value in attributes.items()})
    element.text = visible(text) or None
    return element


def _begun(results: Results) -> str:
    """Return the start of the run in UTC, without a time zone as the format requires."""
    source = results.run or results.session
    begun_s = source.begun_ns // 10**9 if source else 0
    return datetime.fromtimestamp(begun_s, UTC).replace(tzinfo=None).isoformat()


def _properties(results: Results) -> ET.Element:
    """Return what identifies the run: the SUT, the verdict, the version and the settings."""
    values = {
        "subject": results.subject.title,
        "subject.version": results.subject.version,
        "verdict": results.label,
        "version": results.tool.version,
    }
    if results.run:
        values |= {"seed": f"{results.run.seed}", **results.run.settings}
    properties = _element("properties")
    properties.extend(_element("property", name=k, value=v) for k, v in values.items())
    return properties


def _outcome(case: Case, accepted: Mapping[str, str]) -> str | None:
    return "skipped" if case.id in accepted else _OUTCOMES.get(case.verdict)


def _sums(cases: list[Case], accepted: Mapping[str, str]) -> dict[str, str]:
    outcomes = [_outcome(case, accepted) for case in cases]
    return {
        "tests": str(len(cases)),
        "failures": str(outcomes.count("failure")),
        "errors": str(outcomes.count("error")),
        "skipped": str(outcomes.count("skipped")),
        "time": f"{sum(case.duration_s for case in cases):.3f}",
    }


def _testcase(case: Case, clause: str, results: Results, accepted: str) -> ET.Element:
    classname = f"{results.tool.name}.{results.role.value}.{clause}"
    name = f"{case.id}: {case.title}".removesuffix(": ")
    element = _element("testcase", name=name, classname=classname, time=f"{case.duration_s:.3f}")
    outcome, text = _OUTCOMES.get(case.verdict), "\n".join(_lines(case))
    if accepted:
        element.append(_element("skipped", text, message=accepted, type=case.verdict.value))
    elif outcome:
        element.append(_element(outcome, text, message=case.message, type=case.verdict.value))
    elif text:
        element.append(_element("system-out", text))
    return element


def _lines(case: Case) -> Iterator[str]:
    """Yield the details of a case; nothing for a pass."""
    if case.verdict is Verdict.PASS:
        return
    yield f"{case.verdict.value}: {case.message}"
    if case.requirements:
        yield f"requirements: {', '.join(case.requirements)}"
    if case.cause:
        yield f"responsible: {case.cause.value}"
    if case.expected or case.observed:
        yield f"expected: {case.expected}"
        yield f"observed: {case.observed}"
    for evidence in case.wire:
        yield f"{evidence.place}: {evidence.frame_hex}".removesuffix(": ")
    if case.replay:
        yield f"reproduction command: {case.replay}"
