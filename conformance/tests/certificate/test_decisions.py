"""Decisions about contested cases: they are complete and fit the document, the register and the
lists."""

import re
import tomllib
from dataclasses import fields
from datetime import date

import pytest

from scaraspec.certificate.decisions import Consequence, Decision, decision_file, decisions
from scaraspec.certificate.mandatory import mandatory_lists
from scaraspec.register import register

DOCUMENT_LINES = 1045
ALL = decisions()
each_decision = pytest.mark.parametrize("decision", ALL, ids=lambda each: ",".join(each.cases))


def test_keys() -> None:
    """Each decision has exactly the documented keys; the order is by date."""
    plain = tomllib.loads(decision_file().read_text("utf-8"))
    assert [set(each) for each in plain["decision"]] == [{f.name for f in fields(Decision)}] * len(
        ALL
    )
    assert [each.date for each in ALL] == sorted(each.date for each in ALL)


@each_decision
def test_values(decision: Decision) -> None:
    """No value is empty, and the lines and register entries exist."""
    assert date.fromisoformat(decision.date)
    assert re.fullmatch(r"\d+\.\d+\.\d+", decision.version)
    assert decision.cases
    assert decision.question.endswith("?")
    assert decision.decision.endswith(".")
    assert decision.lines or decision.register
    for lines in decision.lines:
        found = re.fullmatch(r"L(\d+)(?:-(\d+))?", lines)
        assert found
        first, last = int(found[1]), int(found[2] or found[1])
        assert 1 <= first <= last <= DOCUMENT_LINES
    assert {*decision.register} <= register().keys()


@each_decision
def test_consequence(decision: Decision) -> None:
    """The list of mandatory cases reflects the decision; the first list has no history."""
    lists = mandatory_lists(decision.role)
    (mandatory,) = [each for each in lists if each.id == decision.list]
    gone = decision.consequence is Consequence.WITHDRAWN
    assert all((case in mandatory.cases) is not gone for case in decision.cases)
    if mandatory != lists[0] and decision.consequence is not Consequence.UPHELD:
        changed = getattr(mandatory.history[-1], decision.consequence.value)
        assert {*decision.cases} <= {*changed}
