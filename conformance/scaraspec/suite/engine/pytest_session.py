"""The pytest session in which shipped cases are collected and run, in this process.

Importing pytest and hypothesis takes longer than a command's help: `collection` imports this module
only when cases are collected.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import pytest

from scaraspec.report.model import Role
from scaraspec.suite.engine.case_collector import CaseCollector
from scaraspec.suite.engine.collection import CASES, SuiteError
from scaraspec.suite.engine.hypothesis_profile import without_files
from scaraspec.suite.engine.plan import Options
from scaraspec.user_message import UserMessage


def run_pytest(
    collector: CaseCollector,
    role: Role,
    options: Options,
    *where: Path,
    only_collect: bool = False,
) -> None:
    """Collect and run shipped cases with pytest, without output.

    Settings and plugins of the user's pytest do not apply: they may change the order of the cases
    or end them.

    Raises:
        SuiteError: pytest could not collect or run them.
        KeyboardInterrupt: The user interrupted the run.
    """
    folder = CASES[role]
    forget_cases(role)
    plugins = ("-phypothesispytest", *(f"-pno:{name}" for name in _NOT_NEEDED))
    alone = ("-c", os.devnull, f"--rootdir={folder}", f"--confcutdir={folder}")
    output = (
        ("--capture=no",) if options.attended else ()
    )  # an operator reads prompts and types replies
    how = (*_SIMPLE, *(["--collect-only"] if only_collect else ()))
    with _without_user_settings(), without_files():
        status = pytest.main(
            [*map(str, where), *alone, *plugins, *output, *how],
            plugins=[collector, _ShortTracebacks(), _OnlyThese(where)],
        )
    if collector.suite_errors:
        raise SuiteError(collector.suite_errors[0])
    if status is pytest.ExitCode.INTERRUPTED:
        raise KeyboardInterrupt
    if status not in _FINISHED:
        raise SuiteError(UserMessage("pytest ended with {status!r}", status=status))


class _OnlyThese:
    """A pytest plugin that ignores the other files of a folder, which takes pytest longer.

    Args:
        where: The files or folders to collect.
    """

    def __init__(self, where: tuple[Path, ...]) -> None:
        self._files = {path for path in where if path.suffix}

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        """Ignore a file; None lets pytest decide."""
        other = self._files and collection_path.suffix and collection_path not in self._files
        return True if other else None


class _ShortTracebacks:
    """Avoids pytest's long traceback, for which it reads the case's source each time."""

    def pytest_configure(self, config: pytest.Config) -> None:
        config.option.tbstyle = "native"


@contextmanager
def _without_user_settings() -> Iterator[None]:
    """Hide what configures pytest in the environment."""
    hidden = {name: os.environ.pop(name) for name in _SETTINGS if name in os.environ}
    os.environ[_NO_PLUGINS] = "1"
    try:
        yield
    finally:
        del os.environ[_NO_PLUGINS]
        os.environ.update(hidden)


def forget_cases(role: Role) -> None:
    """Remove the cases from `sys.modules`: their hypothesis settings are fixed at import."""
    cases_here = str(CASES[role] / "test_")
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(cases_here):
            del sys.modules[name]


_NO_PLUGINS: Final = "PYTEST_DISABLE_PLUGIN_AUTOLOAD"
_SETTINGS: Final = ("PYTEST_ADDOPTS", "PYTEST_PLUGINS", _NO_PLUGINS)
"""Environment variables of pytest."""

_SIMPLE: Final = ("--import-mode=importlib", "--assert=plain")  # cases contain no assert
_NOT_NEEDED: Final = (
    *("terminal", "cacheprovider", "junitxml", "logging", "pastebin", "subtests"),
    *("debugging", "faulthandler", "setuponly", "setupplan", "stepwise"),
    *("unittest", "doctest", "tmpdir", "legacypath", "monkeypatch", "recwarn"),
    *("unraisableexception", "threadexception"),  # each run would collect garbage ten times
)
"""Plugins of pytest."""


_FINISHED: Final = (
    pytest.ExitCode.OK,
    pytest.ExitCode.TESTS_FAILED,
    pytest.ExitCode.NO_TESTS_COLLECTED,
)
