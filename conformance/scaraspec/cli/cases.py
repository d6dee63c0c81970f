"""`scaraspec cases`: what the suite tries, and the test specification."""

from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path

import click
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from scaraspec.certificate.decisions import decisions
from scaraspec.cli.problems import Problem, require_replaceable
from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import ExitStatus
from scaraspec.report.files import write_whole
from scaraspec.report.model import Role
from scaraspec.suite.engine.case_sheet import CaseSheet, case_sheets
from scaraspec.suite.engine.collection import collect
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.selection import SelectionError, parse_selection
from scaraspec.suite.engine.specification import INTRO, MARK, hazards_of, render, rows
from scaraspec.translation import localized
from scaraspec.user_message import UserMessage

EXAMPLE = "Example: scaraspec cases 4.15/2.missing"

_ROLES = (Role.CONTROLLER, Role.CLIENT)


@click.command(epilog=EXAMPLE)
@click.argument("case_id", metavar="[ID]", required=False)
@click.option(
    "--role",
    "role_name",
    type=click.Choice([role.value for role in _ROLES]),
    help="Only the cases for this role.",
)
@click.option("--only", metavar="LIST", help="Clauses, requirements or cases, such as 4.15,3/31.")
@click.option(
    "--html",
    "html_path",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the test specification: everything about these cases, to print.",
)
def command(
    case_id: str | None, *, role_name: str | None, only: str | None, html_path: Path | None
) -> None:
    """List the cases of the suite, or show everything about the case ID.

    If ID is a requirement and no case has this id, list the cases that judge it.

    The duration is that of a run which passes, on the simulated clock: the time that the case
    waits, and its number of steps.
    """
    if case_id and only:
        raise Problem("ID cannot be combined with --only")
    require_replaceable(html_path, MARK)
    roles = [Role(role_name)] if role_name else [*_ROLES]
    named = _named(case_id, roles) if case_id else []
    if case_id and not named and case_id not in REQUIREMENTS:
        raise _unknown(case_id, roles)
    sheets = named or [*_selected(case_id or only, roles)]
    if html_path:
        _write(html_path, sheets)
        return
    console = Console(highlight=False)
    for sheet in sheets:
        _show(sheet, console, whole=bool(named))
    if named:
        console.print(Padding(Text("\n".join(map(localized, INTRO))), (1, 0, 0, 0)))
    else:
        click.echo(localized("{count} cases", count=len(sheets)))


def _named(case_id: str, roles: list[Role]) -> list[CaseSheet]:
    """Return the sheets of a case; a controller case and a client case may have the same id."""
    only = Options(only=frozenset(), cases=frozenset({case_id}))
    return [sheet for role in roles for sheet in case_sheets(role, only)]


def _unknown(case_id: str, roles: list[Role]) -> Problem:
    known = [case.id for role in roles for case in collect(Options(), role)]
    near = get_close_matches(case_id, known, n=2)
    return Problem(
        UserMessage(
            "there is no case {case_id!r}{hint}; `scaraspec cases` lists all",
            case_id=case_id,
            hint=UserMessage(", did you mean {names}?", names=", ".join(near)) if near else "",
        )
    )


def _selected(only: str | None, roles: list[Role]) -> Iterator[CaseSheet]:
    """Yield the sheets of a selection, which must name something for one of the roles."""
    problems: list[SelectionError] = []
    for role in roles:
        try:
            selection = parse_selection(only, role)
        except SelectionError as error:
            problems.append(error)
        else:
            yield from case_sheets(
                role, Options(only=selection.requirements, cases=selection.cases)
            )
    if len(problems) == len(roles):
        raise Problem(UserMessage("no case is selected: {error}", error=problems[0]))


def _write(path: Path, sheets: list[CaseSheet]) -> None:
    try:
        write_whole(path, render(sheets))
    except OSError as error:
        raise Problem(
            UserMessage("{path} cannot be written: {reason}", path=path, reason=error.strerror),
            ExitStatus.INCONCLUSIVE,
        ) from None
    click.echo(localized("{path}: {count} cases", path=path, count=len(sheets)))


def _show(sheet: CaseSheet, console: Console, *, whole: bool) -> None:
    case = sheet.case
    if whole:
        console.print(f"[bold]{case.id}[/]  {localized(case.role.value)}")
        console.print(Padding(Text("\n\n".join(map(localized, case.paragraphs))), (0, 0, 0, 4)))
        for label, lines in rows(sheet):
            console.print(f"[bold]{localized(label)}[/]")
            for line in lines:
                console.print(Padding(Text(localized(line)), (0, 0, 0, 4)))
        for each in decisions():
            if each.role is case.role and case.id in each.cases:
                text = localized("decision of {date}", date=each.date)
                console.print(f"[bold]{text}[/]  {localized(each.consequence.value)}")
                texts = "\n".join(map(localized, (each.question, each.decision)))
                console.print(Padding(Text(texts), (0, 0, 0, 4)))
        return
    facts = [
        localized(case.role.value),
        localized(hazards_of(case)),
        *(localized("hook {hook}", hook=hook) for hook in case.needs),
        localized(sheet.duration.sentence),
    ]
    console.print(f"[bold]{case.id}[/]  {localized('; ').join(facts)}", soft_wrap=True)
    judged = localized("judges {requirements}", requirements=", ".join(case.requirements))
    console.print(Padding(Text(f"{localized(case.sentence)}\n{judged}"), (0, 0, 0, 8)))
