"""Requests of the user for a mark in the recording, passed on to the writing process.

The spool holds a number. The recorder's own process increments it, and the writing process reads
it. A request that a dead writing process has not acknowledged is carried out by the next one.
"""

from contextlib import suppress
from pathlib import Path
from typing import Final

_NAME: Final = "asked"


def request_mark(spool: Path) -> None:
    """Ask for a mark.

    Raises:
        OSError: The request cannot be written.
    """
    beside = spool / f"{_NAME}.new"
    beside.write_text(str(mark_request_count(spool) + 1), "ascii")
    beside.replace(spool / _NAME)


def mark_request_count(spool: Path) -> int:
    """Return how often the user has asked since the spool was made."""
    with suppress(FileNotFoundError, ValueError):  # never yet, or torn by a loss of power
        return int((spool / _NAME).read_text("ascii"))
    return 0
