"""The inlet: what one client sends, as frames.

How the controller resynchronises (A-3-10) and for how long it waits for the rest of a frame
(A-3-11) lives here; what a frame means does not.
"""

from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame, Framer, Skipped, SkipReason, StreamItem
from scaraspec.protocol.readings import Dialect

_HEAD_BYTES = 3
_FRAME_BYTES = 4  # of a frame without data


class RequestFramer:
    """Finds a client's frames in its bytes, as a dialect has it; at most 260 bytes are held.

    Where the reading ``resync`` is "close", whoever meets the first skipped bytes is to close.
    """

    def __init__(self, dialect: Dialect) -> None:
        self._resync = dialect["resync"]
        self._timeout_s = dialect.seconds("partial_timeout")
        self._heard_s = 0.0
        self._framer = self._new_framer()

    @property
    def held_bytes(self) -> int:
        """How many bytes of an unfinished frame are held."""
        return self._framer.held_bytes

    @property
    def deadline_s(self) -> float | None:
        """When silence ends the wait for the rest of a frame; None if none is awaited."""
        if self._timeout_s is None or not self._framer.held_bytes:
            return None
        return self._heard_s + self._timeout_s

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Take the next bytes and return what they complete, in order."""
        self._heard_s = now_s
        return self._flushed(self._framer.feed(data))

    def expire(self, now_s: float) -> list[StreamItem]:
        """Give up an unfinished frame whose time is over; what it hid may be whole frames."""
        deadline_s = self.deadline_s
        if deadline_s is None or now_s < deadline_s:
            return []
        return self._flushed(self._framer.finish())

    def _new_framer(self) -> "Framer | _WholeCandidates":
        return _WholeCandidates() if self._resync == "framewise" else Framer(A2C)

    def _flushed(self, found: list[StreamItem]) -> list[StreamItem]:
        """Under the reading "flush": forget everything buffered behind the first bad bytes."""
        if self._resync == "flush":
            for index, item in enumerate(found):
                if isinstance(item, Skipped):
                    self._framer = self._new_framer()
                    return found[: index + 1]
        return found


class _WholeCandidates:
    """Finds frames as `Framer` does, but goes on behind the whole of a bad candidate."""

    def __init__(self) -> None:
        self._held = b""

    @property
    def held_bytes(self) -> int:
        return len(self._held)

    def feed(self, data: bytes) -> list[StreamItem]:
        buffer = self._held + data
        found: list[StreamItem] = []
        at = 0
        while len(buffer) - at >= _HEAD_BYTES:
            if buffer[at] != A2C.start:
                start = buffer.find(A2C.start, at)
                until = start if start >= 0 else len(buffer)
                found.append(Skipped(buffer[at:until], SkipReason.STRAY))
            else:
                until = at + _FRAME_BYTES + buffer[at + 2]
                if until > len(buffer):
                    break
                whole = buffer[at:until]
                found.append(
                    Frame(A2C, whole[1], whole[_HEAD_BYTES:-1])
                    if whole[-1] == A2C.end
                    else Skipped(whole, SkipReason.BAD_END)
                )
            at = until
        self._held = buffer[at:]
        return found

    def finish(self) -> list[StreamItem]:
        held, self._held = self._held, b""
        return [Skipped(held, SkipReason.TRUNCATED)] if held else []
