"""Journal: records what a run may change on a controller, before the change is sent.

Each controller has one journal in the user's state directory, independent of ``--out``. A run that
ends normally removes it. If a run is killed, the next run reads the journal and restores everything
first (see `suite.controller.harness.state.recovery`). Only passwords of the suite are stored, never
the user's.

The file has one JSON object per line. Each line is on disk before the change that it announces is
sent. So an incomplete last line never announces a change that was sent.
"""

import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from scaraspec.operating_system import (
    LockedError,
    locked,
    make_private_folder,
    open_private,
    replace_file,
)
from scaraspec.suite.engine.expectations import CaseInconclusive
from scaraspec.user_message import UserMessage

T = TypeVar("T")

FORMAT: Final = 1
_SLUG: Final = re.compile(r"[^A-Za-z0-9.]+")
_DIGEST_CHARACTERS: Final = 8


class JournalError(CaseInconclusive):
    """The journal cannot be read or written; one sentence for the user."""


class ControllerBusyError(Exception):
    """Another run uses this controller; one sentence for the user."""


@dataclass
class Changes:
    """What a run may have changed and has not restored. Set by `apply` only.

    Attributes:
        started: When the run began, as ISO 8601.
        settings: What the settings were before the run, by name.
        changed: The names of the settings that the run may have changed.
        passwords: The passwords that the run may have set, the last one last; None is the user's.
        files: The files whose upload the controller has accepted and that are not deleted.
        offered: The files whose upload was requested and was not answered.
        motion: Whether the robot may be executing something.
    """

    started: str = ""
    settings: dict[str, Any] = field(default_factory=dict)
    changed: list[str] = field(default_factory=list)
    passwords: list[str | None] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    offered: list[str] = field(default_factory=list)
    motion: bool = False

    @property
    def any(self) -> bool:
        """Whether anything may have to be restored."""
        return bool(self.changed or self.passwords or self.files or self.offered or self.motion)

    @property
    def only_outputs(self) -> bool:
        """Whether only outputs may have to be restored."""
        others = self.passwords or self.files or self.offered or self.motion
        return not others and self.changed in ([], ["outputs"])

    def apply(self, record: Mapping[str, Any]) -> None:  # noqa: C901, PLR0912 - a branch for each event
        """Apply one record of the journal.

        Raises:
            KeyError, TypeError: It is not a record of this format.
        """
        match record["event"]:
            case "run":
                if record["format"] != FORMAT:
                    raise KeyError(record["format"])
                self.started = record["started"]
            case "settings":
                self.settings = dict(record["before"])
            case "changing":
                _add(self.changed, record["setting"])
            case "restored":  # a comparison has shown that every changed setting is restored
                self.changed.clear()
                self.offered.clear()
            case "password":
                _remove(self.passwords, record["value"])
                self.passwords.append(record["value"])
            case "password-refused":  # probably not set, so recovery tries it last
                _remove(self.passwords, record["value"])
                self.passwords.insert(0, record["value"])
            case "password-restored":
                self.passwords.clear()
            case "offered":
                _add(self.offered, record["name"])
            case "accepted":
                _remove(self.offered, record["name"])
                _add(self.files, record["name"])
            case "refused":
                _remove(self.offered, record["name"])
            case "deleted":
                _remove(self.files, record["name"])
            case "motion":
                self.motion = True
            case "rest":
                self.motion = False
            case _:
                raise KeyError(record["event"])


class Journal:
    """The journal of one run.

    Args:
        path: The file; None keeps everything in memory, for a controller in this process.

    Attributes:
        path: The file.
        earlier: The changes of an interrupted run; None if there was none.
        changes: What this run may have changed and has not restored.
        failure: Why a record of this run could not be written at once; empty if all could.

    Raises:
        JournalError: The journal of an earlier run cannot be read.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path
        self.changes = Changes()
        self.earlier = _load(path) if path else None
        self._descriptor: int | None = None
        self.failure = ""
        self._unwritten, self._on_disk = b"", True
        self._restoring = False

    @classmethod
    @contextmanager
    def of(cls, controller: str, folder: Path, *, wait_s: float = 0.0) -> Iterator[Self]:
        """Open the journal of a controller and lock it against other runs.

        Args:
            controller: The controller's URL with its address resolved.
            folder: The state directory.
            wait_s: How long to wait for another run.

        Raises:
            ControllerBusyError: Another run uses it.
            JournalError: The state directory cannot be used, or the journal cannot be read.
        """
        digest = sha256(controller.encode()).hexdigest()[:_DIGEST_CHARACTERS]
        name = f"{_SLUG.sub('-', controller).strip('-')}-{digest}"
        with ExitStack() as held:
            try:
                make_private_folder(folder)
                held.enter_context(locked(folder / f"{name}.lock", wait_s))
            except LockedError:
                raise ControllerBusyError(
                    UserMessage(
                        "another scaraspec run is using {controller}: wait for it with "
                        "--wait-for-lock 60s",
                        controller=controller,
                    )
                ) from None
            except OSError as error:
                raise JournalError(
                    UserMessage(
                        "the state directory {folder} cannot be used: {strerror}; name "
                        "another one with --state-dir",
                        folder=folder,
                        strerror=error.strerror,
                    )
                ) from None
            journal = cls(folder / f"{name}.journal")
            held.callback(journal.close)
            yield journal

    def begin(self, started: str, settings: Mapping[str, Any]) -> None:
        """Begin a run. The changes of an earlier run must be restored before.

        Args:
            started: The time, as ISO 8601.
            settings: What the settings are, by name.

        Raises:
            JournalError: It cannot be written.
        """
        self.close()
        self.changes, self.earlier = Changes(), None
        if self.path:
            fresh = self.path.with_suffix(".new")
            self._open(fresh, os.O_TRUNC)
        self.write("run", format=FORMAT, started=started, process=os.getpid())
        self.write("settings", before=dict(settings))
        if self.path:
            self.close()  # Windows renames no open file
            try:
                replace_file(fresh, self.path)
            except OSError as error:
                raise self._unwritable(error) from None
            self._open(self.path, os.O_APPEND)

    def resume(self) -> None:
        """Continue the journal of an interrupted run, to restore its changes.

        Raises:
            JournalError: It cannot be written.
        """
        assert self.earlier is not None, "no run was interrupted"
        self.changes = self.earlier
        if self.path:
            self._open(self.path, os.O_APPEND)
            self._unwritten = b"\n"  # start a new line after an incomplete one

    def write(self, event: str, **values: Any) -> None:
        """Write a record, and wait until it is on disk.

        Raises:
            JournalError: It cannot be written yet: the change that it announces must not be made.
        """
        record = self._queued(event, values)
        try:
            self.flush()
        except JournalError:
            if not self._restoring:
                raise
        self.changes.apply(record)

    def confirm(self, event: str, **values: Any) -> None:
        """Write a record of something that has happened; if the disk is full, write it later.

        It is on disk at the latest after the next `write`. Without it, a later run may try to
        restore more than necessary.
        """
        self.changes.apply(self._queued(event, values))
        with suppress(JournalError):
            self.flush(wait=False)

    def flush(self, *, wait: bool = True) -> None:
        """Write all records.

        Args:
            wait: Wait until they are on disk. Otherwise they survive the end of this process, and
                not that of the system.

        Raises:
            JournalError: They cannot be written.
        """
        if self._descriptor is None:
            return
        try:
            while self._unwritten:
                self._unwritten = self._unwritten[os.write(self._descriptor, self._unwritten) :]
                self._on_disk = False
            if wait and not self._on_disk:
                os.fsync(self._descriptor)
                self._on_disk = True
        except OSError as error:
            failure = self._unwritable(error)
            self.failure = f"{failure}"
            raise failure from None

    @contextmanager
    def restoring(self) -> Iterator[None]:
        """In this context a failed write is ignored: a full disk must not prevent restoration."""
        before, self._restoring = self._restoring, True
        try:
            yield
        finally:
            self._restoring = before

    def finish(self) -> None:
        """End a run whose changes are all restored, and remove the journal.

        Raises:
            JournalError: It cannot be removed.
        """
        self.close()
        self.changes = Changes()
        if self.path:
            try:
                self.path.unlink(missing_ok=True)
            except OSError as error:
                raise self._unwritable(error) from None

    def close(self) -> None:
        """Close the file and keep it."""
        self._unwritten = b""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _queued(self, event: str, values: Mapping[str, Any]) -> dict[str, Any]:
        record = {"event": event, **values}
        if self._descriptor is not None:
            self._unwritten += json.dumps(record, ensure_ascii=True).encode() + b"\n"
        return record

    def _open(self, path: Path, flag: int) -> None:
        try:
            self._descriptor = open_private(path, os.O_WRONLY | os.O_CREAT | flag)
        except OSError as error:
            raise self._unwritable(error) from None

    def _unwritable(self, error: OSError) -> JournalError:
        return JournalError(
            UserMessage(
                "the journal {path} cannot be written: {strerror}",
                path=self.path,
                strerror=error.strerror,
            )
        )


def _load(path: Path) -> Changes | None:
    """Read the changes of an interrupted run; None if there is no journal.

    Raises:
        JournalError: It cannot be read.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return None
    except OSError as error:
        raise JournalError(
            UserMessage(
                "the journal {path} cannot be read: {strerror}", path=path, strerror=error.strerror
            )
        ) from None
    changes = Changes()
    for number, line in enumerate(lines, 1):
        try:
            record = json.loads(line)
        except ValueError:
            continue  # the run was killed while it wrote this line: its change was not sent
        try:
            changes.apply(record)
        except (KeyError, TypeError):
            raise JournalError(
                UserMessage(
                    "line {number} of the journal {path} is of another version of scaraspec: "
                    "restore the values in the file by hand, then delete it",
                    number=number,
                    path=path,
                )
            ) from None
    return changes


def _add(values: list[T], value: T) -> None:
    if value not in values:
        values.append(value)


def _remove(values: list[T], value: T) -> None:
    if value in values:
        values.remove(value)
