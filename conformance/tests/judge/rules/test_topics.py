"""The docstring of `judge.rules` lists the clauses of each topic."""

import re
from collections import defaultdict
from functools import partial

from scaraspec.judge import rules
from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.rules.rule import RULES, Rule

CLAUSES = sorted(
    {each.clause for each in REQUIREMENTS.values()},
    key=lambda clause: [int(number) for number in re.findall("[0-9]+", clause)],
)


def module_of(rule: Rule) -> str:
    """Return the name of the module in which the function of a rule is."""
    check = rule.check.func if isinstance(rule.check, partial) else rule.check
    return str(check.__module__).rpartition(".")[2]


def expanded(text: str) -> set[str]:
    """Return the clauses of a list such as ``4, 4.15 to 4.18``; 6 means all parts of clause 6."""
    found = set[str]()
    for first, last in re.findall(r"([0-9.]+|T)(?: to ([0-9.]+))?", text):
        if first == "6":
            found |= {clause for clause in CLAUSES if clause.startswith("6")}
        else:
            found |= set(CLAUSES[CLAUSES.index(first) : CLAUSES.index(last or first) + 1])
    return found


def test_clauses_of_each_topic() -> None:
    """The list is complete, and no clause is listed that a topic does not judge."""
    actual: defaultdict[str, set[str]] = defaultdict(set)
    for rule in RULES:
        actual[module_of(rule)].add(REQUIREMENTS[rule.requirement].clause)
    lines = re.findall(
        r"^- `(\w+)`: ((?:[0-9.T]+(?:, | to )?)+)", rules.__doc__ or "", re.MULTILINE
    )
    assert {name: expanded(clauses) for name, clauses in lines} == actual
