"""Coverage of the rules: each requirement has a rule or a reason, and firm ones can fail."""

import runpy
from itertools import chain
from pathlib import Path

from scaraspec.judge.requirements import REQUIREMENTS, Method, Strength
from scaraspec.judge.rules import RULES
from scaraspec.judge.rules.undecided import UNDECIDED
from scaraspec.protocol.readings import READINGS

HERE = Path(__file__)
TABLES = [runpy.run_path(str(p)) for p in sorted(HERE.parent.glob("test_*.py")) if p != HERE]
HELD: list[tuple[str, str, str]] = list(
    chain.from_iterable(table.get("CASES", ()) for table in TABLES)
)

NEVER_FAIL = {
    "2/3": "to another port the user may have sent the client",
    "3/33": "a client may have discarded the late reply",
    "4/16": "the user may have asked again, not the client by itself",
    "4.15/2": "a missing program may show later (A-4.15-1)",
    "6.4/4": "a field of fixed width holds no longer name",
    "6.5/1": "a field of fixed width holds no longer alias",
    "6.5/7": "a field of fixed width holds no longer time",
}
"""Firm requirements that no traffic in a recording can fail, and the reason."""


def test_every_passive_requirement_has_a_rule_or_a_reason() -> None:
    """Each passively testable requirement has a rule or an entry in UNDECIDED."""
    ruled = {rule.requirement for rule in RULES}
    passive = {r.id for r in REQUIREMENTS.values() if Method.PASSIVE in r.testable}
    assert len(passive) == 318
    assert ruled | set(UNDECIDED) == passive
    assert not ruled & set(UNDECIDED)
    assert all(UNDECIDED.values())


def test_firm_requirements_can_fail() -> None:
    """Each firm requirement in the cases has a case that fails, or is in NEVER_FAIL."""
    judged = {name for name, _, _ in HELD}
    failing = {name for name, expected, _ in HELD if expected.startswith("fail")}
    firm = {name for name in judged if REQUIREMENTS[name].strength is Strength.FIRM}
    assert firm - failing == set(NEVER_FAIL)


def test_tolerations_are_in_the_register() -> None:
    """A tolerated case names a reading and its option, or an entry of the register."""
    for requirement, expected, _ in HELD:
        if expected.startswith("tolerated"):
            key, _, option = expected.removeprefix("tolerated ").partition("=")
            entry = key.startswith("A-") or key == requirement
            assert entry or READINGS[key].unit or option in {o.name for o in READINGS[key].options}
