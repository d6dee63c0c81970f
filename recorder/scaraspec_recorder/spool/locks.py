"""Location of the spool of an output folder, and its locks.

A spool that is locked or that contains unwritten data is never removed by another process.
"""

import hashlib
import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from scaraspec.user_message import UserMessage
from scaraspec_recorder.spool.spool import LIMIT_BYTES, READER_LOCK, lock, unread_bytes

_MEMORY: Final = Path(
    "/dev/shm"  # noqa: S108 - files are created in an own folder with mode 0700
    if sys.platform != "win32"
    else "//./none"  # no such folder, also where Windows is emulated on another system
)
_PREFIX: Final = "scaraspec-"
_LOCK: Final = "recorder.lock"
_LOCKS: Final = (_LOCK, READER_LOCK)


def spool_folder(out_dir: Path, limit_bytes: int = LIMIT_BYTES, *, durable: bool = False) -> Path:
    """Return the spool folder of recordings into `out_dir`; it is created if missing.

    The folder is in memory (/dev/shm) if possible, so that a slow or full disk does not affect the
    tap; otherwise, and if it must be durable, in `out_dir`.

    Raises:
        OSError: The folder cannot be created, or other users can access it. Or it must be durable,
            and an earlier recorder has left data in memory.
    """
    on_disk, in_memory = _places(out_dir)
    if durable and in_memory.is_dir() and unread_bytes(in_memory):
        raise OSError(
            UserMessage(
                "{folder} has data of an earlier recording: start once without --durable to write "
                "it",
                folder=in_memory,
            )
        )
    if not durable and not on_disk.exists() and (in_memory.exists() or _has_room(limit_bytes)):
        in_memory.mkdir(mode=0o700, exist_ok=True)
        found = in_memory.lstat()  # another user may have created it
        private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
        if not private or found.st_uid != os.geteuid():
            raise PermissionError(
                UserMessage(
                    "{folder} is not a private folder of this user: remove it", folder=in_memory
                )
            )
        return in_memory
    on_disk.mkdir(mode=0o700, parents=True, exist_ok=True)
    return on_disk


def find_spool(out_dir: Path) -> Path | None:
    """Return the spool folder of recordings into `out_dir`; None if there is none."""
    on_disk, in_memory = _places(out_dir)
    return next((folder for folder in (on_disk, in_memory) if folder.is_dir()), None)


def _places(out_dir: Path) -> tuple[Path, Path]:
    """Return the possible folders, on disk and in memory."""
    on_disk = out_dir.resolve() / ".spool"
    name = hashlib.sha256(os.fsencode(on_disk)).hexdigest()[:16]
    return on_disk, _MEMORY / f"{_PREFIX}{name}"


def _has_room(size_bytes: int) -> bool:
    if not os.access(_MEMORY, os.W_OK):
        return False
    return shutil.disk_usage(_MEMORY).free > size_bytes


def lock_spool(spool: Path) -> int:
    """Lock a spool until the returned descriptor is closed or the process ends.

    Raises:
        BlockingIOError: Another process has the lock.
        OSError: The lock file cannot be created.
    """
    while True:
        held = lock(spool / _LOCK, wait=False)
        with suppress(FileNotFoundError):  # another process just removed it
            if (spool / _LOCK).stat().st_ino == os.fstat(held).st_ino:
                return held
        os.close(held)
        spool.mkdir(mode=0o700, exist_ok=True)


def remove_spool(spool: Path) -> None:
    """Remove a spool that this process has locked; on Windows, without its lock files.

    Raises:
        OSError: A file cannot be removed.
    """
    if sys.platform == "win32":
        for path in spool.iterdir():
            if path.name not in _LOCKS:
                path.unlink()
    else:
        shutil.rmtree(spool)


def release_spool(spool: Path, held: int) -> None:
    """Release the lock of a spool. On Windows, also remove the lock files of a removed spool."""
    os.close(held)
    if sys.platform == "win32":  # no open file can be removed there
        with suppress(OSError):  # it was not removed, or another process has just opened it
            if all(path.name in _LOCKS for path in spool.iterdir()):
                shutil.rmtree(spool)


def was_removed(spool: Path) -> bool:
    """Whether another process has removed a spool that this process has locked."""
    return not (spool / _LOCK).exists()


@contextmanager
def locked_spool(out_dir: Path, limit_bytes: int, *, durable: bool = False) -> Iterator[Path]:
    """Lock the spool of `out_dir`, and remove abandoned spools."""
    remove_abandoned_spools()
    spool = spool_folder(out_dir, limit_bytes, durable=durable)
    try:
        held = lock_spool(spool)
    except BlockingIOError:
        advice = "choose another folder"
        raise BlockingIOError(
            UserMessage(
                "another recorder writes into {out_dir}: {advice}", out_dir=out_dir, advice=advice
            )
        ) from None
    try:
        yield spool
    finally:
        release_spool(spool, held)


def remove_abandoned_spools() -> None:
    """Remove the spools in memory of killed recorders, if all their data is written."""
    for spool in _MEMORY.glob(f"{_PREFIX}*"):
        # OSError: locked, or owned by another user. Without a lock file: being created.
        with suppress(OSError), ExitStack() as held:
            if (spool / _LOCK).exists():
                held.callback(os.close, lock_spool(spool))
                held.callback(os.close, lock(spool / READER_LOCK, wait=False))
                if not unread_bytes(spool):
                    shutil.rmtree(spool)
