"""ctrf.json has the members that its specification requires, and only those that it knows."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from scaraspec.judge.verdicts import Conclusion
from scaraspec.report import ctrf
from scaraspec.report.model import Results

# From schema/ctrf.schema.json of the specification, whose objects allow no further members.
KNOWN_IN_TEST = {
    *("id", "name", "status", "duration", "start", "stop", "suite", "message", "trace", "snippet"),
    *("line", "rawStatus", "tags", "labels", "type", "filePath", "extra"),
}
SUMMARY = {"tests", "passed", "failed", "skipped", "pending", "other", "start", "stop"}


def document_of(results: Results) -> dict[str, Any]:
    """What another program reads."""
    document: dict[str, Any] = json.loads(ctrf.render(results))
    return document


def test_the_required_members_are_there(full: Results) -> None:
    """With the types that the specification gives them."""
    document = document_of(full)
    assert (document["reportFormat"], document["specVersion"]) == ("CTRF", "0.0.0")
    results = document["results"]
    assert results["tool"] == {"name": "scaraspec", "version": "0.1.0"}
    assert results["summary"].keys() == SUMMARY | {"extra"}
    assert all(type(results["summary"][member]) is int for member in SUMMARY)
    for test in results["tests"]:
        assert {"name", "status", "duration"} <= test.keys() <= KNOWN_IN_TEST
        assert test["name"]
        assert type(test["duration"]) is int
        assert test["status"] in ("passed", "failed", "skipped", "pending", "other")
        assert test["suite"]


def test_each_verdict_has_its_status(full: Results) -> None:
    """Our own verdict goes with it; inconclusive is neither passed nor the subject's failure."""
    tests = document_of(full)["results"]["tests"]
    assert {test["rawStatus"]: test["status"] for test in tests} == {
        "pass": "passed",
        "tolerated": "passed",
        "fail": "failed",
        "inconclusive": "other",
        "error": "other",
        "none": "skipped",
    }


def test_the_summary_is_that_of_the_tests(full: Results) -> None:
    """Sums and times agree with the list; times are milliseconds."""
    results = document_of(full)["results"]
    summary, statuses = results["summary"], Counter(test["status"] for test in results["tests"])
    assert {status: summary[status] for status in statuses} == dict(statuses)
    assert summary["tests"] == 6
    assert summary["stop"] - summary["start"] == 4080
    assert results["tests"][1]["duration"] == 1500
    alone = document_of(replace(full, session=None))["results"]["summary"]
    assert (alone["start"], alone["stop"]) == (0, 1500)


def test_a_failure_says_what_was_due_and_how_to_see_it_again(full: Results) -> None:
    """Message, trace and replay."""
    failed = document_of(full)["results"]["tests"][1]
    assert failed["message"] == "run_program ended a second time"
    assert failed["trace"] == "expected: one final result\nobserved: a second one"
    assert failed["extra"] == {"replay": "scaraspec certify controller tcp://robot --only 3/18"}
    assert failed["tags"] == ["hazard:motion", "requirement:3/18"]


def test_nothing_tested_is_not_green(full: Results) -> None:
    """An empty run has a test that did not pass."""
    document = document_of(replace(full, verdict=Conclusion.NOTHING_TESTED, cases=()))
    assert document["results"]["summary"]["other"] == 1
    assert document["results"]["summary"]["passed"] == 0


def test_hostile_text_is_written_and_read(
    hostile: Results, hostile_text: str, audited: Callable[[str], Results], tmp_path: Path
) -> None:
    """JSON escapes it; nothing is lost."""
    path = tmp_path / "ctrf.json"
    ctrf.write(hostile, path)
    tests = json.loads(path.read_text(encoding="utf-8"))["results"]["tests"]
    assert all(test["message"] == hostile_text for test in tests)
    ctrf.write(audited("complaint-1"), path)
    failed = json.loads(path.read_text(encoding="utf-8"))["results"]["summary"]["failed"]
    assert failed >= 2
