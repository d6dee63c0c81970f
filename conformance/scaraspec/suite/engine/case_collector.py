"""Case collector: finds the cases in a pytest session and brings them into their order.

It runs nothing and needs no subject. Other tests of the session are left unchanged.
"""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from scaraspec.report.model import Role
from scaraspec.suite.engine.case import Case, case_of, declare_mark, is_case
from scaraspec.suite.engine.hypothesis_profile import HypothesisProfile
from scaraspec.suite.engine.plan import Options, is_selected
from scaraspec.user_message import UserMessage


class CaseModule(pytest.Module):
    """A file of the suite; its test functions are the cases."""

    def funcnamefilter(self, name: str) -> bool:
        """Whether the function of this name is a case."""
        return name.startswith("test_")


class CaseCollector:
    """The pytest plugin object that collects the cases for one role.

    Args:
        role: The role of the subject.
        options: The options of the user.
        folder: Where the cases are. Their modules are imported with the hypothesis profile of the
            suite, because hypothesis settings are fixed at import.

    Attributes:
        cases: The collected cases that the options select, in the order in which they run.
        items: The pytest items of these cases, in the same order.
        suite_errors: Errors of the suite itself; a run with any of them is invalid.
    """

    def __init__(self, role: Role, options: Options, folder: Path) -> None:
        self.options = options
        self._role, self._folder = role, folder
        self._profile = HypothesisProfile(options.examples, options.seed)
        self._collected: dict[pytest.Item, Case] = {}
        self.cases: list[Case] = []
        self.items: list[pytest.Item] = []
        self.suite_errors: list[str] = []

    def pytest_configure(self, config: pytest.Config) -> None:
        """Declare the mark of cases."""
        declare_mark(config)

    def pytest_pycollect_makemodule(
        self, module_path: Path, parent: pytest.Collector
    ) -> pytest.Module | None:
        """Collect a file of the suite, whatever names the functions of other tests have."""
        if self._folder not in module_path.parents:
            return None
        name = f"scaraspec/{module_path.name}"  # the path may be outside of the team's repository
        module: pytest.Module = CaseModule.from_parent(parent, path=module_path, nodeid=name)
        return module

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        """Import a file of the suite with its hypothesis profile; report it if that fails."""
        if self._folder not in collector.path.parents:
            return (yield)
        with self._profile:
            report = yield
        if report.failed:
            self.suite_errors.append(str(report.longrepr))
        return report

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Note a case in the order of the files."""
        if is_case(item):
            self._collected[item] = case_of(item)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> Generator[None, Any, None]:
        """Keep the selected cases, after all other tests and the harmless ones first.

        Plugins that change the order of tests do not change the order of the cases.
        """
        yield
        ids = [case.id for case in self._collected.values()]
        if twice := {i for i in ids if ids.count(i) > 1}:
            self.suite_errors.append(
                UserMessage(
                    "several cases have the same id: {names}", names=", ".join(sorted(twice))
                )
            )
        kept = {item for item in items if item in self._collected and self._tries(item)}
        chosen = [item for item in self._collected if item in kept]
        chosen.sort(key=lambda item: self._turn(self._collected[item]))
        self.cases = [self._collected[item] for item in chosen]
        self.items = chosen
        if rest := [i for i in items if i in self._collected and i not in kept]:
            config.hook.pytest_deselected(items=rest)
        items[:] = [*(item for item in items if item not in self._collected), *chosen]

    def _turn(self, case: Case) -> tuple[int, tuple[str, ...]]:
        """The order of execution: a key to sort the cases by."""
        return case.turn, ()

    def _tries(self, item: pytest.Item) -> bool:
        case = self._collected[item]
        return case.role is self._role and is_selected(case, self.options)
