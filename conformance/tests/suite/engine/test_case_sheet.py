"""Sheets of cases: what the test specification states about a case."""

from scaraspec.report.model import Role
from scaraspec.suite.engine.case_sheet import CaseSheet, case_sheets
from scaraspec.suite.engine.plan import Options


def _sheet(case_id: str, role: Role = Role.CONTROLLER) -> CaseSheet:
    only = Options(only=frozenset(), cases=frozenset({case_id}))
    (sheet,) = case_sheets(role, only)
    return sheet


def test_values() -> None:
    """Listed values are those of the list, drawn ones the strategy."""
    sheet = _sheet("4.15/7")
    assert sheet.values[0].startswith("listed: [stem, stem + dot, ")
    assert sheet.values[1] == "drawn: st.text('abcxyzABC0123456789_-', min_size=8, max_size=20)"
    assert sheet.examples == 30


def test_parameters() -> None:
    """Each of several cases with the same function states its parameters."""
    assert _sheet("4.17/6.jog").values[0].endswith(" = jog")


def test_preconditions() -> None:
    """Hazards, options, hooks, order and skips are preconditions."""
    assert "--allow state,motion" in _sheet("4.15/5").preconditions[0]
    assert any("slow" in each for each in _sheet("4.15/5").preconditions)
    assert any("after all other cases" in each for each in _sheet("4.35/2").preconditions)
    assert "it is skipped if: the controller accepts no other gripper center" in (
        _sheet("7/1").preconditions
    )


def test_a_long_case() -> None:
    """It has a long duration, which is in hours."""
    sheet = _sheet("4.6/4.days")
    assert "--patience, if it waits longer; otherwise it is skipped" in sheet.preconditions
    assert sheet.duration.sentence.startswith("72 h and ")


def test_criteria_of_helpers() -> None:
    """Checks in the same file and shared ones belong to the case, also with values of the run."""
    assert any(each.startswith("{command} of a program that") for each in _sheet("4.15/7").criteria)
    sheet = _sheet("4.17/9.jog", Role.CLIENT)
    assert any("was stopped, but the client reports success" in each for each in sheet.criteria)
