"""Shared fixtures: run some of the cases on a controller made by the test."""

from collections.abc import Callable, Collection
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import Robot, certified, hooks_of
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.model import Case, Results
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore

_SIZES, _FILES = "5.2/16", "5.2/12"
_NOT_PASSED = (Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE)


class CaseResults(dict[str, Case]):
    """The results of the cases by their id, the observed readings and the notices."""

    def __init__(self, results: Results) -> None:
        super().__init__((case.id, case) for case in results.cases)
        self.counts = results.counts
        self.readings = results.readings[results.role.value]
        self.notices = results.notices

    @property
    def not_passed(self) -> list[str]:
        """The cases that neither passed nor were tolerated, including skipped ones.

        At least one case must have been collected.
        """
        assert self
        return self._of(*_NOT_PASSED, Verdict.NONE)

    @property
    def problems(self) -> list[str]:
        """The cases that ran and neither passed nor were tolerated.

        At least one case must have passed or been tolerated.
        """
        assert self.counts[Verdict.PASS] + self.counts[Verdict.TOLERATED]
        return self._of(*_NOT_PASSED)

    @property
    def violated(self) -> set[str]:
        """The violated requirements. At least one case must have been collected."""
        assert self
        failed = (case for case in self.values() if case.verdict is Verdict.FAIL)
        return {requirement for case in failed for requirement in case.requirements}

    def _of(self, *verdicts: Verdict) -> list[str]:
        return [f"{c.id}: {c.message}" for c in self.values() if c.verdict in verdicts]


def _run_cases(  # noqa: PLR0913 - each may differ
    core: type[ControllerCore],
    *only: str,
    actual: Dialect | None = None,
    allowed: Collection[Hazard] = ALL,
    examples: int = 3,
    hooks: Collection[str] = (),
    fail_fast: bool = False,
    **claims: Any,
) -> CaseResults:
    """Run the cases of these requirements.

    The cases with large files, which take as long as a hundred others, run only with 5.2/16.

    Args:
        core: The controller.
        only: The requirements.
        actual: The readings that the controller follows; by default the claimed ones.
        allowed: The allowed hazards.
        examples: The number of examples to draw.
        hooks: The available hooks.
        fail_fast: Whether the run ends with the first case that fails.
        claims: Other fields of the ICS.
    """
    robot = Robot(core, actual or claims.get("dialect", DEFAULT))
    handlers = {name: hook for name, hook in hooks_of(robot).items() if name in hooks}
    requirements, cases = frozenset(only), frozenset[str]()
    if _FILES in requirements and _SIZES not in requirements:
        requirements -= {_FILES}
        chosen = collect(Options(frozenset({_FILES})))
        cases = frozenset(case.id for case in chosen if _SIZES not in case.requirements)
    options = Options(
        requirements,
        frozenset(allowed),
        cases=cases,
        undefined=True,
        examples=examples,
        fail_fast=fail_fast,
    )
    return CaseResults(certified(robot, Ics(hooks=handlers, **claims), options))


@pytest.fixture
def run_cases() -> Callable[..., CaseResults]:
    """Return a function that runs cases on a controller."""
    return _run_cases
