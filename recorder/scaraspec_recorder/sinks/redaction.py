"""Masks passwords in raw events, independent of how the bytes are split.

`scaraspec.protocol.redaction` defines what is secret and how it is masked. This module finds the
secret bytes in a stream. If in doubt, it masks too much rather than too little.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from scaraspec.protocol.commands import is_known_opcode
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame, Framer, Skipped
from scaraspec.protocol.redaction import is_secret, mask, secret_offset
from scaraspec.traffic.wire import Kind, WireEvent

MASKED_NOTE: Final = "passwords masked"
"""The note of every raw event in which bytes were hidden."""


@dataclass(slots=True)
class _Client:
    """Bytes of one client and the ranges to mask; positions count from its first byte."""

    framer: Framer
    after_gap: bool = False
    held: bytes = b""
    pending: deque[tuple[int, WireEvent]] = field(default_factory=deque)
    hidden: deque[tuple[int, int]] = field(default_factory=deque)

    def take(self, event: WireEvent) -> None:
        """Queue an event, and note the secret ranges in the frames that it completes."""
        framer = self.framer
        at = framer.offset_bytes
        self.pending.append((at + framer.buffered_bytes, event))
        if event.kind in (Kind.CLOSED, Kind.RESET):
            self._note(framer.finish(), at)
        elif event.direction is not A2C:
            return
        elif event.kind is Kind.BYTES:
            self._note(framer.feed(event.data), at)
        elif event.kind is Kind.HALF_CLOSED:
            self._note(framer.finish(), at)
        elif event.kind is Kind.GAP:
            self._note(framer.skip_gap(max(event.length_bytes, 0), is_known_opcode), at)
            self.after_gap = True
        held = framer.buffered_bytes
        self.held = (self.held + event.data)[-held:] if held else b""

    def release(self) -> Iterator[WireEvent]:
        """Yield pending events up to the first incomplete frame."""
        yield from self._release(self.framer.offset_bytes)

    def force(self) -> Iterator[WireEvent]:
        """Yield all pending events, with possibly secret bytes masked."""
        at = self.framer.offset_bytes
        self._note_loose(self.held, at)
        yield from self._release(at + len(self.held))

    def _note(self, found: list[Frame | Skipped], at: int) -> None:
        for item in found:
            end = at + item.size_bytes
            if isinstance(item, Skipped):
                self._note_loose(item.data, at)
            else:
                self.after_gap = False
                if is_secret(item):
                    self.hidden.append((end - 1 - len(item.data), end - 1))
            at = end

    def _note_loose(self, data: bytes, at: int) -> None:
        """Note secret ranges in bytes outside frames. After a gap, they may end a secret frame."""
        begin = 0 if self.after_gap else secret_offset(data)
        if begin < len(data):
            self.hidden.append((at + begin, at + len(data)))

    def _release(self, until: int) -> Iterator[WireEvent]:
        while self.pending:
            begin, event = self.pending[0]
            end = begin + (len(event.data) if event.direction is A2C else 0)
            if end > until:
                return
            self.pending.popleft()
            while self.hidden and self.hidden[0][1] <= begin:
                self.hidden.popleft()
            yield self._masked(event, begin) if end > begin else event

    def _masked(self, event: WireEvent, begin: int) -> WireEvent:
        data = bytearray(event.data)
        for first, last in self.hidden:
            part = slice(max(first - begin, 0), max(last - begin, 0))
            data[part] = mask(bytes(data[part]))
        return event if data == event.data else replace(event, data=bytes(data), note=MASKED_NOTE)


class Redactor:
    """Masks passwords in raw events, for recordings that are passed to others.

    Whether a byte is secret is known only when its frame is complete. Until then, or until `flush`,
    the events of its connection are held back, in order.
    """

    def __init__(self) -> None:
        self._clients: dict[str, _Client] = {}

    def feed(self, event: WireEvent) -> Iterator[WireEvent]:
        """Process the next event. Yield the events that are decided."""
        client = self._clients.get(event.connection)
        if client is None:
            client = self._clients[event.connection] = _Client(Framer(A2C))
        client.take(event)
        if event.kind in (Kind.CLOSED, Kind.RESET):
            del self._clients[event.connection]
        yield from client.release()

    def flush(self) -> Iterator[WireEvent]:
        """Yield all events held back, with possibly secret bytes masked."""
        for client in self._clients.values():
            yield from client.force()
