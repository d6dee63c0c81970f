"""Test specification: the case sheets as a page to print, and the rows of a sheet."""

import itertools
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.protocol.hazard import Hazard
from scaraspec.report.model import Tool
from scaraspec.suite.engine.case import Case
from scaraspec.suite.engine.case_sheet import CaseSheet
from scaraspec.translation import display_language, localized
from scaraspec.user_message import UserMessage

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
    yield UserMessage("judges"), [line for each in case.requirements for line in _requirement(each)]
    yield UserMessage("hazards"), [hazards_of(case)]
    for label, lines in (
        (UserMessage("needs"), sheet.preconditions),
        (UserMessage("values"), sheet.values),
        (UserMessage("fails if"), sheet.criteria),
    ):
        if lines:
            yield label, lines
    if sheet.examples:
        yield UserMessage("values tried"), [f"{sheet.examples}"]
    yield UserMessage("steps"), [_steps(sheet.steps) or UserMessage("no steps")]
    yield UserMessage("typical duration"), [sheet.duration.sentence]
    yield UserMessage("source"), [sheet.location]


def hazards_of(case: Case) -> str:
    """Return the hazards of a case as a list."""
    return UserMessage.listed(UserMessage(each.value) for each in Hazard if each in case.hazards)


def _steps(steps: str) -> str:
    """Return the steps as a message; names of commands are the same in every language."""
    parts = {f"part_{number}": _step(part) for number, part in enumerate(steps.split(", "))}
    return UserMessage(", ".join(f"{{{name}}}" for name in parts), **parts) if steps else ""


def _step(step: str) -> str:
    """Return a step, which may be in brackets and have a number of repetitions."""
    found = _STEP.search(step)
    if not found:
        return step
    kind, name = found.groups()
    return UserMessage(
        "{before}{step}{after}",
        before=step[: found.start()],
        step=UserMessage(_STEPS[kind], name=name),
        after=step[found.end() :],
    )


_STEP: Final = re.compile(
    r"\b(connect|close|abort|invalid|result|opcode)\b(?: bytes| of)?(?: (\w+))?"
)
_STEPS: Final = {
    "connect": UserMessage("connect"),
    "close": UserMessage("close"),
    "abort": UserMessage("abort"),
    "invalid": "invalid bytes",
    "result": "result of {name}",
    "opcode": "opcode {name}",
}
"""Steps that are not the name of a command."""


def _requirement(name: str) -> Iterator[str]:
    """Yield the sentence of a requirement, and the words of the document."""
    found = REQUIREMENTS[name]
    lines = filter(None, found.where.split(", "))
    notes = (*lines, UserMessage(found.strength.value), *found.register)
    yield UserMessage(
        "{name}: {sentence} ({notes})",
        name=name,
        sentence=found.sentence,
        notes=UserMessage.listed(notes),
    )
    if found.original:
        yield f"「{found.original}」"


@dataclass(frozen=True, slots=True)
class _Group:
    """The cases of a role about one clause."""

    title: str
    anchor: str
    sheets: list[CaseSheet]


def render(sheets: Iterable[CaseSheet]) -> str:
    """Return the test specification as an HTML page that makes no network requests.

    It is in the display language.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - slow

    ordered = [*sheets]
    environment = Environment(
        loader=PackageLoader("scaraspec.suite.engine", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["localized"] = localized
    return environment.get_template("specification.html").render(
        language=display_language().value,
        title=UserMessage("Test specification"),
        about=UserMessage(
            "scaraspec {version}, UISR4200S protocol V1.0, {count} cases. This page is generated "
            "from the cases.",
            version=Tool.own().version,
            count=len(ordered),
        ),
        version=Tool.own().version,
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
        title = UserMessage("{role}, clause {clause}", role=UserMessage(role), clause=clause)
        yield _Group(title, f"{role}-{clause}", [*found])
