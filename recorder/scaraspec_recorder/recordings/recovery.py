"""Recovery: repairs recordings whose writer was interrupted, including their .rrd files.

Belongs here: the search for such files and the lock on their folder, see `locked_folder`. Files
that a recorder is writing are not touched. `repair` repairs a single file.
"""

import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.recordings.capture import write_rrd
from scaraspec_recorder.recordings.repair import (
    is_full,
    remove_if_empty,
    remove_temporary_files,
    repair,
)
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.rerun.optimizer import is_whole
from scaraspec_recorder.sinks.sink import OutputFolder, Sink, SinkFactory
from scaraspec_recorder.sources.mcap_reader import read_mcap
from scaraspec_recorder.spool.locks import lock_spool, spool_folder
from scaraspec_recorder.spool.spool import unread_bytes

_log = logging.getLogger(__name__)


def sink_after_repair(folder: OutputFolder, *, make: SinkFactory) -> Sink:
    """Repair what an earlier recorder left in the folder, then make another sink (a `SinkFactory`).

    It is called with the folder held, and by whoever is to write there.

    Raises:
        OSError: The disk is full: nothing can be repaired, nor recorded.
    """
    remove_temporary_files(folder.path)
    for path in sorted(folder.path.glob("*.mcap")):
        if _unless_unreadable(_is_ended, path):
            continue
        try:
            if remove_if_empty(path):
                continue
            report = repair(path)
        except (CaptureError, OSError) as error:
            if isinstance(error, OSError) and is_full(folder.path):
                raise
            _log.warning("not repaired: %s", error)
        else:
            _log.warning("repaired %s: %s", path, "; ".join(report.notes))
    return make(folder)


@contextmanager
def locked_folder(folder: Path) -> Iterator[int]:
    """Hold a folder against recorders; give how much one that was killed has left unwritten.

    The number is that of bytes in its spool which it has not acknowledged; some may be written.

    Raises:
        BlockingIOError: A recorder writes into the folder.
        OSError: There is no room for a lock.
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
            shutil.rmtree(spool)
        os.close(held)


def has_complete_rrd(path: Path) -> bool:
    """Whether there is a whole .rrd file."""
    return path.exists() and _unless_unreadable(is_whole, path)


def rebuild_rrd(path: Path) -> Path:
    """Draw the .rrd file of a recording anew, in one step; return it.

    Raises:
        CaptureError: The recording cannot be read.
        OSError: The picture cannot be written; the one that is there stays.
        ImportError: Drawing needs an extra that is not installed; the text says which.
    """
    drawn = path.with_suffix(".rrd")
    beside = drawn.with_name(f".{drawn.name}.new")
    try:
        capture = read_mcap(path)
        write_rrd(capture, beside, needs_login=capture.needs_login)
        beside.replace(drawn)
    finally:
        beside.unlink(missing_ok=True)
    return drawn


def _is_ended(path: Path) -> bool:
    """Whether a recording was ended in order."""
    with path.open("rb") as file:
        file.seek(-min(len(MAGIC), path.stat().st_size), os.SEEK_END)
        return file.read() == MAGIC


def _unless_unreadable(ask: Callable[[Path], bool], path: Path) -> bool:
    """Ask it of a file; one that cannot be read is told, and left alone as if it were so."""
    try:
        return ask(path)
    except OSError as error:
        _log.warning("%s cannot be read: %s", path, error.strerror)
        return True
