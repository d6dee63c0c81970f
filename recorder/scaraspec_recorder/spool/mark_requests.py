"""Passes requests of the user for a mark in the recording to the writer process.

The spool holds a number. The recorder's own process increments it, and the writer process reads
it. If the writer process dies before it acknowledges a request, its successor handles the request.
"""

from contextlib import suppress
from pathlib import Path
from typing import Final

_NAME: Final = "asked"


def request_mark(spool: Path) -> None:
    """Request a mark in the recording.

    Raises:
        OSError: The request cannot be written.
    """
    temporary = spool / f"{_NAME}.new"
    temporary.write_text(str(mark_request_count(spool) + 1), "ascii")
    temporary.replace(spool / _NAME)


def mark_request_count(spool: Path) -> int:
    """Return the number of requests since the spool was created."""
    with suppress(
        FileNotFoundError, ValueError
    ):  # no request yet, or the file was damaged by a power failure
        return int((spool / _NAME).read_text("ascii"))
    return 0
