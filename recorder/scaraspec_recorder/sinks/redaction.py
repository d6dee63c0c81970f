"""Masks passwords in raw events, independent of how the bytes are split.

`scaraspec.protocol.redaction` defines what is secret and how it is masked. This module finds the
secret bytes in a stream: passwords, also where they occur again, bytes outside of frames, and the
data of unknown frames. If in doubt, it masks too much rather than too little. Only an unfinished
frame with a known opcode, at a flush, is shown except for passwords.
"""

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from scaraspec.protocol.commands import is_known_opcode
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import TAG, Frame, Framer, Skipped
from scaraspec.protocol.redaction import is_secret, mask, secret_offset
from scaraspec.traffic.wire import Kind, WireEvent

MASKED_NOTE: Final = "passwords masked"
"""The note of every raw event in which bytes were hidden."""

MIN_PASSWORD_BYTES: Final = 4
"""Length from which on a password is also masked where it occurs in other frames."""

_MAX_PASSWORDS: Final = 64
_RESULT: Final = re.compile(rb"[01]{1,2}(\|?[0-9A-Fa-f]{1,3})?")


@dataclass(slots=True)
class _Stream:
    """One direction and the ranges to mask; positions count from its first byte."""

    framer: Framer
    after_gap: bool = False
    held: bytes = b""
    hidden: deque[tuple[int, int]] = field(default_factory=deque)


class _Link:
    """The events of one connection.

    Args:
        passwords: The latest passwords of all connections; updated.
    """

    def __init__(self, passwords: deque[bytes]) -> None:
        self._passwords = passwords
        self._streams = {direction: _Stream(Framer(direction)) for direction in Direction}
        self._pending: deque[tuple[int, WireEvent]] = deque()

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
            begin = 0 if stream.after_gap else min(secret_offset(held), _known_bytes(held))
            stream.hidden.append((at + begin, at + len(held)))
            self._note_passwords(stream, held, at)
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
    """Return how many bytes of an unfinished frame may be shown: all if its opcode is known."""
    tagged = held[1:2] == bytes((TAG,))
    opcode = held[1 + tagged : 2 + tagged]
    return len(held) if not opcode or is_known_opcode(opcode[0], tagged) else 1


class Redactor:
    """Masks passwords in raw events, for recordings that are passed to others.

    Whether a byte is secret is known only when its frame is complete. Until then, or until `flush`,
    the events of its connection are held back, in order.
    """

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}
        self._passwords: deque[bytes] = deque(maxlen=_MAX_PASSWORDS)

    def feed(self, event: WireEvent) -> Iterator[WireEvent]:
        """Process the next event. Yield the events that are decided."""
        link = self._links.get(event.connection)
        if link is None:
            link = self._links[event.connection] = _Link(self._passwords)
        link.take(event)
        if event.kind in (Kind.CLOSED, Kind.RESET):
            del self._links[event.connection]
        yield from link.release()

    def flush(self) -> Iterator[WireEvent]:
        """Yield all events held back, with possibly secret bytes masked."""
        for link in self._links.values():
            yield from link.force()
