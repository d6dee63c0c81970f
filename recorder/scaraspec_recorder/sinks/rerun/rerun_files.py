"""Streams of Rerun: begun and ended so that nothing of them is left, and files that may refuse.

Law: what is drawn stands elsewhere. The SDK keeps a stream that was closed, and the stream by which
it sends a layout, with two threads and a mebibyte each; a recorder that rotates for weeks would
gather thousands of them. And where a file refuses a write, its writer ends, and whoever then waits
for it waits for ever: at the next flush, at a stream's end, at the end of the process. So what it
writes goes through a pipe, and into the file from there, by ourselves.
"""

import os
import threading
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from typing import Any, Final
from uuid import uuid4

import rerun as rr
import rerun_bindings

_PIPES: Final = Path("/dev/fd")  # where a pipe has a name: not on every system
_READ_BYTES: Final = 1 << 16


class _Layout:
    """A layout that knows by which stream it was sent, which nobody else tells."""

    def __init__(self, layout: Any) -> None:
        self._layout = layout
        self._stream: rr.RecordingStream | None = None

    def to_blueprint(self) -> "_Layout":
        """What the SDK asks for first."""
        return self

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._layout._log_to_stream(stream)  # noqa: SLF001 - what the SDK calls in turn

    def end(self) -> None:
        """It has been sent: let go of it."""
        if self._stream:
            self._stream.disconnect()


class RerunFile:
    """A stream into a new file; a file that is there is replaced.

    The footer tells where everything is. The SDK gathers it in memory: tens of MiB an hour.

    Args:
        application: Its name in the viewer.
        path: The file.
        layout: How it is shown.
        footer: Whether to write one.

    Attributes:
        stream: The stream.

    Raises:
        OSError: From every method, where the file cannot be written.
    """

    def __init__(self, application: str, path: Path, layout: Any, *, footer: bool = True) -> None:
        self._pipe = _Pipe(path) if _PIPES.exists() else None
        self.stream, sent = rr.RecordingStream(application, recording_id=uuid4()), _Layout(layout)
        try:
            where = self._pipe.name if self._pipe else path
            self.stream.save(where, sent, write_footer=footer)  # type: ignore[arg-type]  # it has what is asked of one
        finally:
            sent.end()
            if self._pipe:
                self._pipe.opened()

    def flush(self) -> None:
        """Wait until what was sent is in the file."""
        try:
            self.stream.flush()
        except RuntimeError as error:  # without a pipe
            raise OSError(f"nothing can be drawn: {error}") from None
        if self._pipe:
            self._pipe.empty()

    def close(self) -> None:
        """End the file; nobody else may have the stream any longer."""
        self.stream.disconnect()
        del self.stream
        release()
        if self._pipe:
            self._pipe.close()


class _Pipe:
    """What comes out of a pipe goes into a file, or nowhere where that refuses it.

    Attributes:
        name: By which whoever writes opens the pipe.

    Raises:
        OSError: The file, or the pipe, cannot be made.
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
        # Not waited for at the end of the process: the SDK closes its end only behind that.
        self._carrier = threading.Thread(target=self._carry, daemon=True)
        self._carrier.start()

    def opened(self) -> None:
        """Whoever writes has opened it."""
        os.close(self._near)

    def empty(self) -> None:
        """Carry what is in it now into the file.

        Raises:
            OSError: That, or something before it, was refused.
        """
        self._take()
        if self._failure:
            raise self._failure

    def close(self) -> None:
        """Wait for the end, which whoever writes has written.

        Raises:
            OSError: Something was refused.
        """
        self._carrier.join()
        if self._failure:
            raise self._failure

    def _carry(self) -> None:
        """Be the thread that reads: whoever writes never waits for long."""
        while self._take():
            self._selector.select()
        self._selector.close()
        os.close(self._far)
        try:
            self._file.close()
        except OSError as error:
            self._failure = self._failure or error

    def _take(self) -> bool:
        """Carry what is there; return whether more may come."""
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
    """Begin a stream into a viewer, with a layout."""
    stream = rr.RecordingStream(application, recording_id=uuid4())
    stream.connect_grpc(url, default_blueprint=layout)
    return stream


def release() -> None:
    """Free what is left of the streams that nobody has any longer."""
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
