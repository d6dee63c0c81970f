"""junit.xml is valid XML for any text, and only passes count as passed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

from scaraspec.judge.verdicts import Conclusion
from scaraspec.report import junit
from scaraspec.report.model import Results


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
    """In the attributes of the suites."""
    root = tree_of(full)
    assert root.attrib == {
        "name": "scaraspec controller",
        "tests": "6",
        "failures": "1",
        "errors": "2",
        "skipped": "1",
        "time": "1.500",
    }
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
        *("testsuites", "testsuite", "testcase", "failure", "error", "skipped", "system-out")
    }
    assert not [c for c in text if ord(c) < 32 and c != "\n"]
    failure = root.find(".//failure")
    assert failure is not None
    assert failure.get("message", "").startswith("</script><script>alert(1)</script><!-- ]]> &")
    assert "⟨U+0000⟩⟨U+001B⟩[31m⟨U+202E⟩txt.exe⟨U+FFFE⟩" in failure.get("message", "")


def test_an_empty_run_does_not_pass(full: Results) -> None:
    """It has an error."""
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
    assert "3/18" in failures
