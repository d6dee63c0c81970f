"""Masks passwords in raw events, independent of how the bytes are split.

`scaraspec.protocol.redaction` defines what is secret and how it is masked. This module finds the
secret bytes in a stream: passwords, also where they occur again, bytes outside of frames, and the
data of unknown frames. If in doubt, it masks too much rather than too little: at a flush, also the
data of an unfinished frame.
"""

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from scaraspec.protocol.commands import BY_NAME, is_known_opcode
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.fields import Diagnostics
from scaraspec.protocol.frames import TAG, Frame, Framer, Skipped
from scaraspec.protocol.redaction import is_secret, mask
from scaraspec.protocol.transfer import HEAD_BYTES, FileData
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.sink import OutputFolder, SinkState

MASKED_NOTE: Final = "passwords masked"
"""The note of every raw event in which bytes were hidden."""

MIN_PASSWORD_BYTES: Final = 4
"""Length from which on a password is also masked where it occurs in other frames."""

_LEAST_PART_BYTES: Final = 2  # of a password at the end of a chunk; a single byte is frequent
_CONTENT_BYTES: Final = 255
_CHUNKS: Final = frozenset(
    ((A2C, BY_NAME["upload_chunk"].opcode), (C2A, BY_NAME["download_chunk"].opcode))
)
_RESULT: Final = re.compile(rb"[01]{1,2}(\|?[0-9A-Fa-f]{1,3})?")


@dataclass(slots=True)
class _Stream:
    """One direction and the ranges to mask; positions count from its first byte."""

    framer: Framer
    after_gap: bool = False
    held: bytes = b""
    hidden: deque[tuple[int, int]] = field(default_factory=deque)
    content: bytes = b""  # the end of the last chunks of files


class _Link:
    """The events of one connection.

    Args:
        passwords: The latest passwords of all connections; updated.
    """

    def __init__(self, passwords: deque[bytes]) -> None:
        self._passwords = passwords
        self._streams = {direction: _Stream(Framer(direction)) for direction in Direction}
        self._pending: deque[tuple[int, WireEvent]] = deque()

    @property
    def held_from(self) -> tuple[Direction, int] | None:
        """Direction and offset of the first event that is held back; None if there is none."""
        if not self._pending:
            return None
        begin, event = self._pending[0]
        return event.direction, begin

    def take(self, event: WireEvent) -> None:
        """Queue an event, and note the secret ranges in the frames that it completes."""
        stream = self._streams[event.direction]
        framer = stream.framer
        at = framer.offset_bytes
        self._pending.append((at + framer.buffered_bytes, event))
        if event.kind in (Kind.CLOSED, Kind.RESET):
            for each in self._streams.values():
                begin = each.framer.offset_bytes
                self._note(each, each.framer.finish(), begin)
        elif event.kind is Kind.BYTES:
            self._note(stream, framer.feed(event.data), at)
        elif event.kind is Kind.HALF_CLOSED:
            self._note(stream, framer.finish(), at)
        elif event.kind is Kind.GAP:
            self._note(stream, framer.skip_gap(max(event.length_bytes, 0), is_known_opcode), at)
            stream.after_gap = True
        held = framer.buffered_bytes
        stream.held = (stream.held + event.data)[-held:] if held else b""

    def release(self) -> Iterator[WireEvent]:
        """Yield pending events up to the first incomplete frame."""
        until = {way: stream.framer.offset_bytes for way, stream in self._streams.items()}
        while self._pending:
            begin, event = self._pending[0]
            end = begin + len(event.data)
            if end > until[event.direction]:
                return
            self._pending.popleft()
            yield self._masked(event, begin) if end > begin else event

    def force(self) -> Iterator[WireEvent]:
        """Yield all pending events, with possibly secret bytes masked."""
        if not self._pending:
            return
        for stream in self._streams.values():
            at, held = stream.framer.offset_bytes, stream.held
            begin = 0 if stream.after_gap else _known_bytes(held)
            stream.hidden.append((at + begin, at + len(held)))
        for begin, event in self._pending:
            yield self._masked(event, begin) if event.data else event
        self._pending.clear()

    def _note(self, stream: _Stream, found: list[Frame | Skipped], at: int) -> None:
        for item in found:
            end = at + item.size_bytes
            if isinstance(item, Skipped):
                stream.hidden.append((at, end))
            else:
                stream.after_gap = False
                begin = end - 1 - len(item.data)
                if is_secret(item):
                    self._learn(item.data)
                if is_secret(item) or not _is_expected(item):
                    stream.hidden.append((begin, end - 1))
                else:
                    self._note_passwords(stream, item.data, begin)
                    if (item.direction, item.opcode) in _CHUNKS:
                        self._note_content(stream, item.data, begin)
            at = end

    def _learn(self, data: bytes) -> None:
        """Add the passwords in the data of a secret frame."""
        for part in data.split(b"|"):
            if len(part) >= MIN_PASSWORD_BYTES and part not in self._passwords:
                self._passwords.append(part)

    def _note_passwords(self, stream: _Stream, data: bytes, at: int) -> None:
        """Note every occurrence of a password."""
        stream.hidden.extend(
            (at + found, at + found + len(password))
            for password in self._passwords
            for found in range(len(data) - len(password) + 1)
            if data.startswith(password, found)
        )

    def _note_content(self, stream: _Stream, data: bytes, at: int) -> None:
        """Note the parts of passwords that are divided between chunks of a file."""
        chunk = FileData().read(data, Diagnostics())
        if chunk is None:
            return
        first = len(stream.content)
        joined = stream.content + chunk.data
        at += HEAD_BYTES - first
        for password in self._passwords:
            size = len(password)
            begins = [n for n in range(first) if joined.startswith(password, n)]
            begins += [
                len(joined) - part
                for part in range(_LEAST_PART_BYTES, size)
                if joined.endswith(password[:part])
            ]
            for begin in begins:
                end = min(begin + size, len(joined))
                stream.hidden.append((at + max(begin, first), at + end))
        stream.content = joined[-_CONTENT_BYTES:]

    def _masked(self, event: WireEvent, begin: int) -> WireEvent:
        hidden = self._streams[event.direction].hidden
        while hidden and hidden[0][1] <= begin:
            hidden.popleft()
        data = bytearray(event.data)
        for first, last in hidden:
            part = slice(max(first - begin, 0), max(last - begin, 0))
            data[part] = mask(bytes(data[part]))
        return event if data == event.data else replace(event, data=bytes(data), note=MASKED_NOTE)


def _is_expected(frame: Frame) -> bool:
    """Whether a frame has a known opcode, and a final result has about the form of one (L318)."""
    known = is_known_opcode(frame.opcode, frame.tagged)
    return known and not (frame.tagged and not _RESULT.fullmatch(frame.data))


def _known_bytes(held: bytes) -> int:
    """Return how many bytes of an unfinished frame may be shown: at most until its opcode.

    The next byte is its length, or the first byte of a password without an opcode.
    """
    tagged = held[1:2] == bytes((TAG,))
    opcode = held[1 + tagged : 2 + tagged]
    return 2 + tagged if opcode and is_known_opcode(opcode[0], tagged) else 1


class Redactor:
    """Masks passwords in raw events, for recordings that are passed to others.

    Whether a byte is secret is known only when its frame is complete. Until then, or until `flush`,
    the events of its connection are held back, in order.

    Args:
        passwords: The latest passwords of all connections; updated. None for no earlier ones.
    """

    def __init__(self, passwords: deque[bytes] | None = None) -> None:
        self._links: dict[str, _Link] = {}
        self._passwords = SinkState().passwords if passwords is None else passwords

    def feed(self, event: WireEvent) -> Iterator[WireEvent]:
        """Process the next event. Yield the events that are decided."""
        link = self._links.get(event.connection)
        if link is None:
            link = self._links[event.connection] = _Link(self._passwords)
        link.take(event)
        if event.kind in (Kind.CLOSED, Kind.RESET):
            del self._links[event.connection]
        yield from link.release()

    def unfinished_frames(self) -> Iterator[tuple[str, Direction, int]]:
        """Yield connection, direction and offset of the first event that each link holds back."""
        for connection, link in self._links.items():
            if link.held_from:
                yield connection, *link.held_from

    def flush(self) -> Iterator[WireEvent]:
        """Yield all events held back, with possibly secret bytes masked."""
        for link in self._links.values():
            yield from link.force()


def make_redactor(folder: OutputFolder) -> Redactor:
    """Return a redactor for recordings in a folder, which knows the passwords of earlier sinks."""
    redactor = Redactor(folder.state.passwords)
    folder.delay_ticks_while(redactor.unfinished_frames)
    return redactor
