"""Selection: which requirements and cases a list such as ``--only`` names."""

from collections.abc import Collection
from typing import Final, NamedTuple

from scaraspec.judge.requirements import REQUIREMENTS, UnknownRequirementError, select
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.readings import READINGS
from scaraspec.report.model import SEEN, Role
from scaraspec.suite.engine.collection import METHODS, collect
from scaraspec.suite.engine.plan import ONE_CASE, Options
from scaraspec.user_message import UserMessage, sentence_of

CLAIM: Final = "claim."
LACKS: Final = "lacks."
"""The beginnings of the ids of claims of the ICS: of a reading, and of an unsupported command."""


class SelectionError(ValueError):
    """A list names nothing that can be run; one sentence for the user."""


class Selection(NamedTuple):
    """What a list names.

    Attributes:
        requirements: The ids of requirements; None for all.
        cases: The ids of single cases.
    """

    requirements: frozenset[str] | None = None
    cases: frozenset[str] = frozenset()


def parse_selection(text: str | None, role: Role) -> Selection:
    """Parse a comma list of clauses, requirements and case ids.

    An id such as ``4.8/4`` may be that of a requirement and of one of its cases. It names the
    requirement with all its cases; ``case:4.8/4`` names this case alone.

    The id of a finding such as ``3/31.seen-1`` names its requirement. The id of a claim such as
    ``claim.prelogin`` names no case: claims are checked in every run.

    Args:
        text: The list; None for everything.
        role: The role of the subject.

    Raises:
        SelectionError: An item is empty, or names nothing that can be tested on this role.
    """
    if text is None:
        return Selection()
    ids = {case.id for case in collect(Options(), role)}
    requirements, cases = set[str](), set[str]()
    for item in (each.strip() for each in text.split(",")):
        name = item.partition(SEEN)[0]
        claim = name.removeprefix(CLAIM)
        is_claim = claim in READINGS or claim.removeprefix(LACKS) in BY_NAME
        if name.startswith(ONE_CASE):
            cases.add(_case(name.removeprefix(ONE_CASE), ids))
        elif (claim != name and is_claim) or (name in ids and name not in REQUIREMENTS):
            cases.add(name)
        else:
            requirements |= _requirements(name, role)
    return Selection(frozenset(requirements), frozenset(cases))


def _case(name: str, ids: Collection[str]) -> str:
    if name not in ids:
        raise SelectionError(
            UserMessage("there is no case {name!r}: `scaraspec cases` lists the cases", name=name)
        )
    return name


def _requirements(name: str, role: Role) -> set[str]:
    if not name:
        raise SelectionError("an item of the list is empty: name clauses, requirements or cases")
    try:
        named = select(name)
    except UnknownRequirementError as error:
        raise SelectionError(sentence_of(error)) from None
    testable = {each.id for each in named if METHODS[role] in each.testable}
    if not testable:
        raise SelectionError(
            UserMessage(
                "{name} cannot be tested on a {role}: `scaraspec requirements --clause {name}` "
                "shows what tests it",
                name=name,
                role=UserMessage(role.value),
            )
        )
    return testable
