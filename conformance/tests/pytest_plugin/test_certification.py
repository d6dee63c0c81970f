"""Which files are collected, and how pytest reports the outcome of a case."""

from pathlib import Path
from typing import Any, cast

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.hazard import Hazard
from scaraspec.pytest_plugin.certification import files_of, reported
from scaraspec.report.model import Role
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.case_collector import CaseCollector
from scaraspec.suite.engine.collection import CASES, cases_in
from scaraspec.suite.engine.outcome import Outcome
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.pytest_session import run_pytest

FOLDER = CASES[Role.CONTROLLER]


def test_files() -> None:
    """Each file contains the ids of its requirements, so that a search finds it."""
    texts = {file: file.read_text("utf-8") for file in FOLDER.glob("test_*.py")}
    for case, file in cases_in(FOLDER, Role.CONTROLLER):
        assert all(f'"{each}"' in texts[file] for each in case.requirements), case.id
    named = [file for file, text in sorted(texts.items()) if '"4.7/2"' in text]
    assert files_of(FOLDER, Options(only=frozenset({"4.7/2"}))) == named


def test_all_files() -> None:
    """Without requirements, or with single cases, all files are collected."""
    every = sorted(FOLDER.glob("test_*.py"))
    assert files_of(FOLDER, Options()) == every
    assert files_of(FOLDER, Options(only=frozenset(), cases=frozenset({"4.8/2.idle"}))) == every


@pytest.mark.parametrize(
    ("verdict", "outcome"),
    [
        (Verdict.NONE, "skipped"),
        (Verdict.PASS, "passed"),
        (Verdict.TOLERATED, "passed"),
        (Verdict.INCONCLUSIVE, "skipped"),
        (Verdict.FAIL, "failed"),
        (Verdict.ERROR, "failed"),
    ],
)
def test_reports(verdict: Verdict, outcome: str) -> None:
    """The report follows the verdict, not the exception of the last attempt."""
    case = Case("4.8/2", ("4.8/2",), frozenset({Hazard.READ_ONLY}))
    known: Any = {"nodeid": "a", "location": ("a", 0, "a"), "keywords": {}, "longrepr": None}
    reports = [
        pytest.TestReport(**known, outcome="passed", when="setup"),
        pytest.TestReport(**known, outcome="failed", when="call"),
        pytest.TestReport(**known, outcome="passed", when="teardown"),
    ]
    item = cast("pytest.Item", type("Item", (), {"path": Path("a")}))
    ended = Outcome(case, verdict, message="me\n::error::", expected="1", observed="2")
    setup, call, teardown = reported(ended, reports, item)
    assert (setup.outcome, call.outcome, teardown.outcome) == ("passed", outcome, "passed")
    if outcome == "failed":
        assert call.longrepr == "me⟨U+000A⟩::error::\nexpected: 1\nobserved: 2"


def test_settings_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    """The settings of a user's pytest do not affect the pytest that runs the cases."""
    monkeypatch.setenv("PYTEST_ADDOPTS", "--no-such-option")
    monkeypatch.setenv("PYTEST_PLUGINS", "no_such_module")
    collector = CaseCollector(Role.CONTROLLER, Options(), FOLDER)
    file = FOLDER / "test_4_07_version.py"
    run_pytest(collector, Role.CONTROLLER, Options(), file, only_collect=True)
    assert "4.7/2" in {case.id for case in collector.cases}
