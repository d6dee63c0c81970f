"""Recovery: repairs recordings whose writer was interrupted, including their .rrd files.

Belongs here: the search for such files and the lock on their folder, see `locked_folder`. Files
that a recorder is writing are not touched. `repair` repairs a single file.
"""

import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.capture import write_rrd
from scaraspec_recorder.recordings.recording_stats import RERUN_SUFFIX
from scaraspec_recorder.recordings.repair import incomplete_rrd, is_full, repair
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.own_files import (
    REBUILT,
    is_own,
    remove_temporary_files,
    temporary_file,
)
from scaraspec_recorder.sinks.rerun.optimizer import is_whole, optimize
from scaraspec_recorder.sinks.sink import OutputFolder, Sink, SinkFactory
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.spool.locks import lock_spool, release_spool, remove_spool, spool_folder
from scaraspec_recorder.spool.spool import unread_bytes

_log = logging.getLogger(__name__)


def sink_after_repair(folder: OutputFolder, *, make: SinkFactory) -> Sink:
    """Repair the files of an earlier recorder, then create another sink (a `SinkFactory`).

    The caller must hold the lock of the folder.

    Raises:
        OSError: The disk is full: neither repair nor recording is possible.
    """
    remove_temporary_files(folder.path)
    for path in sorted(folder.path.glob("*.mcap")):
        with suppress(OSError):  # reported below
            if torn := is_own(path) and incomplete_rrd(path):
                _log.warning("%s", torn)
        if _unless_unreadable(_is_complete, path):
            continue
        try:
            report = repair(path)
        except (CaptureError, OSError) as error:
            if isinstance(error, OSError) and is_full(folder.path):
                raise
            _log.warning("not repaired: %s", error)
        else:
            _log.warning("repaired %s: %s", path, "; ".join(report.notes))
    for drawn in sorted(folder.path.glob("*.rrd")):
        if _unless_unreadable(lacks_recording, drawn) and not has_complete_rrd(drawn):
            _log.warning(
                "%s",
                UserMessage(
                    "{drawn} is incomplete, and its .mcap file is missing: "
                    "scaraspec recover {drawn} repairs it",
                    drawn=drawn,
                ),
            )
    return make(folder)


@contextmanager
def locked_folder(folder: Path) -> Iterator[int]:
    """Lock a folder against recorders. Yields the unacknowledged bytes in its spool.

    Some of these bytes may already be written.

    Raises:
        BlockingIOError: A recorder writes into the folder.
        OSError: The lock file cannot be created.
    """
    spool = spool_folder(folder)
    try:
        held = lock_spool(spool)
    except BlockingIOError:
        raise BlockingIOError(
            UserMessage("a recorder writes into {folder}: stop it first", folder=folder)
        ) from None
    unwritten_bytes = unread_bytes(spool)
    try:
        yield unwritten_bytes
    finally:
        if not unwritten_bytes:
            remove_spool(spool)
        release_spool(spool, held)


def lacks_recording(path: Path) -> bool:
    """Whether a file is an .rrd file of this recorder whose .mcap file was removed.

    Raises:
        OSError: The file cannot be read.
    """
    return path.suffix == RERUN_SUFFIX and not path.with_suffix(".mcap").exists() and is_own(path)


def repair_rrd(path: Path) -> bool:
    """Repair an .rrd file without its .mcap file: what was written before the interruption remains.

    Returns:
        Whether it was rewritten; False if it was complete.

    Raises:
        CaptureError: It cannot be repaired, and is unchanged.
        OSError: The file cannot be read.
    """
    if is_whole(path):
        return False
    if not optimize(path):
        raise CaptureError(
            UserMessage(
                "{path} was not repaired: the tool rerun cannot read it, or the disk is full",
                path=path,
            )
        )
    return True


def has_complete_rrd(path: Path) -> bool:
    """Whether a complete .rrd file exists."""
    return path.exists() and _unless_unreadable(is_whole, path)


def rebuild_rrd(path: Path) -> Path:
    """Write the .rrd file of a recording again and replace it atomically. Return its path.

    Raises:
        CaptureError: The recording cannot be read.
        OSError: The .rrd file cannot be written; the old one remains.
        ImportError: The extra for Rerun is not installed.
    """
    drawn = path.with_suffix(RERUN_SUFFIX)
    temporary = temporary_file(drawn, REBUILT)
    try:
        shutil.copymode(path, temporary)
        capture = read_mcap(path)
        write_rrd(capture, temporary, needs_login=capture.needs_login)
        temporary.replace(drawn)
    finally:
        temporary.unlink(missing_ok=True)
    return drawn


def _is_complete(path: Path) -> bool:
    """Whether a recording was closed properly, or is not one of this recorder."""
    if not is_own(path):
        return True
    with path.open("rb") as file:
        file.seek(-min(len(MAGIC), path.stat().st_size), os.SEEK_END)
        return file.read() == MAGIC


def _unless_unreadable(ask: Callable[[Path], bool], path: Path) -> bool:
    """Return the result of a check. Log an unreadable file and return True."""
    try:
        return ask(path)
    except OSError as error:
        _log.warning("%s cannot be read: %s", path, error.strerror)
        return True
