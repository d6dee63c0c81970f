"""Claims: where the spool of a folder lies, and which recorder holds it.

Law: a spool that anybody holds, or that holds anything unwritten, is touched by nobody else.
"""

import hashlib
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from scaraspec.user_message import UserMessage
from scaraspec_recorder.spool.spool import LIMIT_BYTES, READER_LOCK, lock, unread_bytes

_MEMORY: Final = Path("/dev/shm")  # noqa: S108 - files there are made in a folder of our own, mode 0700
_PREFIX: Final = "scaraspec-"
_LOCK: Final = "recorder.lock"


def spool_folder(out_dir: Path, limit_bytes: int = LIMIT_BYTES) -> Path:
    """Return the folder of the spool of recordings into `out_dir`; made where it is not there.

    It lies in memory where the system has files there, for a disk that is slow or full must not
    reach the tap, and is just what the spool has to bridge; else in `out_dir`.

    Raises:
        OSError: It cannot be made, or is not ours alone.
    """
    beside = out_dir.resolve() / ".spool"
    name = hashlib.sha256(os.fsencode(beside)).hexdigest()[:16]
    in_memory = _MEMORY / f"{_PREFIX}{name}"
    if not beside.exists() and (in_memory.exists() or _has_room(limit_bytes)):
        in_memory.mkdir(mode=0o700, exist_ok=True)
        found = in_memory.lstat()  # it may have been laid there by somebody else
        private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
        if not private or found.st_uid != os.geteuid():
            raise PermissionError(
                UserMessage(
                    "{in_memory} is not a folder of this user alone: remove it", in_memory=in_memory
                )
            )
        return in_memory
    beside.mkdir(mode=0o700, parents=True, exist_ok=True)
    return beside


def _has_room(size_bytes: int) -> bool:
    if not os.access(_MEMORY, os.W_OK):
        return False
    return shutil.disk_usage(_MEMORY).free > size_bytes


def lock_spool(spool: Path) -> int:
    """Hold a spool until the returned descriptor is closed or the process ends.

    Raises:
        BlockingIOError: Another process holds it.
        OSError: There is no room for a lock.
    """
    while True:
        held = lock(spool / _LOCK, wait=False)
        with suppress(FileNotFoundError):  # it was just cleared away
            if (spool / _LOCK).stat().st_ino == os.fstat(held).st_ino:
                return held
        os.close(held)
        spool.mkdir(mode=0o700, exist_ok=True)


@contextmanager
def locked_spool(out_dir: Path, limit_bytes: int) -> Iterator[Path]:
    """Hold the spool against other recorders; those of dead ones are cleared away."""
    remove_abandoned_spools()
    spool = spool_folder(out_dir, limit_bytes)
    try:
        held = lock_spool(spool)
    except BlockingIOError:
        rule = "a folder has one recorder at a time, name another"
        raise BlockingIOError(
            UserMessage(
                "another recorder writes into {out_dir}: {rule}", out_dir=out_dir, rule=rule
            )
        ) from None
    try:
        yield spool
    finally:
        os.close(held)


def remove_abandoned_spools() -> None:
    """Remove what recorders that were killed have left in memory, where all of it is written."""
    for spool in _MEMORY.glob(f"{_PREFIX}*"):
        # Somebody holds it, or it is another user's; one without a lock is just being made.
        with suppress(OSError), ExitStack() as held:
            if (spool / _LOCK).exists():
                held.callback(os.close, lock_spool(spool))
                held.callback(os.close, lock(spool / READER_LOCK, wait=False))
                if not unread_bytes(spool):
                    shutil.rmtree(spool)
