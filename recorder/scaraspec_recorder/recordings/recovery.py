"""Leftovers: recordings that nobody ended, found and made whole again, picture and all.

Law: what a recorder is writing is not touched, see `hold`. How a file is repaired stands in
`recover`.
"""

import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from scaraspec.user_message import UserMessage
from scaraspec_recorder.problems import CaptureError
from scaraspec_recorder.recordings.capture import draw_capture
from scaraspec_recorder.recordings.recover import discard_empty, is_full, recover, sweep
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.rerun.optimizing import is_whole
from scaraspec_recorder.sinks.sinks import Folder, Sink, SinkFactory
from scaraspec_recorder.sources.mcap_reading import read_mcap
from scaraspec_recorder.spool.locks import claim, spool_folder
from scaraspec_recorder.spool.spool import unread_bytes

_log = logging.getLogger(__name__)


def repairing_sink(folder: Folder, *, make: SinkFactory) -> Sink:
    """Repair what an earlier recorder left in the folder, then make another sink (a `SinkFactory`).

    It is called with the folder held, and by whoever is to write there.

    Raises:
        OSError: The disk is full: nothing can be repaired, nor recorded.
    """
    sweep(folder.path)
    for path in sorted(folder.path.glob("*.mcap")):
        if _unless_unreadable(_is_ended, path):
            continue
        try:
            if discard_empty(path):
                continue
            report = recover(path)
        except (CaptureError, OSError) as error:
            if isinstance(error, OSError) and is_full(folder.path):
                raise
            _log.warning("not repaired: %s", error)
        else:
            _log.warning("repaired %s: %s", path, "; ".join(report.notes))
    return make(folder)


@contextmanager
def hold(folder: Path) -> Iterator[int]:
    """Hold a folder against recorders; give how much one that was killed has left unwritten.

    The number is that of bytes in its spool which it has not acknowledged; some may be written.

    Raises:
        BlockingIOError: A recorder writes into the folder.
        OSError: There is no room for a lock.
    """
    spool = spool_folder(folder)
    try:
        held = claim(spool)
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


def is_drawn(path: Path) -> bool:
    """Whether there is a whole .rrd file."""
    return path.exists() and _unless_unreadable(is_whole, path)


def redraw(path: Path) -> Path:
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
        draw_capture(capture, beside, needs_login=capture.needs_login)
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
