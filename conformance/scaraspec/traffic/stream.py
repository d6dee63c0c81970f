"""Stream: one direction's bytes made into frames, and into runs of bytes that are none.

Records what passed when, and how far the framing can be trusted after a gap. What a frame is
is defined in `scaraspec.protocol.frames`, what it means in `dialogue`.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Final

from scaraspec.protocol import commands
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import Frame, Framer, Skipped, SkipReason, StreamItem
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.traffic.wire import WireEvent, WireRange

_KEPT_UNDECODABLE_BYTES: Final = 4096
_SILENCE_NS: Final = 2_000_000_000
"""For how long a frame may stop in its middle before another one after it ends it (A-3-11)."""


class Stream:
    """What one side sends on one connection."""

    def __init__(self, connection: str, direction: Direction) -> None:
        self._connection = connection
        self._direction = direction
        self._framer = Framer(direction, recovery_filter=commands.is_known_opcode)
        self._pieces: deque[tuple[int, int]] = deque()  # offset of the first byte, time
        self._run: InvalidBytes | None = None
        self._in_step = True
        self._ends_with_frame = False
        self._silent_bytes = 0  # at which offset there was a long silence within a frame
        self._claimed_bytes = 0  # up to which one a frame that was given up would have reached

    def feed(self, event: WireEvent) -> Iterator[FrameSeen | InvalidBytes]:
        """Take the next bytes."""
        if event.data:
            if self._framer.buffered_bytes:
                yield from self._resume(event)
            end_bytes = self._framer.offset_bytes + self._framer.buffered_bytes
            self._pieces.append((end_bytes, event.time_ns))
            at = self._framer.offset_bytes
            yield from self._emit(at, self._framer.feed(event.data), certain=self._in_step)

    def _resume(self, event: WireEvent) -> Iterator[FrameSeen | InvalidBytes]:
        """Wait no longer for the rest of a frame where after a long silence another one stands.

        Who does wait may take what follows for that rest: up to there nothing is certain.
        """
        framer = self._framer
        if event.time_ns - self._pieces[-1][1] >= _SILENCE_NS:
            self._silent_bytes = framer.offset_bytes + framer.buffered_bytes
        at, buffered_bytes = framer.offset_bytes, self._silent_bytes - framer.offset_bytes
        if buffered_bytes > 0 and framer.frame_follows(buffered_bytes, event.data):
            self._claimed_bytes = at + framer.announced_bytes(buffered_bytes)
            wrong = [
                item if isinstance(item, Frame) else item._replace(reason=SkipReason.BAD_END)
                for item in framer.abandon(buffered_bytes)
            ]
            yield from self._emit(at, wrong, certain=False)
            yield from self.flush()

    @property
    def buffered_bytes(self) -> int:
        """How many bytes there are of a frame that is not whole yet."""
        return self._framer.buffered_bytes

    def settle(self) -> Iterator[InvalidBytes]:
        """The other side speaks: what is no frame is over.

        Where the bytes end with a frame just then, they are in step again after a gap: a frame
        that was misread out of the middle of another one would have left bytes after it.
        """
        if self._run:
            yield from self.flush()
        if self._ends_with_frame and not self._framer.buffered_bytes:
            self._in_step = True

    def lose(self, length_bytes: int) -> Iterator[FrameSeen | InvalidBytes]:
        """Bytes passed unseen; a frame that they tear is not searched for others."""
        at = self._framer.offset_bytes
        found = self._framer.skip_gap(max(length_bytes, 0), commands.is_known_opcode)
        torn = b"".join(i.encode() if isinstance(i, Frame) else i.data for i in found)
        if torn:
            yield from self._emit(at, [Skipped(torn, SkipReason.TRUNCATED)], certain=False)
        if self._run:
            self._run = replace(self._run, touches_gap=True)
        yield from self.flush()
        self._in_step = self._ends_with_frame = False

    def finish(self) -> Iterator[FrameSeen | InvalidBytes]:
        """No more bytes come; frames within an unfinished one are a guess."""
        at = self._framer.offset_bytes
        yield from self._emit(at, self._framer.finish(), certain=False)
        yield from self.flush()

    def flush(self) -> Iterator[InvalidBytes]:
        """Hand out the run of undecodable bytes that is open, if there is one."""
        run, self._run = self._run, None
        if run:
            yield run

    def _emit(
        self, at: int, found: list[StreamItem], *, certain: bool
    ) -> Iterator[FrameSeen | InvalidBytes]:
        pieces = self._pieces
        for item in found:
            end = at + item.size_bytes
            begun_ns, time_ns = self._time(at), self._time(end - 1)
            place = WireRange(self._connection, self._direction, at, end - at, time_ns)
            at = end
            while len(pieces) > 1 and pieces[1][0] <= at:
                pieces.popleft()
            self._ends_with_frame = isinstance(item, Frame)
            if isinstance(item, Frame):
                if self._run:
                    yield from self.flush()
                sure = certain and end > self._claimed_bytes
                yield FrameSeen(item, place, begun_ns, commands.parse_frame(item), sure)
            else:
                yield from self._skip(item, place)

    def _skip(self, item: Skipped, place: WireRange) -> Iterator[InvalidBytes]:
        """Join what the framer told in pieces: a false frame takes in what follows it."""
        run = self._run
        if run and (
            item.reason is SkipReason.STRAY
            or (run.reason is not SkipReason.STRAY and item.reason is not SkipReason.TRUNCATED)
        ):
            room = max(_KEPT_UNDECODABLE_BYTES - len(run.data), 0)
            length_bytes = run.place.length_bytes + place.length_bytes
            place = run.place._replace(length_bytes=length_bytes, time_ns=place.time_ns)
            self._run = replace(run, data=run.data + item.data[:room], place=place)
            return
        yield from self.flush()
        if item.reason is SkipReason.IMPLAUSIBLE and item.size_bytes == 1 and self._in_step:
            return  # the wrong end byte of a frame that has been told
        data = item.data[:_KEPT_UNDECODABLE_BYTES]
        self._run = InvalidBytes(data, item.reason, place, touches_gap=not self._in_step)

    def _time(self, offset_bytes: int) -> int:
        """When the byte at this offset passed."""
        time_ns = self._pieces[0][1]
        for begin, piece_ns in islice(self._pieces, 1, None):
            if begin > offset_bytes:
                break
            time_ns = piece_ns
        return time_ns
