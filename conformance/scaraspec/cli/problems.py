"""Errors that a user can cause: one sentence and an exit status."""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.user_message import UserMessage, sentence_of
from scaraspec_recorder.errors import TornCaptureError

_NO_CONTENT: Final = (b"", b"[]")


class Problem(Exception):  # noqa: N818 - it is a message for the user
    """An error that a user can cause: one sentence with the error, its place and the remedy."""

    def __init__(self, sentence: str, exit_status: ExitStatus = ExitStatus.USAGE) -> None:
        super().__init__(sentence)
        self.exit_status = exit_status


def unreadable(error: Exception) -> Problem:
    """Return the problem for a capture that cannot be read; a torn one is incomplete."""
    torn = isinstance(error, TornCaptureError)
    return Problem(sentence_of(error), ExitStatus.INCONCLUSIVE if torn else ExitStatus.USAGE)


def unwritable(error: OSError, exit_status: ExitStatus = ExitStatus.USAGE) -> Problem:
    """Return the problem for a file that cannot be written; the error names it."""
    return Problem(
        UserMessage(
            "{path} cannot be written: {reason}", path=error.filename, reason=error.strerror
        ),
        exit_status,
    )


def no_such_mutant(mutant_id: str, known: Iterable[str], role: str) -> Problem:
    """Return the problem for an unknown mutant id; it names the most similar ids."""
    near = ", ".join(get_close_matches(mutant_id, known, n=2))
    return Problem(
        UserMessage(
            "--mutant {mutant_id}: there is no such mutant{meant}; scaraspec prove --role {role} "
            "--list prints all",
            mutant_id=mutant_id,
            meant=UserMessage(", did you mean {names}?", names=near) if near else "",
            role=role,
        )
    )


def require_replaceable(path: Path | None, mark: str) -> None:
    """Require that a report overwrites nothing but an earlier report, or a file without content.

    Args:
        path: The file to write; None to write none.
        mark: Text that every report of this kind contains.

    Raises:
        Problem: The path is another file, a folder or a device.
    """
    if path is None or not path.exists():
        return
    try:
        earlier = path.read_bytes() if path.is_file() else b"no file"
    except OSError as error:
        raise Problem(
            UserMessage("{path} cannot be read: {reason}", path=path, reason=error.strerror)
        ) from None
    if mark.encode() not in earlier and earlier.strip() not in _NO_CONTENT:
        raise Problem(
            UserMessage(
                "{path} exists and is no earlier report of this kind: name another file", path=path
            )
        )


def make_folder(path: Path) -> None:
    """Create a folder to write into. A full or failing disk is ignored: it may recover.

    Raises:
        Problem: The path cannot become a folder.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise Problem(
            UserMessage("{path} is not a folder: name another one with --out", path=path)
        ) from None
    except (FileNotFoundError, PermissionError) as error:
        raise Problem(
            UserMessage(
                "the folder {path} cannot be created: {strerror}",
                path=path,
                strerror=error.strerror,
            )
        ) from None
    except OSError:
        pass
