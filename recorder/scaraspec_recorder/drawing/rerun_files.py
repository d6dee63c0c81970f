"""Streams of Rerun, begun and ended so that nothing of them is left.

Law: what is drawn stands elsewhere. The SDK keeps a stream that was closed, and the stream by which
it sends a layout, with two threads and a mebibyte each; a recorder that rotates for weeks would
gather thousands of them.
"""

from pathlib import Path
from typing import Any
from uuid import uuid4

import rerun as rr
import rerun_bindings


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


def begin(application: str, path: Path, layout: Any, *, footer: bool = True) -> rr.RecordingStream:
    """Begin a stream into a new file, with a layout; a file that is there is replaced.

    The footer tells where everything is. The SDK gathers it in memory: tens of MiB an hour.

    Raises:
        RuntimeError: The file cannot be written.
    """
    stream, sent = rr.RecordingStream(application, recording_id=uuid4()), _Layout(layout)
    try:
        stream.save(path, sent, write_footer=footer)  # type: ignore[arg-type]  # it has what is asked of one
    finally:
        sent.end()
    return stream


def connect(application: str, url: str, layout: Any) -> rr.RecordingStream:
    """Begin a stream into a viewer, with a layout."""
    stream = rr.RecordingStream(application, recording_id=uuid4())
    stream.connect_grpc(url, default_blueprint=layout)
    return stream


def release() -> None:
    """Free what is left of the streams that nobody has any longer."""
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
