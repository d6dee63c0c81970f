"""Standard streams and signals of a command.

A command continues if the reader of its output closes the pipe or the terminal, and its exit status
is the same. A stream that was closed at the start is handled alike. If output cannot be written for
another reason, such as a full disk, the exit status is not 0. SIGTERM and SIGHUP end a command as
Ctrl-C does.
"""

import errno
import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, BinaryIO, Final, cast

import click

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import ending_signals
from scaraspec.translation import localized

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_DEFAULTS: Final = (signal.SIG_DFL, signal.default_int_handler)
"""Handlers of a signal that no command has replaced; the second is that of `scaraspec.cli.main`."""

_READER_GONE: Final = frozenset({errno.EPIPE, errno.EIO})
"""Errors of a pipe whose reader is gone, and of a closed terminal."""


@contextmanager
def ending_alike() -> Iterator[None]:
    """Handle SIGTERM and SIGHUP like Ctrl-C, so that a command cleans up.

    A command that handles signals itself installs its own handlers later.
    """
    taken = [
        number
        for number in ending_signals()
        if number is not signal.SIGINT and signal.getsignal(number) in _DEFAULTS
    ]
    for number in taken:
        signal.signal(number, _as_ctrl_c)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def _as_ctrl_c(number: int, frame: FrameType | None) -> None:
    """Call the current handler of Ctrl-C. An event loop then cancels its tasks."""
    handler = signal.getsignal(signal.SIGINT)
    (handler if callable(handler) else signal.default_int_handler)(number, frame)


def insists(number: int) -> bool:
    """Return whether a second signal ends the command at once. A lost terminal sends it twice."""
    return number in (signal.SIGINT, signal.SIGTERM)


@contextmanager
def outliving_readers() -> Iterator[None]:
    """Continue a command if its output cannot be written, while the context is active.

    Raises:
        SystemExit: The command has ended. The status is 3 instead of 0 if output was lost, for
            example on a full disk.
    """
    _open_closed_streams()
    files = [_replace(name) for name in ("stdout", "stderr")]
    try:
        yield
    except SystemExit as ended:
        sys.stdout.flush()
        error = next((file.error for file in files if file and file.error), "")
        if error and not ended.code:
            text = localized("the output cannot be written: {error}", error=error)
            click.echo(f"scaraspec: {text}", err=True)
            raise SystemExit(ExitStatus.INCONCLUSIVE) from None
        raise


def _open_closed_streams() -> None:
    """Open the null device for standard streams that were closed at the start.

    Otherwise the next file that is opened would get the descriptor of the stream.
    """
    for descriptor, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            try:
                os.fstat(descriptor)
            except OSError:
                null = os.open(os.devnull, os.O_RDWR)
                if null != descriptor:
                    os.dup2(null, descriptor)
                    os.close(null)
            stream = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115 - for the process
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)


def _replace(name: str) -> "_Lenient | None":
    """Replace the file of a standard stream. Return None if the stream was replaced already."""
    stream = getattr(sys, name)
    if stream is None or stream is not getattr(sys, f"__{name}__"):
        return None
    redirected_on_windows = sys.platform == "win32" and not stream.isatty()
    if sys.platform == "win32" and not redirected_on_windows:
        stream.reconfigure(errors="backslashreplace")
        return None  # only Python's own stream writes Unicode to a console
    file = _Lenient(stream.fileno(), "w", closefd=False)
    text = io.TextIOWrapper(
        cast("BinaryIO", file) if stream.write_through else io.BufferedWriter(file),
        "utf-8" if redirected_on_windows else stream.encoding,  # not the ANSI code page
        "backslashreplace",  # some encodings of terminals lack characters
        "" if redirected_on_windows else None,  # the same bytes as on other systems
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    setattr(sys, name, text)
    return file


class _Lenient(io.FileIO):
    """A file that drops what cannot be written.

    Attributes:
        error: Why something was dropped; empty if the reader is gone.
    """

    error = ""

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write the data, or drop it."""
        try:
            return super().write(data)
        except OSError as problem:
            if problem.errno not in _READER_GONE:
                self.error = problem.strerror or f"{problem}"
            return memoryview(data).nbytes
