"""Test specification: the case sheets as a page to print, and the rows of a sheet."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Tool
from scaraspec.suite.engine.case_sheet import CaseSheet

MARK: Final = '<meta name="generator" content="scaraspec cases">'
"""What every test specification contains."""

INTRO: Final = (
    (
        "Each case has a positive control before and after it: a connection, a login and a status "
        "request must work."
    ),
    (
        "A case passes if none of its checks fails and the judge finds no violation in its traffic."
        " The connections of the suite also check the form of each reply."
    ),
    (
        "A case is skipped if lacks in the ICS names a command that it needs, or if a hook that it "
        "needs is missing."
    ),
    (
        "Values in braces are known only in a run. Listed and drawn values are expressions of "
        "Python. The option --seed decides what is drawn, and --examples how many values."
    ),
    (
        "Steps and duration are those of a run that passes, with our own implementation on the "
        "simulated clock. Each step of a real run adds the reply time of the subject. [2] before a "
        "step is the second connection that is open; it holds until another number."
    ),
)
"""How to read a case sheet; a sentence or two each."""


def rows(sheet: CaseSheet) -> Iterator[tuple[str, Sequence[str]]]:
    """Yield what a sheet states besides id and purpose: a label and lines."""
    case = sheet.case
    yield "judges", [line for each in case.requirements for line in _requirement(each)]
    yield "hazards", [", ".join(hazard.value for hazard in Hazard if hazard in case.hazards)]
    for label, lines in (
        ("needs", sheet.preconditions),
        ("values", sheet.values),
        ("fails if", sheet.criteria),
    ):
        if lines:
            yield label, lines
    if sheet.examples:
        yield "values tried", [f"{sheet.examples}"]
    yield "steps", [sheet.steps or "none"]
    yield "typical duration", [sheet.duration.sentence]
    yield "source", [sheet.location]


def _requirement(name: str) -> Iterator[str]:
    """Yield the sentence of a requirement, and the words of the document."""
    found = REQUIREMENTS[name]
    notes = [f"{found.where}", found.strength.value, *found.register]
    yield f"{name}: {found.sentence} ({', '.join(filter(None, notes))})"
    if found.original:
        yield f"「{found.original}」"


@dataclass(frozen=True, slots=True)
class _Group:
    """The cases of a role about one clause."""

    title: str
    anchor: str
    sheets: list[CaseSheet]


def render(sheets: Iterable[CaseSheet]) -> str:
    """Return the test specification as an HTML page that makes no network requests."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - slow

    ordered = [*sheets]
    environment = Environment(
        loader=PackageLoader("scaraspec.suite.engine", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template("specification.html").render(
        version=Tool.own().version,
        sheets=ordered,
        intro=INTRO,
        groups=[*_groups(ordered)],
        rows=rows,
    )


def _groups(sheets: Iterable[CaseSheet]) -> Iterator[_Group]:
    def place(sheet: CaseSheet) -> tuple[str, str]:
        return sheet.case.role.value, REQUIREMENTS[sheet.case.requirements[0]].clause

    order = {clause: at for at, clause in enumerate(r.clause for r in REQUIREMENTS.values())}
    by_place = sorted(
        sheets, key=lambda sheet: (place(sheet)[0] == "client", order[place(sheet)[1]])
    )
    for (role, clause), found in itertools.groupby(by_place, key=place):
        yield _Group(f"{role}, clause {clause}", f"{role}-{clause}", [*found])
