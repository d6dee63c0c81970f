"""Collection: a run imports only the files of its cases."""

from pathlib import Path

from scaraspec.report.model import Role
from scaraspec.suite.engine.case_collector import CaseCollector
from scaraspec.suite.engine.collection import CASES, cases_in, run_pytest
from scaraspec.suite.engine.plan import Options


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
