"""Calls that depend on the operating system: the state directory, locks, private files, signals.

No other module of the package `scaraspec` chooses between operating systems.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import platformdirs
from filelock import FileLock, Timeout

_PRIVATE_FOLDER = 0o700
_PRIVATE_FILE = 0o600


def state_directory() -> Path:
    """Where scaraspec keeps what must survive a run, for example ~/.local/state/scaraspec."""
    return Path(platformdirs.user_state_dir("scaraspec", appauthor=False))


def make_private_folder(path: Path) -> None:
    """Make a folder that only its user can read.

    Raises:
        OSError: It cannot be made.
    """
    path.mkdir(mode=_PRIVATE_FOLDER, parents=True, exist_ok=True)


def open_private(path: Path, flags: int) -> int:
    """Open a file that only its user can read; return the file descriptor.

    Args:
        path: The file.
        flags: As for `os.open`, for example ``os.O_WRONLY | os.O_CREAT``.

    Raises:
        OSError: It cannot be opened.
    """
    return os.open(path, flags | getattr(os, "O_BINARY", 0), _PRIVATE_FILE)


class LockedError(Exception):
    """Another process holds the lock."""


@contextmanager
def locked(path: Path, wait_s: float) -> Iterator[None]:
    """Hold a lock that ends with this process, however the process ends.

    Args:
        path: The lock file; it is left behind when the lock is released.
        wait_s: How long to wait for another process that holds the lock.

    Raises:
        LockedError: Another process still holds it.
        OSError: The lock file cannot be made.
    """
    lock = FileLock(path, timeout=wait_s, mode=_PRIVATE_FILE)
    try:
        lock.acquire()
    except Timeout:
        raise LockedError from None
    try:
        yield
    finally:
        lock.release()


def ending_signals() -> tuple[signal.Signals, ...]:
    """The signals that ask a command to end: SIGINT, SIGTERM and, where it exists, SIGHUP.

    SIGHUP is left out if the process was started with it ignored, as by nohup.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    with suppress(AttributeError):  # Windows has no SIGHUP
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            numbers.append(signal.SIGHUP)
    return tuple(numbers)
