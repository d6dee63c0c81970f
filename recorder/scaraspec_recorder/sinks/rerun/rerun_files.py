"""Rerun streams that release all resources, and files whose write errors are handled.

The SDK keeps closed streams and layout streams, with two threads and 1 MiB each; a recorder that
rotates for weeks would accumulate thousands. If a file write fails, the SDK's writer thread ends
and later flushes block forever. Therefore the SDK writes into a pipe, and this module copies from
the pipe into the file.
"""

import os
import threading
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from typing import Any, Final
from uuid import uuid4

import rerun as rr
import rerun_bindings

_PIPES: Final = Path("/dev/fd")  # pipes have names there; not on every system
_READ_BYTES: Final = 1 << 16


class _Layout:
    """A layout that keeps the stream by which it was sent; the SDK does not expose it."""

    def __init__(self, layout: Any) -> None:
        self._layout = layout
        self._stream: rr.RecordingStream | None = None

    def to_blueprint(self) -> "_Layout":
        """Return the object that the SDK logs."""
        return self

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._layout._log_to_stream(stream)  # noqa: SLF001 - what the SDK calls in turn

    def end(self) -> None:
        """Release the stream after the layout is sent."""
        if self._stream:
            self._stream.disconnect()


class RerunFile:
    """A stream into a new file; an existing file is replaced.

    The footer is an index. The SDK collects it in memory: tens of MiB per hour.

    Args:
        application: Application name in the viewer.
        path: The file.
        layout: The layout.
        footer: Whether to write one.

    Attributes:
        stream: The stream.

    Raises:
        OSError: From every method, if the file cannot be written.
    """

    def __init__(self, application: str, path: Path, layout: Any, *, footer: bool = True) -> None:
        self._pipe = _Pipe(path) if _PIPES.exists() else None
        self.stream, sent = rr.RecordingStream(application, recording_id=uuid4()), _Layout(layout)
        try:
            where = self._pipe.name if self._pipe else path
            self.stream.save(where, sent, write_footer=footer)  # type: ignore[arg-type]  # it has the methods of a blueprint
        finally:
            sent.end()
            if self._pipe:
                self._pipe.opened()

    def flush(self) -> None:
        """Wait until all sent data is in the file."""
        try:
            self.stream.flush()
        except RuntimeError as error:  # without a pipe
            raise OSError(f"the recording cannot be drawn: {error}") from None
        if self._pipe:
            self._pipe.empty()

    def close(self) -> None:
        """Close the file. No other reference to the stream may exist."""
        self.stream.disconnect()
        del self.stream
        release()
        if self._pipe:
            self._pipe.close()


class _Pipe:
    """Copies data from a pipe into a file; discards it after a write error.

    Attributes:
        name: Path by which the writer opens the pipe.

    Raises:
        OSError: The file or the pipe cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb", buffering=0)
        self._far, self._near = os.pipe()
        os.set_blocking(self._far, False)
        self._selector = DefaultSelector()
        self._selector.register(self._far, EVENT_READ)
        self.name = f"{_PIPES}/{self._near}"
        self._failure: OSError | None = None
        self._ended = False
        self._lock = threading.Lock()
        # Daemon: at process exit, the SDK closes its end only after the threads are joined.
        self._carrier = threading.Thread(target=self._carry, daemon=True)
        self._carrier.start()

    def opened(self) -> None:
        """The writer has opened the pipe: close our writing end."""
        os.close(self._near)

    def empty(self) -> None:
        """Copy the available data into the file.

        Raises:
            OSError: This or an earlier write failed.
        """
        self._take()
        if self._failure:
            raise self._failure

    def close(self) -> None:
        """Wait until the writer closes the pipe.

        Raises:
            OSError: A write failed.
        """
        self._carrier.join()
        if self._failure:
            raise self._failure

    def _carry(self) -> None:
        """Thread that copies data, so that the writer does not block."""
        while self._take():
            self._selector.select()
        self._selector.close()
        os.close(self._far)
        try:
            self._file.close()
        except OSError as error:
            self._failure = self._failure or error

    def _take(self) -> bool:
        """Copy the available data. Return whether more may follow."""
        with self._lock:
            while not self._ended:
                try:
                    data = memoryview(os.read(self._far, _READ_BYTES))
                except BlockingIOError:
                    return True
                self._ended = not data
                try:
                    while data and not self._failure:
                        data = data[self._file.write(data) :]
                except OSError as error:
                    self._failure = error
        return False


def connect(application: str, url: str, layout: Any) -> rr.RecordingStream:
    """Open a stream to a viewer, with a layout."""
    stream = rr.RecordingStream(application, recording_id=uuid4())
    stream.connect_grpc(url, default_blueprint=layout)
    return stream


def release() -> None:
    """Free streams without references."""
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
