"""`scaraspec requirements`: the catalogue, the register, and what tests each requirement."""

import ast
import json
from collections import Counter
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
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
    requirement,
    select,
)
from scaraspec.judge.rules import RULES
from scaraspec.judge.rules.rule import Rule
from scaraspec.judge.rules.undecided import UNDECIDED
from scaraspec.register import Entry, register
from scaraspec.suite.engine.collection import CASES, METHODS, cases_in, collect
from scaraspec.suite.engine.plan import Options
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

if TYPE_CHECKING:
    from scaraspec.report.model import Role

EXAMPLE = "Example: scaraspec requirements --entry 4.17/3"

_HARM = "no network tool can test it without harm, or without Bluetooth"
_RULES = Counter(rule.requirement for rule in RULES)


class Coverage:
    """What tests each requirement."""

    def __init__(self) -> None:
        self._cases: dict[tuple[Role, str], list[str]] = {}
        for role in METHODS:
            for case in collect(Options(), role):
                for judged in case.requirements:
                    self._cases.setdefault((role, judged), []).append(case.id)

    def of(self, requirement: Requirement) -> dict[str, object]:
        """Return the rules and cases by test method; the reason if there are none."""
        tests: dict[str, object] = {}
        if Method.PASSIVE in requirement.testable:
            tests["capture"] = _RULES[requirement.id] or UNDECIDED.get(requirement.id, "no rule")
        for role, method in METHODS.items():
            if method in requirement.testable:
                tests[role.value] = self._cases.get((role, requirement.id), "no case")
        if Method.STATIC in requirement.testable:
            tests[UserMessage("file")] = "scaraspec program check"
        return tests or {UserMessage("untested"): _HARM}

    def missing(self, requirement: Requirement) -> bool:
        """Return whether a test method applies, has no test, and no reason is given."""
        return any(what in ("no rule", "no case") for what in self.of(requirement).values())


def _tests_text(tests: object) -> str:
    """Return the tests of one method as text."""
    if isinstance(tests, int):
        return localized("1 rule" if tests == 1 else "{count} rules", count=tests)
    return ", ".join(tests) if isinstance(tests, list) else localized(str(tests))


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
    "--entry", metavar="ID", help="One entry of the register (A-3-14) or one requirement (4.17/3)."
)
@click.option(
    "--uncovered", is_flag=True, help="Only requirements that could be tested, and are not."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, with the document's sentences.")
def command(clause: str | None, entry: str | None, *, uncovered: bool, as_json: bool) -> None:
    """Show the requirements of the document, and what tests each of them.

    With --entry, show one entry of the register of open points, or one requirement with the
    document's sentence and the file and line of its rules, cases and mutants.
    """
    if entry:
        if clause or uncovered:
            raise Problem("--entry cannot be combined with --clause or --uncovered")
        _show_entry(entry, as_json=as_json)
        return
    try:
        chosen = select(clause) if clause else tuple(REQUIREMENTS.values())
    except UnknownRequirementError as unknown:
        raise Problem(UserMessage("--clause: {unknown}", unknown=unknown)) from None
    coverage = Coverage()
    if uncovered:
        chosen = tuple(r for r in chosen if coverage.missing(r))
    if as_json:
        _print_json([_as_json(r, coverage) for r in chosen])
        return
    console = Console(highlight=False)
    for r in chosen:
        words = map(UserMessage, (r.binds.value, r.strength.value, r.hazard.value))
        facts = UserMessage.listed((*filter(None, r.where.split(", ")), *words))
        console.print(f"[bold]{r.id}[/]  {localized(facts)}")
        tested = localized("; ").join(
            localized("{method}: {tests}", method=UserMessage(method), tests=_tests_text(tests))
            for method, tests in coverage.of(r).items()
        )
        console.print(Padding(Text(f"{localized(r.sentence)}\n{tested}"), (0, 0, 0, 8)))
    text = "{count} of {total} requirements"
    click.echo(localized(text, count=len(chosen), total=len(REQUIREMENTS)))


def _print_json(value: object) -> None:
    click.echo(json.dumps(value, ensure_ascii=False, indent=1))


def _show_entry(name: str, *, as_json: bool) -> None:
    if name in register():
        fields = _of_register(register()[name])
    else:
        try:
            fields = _of_requirement(requirement(name))
        except UnknownRequirementError as unknown:
            raise Problem(
                UserMessage(
                    "--entry: {unknown}; register entries have ids such as A-3-14", unknown=unknown
                )
            ) from None
    if as_json:
        _print_json(fields)
        return
    console = Console(highlight=False)
    for label, value in fields.items():
        lines = value if isinstance(value, list) else [value]
        console.print(f"[bold]{localized(label)}[/]")
        for line in lines or [localized("none")]:
            console.print(Padding(Text(localized(line)), (0, 0, 0, 4)))


def _of_register(entry: Entry) -> dict[str, str | list[str]]:
    fields: dict[str, str | list[str]] = {
        UserMessage("id"): entry.id,
        UserMessage("title"): entry.title,
        UserMessage("verdict"): entry.verdict,
        "lines of the document": entry.where,
        "the document says": entry.says,
        UserMessage("problem"): entry.problem,
        UserMessage("readings"): entry.readings,
        UserMessage("default"): entry.default,
        "what a report may say": entry.tool_may_say,
    }
    return fields | ({"key of the reading": entry.key} if entry.key else {})


def _of_requirement(found: Requirement) -> dict[str, str | list[str]]:
    return {
        UserMessage("id"): found.id,
        UserMessage("requirement"): found.sentence,
        "lines of the document": str(found.where),
        "the document says": found.original,
        "register entries": list(found.register),
        UserMessage("rules"): [
            _rule_location(rule) for rule in RULES if rule.requirement == found.id
        ],
        UserMessage("cases"): list(_case_locations(found.id)),
        UserMessage("mutants"): list(_mutant_locations(found.id)),
    }


def _location(file: str, line: int) -> str:
    """Return file and line, relative to the folder that holds the package."""
    return f"{Path(file).relative_to(Path(__file__).parents[2])}:{line}"


def _rule_location(rule: Rule) -> str:
    """Return where the function of a rule is; several rules may share it, with other arguments."""
    check = rule.check.func if isinstance(rule.check, partial) else rule.check
    return _location(check.__code__.co_filename, check.__code__.co_firstlineno)


def _case_locations(requirement_id: str) -> Iterator[str]:
    for role, folder in CASES.items():
        for case, file in cases_in(folder, role):
            if requirement_id in case.requirements:
                place = _location(str(file), _function_lines(file)[case.function])
                yield UserMessage(
                    "{place}: {case}: {sentence}",
                    place=place,
                    case=case.id,
                    sentence=case.sentence,
                )


@cache
def _function_lines(file: Path) -> dict[str, int]:
    functions = (
        n for n in ast.parse(file.read_text("utf-8")).body if isinstance(n, ast.FunctionDef)
    )
    return {function.name: function.lineno for function in functions}


def _mutant_locations(requirement_id: str) -> Iterator[str]:
    from scaraspec.mutants import client as client_mutants  # noqa: PLC0415 - slow to import
    from scaraspec.mutants import controller as controller_mutants  # noqa: PLC0415 - slow to import

    for package in (controller_mutants, client_mutants):
        for mutant in package.mutants().values():
            if requirement_id in mutant.requirements:
                yield f"{_location(*mutant.location)}: {mutant.name}"
