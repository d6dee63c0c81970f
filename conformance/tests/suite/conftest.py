"""What most tests of the suite do: let some of its cases be tried on a controller of their own."""

from collections.abc import Callable, Collection
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import Robot, certified, hooks_of
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.model import Case, Results
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore

_RUN_AND_WRONG = (Verdict.FAIL, Verdict.ERROR, Verdict.INCONCLUSIVE)


class Tried(dict[str, Case]):
    """What came of each case, by its id; and what was found out at the open points."""

    def __init__(self, results: Results) -> None:
        super().__init__((case.id, case) for case in results.cases)
        self.counts = results.counts
        self.readings = results.readings[results.role.value]

    @property
    def wrong(self) -> list[str]:
        """Those that neither passed nor were tolerated; there are some at all."""
        assert self
        return self._of(*_RUN_AND_WRONG, Verdict.NONE)

    @property
    def alarms(self) -> list[str]:
        """Those that were run, and neither passed nor were tolerated; some were."""
        assert self.counts[Verdict.PASS] + self.counts[Verdict.TOLERATED]
        return self._of(*_RUN_AND_WRONG)

    @property
    def failed(self) -> set[str]:
        """The requirements that are violated; there are cases at all."""
        assert self
        failed = (case for case in self.values() if case.verdict is Verdict.FAIL)
        return {requirement for case in failed for requirement in case.requirements}

    def _of(self, *verdicts: Verdict) -> list[str]:
        return [f"{c.id}: {c.message}" for c in self.values() if c.verdict in verdicts]


def _tried(
    core: type[ControllerCore],
    *only: str,
    spoken: Dialect | None = None,
    allowed: Collection[Hazard] = ALL,
    examples: int = 3,
    handled: Collection[str] = (),
    **claims: Any,
) -> Tried:
    """Try the cases of these requirements.

    Args:
        core: The controller.
        only: The requirements.
        spoken: The readings that it follows; where not said, those that it claims.
        allowed: The hazards that may be risked.
        examples: How many to draw.
        handled: The hooks that there are.
        claims: What is in its statement of conformance besides.
    """
    robot = Robot(core, spoken or claims.get("dialect", DEFAULT))
    hooks = {name: hook for name, hook in hooks_of(robot).items() if name in handled}
    options = Options(frozenset(only), frozenset(allowed), undefined=True, examples=examples)
    return Tried(certified(robot, Ics(hooks=hooks, **claims), options))


@pytest.fixture
def tried() -> Callable[..., Tried]:
    """Let the suite try some cases on a controller."""
    return _tried
