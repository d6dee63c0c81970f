"""Collection: finds the shipped cases."""

from functools import cache
from pathlib import Path
from typing import Final

from scaraspec.judge.requirements import Method
from scaraspec.report.model import Role
from scaraspec.suite.engine import case as cases
from scaraspec.suite.engine.plan import Options, is_selected

CASES: Final = {
    role: Path(__file__).parents[1] / role.value / "cases"
    for role in (Role.CONTROLLER, Role.CLIENT)
}
"""Where the shipped cases are."""

METHODS: Final = {Role.CONTROLLER: Method.ACTIVE_CONTROLLER, Role.CLIENT: Method.ACTIVE_CLIENT}
"""The test method for each role."""


def collect(options: Options, role: Role = Role.CONTROLLER) -> list[cases.Case]:
    """Return the cases for this role that `options` select; no subject is needed.

    Raises:
        SuiteError: The suite itself is defective.
    """
    return [case for case, _ in cases_in(CASES[role], role) if is_selected(case, options)]


class SuiteError(Exception):
    """The suite itself is defective; the message states the defect."""


@cache
def cases_in(folder: Path, role: Role) -> tuple[tuple[cases.Case, Path], ...]:
    """All cases in a folder and their files. A run imports only the files of its cases.

    Raises:
        SuiteError: The suite itself is defective.
    """
    from scaraspec.suite.engine.case_collector import CaseCollector  # noqa: PLC0415 - pytest is slow
    from scaraspec.suite.engine.pytest_session import run_pytest  # noqa: PLC0415 - for the same reason

    collector = CaseCollector(role, Options(), folder)
    run_pytest(collector, role, Options(), folder, only_collect=True)
    return tuple(zip(collector.cases, (item.path for item in collector.items), strict=True))
