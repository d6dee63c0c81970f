"""Decisions about contested cases, in `spec/decisions.toml`; see docs/disputes.md."""

import tomllib
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Final

import scaraspec
from scaraspec.report.codec import from_plain
from scaraspec.report.model import Role

_PACKAGE: Final = Path(scaraspec.__file__).parent


class Consequence(Enum):
    """What a decision changes: nothing, the cases, or the list that had them."""

    UPHELD = "upheld"
    REPAIRED = "repaired"
    WITHDRAWN = "withdrawn"


@dataclass(frozen=True, slots=True)
class Decision:
    """A decision about contested cases.

    Attributes:
        date: The date, as ISO 8601.
        role: The role of the SUT.
        cases: The ids of the cases.
        version: The first version of scaraspec that follows the decision.
        question: What was in doubt.
        decision: The answer, and why.
        lines: The lines of the document that decide, such as ``L79``.
        register: The register entries that decide, or that were changed.
        consequence: What happened to the cases.
        list: The id of the first list of mandatory cases that has the consequence.
    """

    date: str
    role: Role
    cases: tuple[str, ...]
    version: str
    question: str
    decision: str
    lines: tuple[str, ...]
    register: tuple[str, ...]
    consequence: Consequence
    list: str


@cache
def decisions() -> tuple[Decision, ...]:
    """Return all decisions, the oldest first."""
    found = tomllib.loads(decision_file().read_text(encoding="utf-8")).get("decision", [])
    return tuple(from_plain(Decision, each) for each in found)


def decision_file() -> Path:
    """Return the file of the decisions, in the wheel or in the repository."""
    installed = _PACKAGE / "_decisions.toml"
    return installed if installed.exists() else _PACKAGE.parents[1] / "spec" / "decisions.toml"
