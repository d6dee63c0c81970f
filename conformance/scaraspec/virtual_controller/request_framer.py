"""The request framer: finds the frames in the bytes of one client.

It resynchronises after invalid bytes (A-3-10) and times out partial frames (A-3-11). It does not
interpret the frames.
"""

from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame, Framer, Skipped, SkipReason, StreamItem
from scaraspec.protocol.readings import Dialect

_HEAD_BYTES = 3
_FRAME_BYTES = 4  # a frame without data


class RequestFramer:
    """Finds a client's frames according to the dialect. It holds at most 260 bytes.

    With the reading ``resync=close`` the caller must close the connection after skipped bytes.
    """

    def __init__(self, dialect: Dialect) -> None:
        self._resync = dialect["resync"]
        self._timeout_s = dialect.seconds("partial_timeout")
        self._last_received_s = 0.0
        self._framer = self._new_framer()

    @property
    def buffered_bytes(self) -> int:
        """Number of bytes of a partial frame."""
        return self._framer.buffered_bytes

    @property
    def deadline_s(self) -> float | None:
        """When a partial frame times out; None if there is none, or no timeout."""
        if self._timeout_s is None or not self._framer.buffered_bytes:
            return None
        return self._last_received_s + self._timeout_s

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Add received bytes and return the completed items, in order."""
        self._last_received_s = now_s
        return self._flushed(self._framer.feed(data))

    def expire(self, now_s: float) -> list[StreamItem]:
        """Discard a partial frame after its timeout; its bytes may contain complete frames."""
        deadline_s = self.deadline_s
        if deadline_s is None or now_s < deadline_s:
            return []
        return self._flushed(self._framer.finish())

    def _new_framer(self) -> "Framer | _WholeCandidates":
        return _WholeCandidates() if self._resync == "framewise" else Framer(A2C)

    def _flushed(self, items: list[StreamItem]) -> list[StreamItem]:
        """With the reading "flush": discard everything buffered after the first invalid bytes."""
        if self._resync == "flush":
            for index, item in enumerate(items):
                if isinstance(item, Skipped):
                    self._framer = self._new_framer()
                    return items[: index + 1]
        return items


class _WholeCandidates:
    """Finds frames like `Framer`, but continues after the whole of an invalid candidate."""

    def __init__(self) -> None:
        self._buffer = b""

    @property
    def buffered_bytes(self) -> int:
        return len(self._buffer)

    def feed(self, data: bytes) -> list[StreamItem]:
        buffer = self._buffer + data
        items: list[StreamItem] = []
        at = 0
        while len(buffer) - at >= _HEAD_BYTES:
            if buffer[at] != A2C.start:
                start = buffer.find(A2C.start, at)
                until = start if start >= 0 else len(buffer)
                items.append(Skipped(buffer[at:until], SkipReason.STRAY))
            else:
                until = at + _FRAME_BYTES + buffer[at + 2]
                if until > len(buffer):
                    break
                candidate = buffer[at:until]
                items.append(
                    Frame(A2C, candidate[1], candidate[_HEAD_BYTES:-1])
                    if candidate[-1] == A2C.end
                    else Skipped(candidate, SkipReason.BAD_END)
                )
            at = until
        self._buffer = buffer[at:]
        return items

    def finish(self) -> list[StreamItem]:
        rest, self._buffer = self._buffer, b""
        return [Skipped(rest, SkipReason.TRUNCATED)] if rest else []
