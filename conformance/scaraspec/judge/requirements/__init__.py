"""The requirement catalogue, and how to find a requirement, a clause or a selection in it.

The ``clause_*`` modules contain the requirements as data, `catalogue` contains their order, and
`entry` contains their types. Clause ``T`` has the conventions of text and numbers, which have no
clause of their own in the document. The rules that judge them are in ``scaraspec.judge.rules``. A
name that matches no requirement is an error and never an empty result: a mistyped selection must
not look like a run without failures.
"""

import difflib
import reprlib
from collections.abc import Mapping
from types import MappingProxyType

from scaraspec.judge.requirements.catalogue import CATALOGUE
from scaraspec.judge.requirements.entry import (
    Basis,
    Binds,
    LineRange,
    Method,
    Requirement,
    Strength,
)
from scaraspec.user_message import UserMessage

__all__ = [
    "REQUIREMENTS",
    "SUCCESS",
    "Basis",
    "Binds",
    "LineRange",
    "Method",
    "Requirement",
    "Strength",
    "UnknownRequirementError",
    "by_clause",
    "requirement",
    "select",
]

REQUIREMENTS: Mapping[str, Requirement] = MappingProxyType({entry.id: entry for entry in CATALOGUE})
"""Every requirement by its id, in the order of the document."""

SUCCESS: Mapping[str, str] = MappingProxyType(
    {
        "run_program": "4.15/5",
        "simulate_program": "4.16/3",
        "emergency_stop": "4.17/4",
        "reset": "4.18/4",
        "set_tool_coordinates": "4.24/6",
        "release_joints": "4.25/3",
        "lock_joints": "4.26/3",
        "jog": "4.28/5",
    }
)
"""The requirement on the final result of a success, by command."""

_LONGEST_NAME = 32  # far above any id: bounds the search for similar names in hostile input


class UnknownRequirementError(LookupError):
    """A name matches no requirement or clause; the message suggests similar names."""


def requirement(requirement_id: str) -> Requirement:
    """Return the requirement with an id, for example ``"4.15/3"``.

    Raises:
        UnknownRequirementError: No requirement has this id.
    """
    try:
        return REQUIREMENTS[requirement_id]
    except KeyError:
        raise _unknown("requirement", requirement_id, list(REQUIREMENTS)) from None


def by_clause(prefix: str) -> tuple[Requirement, ...]:
    """Return the requirements of a clause and of its subclauses, in the order of the document.

    Numbers are compared as a whole: ``"4.1"`` selects clause 4.1 and not 4.15. ``"4"`` selects all
    of clause 4, and ``"6.6"`` selects both clauses with this number.

    Raises:
        UnknownRequirementError: No clause has this number.
    """
    found = tuple(r for r in CATALOGUE if _is_within(r.clause, prefix))
    if not found:
        raise _unknown("clause", prefix, [r.clause for r in CATALOGUE])
    return found


def select(selection: str) -> tuple[Requirement, ...]:
    """Return the requirements of a list of clauses and ids, such as ``"4.15, 2/3"``.

    Each requirement is returned once, in the order of the document.

    Raises:
        UnknownRequirementError: An item of the list is neither a clause nor a requirement.
    """
    chosen = set[str]()
    for name in (item.strip() for item in selection.split(",")):
        named = (requirement(name),) if "/" in name else by_clause(name)
        chosen.update(r.id for r in named)
    return tuple(r for r in CATALOGUE if r.id in chosen)


def _is_within(clause: str, prefix: str) -> bool:
    number_ends = not clause[len(prefix) :][:1].isdigit()
    return bool(prefix) and clause.startswith(prefix) and number_ends


def _unknown(kind: str, name: str, known: list[str]) -> UnknownRequirementError:
    near = difflib.get_close_matches(name[:_LONGEST_NAME], dict.fromkeys(known))
    hint = (
        UserMessage("did you mean {names}?", names=", ".join(near))
        if near
        else UserMessage("`scaraspec requirements` lists all.")
    )
    return UnknownRequirementError(
        UserMessage(
            "There is no {kind} {name}; {hint}", kind=kind, name=reprlib.repr(name), hint=hint
        )
    )
