"""Calls that depend on the operating system: folders, locks, files, signals, commands, locale.

No other module of the package `scaraspec` chooses between operating systems.
"""

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import asyncio

_PRIVATE_FOLDER = 0o700
_PRIVATE_FILE = 0o600
_PRIMARY_LANGUAGE = 0x3FF  # of a Windows language identifier
_WINDOWS_CHINESE = 0x04
_CONTINUOUS, _SYSTEM_REQUIRED = 0x80000000, 1  # of SetThreadExecutionState
_REPLACE_S: Final = 1.0
_RETRY_S: Final = 0.01


def state_directory() -> Path:
    """Return the directory for data that must survive a run, e.g. ~/.local/state/scaraspec."""
    import platformdirs  # noqa: PLC0415 - most commands do not need it

    return Path(platformdirs.user_state_dir("scaraspec", appauthor=False))


def wireshark_plugin_directory() -> Path:
    """Return the user's folder of Wireshark plugins; it may not exist."""
    import platformdirs  # noqa: PLC0415 - most commands do not need it

    if sys.platform == "win32":
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


def replace_file(source: Path, target: Path) -> None:
    """Rename a file, over another file if one exists.

    Windows refuses this while another process reads the target; it is then tried for a second.

    Raises:
        OSError: The file cannot be renamed.
    """
    if sys.platform == "win32":
        until_s = time.monotonic() + _REPLACE_S
        while time.monotonic() < until_s:
            with suppress(PermissionError):
                source.replace(target)
                return
            time.sleep(_RETRY_S)
    source.replace(target)


def join_command(words: Iterable[str]) -> str:
    """Return a command line for the shell of this system: cmd on Windows, sh elsewhere."""
    if sys.platform == "win32":
        return subprocess.list2cmdline(words)
    return shlex.join(words)


def split_command(text: str) -> list[str]:
    """Return the words of a command line of the user, which is not run by a shell.

    On Windows a backslash is a part of a path, and escapes nothing.

    Raises:
        ValueError: A quotation mark is missing.
    """
    words = shlex.shlex(text, posix=True, punctuation_chars=False)
    words.whitespace_split, words.commenters = True, ""
    if sys.platform == "win32":
        words.escape = ""
    return list(words)


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
    from filelock import FileLock, Timeout  # noqa: PLC0415 - most commands do not need it

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
    """Return the signals that terminate a command: SIGINT, SIGTERM, and SIGHUP or SIGBREAK.

    Windows sends SIGBREAK for Ctrl-Break and when the console window is closed; other systems send
    SIGHUP when the terminal is closed. SIGHUP is not included if the process was started with
    SIGHUP ignored, for example by nohup.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    if sys.platform == "win32":
        numbers.append(signal.SIGBREAK)
    elif signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    return tuple(numbers)


def on_ending_signals(loop: "asyncio.AbstractEventLoop", end: Callable[[int], None]) -> None:
    """Call `end` in an event loop, with the number of the signal, for each ending signal."""
    for number in ending_signals():
        if sys.platform == "win32":  # its event loops have no signal handlers
            signal.signal(number, lambda given, _: loop.call_soon_threadsafe(end, given))
        else:
            loop.add_signal_handler(number, end, number)


@contextmanager
def kept_awake() -> Iterator[None]:
    """Keep Windows from going to sleep because no user is active. Other systems do not."""
    if sys.platform == "win32":
        import ctypes  # noqa: PLC0415 - needed on Windows only

        kernel = ctypes.CDLL("kernel32")
        kernel.SetThreadExecutionState(_CONTINUOUS | _SYSTEM_REQUIRED)
        try:
            yield
        finally:
            kernel.SetThreadExecutionState(_CONTINUOUS)
    else:
        yield


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
