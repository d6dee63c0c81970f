"""Calls that depend on the operating system: folders, locks, private files, signals, locale.

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
_PRIMARY_LANGUAGE = 0x3FF  # of a Windows language identifier
_WINDOWS_CHINESE = 0x04


def state_directory() -> Path:
    """Return the directory for data that must survive a run, e.g. ~/.local/state/scaraspec."""
    return Path(platformdirs.user_state_dir("scaraspec", appauthor=False))


def wireshark_plugin_directory() -> Path:
    """Return the user's folder of Wireshark plugins; it may not exist."""
    if os.name == "nt":
        return (
            Path(platformdirs.user_config_dir("Wireshark", appauthor=False, roaming=True))
            / "plugins"
        )
    return Path.home() / ".local/lib/wireshark/plugins"  # on macOS, too


def make_private_folder(path: Path) -> None:
    """Create a folder that only its owner can read; no error if it exists.

    Raises:
        OSError: The folder cannot be created.
    """
    path.mkdir(mode=_PRIVATE_FOLDER, parents=True, exist_ok=True)


def open_private(path: Path, flags: int) -> int:
    """Open a file that only its owner can read, and return the file descriptor.

    Args:
        path: The file.
        flags: The flags of `os.open`, for example ``os.O_WRONLY | os.O_CREAT``.

    Raises:
        OSError: The file cannot be opened.
    """
    return os.open(path, flags | getattr(os, "O_BINARY", 0), _PRIVATE_FILE)


class LockedError(Exception):
    """Another process holds the lock."""


@contextmanager
def locked(path: Path, wait_s: float) -> Iterator[None]:
    """Hold a lock that is released when this process ends, even after a crash.

    Args:
        path: The lock file; it is not deleted when the lock is released.
        wait_s: Timeout in seconds if another process holds the lock.

    Raises:
        LockedError: Another process holds the lock after the timeout.
        OSError: The lock file cannot be created.
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
    """Return the signals that terminate a command: SIGINT, SIGTERM and, if it exists, SIGHUP.

    SIGHUP is not included if the process was started with SIGHUP ignored, for example by nohup.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    with suppress(AttributeError):  # Windows has no SIGHUP
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            numbers.append(signal.SIGHUP)
    return tuple(numbers)


def user_locale() -> str:
    """Return the locale of messages, such as ``zh_CN.UTF-8``; empty if the user has set none.

    On Windows, which has no such variables, it is ``zh`` if that is the language of the user
    interface.
    """
    named = (os.environ.get(name) for name in ("LC_ALL", "LC_MESSAGES", "LANG"))
    if (chosen := next(filter(None, named), "")) or os.name != "nt":
        return chosen
    import ctypes  # noqa: PLC0415 - needed on Windows only

    language = ctypes.CDLL("kernel32").GetUserDefaultUILanguage() & _PRIMARY_LANGUAGE
    return "zh" if language == _WINDOWS_CHINESE else ""
