"""Frames (clause 3): bytes to frames and back, one `Framer` per direction.

Lives here: the layout start, [0x90], opcode, length, data, end; finding frames in a byte stream;
resynchronisation after bytes that are none. Does not live here: what an opcode means. Nothing in
this file raises on bad input, and nothing grows with it.
"""

from collections.abc import Callable
from enum import Enum
from typing import Final, NamedTuple

from scaraspec.protocol.direction import Direction

TAG: Final = 0x90
"""标志符: after a controller's start byte it announces a final result (L320-321; A-3-5)."""

MAX_DATA_BYTES: Final = 255
MAX_FRAME_BYTES: Final = MAX_DATA_BYTES + 5
_MIN_FRAME_BYTES: Final = 4


class Frame(NamedTuple):
    """One frame: who sent it, its opcode, its data, and whether it bore the 0x90 tag."""

    direction: Direction
    opcode: int
    data: bytes = b""
    tagged: bool = False

    def encode(self) -> bytes:
        """Return the frame's bytes: start, [tag], opcode, length, data, end (L89-98).

        Raises:
            ValueError: The data is longer than the 255 bytes that one length byte can say (L89).
        """
        if len(self.data) > MAX_DATA_BYTES:
            raise ValueError(
                f"{len(self.data)} data bytes do not fit a frame: its length byte ends at 255 (L89)"
            )
        head = (self.direction.start, TAG) if self.tagged else (self.direction.start,)
        return (
            bytes((*head, self.opcode, len(self.data))) + self.data + bytes((self.direction.end,))
        )

    @property
    def size_bytes(self) -> int:
        """How many bytes the frame takes on the wire."""
        return len(self.data) + (5 if self.tagged else 4)

    def __str__(self) -> str:
        tag = " 90" if self.tagged else ""
        return f"{self.direction.value}{tag} {self.opcode:02X} [{self.data.hex(' ').upper()}]"


class SkipReason(Enum):
    """Why bytes are no part of any frame."""

    STRAY = "stray"  # no start byte of this direction begins here
    BAD_END = "bad end"  # a start byte, but no end byte where the length says
    IMPLAUSIBLE = "implausible"  # looking for a foothold: no command of this direction
    TRUNCATED = "truncated"  # the stream ended, or was given up, inside a frame


class Skipped(NamedTuple):
    """Bytes between frames: dropped one at a time, told in runs of one reason."""

    data: bytes
    why: SkipReason

    @property
    def size_bytes(self) -> int:
        """How many bytes were skipped."""
        return len(self.data)


StreamItem = Frame | Skipped
"""What a stream is tiled with: every byte belongs to one of them, so that offsets are sums."""


class Framer:
    """Finds the frames of one direction in its bytes, however they are split or joined.

    After a wrong end byte one byte is dropped and the scan goes on (A-3-10, reading "byte-wise").
    At most one unfinished frame (260 bytes) is held back.

    Args:
        direction: Whose frames these are.
        resync_filter: If given, the scan starts unsynchronised (a capture that begins mid-stream).
            The first frame is one for which ``resync_filter(opcode, tagged)`` is true.
        recovery: Where given, this is asked of the first frame behind bytes that are none: a wrong
            end byte may look like a start byte, and "CC CC 09 ..." is no frame with the opcode CC.
    """

    def __init__(
        self,
        direction: Direction,
        resync_filter: Callable[[int, bool], bool] | None = None,
        recovery: Callable[[int, bool], bool] | None = None,
    ) -> None:
        self.direction = direction
        self.offset_bytes = 0
        """Stream offset of the first byte not yet told as part of a frame or a skipped run."""
        self._held = b""
        self._foothold = resync_filter
        self._recovery = recovery
        self._start, self._end = direction.start, direction.end
        self._tag = TAG if direction is Direction.C2A else -1  # clients send no tag (3/15)
        # Making a tuple costs a third of calling Frame; one look-up gives all that the loop needs.
        self._marks = (direction, self._start, self._end, self._tag, tuple.__new__)

    @property
    def held_bytes(self) -> int:
        """How many bytes of an unfinished frame are held back."""
        return len(self._held)

    def feed(self, data: bytes) -> list[StreamItem]:
        """Take the next bytes of the stream and return what they complete, in order.

        The first thing found begins at `offset_bytes` as it was before the call, each other where
        the one before it ends. The loop below is the tool's hottest.
        """
        buffer = self._held + data if self._held else data
        found: list[StreamItem] = []
        at, size = 0, len(buffer)
        if self._foothold is None:
            direction, start, end, tag, make = self._marks
            take = found.append
            while size - at >= _MIN_FRAME_BYTES and buffer[at] == start:
                opcode = buffer[at + 1]
                if opcode != tag:
                    head = at + 3
                    stop = head + buffer[at + 2]
                    if stop >= size or buffer[stop] != end:
                        break
                    take(make(Frame, (direction, opcode, buffer[head:stop], False)))
                else:
                    head = at + 4
                    stop = head + buffer[at + 3]
                    if stop >= size or buffer[stop] != end:
                        break
                    take(make(Frame, (direction, buffer[at + 2], buffer[head:stop], True)))
                at = stop + 1
        if at < size:
            at = self._search(buffer, at, found)
        self._held = buffer[at:]
        self.offset_bytes += at
        return found

    def finish(self) -> list[StreamItem]:
        """Give up on an unfinished frame: the stream ended, or was silent for too long (A-3-11).

        What is held is searched once more for whole frames; the rest is told as truncated.
        """
        return self._give_up()

    def stands_behind(self, held_bytes: int, data: bytes) -> bool:
        """Whether a whole frame stands behind so many held bytes, once these data have come."""
        found = Framer(self.direction, self._recovery).feed(self._held[held_bytes:] + data)
        return bool(found) and isinstance(found[0], Frame)

    def announced_bytes(self, held_bytes: int) -> int:
        """How long the frame is that so many held bytes begin; as long as they are if unsaid."""
        head = 4 if self._held[1:2] == bytes((TAG,)) and self._tag == TAG else 3
        return head + self._held[head - 1] + 1 if held_bytes >= head else held_bytes

    def abandon(self, held_bytes: int) -> list[StreamItem]:
        """Give up the frame that so many held bytes begin; what is behind them begins anew."""
        self._held, rest = self._held[:held_bytes], self._held[held_bytes:]
        return self._give_up() + self.feed(rest)

    def lose(
        self, length_bytes: int, resync_filter: Callable[[int, bool], bool]
    ) -> list[StreamItem]:
        """Account for bytes that passed unseen: finish, move on, and look for a new foothold."""
        found = self.finish()
        self.offset_bytes += length_bytes
        self._foothold = resync_filter
        return found

    def _search(self, buffer: bytes, at: int, found: list[StreamItem]) -> int:
        """Take frames and skipped runs from `at` on; return where an unfinished frame begins."""
        size, start = len(buffer), bytes((self._start,))
        run_from, run_why = at, SkipReason.STRAY  # bytes skipped since the last frame, and why

        def tell_run(until: int) -> None:
            if run_from < until:
                found.append(Skipped(buffer[run_from:until], run_why))

        while at < size:
            if buffer[at] != self._start:
                next_start = buffer.find(start, at)
                at = size if next_start < 0 else next_start
                self._foothold = self._foothold or self._recovery
                continue
            tagged = size - at > 1 and buffer[at + 1] == self._tag
            head = at + 4 if tagged else at + 3
            stop = head + buffer[head - 1] if head <= size else size
            asked = self._foothold if head <= size else None
            plausible = not asked or asked(buffer[head - 2], tagged)
            if stop >= size and plausible:
                break
            if plausible and buffer[stop] == self._end:
                tell_run(at)
                self._foothold = None
                found.append(Frame(self.direction, buffer[head - 2], buffer[head:stop], tagged))
                at = run_from = stop + 1
                run_why = SkipReason.STRAY
                continue
            if (
                run_why is SkipReason.STRAY
            ):  # stray bytes before a false frame are a run of their own
                tell_run(at)
                run_from = at
                run_why = SkipReason.BAD_END if plausible else SkipReason.IMPLAUSIBLE
            self._foothold = self._foothold or self._recovery
            at += 1
        tell_run(at)
        return at

    def _give_up(self) -> list[StreamItem]:
        """Drop the held start byte, take whole frames hidden behind it; the rest is truncated."""
        found: list[StreamItem] = []
        run = b""
        while self._held:
            held, self._held = self._held, b""
            run += held[:1]
            self.offset_bytes += 1
            for item in self.feed(held[1:]):
                if isinstance(item, Skipped):
                    run += item.data
                    continue
                if run:
                    found.append(Skipped(run, SkipReason.TRUNCATED))
                    run = b""
                found.append(item)
        if run:
            found.append(Skipped(run, SkipReason.TRUNCATED))
        return found
