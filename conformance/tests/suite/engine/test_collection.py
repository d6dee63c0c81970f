"""Collection: a run imports only the files of its cases."""

from pathlib import Path

import pytest
from hypothesis.internal.conjecture import providers

from scaraspec.report.model import Role
from scaraspec.suite.engine.case_collector import CaseCollector
from scaraspec.suite.engine.collection import CASES, cases_in
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.pytest_session import run_pytest


class _Watching(CaseCollector):
    """Records the files that pytest considers."""

    def __init__(self) -> None:
        super().__init__(Role.CONTROLLER, Options(), CASES[Role.CONTROLLER])
        self.considered: list[Path] = []

    def pytest_collect_file(self, file_path: Path) -> None:
        self.considered.append(file_path)


def test_other_files_are_ignored() -> None:
    """pytest considers only the given files of the suite."""
    files = {file for _, file in cases_in(CASES[Role.CONTROLLER], Role.CONTROLLER)[:20]}
    watching = _Watching()
    run_pytest(watching, Role.CONTROLLER, Options(), *sorted(files), only_collect=True)
    assert set(watching.considered) == files
    assert {item.path for item in watching.items} == files


def test_modules_are_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """hypothesis does not read the modules of the tool, and leaves no folder where a user works."""
    read: list[None] = []
    monkeypatch.setattr(providers, "_get_local_constants", lambda: read.append(None))
    collector = CaseCollector(Role.CLIENT, Options(), CASES[Role.CLIENT])
    run_pytest(collector, Role.CLIENT, Options(), CASES[Role.CLIENT], only_collect=True)
    assert collector.cases
    assert not read
