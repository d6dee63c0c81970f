"""What `--only` names."""

import pytest

from scaraspec.report.model import Role
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.selection import Selection, SelectionError, parse_selection


@pytest.mark.parametrize(
    ("text", "requirements", "cases"),
    [
        ("4.7/2", {"4.7/2"}, set()),
        ("4/8.queries", set(), {"4/8.queries"}),
        (" 4.7/2 , 4/8.queries", {"4.7/2"}, {"4/8.queries"}),
        ("4.8/4", {"4.8/4"}, set()),
        ("case:4.8/4", set(), {"4.8/4"}),
        ("case:4/8.queries", set(), {"4/8.queries"}),
        ("3/31.seen-1", {"3/31"}, set()),
        ("claim.prelogin", set(), {"claim.prelogin"}),
        ("claim.lacks.jog", set(), {"claim.lacks.jog"}),
    ],
)
def test_items(text: str, requirements: set[str], cases: set[str]) -> None:
    """Requirements, cases, findings and claims are accepted in the form of the report."""
    expected = Selection(frozenset(requirements), frozenset(cases))
    assert parse_selection(text, Role.CONTROLLER) == expected


def test_the_settings_of_a_run_name_a_case_alone() -> None:
    """So the reproduction command does not select all cases of the requirement with its id."""
    selected = parse_selection("4.7/2,case:4.8/4,4/8.queries", Role.CONTROLLER)
    text = Options(only=selected.requirements, cases=selected.cases).summary["only"]
    assert text == "4.7/2,4/8.queries,case:4.8/4"
    assert parse_selection(text, Role.CONTROLLER) == selected


def test_everything() -> None:
    """Without a list everything is selected; a clause selects its testable requirements."""
    assert parse_selection(None, Role.CONTROLLER).requirements is None
    clause = parse_selection("4.7", Role.CONTROLLER).requirements
    assert clause is not None
    assert {each.partition("/")[0] for each in clause} == {"4.7"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "an item of the list is empty"),
        ("4.7/2,,", "an item of the list is empty"),
        ("T/9", "T/9 cannot be tested on a controller: `scaraspec requirements --clause T/9`"),
        ("case:4.7", "there is no case '4.7': `scaraspec cases` lists the cases"),
        ("4/8.nothing", "There is no requirement '4/8.nothing'"),
    ],
)
def test_errors(text: str, message: str) -> None:
    """An item that names nothing to run is an error, not an empty run."""
    with pytest.raises(SelectionError) as caught:
        parse_selection(text, Role.CONTROLLER)
    assert message in str(caught.value)
