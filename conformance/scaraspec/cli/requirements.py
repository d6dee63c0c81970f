"""`scaraspec requirements`: the catalogue, and which rules judge each requirement."""

import json

import click
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from scaraspec.cli.problems import Problem
from scaraspec.judgement.requirements import (
    REQUIREMENTS,
    Method,
    Requirement,
    UnknownRequirementError,
    select,
)
from scaraspec.judgement.rules import RULES

EXAMPLE = "Example: scaraspec requirements --clause 4.15,3/31"

_RULES = {rule.requirement for rule in RULES}


def _passive(requirement: Requirement) -> str:
    """Whether a capture decides it: yes, no, or not yet."""
    if Method.PASSIVE not in requirement.testable:
        return "no"
    return "yes" if requirement.id in _RULES else "no rule"


def _as_json(requirement: Requirement) -> dict[str, object]:
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
        "passive_rule": requirement.id in _RULES,
    }


@click.command(epilog=EXAMPLE)
@click.option("--clause", metavar="LIST", help="Clauses or ids, separated by commas.")
@click.option(
    "--uncovered", is_flag=True, help="Only those that a capture could decide and no rule does."
)
@click.option("--json", "as_json", is_flag=True, help="One JSON array, with the document's words.")
def command(clause: str | None, *, uncovered: bool, as_json: bool) -> None:
    """Show the requirements of the document, numbered by clause."""
    try:
        chosen = select(clause) if clause else tuple(REQUIREMENTS.values())
    except UnknownRequirementError as unknown:
        raise Problem(f"--clause: {unknown}") from None
    if uncovered:
        chosen = tuple(r for r in chosen if _passive(r) == "no rule")
    if as_json:
        click.echo(json.dumps([_as_json(r) for r in chosen], ensure_ascii=False, indent=1))
        return
    console = Console(highlight=False)
    for r in chosen:
        facts = (r.where, r.binds.value, r.strength.value, r.hazard.value)
        told = ", ".join(fact for fact in facts if fact)
        console.print(f"[bold]{r.id}[/]  {told}; from a capture: {_passive(r)}")
        console.print(Padding(Text(r.sentence), (0, 0, 0, 8)))
    click.echo(f"{len(chosen)} of {len(REQUIREMENTS)} requirements")
