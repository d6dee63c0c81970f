"""Register of open points: what the protocol document leaves open, and how scaraspec decides it.

The entries are in `register.toml`. The page `spec/register.md` is generated from them. Code cites
an entry by its id, such as ``A-3-14``.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Final

DOCUMENT_SHA256: Final = "502c86166053c6776697b7e9b7b2d3420177ca3a22586a78c33829a6f490e68d"
"""The SHA-256 checksum of the plain text of the document, V1.0, which line numbers refer to."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One open point, contradiction or gap of the document.

    Attributes:
        id: The id, ``A-`` with clause and number.
        chapter: The chapter of the register.
        title: What it is about.
        verdict: ``FIRM`` (another behaviour fails), ``TOLERANT`` (each reading passes and is
            reported) or ``INFO`` (nothing can be decided from the text).
        where: The lines of the document, as ``L123``.
        says: The words of the document.
        problem: What is missing or contradictory.
        readings: The plausible interpretations.
        default: The reading that scaraspec takes unless another one is claimed, and why.
        tool_may_say: What a conformance tool may report.
        key: The key of the reading in a dialect; empty if there is none.
    """

    id: str
    chapter: str
    title: str
    verdict: str
    where: str
    says: str
    problem: str
    readings: str
    default: str
    tool_may_say: str
    key: str = ""


@cache
def register() -> Mapping[str, Entry]:
    """Return all entries by id, in the order of the document."""
    text = resources.files(__package__).joinpath("register.toml").read_text("utf-8")
    entries = (Entry(**fields) for fields in tomllib.loads(text)["entry"])
    return MappingProxyType({entry.id: entry for entry in entries})
