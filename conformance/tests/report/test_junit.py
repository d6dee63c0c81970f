"""junit.xml is valid XML for any text, and only passes count as passed."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

from junitparser import JUnitXml

from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.report import junit
from scaraspec.report.model import Results, RunInfo


def tree_of(results: Results) -> ET.Element:
    """Return the parsed document."""
    return ET.fromstring(junit.render(results))


def test_each_verdict_has_its_element(full: Results) -> None:
    """Inconclusive and error are errors; tolerated passes with a reason."""
    cases = {case.get("name"): case for case in tree_of(full).iter("testcase")}
    assert {name: [child.tag for child in case] for name, case in cases.items()} == {
        "3/1": [],
        "3/18": ["failure"],
        "4.1/2": ["skipped"],
        "5.1/9": ["system-out"],
        "5.2/3": ["error"],
        "9/9": ["error"],
    }
    types = {name: child.get("type") for name, case in cases.items() for child in case}
    assert types["3/18"] == "fail"
    assert types["5.2/3"] == "inconclusive"
    assert types["9/9"] == "error"


def test_content_of_a_failure(full: Results) -> None:
    """Message, expected, observed, the bytes, and the reproduction command."""
    failure = tree_of(full).find(".//failure")
    assert failure is not None
    assert failure.get("message") == "run_program ended a second time"
    assert failure.text == (
        "fail: run_program ended a second time\n"
        "requirements: 3/18\n"
        "responsible: subject\n"
        "expected: one final result\n"
        "observed: a second one\n"
        "connection 1, C2A byte 73, 7 bytes: CC9030023131AA\n"
        "connection 1, C2A byte 73, 7 bytes\n"
        "reproduction command: scaraspec certify controller tcp://robot --only 3/18"
    )


def test_the_sums_match_the_cases(full: Results) -> None:
    """The attributes of the suites have the right sums."""
    root = tree_of(full)
    assert root.attrib == {
        "name": "scaraspec controller",
        "tests": "6",
        "failures": "1",
        "errors": "2",
        "time": "1.500",
    }
    assert sum(int(suite.get("skipped", 0)) for suite in root) == 1
    assert [suite.get("name") for suite in root] == ["3", "4.1", "5.1", "5.2", "9"]
    assert sum(int(suite.get("tests", 0)) for suite in root) == 6
    case = root.find(".//testcase")
    assert case is not None
    assert case.get("classname") == "scaraspec.controller.3"


def test_hostile_text_stays_text(hostile: Results) -> None:
    """A message creates no control character, element or attribute."""
    text = junit.render(hostile)
    root = ET.fromstring(text)
    assert {element.tag for element in root.iter()} == {
        *("testsuites", "testsuite", "properties", "property"),
        *("testcase", "failure", "error", "skipped", "system-out"),
    }
    assert not [c for c in text if ord(c) < 32 and c != "\n"]
    failure = root.find(".//failure")
    assert failure is not None
    assert failure.get("message", "").startswith("</script><script>alert(1)</script><!-- ]]> &")
    assert "⟨U+0000⟩⟨U+001B⟩[31m⟨U+202E⟩txt.exe⟨U+FFFE⟩" in failure.get("message", "")


def test_an_empty_run_does_not_pass(full: Results) -> None:
    root = tree_of(replace(full, verdict=Conclusion.NOTHING_TESTED, cases=()))
    assert root.get("errors") == "1"
    error = root.find(".//error")
    assert error is not None
    assert error.get("message") == "nothing was tested: no requirement could be judged"


def test_a_file_is_written(audited: Callable[[str], Results], tmp_path: Path) -> None:
    """Declared as UTF-8, and readable by another parser."""
    path = tmp_path / "junit.xml"
    junit.write(audited("complaint-1"), path)
    assert path.read_bytes().startswith(b'<?xml version="1.0" encoding="UTF-8"?>\n<testsuites')
    failures = [case.get("name") for case in ET.parse(path).iterfind(".//testcase[failure]")]
    assert any(name and name.startswith("3/18: ") for name in failures)


ALLOWED = {
    "testsuites": ({"name", "time", "tests", "failures", "errors"}, {"testsuite"}),
    "testsuite": (
        {"name", "tests", "failures", "errors", "skipped", "time", "timestamp"},
        {"properties", "testcase"},
    ),
    "properties": (set(), {"property"}),
    "property": ({"name", "value"}, set()),
    "testcase": (
        {"name", "classname", "time"},
        {"skipped", "error", "failure", "system-out"},
    ),
    **dict.fromkeys(("skipped", "error", "failure"), ({"message", "type"}, set())),
    "system-out": (set(), set()),
}
"""The attributes and elements that we write; the xUnit plugin of Jenkins allows all of them."""

REQUIRED = {
    "testsuite": {"name", "tests", "failures", "errors"},
    "testcase": {"name"},
    "property": {"name", "value"},
}
"""The attributes that the plugin requires."""


def test_only_allowed_elements(full: Results, hostile: Results) -> None:
    """The schema of the plugin refuses a file with any other attribute, such as `skipped` above."""
    long = replace(full.cases[0], duration_s=12345.6)
    slow = replace(full, cases=(long, *full.cases[1:]))
    for element in (each for results in (slow, hostile) for each in tree_of(results).iter()):
        attributes, children = ALLOWED[element.tag]
        assert REQUIRED.get(element.tag, set()) <= set(element.attrib) <= attributes
        assert {child.tag for child in element} <= children
        assert re.fullmatch(r"[0-9]*(\.[0-9]*)?", element.get("time", ""))
        if children:
            assert not (element.text or "").strip()


def test_an_independent_reader(full: Results, hostile: Results) -> None:
    """A parser by other authors finds the cases and their outcomes, whatever text they contain."""
    for results in (full, hostile):
        read = JUnitXml.fromstring(junit.render(results).encode())
        found = [case for suite in read for case in suite]
        assert read.tests == len(found) == len(results.cases)
        outcomes = [type(each).__name__ for case in found for each in case.result]
        assert (read.failures, read.errors) == (outcomes.count("Failure"), outcomes.count("Error"))
        passed = [case.verdict in (Verdict.PASS, Verdict.TOLERATED) for case in results.cases]
        assert sum(case.is_passed for case in found) == sum(passed)
    names = [case.name for suite in JUnitXml.fromstring(junit.render(full)) for case in suite]
    assert sorted(names) == sorted(case.id for case in full.cases)


def test_what_identifies_the_run(full: Results) -> None:
    """Properties, the time of the start in UTC, and the title of a case."""
    run = RunInfo(1_700_000_000_000_000_000, 1_700_000_060_000_000_000, 7, {"allow": "state"})
    cases = (replace(full.cases[0], title="The frame has a start."), *full.cases[1:])
    suite = tree_of(replace(full, run=run, cases=cases)).find("testsuite")
    assert suite is not None
    assert suite.get("timestamp") == "2023-11-14T22:13:20"
    properties = {each.get("name"): each.get("value") for each in suite.iter("property")}
    assert (properties["seed"], properties["allow"], properties["subject.version"]) == (
        *("7", "state", "1.0.0"),
    )
    case = suite.find("testcase")
    assert case is not None
    assert case.get("name") == "3/1: The frame has a start."


def test_an_accepted_failure_is_skipped(full: Results) -> None:
    """A gate has accepted it; the reason is its message."""
    root = ET.fromstring(junit.render(full, {"3/18": "waived until 2027-01-31"}))
    assert root.get("failures") == "0"
    skipped = root.find(".//testcase[@name='3/18']/skipped")
    assert skipped is not None
    assert (skipped.get("message"), skipped.get("type")) == ("waived until 2027-01-31", "fail")
