"""What is known about uploads: the log of a folder (archived.jsonl), and the state of the upload.

The log has one line for each uploaded recording. The state is in the spool, and ends with it.
"""

import json
import os
import time
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from scaraspec.user_message import UserMessage
from scaraspec_recorder.recordings.upload_store import without_secrets
from scaraspec_recorder.sinks.own_files import REBUILT, temporary_file
from scaraspec_recorder.units import SECOND_NS, show_size

FILE_NAME: Final = "archived.jsonl"

STALL_NS: Final = 120 * SECOND_NS
"""Time without progress after which an upload counts as stalled."""

_STATE_NAME: Final = "archive.json"
_OBSOLETE_LINES: Final = 1000  # of removed recordings, after which the log is written again


class UploadLog:
    """The recordings of a folder that are in a store.

    Args:
        folder: The folder of the recordings.
        url: Path or URL of the store.
    """

    def __init__(self, folder: Path, url: str) -> None:
        self._path = folder / FILE_NAME
        self._url = without_secrets(url)
        self._names: set[str] = set()
        self._read: object = None  # what identifies the content that was read

    def names(self) -> Collection[str]:
        """Return the names of the uploaded recordings.

        Raises:
            OSError: The log cannot be read.
        """
        with suppress(FileNotFoundError):
            status = self._path.stat()
            now = status.st_ino, status.st_size, status.st_mtime_ns
            if now != self._read:
                self._names = {line["name"] for line in self._lines() if line["url"] == self._url}
                self._read = now
        return self._names

    def add(self, name: str, **facts: Any) -> None:
        """Add a recording.

        Args:
            name: Its name.
            facts: What happened to it.

        Raises:
            OSError: The log cannot be written.
        """
        line = {"name": name, "url": self._url, "time_ns": time.time_ns(), **facts}
        with self._path.open("ab") as file:
            file.write(_encode(line))
            file.flush()
            os.fsync(file.fileno())

    def forget(self, present: Collection[str]) -> None:
        """Write the log again without removed recordings, if there are many.

        Args:
            present: The names of all recordings in the folder.

        Raises:
            OSError: The log cannot be written; the old one remains.
        """
        lines = [*self._lines()]
        kept = [line for line in lines if line["name"] in present]
        if len(lines) - len(kept) < _OBSOLETE_LINES:
            return
        beside = temporary_file(self._path, REBUILT)
        try:
            beside.write_bytes(b"".join(map(_encode, kept)))
            beside.replace(self._path)
        finally:
            beside.unlink(missing_ok=True)

    def _lines(self) -> Iterator[dict[str, Any]]:
        """Yield the valid lines of the log."""
        try:
            file = self._path.open("rb")
        except FileNotFoundError:
            return
        with file:
            for text in file:
                with suppress(ValueError, RecursionError):  # the end of a killed process
                    line = json.loads(text)
                    if isinstance(line, dict) and {"name", "url"} <= line.keys():
                        yield line


def _encode(line: dict[str, Any]) -> bytes:
    return json.dumps(line, ensure_ascii=False).encode() + b"\n"


@dataclass(slots=True)
class UploadState:
    """State of the uploads of a recorder. Its process sets it; after its end, the supervisor.

    Attributes:
        url: Path or URL of the store, without passwords.
        archived: Number of uploaded recordings.
        waiting: Number of recordings that are not uploaded yet.
        waiting_bytes: Their size.
        failed: Name of the recording whose upload failed last.
        failure: Why uploads fail; empty if they do not.
        time_ns: Time of the last progress, in nanoseconds since the Unix epoch.
    """

    url: str = ""
    archived: int = 0
    waiting: int = 0
    waiting_bytes: int = 0
    failed: str = ""
    failure: str = ""
    time_ns: int = 0

    @classmethod
    def read(cls, spool: Path) -> "UploadState | None":
        """Return the state that was saved last; None if there is none."""
        with suppress(OSError, ValueError, TypeError):
            return cls(**json.loads((spool / _STATE_NAME).read_text("utf-8")))
        return None

    def save(self, spool: Path) -> None:
        """Save the state, unless the spool cannot be written."""
        temporary = spool / f"{_STATE_NAME}.new"
        with suppress(OSError):
            temporary.write_text(json.dumps(asdict(self)), "utf-8")
            temporary.replace(spool / _STATE_NAME)

    @property
    def waiting_text(self) -> str:
        """The number of waiting recordings, and their size."""
        template = "{count} file ({size})" if self.waiting == 1 else "{count} files ({size})"
        return UserMessage(template, count=self.waiting, size=show_size(self.waiting_bytes))

    def problem(self, now_ns: int) -> str:
        """Return why recordings are not uploaded now; empty if they are, or if none waits."""
        if self.failure:
            return UserMessage(
                "archiving fails, {files} waiting: {reason}",
                files=self.waiting_text,
                reason=self.failure,
            )
        if self.waiting and now_ns - self.time_ns > STALL_NS:
            silent_s = (now_ns - self.time_ns) // SECOND_NS
            return UserMessage(
                "archiving is stalled for {silent_s} s, {files} waiting",
                silent_s=silent_s,
                files=self.waiting_text,
            )
        return ""


def forget_state(spool: Path) -> None:
    """Remove the state of an earlier recorder."""
    with suppress(OSError):
        (spool / _STATE_NAME).unlink(missing_ok=True)
