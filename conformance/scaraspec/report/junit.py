"""junit.xml: the cases for continuous integration, one test suite for each clause.

A failure is a ``<failure>``. Inconclusive cases and errors of the suite are an ``<error>``, so that
they never pass. Tolerated cases pass, with the reason as output.
"""

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.files import write_whole
from scaraspec.report.model import Case, Results
from scaraspec.report.ordering import cases_for_machines
from scaraspec.report.sanitizing import visible

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


def render(results: Results) -> str:
    """Return the text of junit.xml."""
    cases = cases_for_machines(results)
    root = _element("testsuites", name=f"{results.tool.name} {results.role.value}", **_sums(cases))
    for clause, of_clause in groupby(cases, key=_clause):
        suite = list(of_clause)
        suite_element = _element("testsuite", name=clause, **_sums(suite))
        suite_element.extend(_testcase(case, clause, results) for case in suite)
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


def _sums(cases: list[Case]) -> dict[str, str]:
    outcomes = [_OUTCOMES.get(case.verdict) for case in cases]
    return {
        "tests": str(len(cases)),
        "failures": str(outcomes.count("failure")),
        "errors": str(outcomes.count("error")),
        "skipped": str(outcomes.count("skipped")),
        "time": f"{sum(case.duration_s for case in cases):.3f}",
    }


def _testcase(case: Case, clause: str, results: Results) -> ET.Element:
    classname = f"{results.tool.name}.{results.role.value}.{clause}"
    element = _element("testcase", name=case.id, classname=classname, time=f"{case.duration_s:.3f}")
    outcome, text = _OUTCOMES.get(case.verdict), "\n".join(_lines(case))
    if outcome:
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
