"""The recorded runs in the test specification."""

import json

import pytest

from scaraspec.mutants.recorded_runs import compressed, recorded_runs
from scaraspec.report.model import Role
from scaraspec.suite.engine.case_sheet import RECORDED_RUNS
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import ALL, Options


@pytest.mark.parametrize("role", [Role.CONTROLLER, Role.CLIENT])
def test_each_case_is_recorded(role: Role) -> None:
    """If this fails, run ``make spec``."""
    recorded = json.loads(RECORDED_RUNS.read_text("utf-8"))[role.value]
    assert recorded.keys() == {case.id for case in collect(Options(), role)}


@pytest.mark.parametrize(
    ("role", "case"),
    [(Role.CONTROLLER, "4.15/2.missing"), (Role.CLIENT, "T/9.temperatures")],
)
def test_recorded_runs_are_current(role: Role, case: str) -> None:
    """A case that needs no earlier case does what is recorded; otherwise run ``make spec``."""
    recorded = json.loads(RECORDED_RUNS.read_text("utf-8"))[role.value]
    options = Options(only=frozenset(), cases=frozenset({case}), allowed=ALL, exhaustive=True)
    assert recorded_runs(role, options) == {case: recorded[case]}


@pytest.mark.parametrize(
    ("steps", "text"),
    [
        ("a a a", "a ×3"),
        ("a b a b c", "(a, b) ×2, c"),
        ("a b c", "a, b, c"),
        ("a a b a a b", "(a, a, b) ×2"),
        (" ".join("abcdefghijklmnop"), "a, b, c, d, e, f, g, h, i, j, k, l, m, n, …"),
    ],
)
def test_compressed(steps: str, text: str) -> None:
    """Repeated sequences are shown once, and long ones are cut."""
    assert compressed(steps.split()) == text
