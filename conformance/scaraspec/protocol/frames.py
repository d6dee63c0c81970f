"""Frames (clause 3): encode frames, and find them in a byte stream with one `Framer` per direction.

This module defines the layout start, [0x90], opcode, length, data, end, and the resynchronisation
after invalid bytes. It does not know what an opcode means. The framer does not raise on invalid
input, and its buffer does not grow with the input.
"""

from collections.abc import Callable
from enum import Enum
from typing import Final, NamedTuple

from scaraspec.protocol.direction import Direction

TAG: Final = 0x90
"""标志符: marks a final result; follows the controller's start byte (L320-321; A-3-5)."""

MAX_DATA_BYTES: Final = 255
MAX_FRAME_BYTES: Final = MAX_DATA_BYTES + 5
_MIN_FRAME_BYTES: Final = 4


class Frame(NamedTuple):
    """One frame: its sender, its opcode, its data, and whether it has the 0x90 tag."""

    direction: Direction
    opcode: int
    data: bytes = b""
    tagged: bool = False

    def encode(self) -> bytes:
        """Return the frame's bytes: start, [tag], opcode, length, data, end (L89-98).

        Raises:
            ValueError: The data has more than 255 bytes, the maximum of the length byte (L89).
        """
        if len(self.data) > MAX_DATA_BYTES:
            raise ValueError(
                f"{len(self.data)} data bytes do not fit into a frame: the maximum is 255 (L89)"
            )
        head = (self.direction.start, TAG) if self.tagged else (self.direction.start,)
        return (
            bytes((*head, self.opcode, len(self.data))) + self.data + bytes((self.direction.end,))
        )

    @property
    def size_bytes(self) -> int:
        """Size of the frame on the wire, in bytes."""
        return len(self.data) + (5 if self.tagged else 4)

    def __str__(self) -> str:
        tag = " 90" if self.tagged else ""
        return f"{self.direction.value}{tag} {self.opcode:02X} [{self.data.hex(' ').upper()}]"


class SkipReason(Enum):
    """Why bytes do not belong to a frame."""

    STRAY = "stray"  # no start byte of this direction
    BAD_END = "bad end"  # a start byte, but no end byte at the position that the length gives
    IMPLAUSIBLE = "implausible"  # during resynchronisation: the filter rejects the opcode
    TRUNCATED = "truncated"  # the stream ended, or the frame timed out, inside a frame


class Skipped(NamedTuple):
    """A run of consecutive bytes that belong to no frame, all for the same reason."""

    data: bytes
    reason: SkipReason

    @property
    def size_bytes(self) -> int:
        """Number of skipped bytes."""
        return len(self.data)


StreamItem = Frame | Skipped
"""An item of a stream. Every byte belongs to exactly one item, so offsets are sums of sizes."""


class Framer:
    """Finds the frames of one direction in a byte stream, however the stream is split.

    After a wrong end byte the framer drops one byte and continues (A-3-10, reading "byte-wise").
    It buffers at most one unfinished frame (260 bytes).

    Args:
        direction: The sender of the frames.
        resync_filter: If given, the scan starts unsynchronised (a capture that begins mid-stream).
            The first frame must satisfy ``resync_filter(opcode, tagged)``.
        recovery_filter: If given, the first frame after invalid bytes must satisfy this filter: a
            wrong end byte may look like a start byte, and "CC CC 09 ..." is not a frame with the
            opcode CC.
    """

    def __init__(
        self,
        direction: Direction,
        resync_filter: Callable[[int, bool], bool] | None = None,
        recovery_filter: Callable[[int, bool], bool] | None = None,
    ) -> None:
        self.direction = direction
        self.offset_bytes = 0
        """Stream offset of the first byte that no returned item contains yet."""
        self._buffer = b""
        self._resync_filter = resync_filter
        self._recovery_filter = recovery_filter
        self._start, self._end = direction.start, direction.end
        self._tag = TAG if direction is Direction.C2A else -1  # clients send no tag (3/15)
        # Making a tuple costs a third of calling Frame; one lookup gives all that the loop needs.
        self._loop_constants = (direction, self._start, self._end, self._tag, tuple.__new__)

    @property
    def buffered_bytes(self) -> int:
        """Number of buffered bytes of an unfinished frame."""
        return len(self._buffer)

    def take_whole(self, data: bytes) -> bool:
        """Take the next bytes of the stream if they are exactly one frame without a tag.

        Returns:
            False if they are not, or if earlier bytes matter; then nothing was taken.
        """
        size = len(data)
        whole = (
            not self._buffer
            and self._resync_filter is None
            and size >= _MIN_FRAME_BYTES
            and data[2] == size - _MIN_FRAME_BYTES
            and data[0] == self._start
            and data[-1] == self._end
            and data[1] != self._tag
        )
        if whole:
            self.offset_bytes += size
        return whole

    def feed(self, data: bytes) -> list[StreamItem]:
        """Add the next bytes of the stream and return the items that they complete, in order.

        The first item begins at the value of `offset_bytes` before the call. Each further item
        begins where the previous one ends. The tool spends more time in this loop than in any
        other code.
        """
        buffer = self._buffer + data if self._buffer else data
        found: list[StreamItem] = []
        at, size = 0, len(buffer)
        if self._resync_filter is None:
            direction, start, end, tag, make = self._loop_constants
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
        self._buffer = buffer[at:]
        self.offset_bytes += at
        return found

    def finish(self) -> list[StreamItem]:
        """Drop the unfinished frame: the stream ended, or a timeout expired (A-3-11).

        The buffered bytes are searched once more for complete frames. The rest is returned as
        truncated.
        """
        return self._drop_unfinished()

    def frame_follows(self, prefix_bytes: int, data: bytes) -> bool:
        """Return whether a complete frame begins right after `prefix_bytes` buffered bytes.

        Args:
            prefix_bytes: The number of buffered bytes before the possible frame.
            data: The next bytes of the stream, which are not buffered yet.
        """
        found = Framer(self.direction, self._recovery_filter).feed(
            self._buffer[prefix_bytes:] + data
        )
        return bool(found) and isinstance(found[0], Frame)

    @property
    def holds_frame(self) -> bool:
        """Whether the unfinished frame ends with a complete one: its length may be wrong."""
        found = Framer(self.direction, self._recovery_filter)
        items = found.feed(self._buffer[1:])
        return bool(items) and isinstance(items[-1], Frame) and not found.buffered_bytes

    def announced_bytes(self, prefix_bytes: int) -> int:
        """Return the size of the unfinished frame, according to its length byte.

        Return `prefix_bytes` if that many buffered bytes do not contain the length byte.
        """
        head = 4 if self._buffer[1:2] == bytes((TAG,)) and self._tag == TAG else 3
        return head + self._buffer[head - 1] + 1 if prefix_bytes >= head else prefix_bytes

    def abandon(self, prefix_bytes: int) -> list[StreamItem]:
        """Drop the frame that begins in `prefix_bytes` buffered bytes; scan the rest again."""
        self._buffer, rest = self._buffer[:prefix_bytes], self._buffer[prefix_bytes:]
        return self._drop_unfinished() + self.feed(rest)

    def skip_gap(
        self, length_bytes: int, resync_filter: Callable[[int, bool], bool]
    ) -> list[StreamItem]:
        """Account for a gap: drop the unfinished frame, advance the offset, and resynchronise.

        Args:
            length_bytes: The number of missing bytes.
            resync_filter: The first frame after the gap must satisfy it.
        """
        found = self.finish()
        self.offset_bytes += length_bytes
        self._resync_filter = resync_filter
        return found

    def _search(self, buffer: bytes, at: int, found: list[StreamItem]) -> int:
        """Add the items from `at` on to `found`; return where an unfinished frame begins."""
        size, start = len(buffer), bytes((self._start,))
        # Start of the bytes skipped since the last frame, and the reason to skip them.
        run_from, run_reason = at, SkipReason.STRAY

        def add_run(until: int) -> None:
            if run_from < until:
                found.append(Skipped(buffer[run_from:until], run_reason))

        while at < size:
            if buffer[at] != self._start:
                next_start = buffer.find(start, at)
                at = size if next_start < 0 else next_start
                self._resync_filter = self._resync_filter or self._recovery_filter
                continue
            tagged = size - at > 1 and buffer[at + 1] == self._tag
            head = at + 4 if tagged else at + 3
            stop = head + buffer[head - 1] if head <= size else size
            accepts = self._resync_filter if head <= size else None
            plausible = not accepts or accepts(buffer[head - 2], tagged)
            if stop >= size and plausible:
                break
            if plausible and buffer[stop] == self._end:
                add_run(at)
                self._resync_filter = None
                found.append(Frame(self.direction, buffer[head - 2], buffer[head:stop], tagged))
                at = run_from = stop + 1
                run_reason = SkipReason.STRAY
                continue
            if run_reason is SkipReason.STRAY:  # stray bytes before an invalid frame: separate run
                add_run(at)
                run_from = at
                run_reason = SkipReason.BAD_END if plausible else SkipReason.IMPLAUSIBLE
            self._resync_filter = self._resync_filter or self._recovery_filter
            at += 1
        add_run(at)
        return at

    def _drop_unfinished(self) -> list[StreamItem]:
        """Drop the buffered start byte and find complete frames after it; the rest is truncated."""
        found: list[StreamItem] = []
        run = b""
        while self._buffer:
            buffered, self._buffer = self._buffer, b""
            run += buffered[:1]
            self.offset_bytes += 1
            for item in self.feed(buffered[1:]):
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
