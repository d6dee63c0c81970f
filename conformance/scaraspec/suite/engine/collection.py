"""Collection: finds the shipped cases and runs them with pytest in this process."""

import os
import sys
from functools import cache
from pathlib import Path
from typing import Final

import pytest

from scaraspec.judge.requirements import Method
from scaraspec.report.model import Role
from scaraspec.suite.engine import case as cases
from scaraspec.suite.engine.case_runner import CaseRunner
from scaraspec.suite.engine.plan import Options, is_selected
from scaraspec.user_message import UserMessage

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
    case_runner = CaseRunner(None, role, Options())
    run_pytest(case_runner, role, Options(), folder)
    return tuple(zip(case_runner.cases, (item.path for item in case_runner.items), strict=True))


def run_pytest(case_runner: CaseRunner, role: Role, options: Options, *where: Path) -> None:
    """Collect and run shipped cases with pytest, without output.

    Raises:
        SuiteError: pytest could not collect or run them.
        KeyboardInterrupt: The user interrupted the run.
    """
    folder = CASES[role]
    _forget_cases(folder)
    quiet = [f"-pno:{name}" for name in _NOT_NEEDED]
    alone = ("-c", os.devnull, f"--rootdir={folder}", f"--confcutdir={folder}")
    drawn = (f"--hypothesis-seed={options.seed}",)
    heard = (
        ("--capture=no",) if options.attended else ()
    )  # an operator reads prompts and types replies
    status = pytest.main(
        [*map(str, where), *alone, *quiet, *drawn, *heard, "--import-mode=importlib"],
        plugins=[case_runner],
    )
    if case_runner.suite_errors:
        raise SuiteError(case_runner.suite_errors[0])
    if status is pytest.ExitCode.INTERRUPTED:
        raise KeyboardInterrupt
    if status not in _FINISHED:
        raise SuiteError(UserMessage("pytest ended with {status!r}", status=status))


def _forget_cases(folder: Path) -> None:
    """Remove the cases from `sys.modules`: their hypothesis settings are fixed at import."""
    cases_here = str(folder / "test_")
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(cases_here):
            del sys.modules[name]


_NOT_NEEDED: Final = (
    *("terminal", "cacheprovider", "junitxml", "logging"),
    *("unraisableexception", "threadexception"),  # each run would collect garbage ten times
)
"""Plugins of pytest."""


_FINISHED: Final = (
    pytest.ExitCode.OK,
    pytest.ExitCode.TESTS_FAILED,
    pytest.ExitCode.NO_TESTS_COLLECTED,
)
