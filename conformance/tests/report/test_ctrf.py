"""ctrf.json has the members that its specification requires."""

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
    """Return the parsed document."""
    document: dict[str, Any] = json.loads(ctrf.render(results))
    return document


def test_required_members(full: Results) -> None:
    """With the types of the specification."""
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
    """Our verdict is the raw status; inconclusive is neither passed nor failed."""
    tests = document_of(full)["results"]["tests"]
    assert {test["rawStatus"]: test["status"] for test in tests} == {
        "pass": "passed",
        "tolerated": "passed",
        "fail": "failed",
        "inconclusive": "other",
        "error": "other",
        "none": "skipped",
    }


def test_the_summary_matches_the_tests(full: Results) -> None:
    """Counts and times; times are in milliseconds."""
    results = document_of(full)["results"]
    summary, statuses = results["summary"], Counter(test["status"] for test in results["tests"])
    assert {status: summary[status] for status in statuses} == dict(statuses)
    assert summary["tests"] == 6
    assert summary["stop"] - summary["start"] == 4080
    assert results["tests"][1]["duration"] == 1500
    alone = document_of(replace(full, session=None))["results"]["summary"]
    assert (alone["start"], alone["stop"]) == (0, 1500)


def test_content_of_a_failure(full: Results) -> None:
    """Message, trace and reproduction command."""
    failed = document_of(full)["results"]["tests"][1]
    assert failed["message"] == "run_program ended a second time"
    assert failed["trace"] == "expected: one final result\nobserved: a second one"
    assert failed["extra"] == {"replay": "scaraspec certify controller tcp://robot --only 3/18"}
    assert failed["tags"] == ["hazard:motion", "requirement:3/18"]


def test_an_empty_run_does_not_pass(full: Results) -> None:
    """It has a test that did not pass."""
    document = document_of(replace(full, verdict=Conclusion.NOTHING_TESTED, cases=()))
    assert document["results"]["summary"]["other"] == 1
    assert document["results"]["summary"]["passed"] == 0


def test_hostile_text(
    hostile: Results, hostile_text: str, audited: Callable[[str], Results], tmp_path: Path
) -> None:
    """JSON escapes it without loss."""
    path = tmp_path / "ctrf.json"
    ctrf.write(hostile, path)
    tests = json.loads(path.read_text(encoding="utf-8"))["results"]["tests"]
    assert all(test["message"] == hostile_text for test in tests)
    ctrf.write(audited("complaint-1"), path)
    failed = json.loads(path.read_text(encoding="utf-8"))["results"]["summary"]["failed"]
    assert failed >= 2


def test_an_accepted_failure_is_skipped(full: Results) -> None:
    """A gate has accepted it; the raw status stays."""
    document = json.loads(ctrf.render(full, {"3/18": "waived until 2027-01-31"}))
    (test,) = (t for t in document["results"]["tests"] if t["name"] == "3/18")
    assert (test["status"], test["rawStatus"]) == ("skipped", "fail")
    assert test["extra"]["accepted"] == "waived until 2027-01-31"
    assert document["results"]["summary"]["failed"] == 0
