"""Stream: turns the bytes of one direction into frames and runs of invalid bytes.

It adds the time of each item, and whether the framing is certain after a gap.
`scaraspec.protocol.frames` defines what a frame is, `dialogue` what it means.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice, pairwise
from typing import Final

from scaraspec.protocol import commands
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import Frame, Framer, Skipped, SkipReason, StreamItem
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.traffic.mixed_frames import find_mixed
from scaraspec.traffic.wire import WireEvent, WireRange

_MAX_INVALID_BYTES: Final = 4096
_SILENCE_NS: Final = 2_000_000_000
"""After this silence inside a frame, the next frame ends it (A-3-11)."""


class Stream:
    """The bytes that one side sends on one connection."""

    def __init__(self, connection: str, direction: Direction) -> None:
        self._connection = connection
        self._direction = direction
        self._framer = Framer(direction, recovery_filter=commands.is_known_opcode)
        self._pieces: deque[tuple[int, int]] = deque()  # offset of the first byte, time
        self._run: InvalidBytes | None = None
        self._in_sync = True
        self._at_gap = False  # the next bytes are the first ones after a gap
        self._ends_with_frame = False
        self._last_item: StreamItem | None = None
        self._silent_bytes = 0  # offset of a long silence inside a frame
        self._claimed_bytes = 0  # offset at which an abandoned frame would have ended

    def feed(self, event: WireEvent) -> Iterable[FrameSeen | InvalidBytes]:
        """Process the next bytes; return the frames and invalid bytes that they complete."""
        framer = self._framer
        if not event.data:
            return ()
        if framer.buffered_bytes:
            return self._continue(event)
        if seen := self.take_whole(event):
            return (seen,)
        at = framer.offset_bytes
        items = framer.feed(event.data)
        if self._at_gap:
            self._at_gap = False
            whole = framer.offset_bytes == at + len(event.data)
            # Packets are lost as a whole. If the bytes of an event are exactly frames with known
            # opcodes, they are in sync: frames inside file content are followed by other bytes.
            self._in_sync = whole and all(isinstance(item, Frame) for item in items)
        self._pieces.append((at, event.time_ns))
        return self._emit(at, items, certain=self._in_sync)

    def take_whole(self, event: WireEvent) -> FrameSeen | None:
        """Take the usual event: its bytes are one frame. Otherwise return None, and take nothing.

        It gives what `_emit` would give.
        """
        data, framer = event.data, self._framer
        if self._run or self._at_gap or not framer.take_whole(data):
            return None
        frame, parsed = commands.read_frame(self._direction, data)
        self._ends_with_frame, self._last_item = True, frame
        end, size, time_ns = framer.offset_bytes, len(data), event.time_ns
        place = WireRange(self._connection, self._direction, end - size, size, time_ns)
        certain = self._in_sync and end > self._claimed_bytes
        return FrameSeen(frame, place, time_ns, parsed, certain)

    @property
    def settled(self) -> bool:
        """Whether `settle` and `end_silent_frame` would change nothing."""
        return self._in_sync and not self._run and not self._framer.buffered_bytes

    def _continue(self, event: WireEvent) -> Iterator[FrameSeen | InvalidBytes]:
        """Process bytes after an unfinished frame."""
        framer = self._framer
        yield from self._abandon_after_silence(event)
        at = framer.offset_bytes
        self._pieces.append((at + framer.buffered_bytes, event.time_ns))
        yield from self._emit(at, framer.feed(event.data), certain=self._in_sync)

    def _abandon_after_silence(self, event: WireEvent) -> Iterator[FrameSeen | InvalidBytes]:
        """Abandon an unfinished frame if another frame follows after a long silence.

        A receiver that still waits may read what follows as the rest of the frame, so nothing is
        certain up to the end of the abandoned frame.
        """
        framer = self._framer
        if event.time_ns - self._pieces[-1][1] >= _SILENCE_NS:
            self._silent_bytes = framer.offset_bytes + framer.buffered_bytes
        buffered_bytes = self._silent_bytes - framer.offset_bytes
        if buffered_bytes > 0 and framer.frame_follows(buffered_bytes, event.data):
            yield from self._abandon(buffered_bytes)

    def end_silent_frame(self, now_ns: int) -> Iterator[FrameSeen | InvalidBytes]:
        """Abandon an unfinished frame after a long silence, if another one was read as its data."""
        ends_ns = self.silence_ends_ns
        if ends_ns is not None and now_ns >= ends_ns and self._framer.holds_frame:
            yield from self._abandon(self._framer.buffered_bytes)

    def _abandon(self, buffered_bytes: int) -> Iterator[FrameSeen | InvalidBytes]:
        framer = self._framer
        at = framer.offset_bytes
        self._claimed_bytes = at + framer.announced_bytes(buffered_bytes)
        items = [
            item if isinstance(item, Frame) else item._replace(reason=SkipReason.BAD_END)
            for item in framer.abandon(buffered_bytes)
        ]
        yield from self._emit(at, items, certain=False)
        yield from self.flush()

    @property
    def silence_ends_ns(self) -> int | None:
        """When `end_silent_frame` ends the unfinished frame; None if there is none."""
        return self._pieces[-1][1] + _SILENCE_NS if self._framer.buffered_bytes else None

    @property
    def buffered_bytes(self) -> int:
        """Number of buffered bytes of an unfinished frame."""
        return self._framer.buffered_bytes

    def settle(self) -> tuple[InvalidBytes, ...]:
        """End the run of invalid bytes, because the other side sends; return it.

        If the bytes end with a frame at this time, the stream is in sync again after a gap: a false
        frame, read from the middle of another one, would leave bytes after it.
        """
        if self._ends_with_frame and not self._framer.buffered_bytes:
            self._in_sync = True
        return self.flush()

    def skip_gap(self, length_bytes: int) -> Iterator[FrameSeen | InvalidBytes]:
        """Process a gap; an unfinished frame before it is not searched for other frames."""
        at = self._framer.offset_bytes
        items = self._framer.skip_gap(max(length_bytes, 0), commands.is_known_opcode)
        unfinished = b"".join(i.encode() if isinstance(i, Frame) else i.data for i in items)
        if unfinished:
            yield from self._emit(at, [Skipped(unfinished, SkipReason.TRUNCATED)], certain=False)
        if self._run:
            self._run = replace(self._run, touches_gap=True)
        yield from self.flush()
        self._in_sync = self._ends_with_frame = False
        self._at_gap = True
        self._last_item = None

    def finish(self) -> Iterator[FrameSeen | InvalidBytes]:
        """End the stream; frames found inside an unfinished frame are not certain."""
        at = self._framer.offset_bytes
        yield from self._emit(at, self._framer.finish(), certain=False)
        yield from self.flush()

    def flush(self) -> tuple[InvalidBytes, ...]:
        """End the current run of invalid bytes, if there is one; return it."""
        run, self._run = self._run, None
        return (run,) if run else ()

    def _emit(
        self, at: int, items: list[StreamItem], *, certain: bool
    ) -> Iterator[FrameSeen | InvalidBytes]:
        pieces = self._pieces
        mixed = self._find_mixed(items)
        for item in items:
            end = at + item.size_bytes
            begun_ns, time_ns = self._time(at), self._time(end - 1)
            pause_ns = self._longest_pause_ns(at, end)
            place = WireRange(self._connection, self._direction, at, end - at, time_ns)
            at = end
            while len(pieces) > 1 and pieces[1][0] <= at:
                pieces.popleft()
            self._ends_with_frame = isinstance(item, Frame)
            if isinstance(item, Frame):
                if self._run:
                    yield from self.flush()
                is_certain = certain and end > self._claimed_bytes
                parsed = commands.parse_frame(item)
                yield FrameSeen(item, place, begun_ns, parsed, is_certain, pause_ns)
            else:
                yield from self._skip(item, place, mixed)

    def _find_mixed(self, items: list[StreamItem]) -> str:
        """Return which two frames are mixed, if skipped bytes are a part of one of them."""
        before, self._last_item = self._last_item, items[-1] if items else self._last_item
        if all(isinstance(item, Frame) for item in items):
            return ""
        pieces = [
            item.encode() if isinstance(item, Frame) else item.data
            for item in (before, *items)
            if item is not None
        ]
        windows = (b"".join(pieces[at : at + size]) for at in range(len(pieces)) for size in (2, 3))
        return next(filter(None, (find_mixed(data, self._direction) for data in windows)), "")

    def _skip(self, item: Skipped, place: WireRange, mixed: str) -> Iterator[InvalidBytes]:
        """Join consecutive skipped items: invalid bytes after a false frame belong to it."""
        run = self._run
        if run and (
            item.reason is SkipReason.STRAY
            or (run.reason is not SkipReason.STRAY and item.reason is not SkipReason.TRUNCATED)
        ):
            room = max(_MAX_INVALID_BYTES - len(run.data), 0)
            length_bytes = run.place.length_bytes + place.length_bytes
            place = run.place._replace(length_bytes=length_bytes, time_ns=place.time_ns)
            self._run = replace(run, data=run.data + item.data[:room], place=place)
            return
        yield from self.flush()
        if item.reason is SkipReason.IMPLAUSIBLE and item.size_bytes == 1 and self._in_sync:
            return  # the wrong end byte of a frame that was already reported
        data = item.data[:_MAX_INVALID_BYTES]
        self._run = InvalidBytes(
            data, item.reason, place, touches_gap=not self._in_sync, mixed=mixed
        )

    def _longest_pause_ns(self, at: int, end: int) -> int:
        """Return the longest time between two pieces of the bytes from one offset to another."""
        later_ns = [time_ns for begin, time_ns in self._pieces if at < begin < end]
        if not later_ns:
            return 0
        return max(after - before for before, after in pairwise((self._time(at), *later_ns)))

    def _time(self, offset_bytes: int) -> int:
        """Return when the byte at this offset was seen."""
        time_ns = self._pieces[0][1]
        for begin, piece_ns in islice(self._pieces, 1, None):
            if begin > offset_bytes:
                break
            time_ns = piece_ns
        return time_ns
