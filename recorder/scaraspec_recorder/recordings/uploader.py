"""Uploads finished recordings to a store, in a process of its own.

The process is started when the index of the folder has changed, and ends when everything in it is
uploaded or an upload fails. The next one continues after a pause. It runs with a low priority and
does not handle traffic; the writer process learns from the log which recordings are uploaded.
"""

import asyncio
import hashlib
import logging
import os
import platform
import socket
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from scaraspec_recorder.child_process import end_of, ignore_signals, spawn
from scaraspec_recorder.recordings.recording_stats import RecordingSummary
from scaraspec_recorder.recordings.upload_log import UploadLog, UploadState, forget_state
from scaraspec_recorder.recordings.upload_store import (
    Pace,
    UploadStore,
    robot_of,
    without_secrets,
)
from scaraspec_recorder.sinks.file_names import INDEX_NAME
from scaraspec_recorder.sinks.own_files import PRIVATE_MODE, umask_of
from scaraspec_recorder.spool.spool import lock
from scaraspec_recorder.units import SECOND_NS

RATE_BYTES: Final = 10_000_000
"""Maximum number of bytes that are read and sent in a second, unless the user sets another."""

MIN_PAUSE_S: Final = 10.0
MAX_PAUSE_S: Final = 300.0
"""Limits of the pause between two uploads; it doubles with each failure."""

HUNG_NS: Final = 600 * SECOND_NS
"""Time without progress after which an upload is given up."""

_NICENESS: Final = 10
_CHECK_S: Final = 1.0
_FAILED: Final = 1  # exit status of a process that has saved the reason
_LOCK: Final = "archive.lock"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Upload:
    """Where finished recordings are uploaded to.

    Attributes:
        url: Path or URL of the store.
        robot: The robot's name.
        rate_bytes: Maximum rate in bytes a second.
        file_mode: Access rights of files in a folder.
    """

    url: str
    robot: str
    rate_bytes: int = RATE_BYTES
    file_mode: int = PRIVATE_MODE


class Uploader:
    """Starts the uploads of a recorder, and reports their state.

    Args:
        upload: Where to upload to.
        folder: The folder of the recordings.
        spool: The spool of the recorder.
    """

    def __init__(self, upload: Upload, folder: Path, spool: Path) -> None:
        self._upload = upload
        self._folder = folder
        self._spool = spool
        self._last = UploadState(without_secrets(upload.url))
        self._ending = asyncio.Event()
        forget_state(spool)
        self._task = asyncio.create_task(self._run())

    @property
    def state(self) -> UploadState:
        """The state at the last progress."""
        self._last = UploadState.read(self._spool) or self._last
        return self._last

    async def finish(self, timeout_s: float) -> None:
        """Upload the rest, until something fails or `timeout_s` is over."""
        self._ending.set()
        try:
            await asyncio.wait_for(self._task, timeout_s)
        except TimeoutError:
            _log.warning("%s: %s are not archived yet", self._upload.robot, self.state.waiting_text)
        finally:
            self._last = self.state  # the spool is removed

    async def _run(self) -> None:
        done, pause_s, failing = None, MIN_PAUSE_S, False
        while True:
            ending, stamp = self._ending.is_set(), self._index_stamp()
            if stamp != done:
                before = self.state.archived
                if complete := await self._upload_once():
                    done = stamp
                progress = complete or self.state.archived > before
                pause_s = MIN_PAUSE_S if progress else min(2 * pause_s, MAX_PAUSE_S)
                if complete is failing:
                    failing = not complete
                    text = self.state.problem(0) if failing else "archiving continues"
                    _log.warning("%s: %s", self._upload.robot, text)
            if ending:
                return
            with suppress(TimeoutError):
                async with asyncio.timeout(pause_s):
                    await self._ending.wait()

    def _index_stamp(self) -> object:
        """Return what changes with the index; None if there is none."""
        with suppress(OSError):
            status = (self._folder / INDEX_NAME).stat()
            return status.st_ino, status.st_size, status.st_mtime_ns
        return None

    async def _upload_once(self) -> bool:
        """Upload everything in the index. Return whether nothing failed."""
        ours, theirs = socket.socketpair()
        with ours, theirs:
            try:
                process = spawn(
                    "archiver", run_uploads, self._upload, self._folder, self._spool, theirs
                )
            except (OSError, MemoryError) as error:  # too many processes or files at the moment
                self._fail(f"the archiving process cannot be started: {error}")
                return False
            begun_ns = time.time_ns()
            ending = asyncio.ensure_future(end_of(process))
            try:
                while not ending.done():
                    await asyncio.wait((ending,), timeout=_CHECK_S)
                    silent_ns = time.time_ns() - max(self.state.time_ns, begun_ns)
                    if silent_ns > HUNG_NS and not ending.done():
                        process.kill()
                status = ending.result()
            finally:
                ending.cancel()
                await asyncio.gather(ending, return_exceptions=True)
        if status not in (0, _FAILED):
            self._fail(f"the archiving process ended with status {status}")
        return status == 0

    def _fail(self, reason: str) -> None:
        state = self.state
        state.failure = reason
        state.save(self._spool)


def run_uploads(upload: Upload, folder: Path, spool: Path, line: socket.socket) -> None:
    """Main function of the process: upload the recordings in the index of a folder.

    It exits with `_FAILED` if an upload fails, after it has saved the reason. It ends when the
    other end of the line is closed.
    """
    ignore_signals()
    os.umask(umask_of(upload.file_mode))
    if hasattr(os, "nice"):  # not on Windows
        os.nice(_NICENESS)
    line.settimeout(0)
    state = UploadState.read(spool) or UploadState()
    state.url = without_secrets(upload.url)
    try:
        held = lock(spool / _LOCK, wait=True)  # a process of a killed recorder may still run
        try:
            _Uploads(upload, folder, spool, line, state).run()
        finally:
            os.close(held)
    except Exception as error:  # noqa: BLE001 - the libraries of stores have many exceptions
        *_, text = f"{error}".splitlines() or (type(error).__name__,)
        state.failure = without_secrets(getattr(error, "strerror", None) or text)
        state.save(spool)
        os._exit(_FAILED)  # at once: a library's thread may wait for a store that does not answer


class _Uploads:
    """One run of `run_uploads`."""

    def __init__(
        self, upload: Upload, folder: Path, spool: Path, line: socket.socket, state: UploadState
    ) -> None:
        self._upload = upload
        self._folder = folder
        self._spool = spool
        self._line = line
        self._state = state
        self._log = UploadLog(folder, upload.url)

    def run(self) -> None:
        """Upload everything.

        Raises:
            Exception: An upload failed.
        """
        from scaraspec_recorder.recordings.recording_index import (  # noqa: PLC0415 - the MCAP library
            listed_recordings,
        )

        listed = listed_recordings(self._folder)
        self._log.forget(listed)
        archived, failed = self._log.names(), self._state.failed
        waiting = [entry for name, entry in listed.items() if name not in archived]
        waiting.sort(key=lambda entry: (entry.name == failed, entry.begin_ns, entry.name))
        sizes_bytes = [self._size_bytes(entry) for entry in waiting]
        self._state.archived = len(archived)
        self._save(sizes_bytes)
        if waiting:
            token = hashlib.sha256(f"{platform.node()} {self._folder.resolve()}".encode())
            pace = Pace(self._upload.rate_bytes)
            store = UploadStore(self._upload.url, token.hexdigest()[:16], pace, self._note_progress)
            for number, entry in enumerate(waiting):
                self._state.failed = entry.name
                self._put(store, entry)
                self._state.archived += 1
                self._state.failure = ""
                self._save(sizes_bytes[number + 1 :])
        self._state.failed = self._state.failure = ""
        self._state.save(self._spool)

    def _size_bytes(self, entry: RecordingSummary) -> int:
        with suppress(OSError):
            return (self._folder / entry.name).stat().st_size
        return 0

    def _put(self, store: UploadStore, entry: RecordingSummary) -> None:
        path = self._folder / entry.name
        if not path.exists():
            _log.warning("%s was removed before it was archived", path)
            self._log.add(entry.name, missing=True)
            return
        stored, renamed = store.put(path, robot_of(entry.name, self._upload.robot))
        stored = without_secrets(stored)
        if renamed:
            _log.warning(
                "%s is archived as %s: the usual name is that of another file", path, stored
            )
        self._log.add(entry.name, stored=stored, size_bytes=path.stat().st_size)

    def _note_progress(self) -> None:
        """Save the time, and end if the recorder has ended."""
        with suppress(BlockingIOError):
            if not self._line.recv(1):
                raise InterruptedError("the recorder has ended")
        if time.time_ns() - self._state.time_ns > SECOND_NS:
            self._state.time_ns = time.time_ns()
            self._state.save(self._spool)

    def _save(self, waiting_bytes: list[int]) -> None:
        """Save the state: the sizes of the recordings that wait."""
        self._state.waiting = len(waiting_bytes)
        self._state.waiting_bytes = sum(waiting_bytes)
        self._state.time_ns = time.time_ns()
        self._state.save(self._spool)
