"""ctrf.json: the cases in the Common Test Report Format (https://ctrf.io).

The format has the statuses passed, failed, skipped and other; the raw status is our own verdict.
Inconclusive cases and errors of the suite are *other*: neither a pass nor a failure of the SUT. A
failure that a gate accepts is *skipped*.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from scaraspec.judge.verdicts import Verdict
from scaraspec.report.files import write_whole
from scaraspec.report.model import Case, Results
from scaraspec.report.ordering import cases_for_machines

SPEC_VERSION: Final = "0.0.0"
"""The version of the specification, which is a draft."""

MARK: Final = '"generatedBy": "scaraspec"'
"""What every file contains."""

_STATUSES: Final = {
    Verdict.NONE: "skipped",
    Verdict.PASS: "passed",
    Verdict.TOLERATED: "passed",
    Verdict.INCONCLUSIVE: "other",
    Verdict.FAIL: "failed",
    Verdict.ERROR: "other",
}


def write(results: Results, path: Path) -> None:
    """Write ctrf.json atomically.

    Raises:
        OSError: The file cannot be written.
    """
    write_whole(path, render(results))


def render(results: Results, accepted: Mapping[str, str] | None = None) -> str:
    """Return the text of ctrf.json.

    Args:
        results: The results.
        accepted: Why a gate accepts a failed case, by case id.
    """
    cases, accepted = cases_for_machines(results), accepted or {}
    tests = [_test(case, results, accepted.get(case.id, "")) for case in cases]
    statuses = [test["status"] for test in tests]
    took_ms = sum(_ms(case) for case in cases)
    begun_ms, ended_ms = 0, took_ms
    if results.session:
        begun_ms, ended_ms = results.session.begun_ns // 10**6, results.session.ended_ns // 10**6
    document = {
        "reportFormat": "CTRF",
        "specVersion": SPEC_VERSION,
        "generatedBy": results.tool.name,
        "results": {
            "tool": {"name": results.tool.name, "version": results.tool.version},
            "summary": {
                "tests": len(cases),
                **{s: statuses.count(s) for s in ("passed", "failed", "skipped", "other")},
                "pending": 0,
                "start": begun_ms,
                "stop": ended_ms,
                "extra": {"verdict": results.verdict.value},
            },
            "tests": tests,
            "environment": {
                "appName": results.subject.title,
                "appVersion": results.subject.version,
            },
        },
    }
    return json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def _ms(case: Case) -> int:
    return round(case.duration_s * 1000)


def _test(case: Case, results: Results, accepted: str) -> dict[str, Any]:
    test: dict[str, Any] = {
        "name": f"{case.id}: {case.title}".removesuffix(": "),
        "status": "skipped" if accepted else _STATUSES[case.verdict],
        "rawStatus": case.verdict.value,
        "duration": _ms(case),
        "suite": [results.role.value, case.id.partition("/")[0]],
        "type": "conformance",
        "message": case.message,
        "tags": [f"hazard:{case.hazard.value}", *(f"requirement:{r}" for r in case.requirements)],
    }
    if case.expected or case.observed:
        test["trace"] = f"expected: {case.expected}\nobserved: {case.observed}"
    if case.attempts:
        failed = [each.verdict is Verdict.FAIL for each in case.attempts]
        test |= {"retries": len(failed) - 1, "flaky": any(failed) and not all(failed)}
    extra = {
        "accepted": accepted,
        "replay": case.replay,
        "reason": case.reason.value if case.reason else "",
        "fingerprint": case.fingerprint,
        "lines": case.lines,
    }
    if any(extra.values()):
        test["extra"] = {key: value for key, value in extra.items() if value}
    return test
