"""Protects the files of the user: which stored files are the suite's own, and their names.

A file is the suite's own if the controller has accepted its upload (0x50 answered with 1) in this
run, or in an earlier run whose journal says so. No other file is deleted, overwritten or run.
"""

import itertools
import secrets
import string
from collections.abc import Callable, Iterable
from typing import Final

from scaraspec.protocol.fields import NAME_MAX_BYTES
from scaraspec.suite.engine.expectations import CaseSkipped
from scaraspec.suite.engine.journal import Journal
from scaraspec.user_message import UserMessage

STEM: Final = "zs"
"""The beginning of the names of all files that the suite creates."""

TOKEN_LETTERS: Final = 2
"""Few enough for names of at most eight characters before the extension (A-5-20)."""
_TOKENS: Final = 100


def random_token() -> str:
    """Return a random token for one run."""
    return "".join(secrets.choice(string.ascii_lowercase) for _ in range(TOKEN_LETTERS))


class OwnFiles:
    """The files of one run.

    Args:
        journal: Records accepted uploads.
        draw_token: Creates a token for the run.

    Attributes:
        prefix: The beginning of the names of the run's files: the stem and the token.
    """

    def __init__(self, journal: Journal, draw_token: Callable[[], str] = random_token) -> None:
        self._journal, self._draw_token = journal, draw_token
        self._foreign: set[bytes] = set()
        self._accepted: set[bytes] = set()
        self._numbers = itertools.count(1)
        self.prefix = (STEM + draw_token()).encode()

    def begin(self, names: Iterable[bytes]) -> None:
        """Choose a token that occurs in no stored file name.

        Args:
            names: The names of the stored files.

        Raises:
            CaseSkipped: All drawn tokens are in use.
        """
        self._foreign = {_base(name) for name in names} - {b""}
        for _ in range(_TOKENS):
            if not any(name.startswith(self.prefix) for name in self._foreign):
                return
            self.prefix = (STEM + self._draw_token()).encode()
        raise CaseSkipped(
            UserMessage("{count} drawn names for new files are all in use", count=_TOKENS)
        )

    def new_name(self, extension: str, stem: str = "", *, lead: str = "") -> bytes:
        """Return a new name: the prefix, `lead`, a number, `stem` and the extension.

        The stem is cut if the name would exceed the maximum length (L226).
        """
        begin = f"{lead}{next(self._numbers)}"
        room = NAME_MAX_BYTES - len(self.prefix) - len(begin) - len(extension)
        if len(stem) > room:
            stem = stem[: max(room, 0)].rstrip(".")
        return self.prefix + f"{begin}{stem}{extension}".encode()

    @property
    def stored(self) -> list[bytes]:
        """The files of the suite that are stored, the oldest first."""
        return [name.encode("latin-1") for name in self._journal.changes.files]

    @property
    def any_accepted(self) -> bool:
        """Whether the upload of a file was accepted in this run."""
        return bool(self._accepted)

    def is_own(self, name: bytes) -> bool:
        """Whether the suite has uploaded this file, in this run or in an interrupted one."""
        return name in self._accepted or name in self.stored

    def note_list(self, names: Iterable[bytes]) -> None:
        """Note the names of a program list: files without the prefix belong to the user."""
        self._foreign |= {
            base for name in names if not (base := _base(name)).startswith(self.prefix)
        } - {b""}

    def check(self, name: bytes) -> None:
        """Require that no file of the user has this name.

        Raises:
            CaseSkipped: A file of the user has this name.
        """
        if _base(name) in self._foreign and not self.is_own(name):
            shown = name.decode("utf-8", "backslashreplace")
            raise CaseSkipped(
                UserMessage(
                    "{name} is a file on the controller that the suite did not create", name=shown
                )
            )

    def note_upload_request(self, name: bytes) -> None:
        """Record that an upload will be requested."""
        self._journal.write("offered", name=name.decode("latin-1"))

    def note_upload_reply(self, name: bytes, *, accepted: bool) -> None:
        """Record the reply to the request of an upload.

        Raises:
            JournalError: The acceptance cannot be recorded, so the content must not be sent.
        """
        if not accepted:
            self._journal.confirm("refused", name=name.decode("latin-1"))
            return
        self.note_stored(name)
        base = name.rstrip(b"\0").replace(b"\\", b"/").rpartition(b"/")[2]
        if base != name and base.startswith(self.prefix):
            self.note_stored(base)  # it may be stored under this name
        self._journal.flush()

    def note_stored(self, name: bytes) -> None:
        """Record that a file of the suite may be stored."""
        self._accepted.add(name)
        self._journal.confirm("accepted", name=name.decode("latin-1"))

    def note_deleted(self, name: bytes) -> None:
        """Record that a file of the suite is deleted or was never created."""
        self._journal.confirm("deleted", name=name.decode("latin-1"))


def _base(name: bytes) -> bytes:
    """Return a name as a controller may compare it: lower case, without path and NUL."""
    return name.rstrip(b"\0").replace(b"\\", b"/").rpartition(b"/")[2].lower()
