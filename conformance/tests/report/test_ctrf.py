"""ctrf.json has the members that its specification requires."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator  # type: ignore[import-untyped] # it has no types

from scaraspec.judge.verdicts import Conclusion
from scaraspec.report import ctrf
from scaraspec.report.model import Results

TEXT, NUMBER, FREE = {"type": "string"}, {"type": "integer"}, {"type": "object"}
TEXTS = {"type": "array", "items": TEXT}
STATUSES = ("passed", "failed", "skipped", "pending", "other")


def objects(required: str, **members: Any) -> dict[str, Any]:
    """Return the schema of objects that have no other members."""
    return {
        "type": "object",
        "required": required.split(),
        "properties": members,
        "additionalProperties": False,
    }


TEST = objects(
    "name status duration",
    **dict.fromkeys(("name", "rawStatus", "type", "message", "trace"), TEXT),
    status={"enum": STATUSES},
    duration=NUMBER,
    retries=NUMBER,
    flaky={"type": "boolean"},
    suite={**TEXTS, "minItems": 1},
    tags=TEXTS,
    extra=FREE,
)
SCHEMA = objects(
    "reportFormat specVersion results",
    reportFormat={"const": "CTRF"},
    specVersion={"type": "string", "pattern": r"^\d+\.\d+\.\d+$"},
    generatedBy=TEXT,
    results=objects(
        "tool summary tests",
        tool=objects("name", name={"type": "string", "minLength": 1}, version=TEXT),
        summary=objects(
            f"tests start stop {' '.join(STATUSES)}",
            **dict.fromkeys(("tests", "start", "stop", *STATUSES), NUMBER),
            extra=FREE,
        ),
        tests={"type": "array", "items": TEST},
        environment=objects("", appName=TEXT, appVersion=TEXT),
    ),
)
"""The members that the specification defines and we write; it allows no unknown members."""


def document_of(results: Results) -> dict[str, Any]:
    """Return the parsed document."""
    document: dict[str, Any] = json.loads(ctrf.render(results))
    return document


def test_the_specification(full: Results, hostile: Results) -> None:
    """The members have the names and types of the specification, whatever text they contain."""
    for results in (full, hostile, replace(full, session=None)):
        for accepted in ({}, {"3/18": "waived"}):
            text = ctrf.render(results, accepted)
            Draft202012Validator(SCHEMA).validate(json.loads(text))
    tool = document_of(full)["results"]["tool"]
    assert tool == {"name": "scaraspec", "version": "0.1.0"}


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
