"""`scaraspec requirements`: the catalogue, and what tests each requirement, or why nothing does."""

import json
from collections import Counter
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from scaraspec.cli.problems import Problem
from scaraspec.judge.requirements import (
    REQUIREMENTS,
    Method,
    Requirement,
    UnknownRequirementError,
    select,
)
from scaraspec.judge.rules import RULES
from scaraspec.judge.rules.undecided import UNDECIDED
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.run import METHODS, collect
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.report.model import Role

EXAMPLE = "Example: scaraspec requirements --clause 4.15,3/31"

_HARM = "no network tool can test it without harm, or without Bluetooth"
_RULES = Counter(rule.requirement for rule in RULES)


class Coverage:
    """What tests each requirement."""

    def __init__(self) -> None:
        self._cases: dict[tuple[Role, str], list[str]] = {}
        for role in METHODS:
            for case in collect(Options(), role):
                for requirement in case.requirements:
                    self._cases.setdefault((role, requirement), []).append(case.id)

    def of(self, requirement: Requirement) -> dict[str, object]:
        """Rules and cases by method; the reason where there are none."""
        told: dict[str, object] = {}
        if Method.PASSIVE in requirement.testable:
            told["capture"] = _RULES[requirement.id] or UNDECIDED.get(requirement.id, "no rule")
        for role, method in METHODS.items():
            if method in requirement.testable:
                told[role.value] = self._cases.get((role, requirement.id), "no case")
        if Method.STATIC in requirement.testable:
            told["file"] = "scaraspec program check"
        return told or {"untested": _HARM}

    def missing(self, requirement: Requirement) -> bool:
        """Whether it could be tested in a way in which it is not, for no reason."""
        return any(what in ("no rule", "no case") for what in self.of(requirement).values())


def _told(what: object) -> str:
    """One way of testing, in words."""
    if isinstance(what, int):
        return f"{what} rule" + "s" * (what > 1)
    return ", ".join(what) if isinstance(what, list) else str(what)


def _as_json(requirement: Requirement, coverage: Coverage) -> dict[str, object]:
    return {
        "id": requirement.id,
        "where": requirement.where,
        "sentence": requirement.sentence,
        "original": requirement.original,
        "binds": requirement.binds.value,
        "testable": [m.name.lower() for m in requirement.testable if m.name],
        "hazard": requirement.hazard.value,
        "strength": requirement.strength.value,
        "basis": requirement.basis.value,
        "register": list(requirement.register),
        "coverage": coverage.of(requirement),
    }


@click.command(epilog=EXAMPLE)
@click.option("--clause", metavar="LIST", help="Clauses or ids, separated by commas.")
@click.option(
    "--uncovered", is_flag=True, help="Only those that could be tested in a way, and are not."
)
@click.option("--json", "as_json", is_flag=True, help="One JSON array, with the document's words.")
def command(clause: str | None, *, uncovered: bool, as_json: bool) -> None:
    """Show the requirements of the document, and what tests them or why nothing does."""
    try:
        chosen = select(clause) if clause else tuple(REQUIREMENTS.values())
    except UnknownRequirementError as unknown:
        raise Problem(UserMessage("--clause: {unknown}", unknown=unknown)) from None
    coverage = Coverage()
    if uncovered:
        chosen = tuple(r for r in chosen if coverage.missing(r))
    if as_json:
        told = [_as_json(r, coverage) for r in chosen]
        click.echo(json.dumps(told, ensure_ascii=False, indent=1))
        return
    console = Console(highlight=False)
    for r in chosen:
        facts = (r.where, r.binds.value, r.strength.value, r.hazard.value)
        console.print(f"[bold]{r.id}[/]  {', '.join(fact for fact in facts if fact)}")
        tested = "; ".join(f"{way}: {_told(what)}" for way, what in coverage.of(r).items())
        console.print(Padding(Text(f"{r.sentence}\n{tested}"), (0, 0, 0, 8)))
    click.echo(f"{len(chosen)} of {len(REQUIREMENTS)} requirements")
