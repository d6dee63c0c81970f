"""What identifies a finding: its fingerprint, and the lines of the document that it cites."""

import hashlib
import re
from collections.abc import Sequence
from typing import Final

from scaraspec.judge.requirements import REQUIREMENTS

_LENGTH: Final = 16
_VARIABLE: Final = re.compile(
    r"\bzs[a-z]{2}[a-z0-9]*"  # names of the suite's files have a token of the run
    r"|\b(?:[0-9A-F]{2} )+[0-9A-F]{2}\b"  # bytes
    r"|\d+(?:\.\d+)?"  # times, ports, connections, counters, values
    r"|, (?:once|\d+ times)"
)


def document_lines(requirements: Sequence[str]) -> str:
    """Return the lines of the document that state the first of these requirements."""
    known = [REQUIREMENTS[each] for each in requirements if each in REQUIREMENTS]
    return str(known[0].where) if known else ""


def fingerprint(case_id: str, requirement: str, message: str) -> str:
    """Return the fingerprint of a finding: 16 hexadecimal digits.

    Args:
        case_id: The id of the case; for a finding of the judge, its requirement.
        requirement: The requirement that was violated.
        message: The message; all that differs between runs is removed from it.
    """
    text = "\0".join((case_id, requirement, _VARIABLE.sub("#", message)))
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:_LENGTH]
