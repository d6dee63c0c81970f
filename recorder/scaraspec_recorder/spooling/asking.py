"""Asking: how somebody who presses a button gets an incident, whatever the writer is doing.

Law: a number in the spool, which the recorder's own process counts up and the writing process
heeds. It outlives a writer that dies: what that had not acknowledged, the next one heeds.
"""

from contextlib import suppress
from pathlib import Path
from typing import Final

_NAME: Final = "asked"


def ask(spool: Path) -> None:
    """Ask for an incident.

    Raises:
        OSError: That cannot be noted.
    """
    beside = spool / f"{_NAME}.new"
    beside.write_text(str(asked(spool) + 1), "ascii")
    beside.replace(spool / _NAME)


def asked(spool: Path) -> int:
    """Return how often that was done since the spool was made."""
    with suppress(FileNotFoundError, ValueError):  # never yet, or torn by a loss of power
        return int((spool / _NAME).read_text("ascii"))
    return 0
