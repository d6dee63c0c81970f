"""Leaving: whoever reads what a command tells may leave, his terminal with him, or want it ended.

What the command does, and what its exit status says, are the same whether anybody hears of it, and
can read it; only where what it tells should be kept, and cannot be, it does not end as if all were
well. Whichever way it is asked to end, it ends in order.
"""

import errno
import io
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, BinaryIO, Final, cast

import click

from scaraspec.judge.verdicts import ExitStatus
from scaraspec.operating_system import ending_signals

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_LEFT: Final = frozenset({errno.EPIPE, errno.EIO})
"""Of a pipe whose reader has left, and of a terminal that is closed."""


@contextmanager
def ending_alike() -> Iterator[None]:
    """Let each of these signals end a command as Ctrl-C does, so that it ends what it has begun.

    A command that ends in another way sets up its own.
    """
    taken = [number for number in ending_signals() if signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, _as_ctrl_c)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def _as_ctrl_c(number: int, frame: FrameType | None) -> None:
    """Do what is done about Ctrl-C just now: an event loop ends its tasks in order."""
    handler = signal.getsignal(signal.SIGINT)
    (handler if callable(handler) else signal.default_int_handler)(number, frame)


def insists(number: int) -> bool:
    """Whether it is a user's who wants a command to end at once; a lost terminal tells it twice."""
    return number in (signal.SIGINT, signal.SIGTERM)


@contextmanager
def outliving_readers() -> Iterator[None]:
    """Let a command go on that can tell nothing any more.

    Raises:
        SystemExit: It has ended; with 3 where all is well but for what a full disk did not take.
    """
    files = [_replace(name) for name in ("stdout", "stderr")]
    try:
        yield
    except SystemExit as ended:
        sys.stdout.flush()
        why = next((file.why for file in files if file and file.why), "")
        if why and not ended.code:
            click.echo(f"scaraspec: what it tells cannot be written: {why}", err=True)
            raise SystemExit(ExitStatus.INCONCLUSIVE) from None
        raise


def _replace(name: str) -> "_Lenient | None":
    """Put a lenient file below a standard stream; none where that is not the process's own."""
    stream = getattr(sys, name)
    if stream is None or stream is not getattr(sys, f"__{name}__"):
        return None
    file = _Lenient(stream.fileno(), "w", closefd=False)
    told = io.TextIOWrapper(
        cast("BinaryIO", file) if stream.write_through else io.BufferedWriter(file),
        stream.encoding,
        "backslashreplace",  # not every terminal, nor every file on Windows, has every character
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
    setattr(sys, name, told)
    return file


class _Lenient(io.FileIO):
    """Drops what cannot be written.

    Attributes:
        why: Why that was, unless nobody reads it any more.
    """

    why = ""

    def write(self, data: "ReadableBuffer", /) -> int:
        """Write it, or drop it."""
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in _LEFT:
                self.why = error.strerror or f"{error}"
            return memoryview(data).nbytes
