"""Builds the wire events of a recording from the records of a spool.

Per connection and direction, the events have no holes: bytes missing between records, or before the
total that the tap reports at the end, become a gap. Connection names are unique, even after a
restart of a process. This module does no I/O and reads no clock.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from scaraspec.protocol.direction import A2C, Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk
from scaraspec_recorder.spool.records import ControlRecord, Record, stream_number

_MOST_DROPPED: Final = 3  # named in the note of a connection; all are counted
_MISSING: Final = "records are missing"
_NO_START: Final = "its beginning is not recorded"


@dataclass(slots=True)
class ByteCounts:
    """Byte and gap counts of one direction, all connections together."""

    recorded_bytes: int = 0
    gap_bytes: int = 0
    gaps: int = 0
    unknown_gaps: int = 0  # of unknown length
    spooled_bytes: int = 0  # left to the next recorder
    unforwarded_bytes: dict[str, int] = field(default_factory=dict)  # dropped, by reason

    @property
    def received_bytes(self) -> int:
        """Bytes that the tap received and forwarded, without gaps of unknown length."""
        return self.recorded_bytes + self.gap_bytes + self.spooled_bytes


@dataclass(slots=True)
class _Stream:
    """One direction of an open connection."""

    name: str
    direction: Direction
    count: ByteCounts
    next_bytes: int | None  # None until the first record if the start is unknown

    def gap(self, time_ns: int, length_bytes: int, note: str) -> WireEvent:
        """Count bytes that were forwarded but not recorded; a length of -1 is unknown."""
        begin_bytes = self.next_bytes or 0
        self.count.gaps += 1
        if length_bytes < 0:
            self.count.unknown_gaps += 1
        else:
            self.count.gap_bytes += length_bytes
            self.next_bytes = begin_bytes + length_bytes
        return WireEvent(
            time_ns, self.name, self.direction, Kind.GAP, b"", begin_bytes, length_bytes, note
        )


@dataclass(slots=True)
class _Link:
    """An open connection."""

    number: int
    opened: WireEvent
    streams: dict[Direction, _Stream] = field(default_factory=dict)
    connecting: bool = False
    dropped: list[str] = field(default_factory=list)  # what was not forwarded


class EventBuilder:
    """Converts records, in their order, to wire events.

    Args:
        counts: Counters of each direction; updated.
        state: State of an earlier builder, see `state`; empty for a new recording.

    Attributes:
        connections: Number of connections so far; their names count from 1.
        time_ns: Time of the last record; None before the first.
    """

    def __init__(self, counts: Mapping[Direction, ByteCounts], state: Mapping[str, Any]) -> None:
        self.connections: int = state.get("connections", 0)
        self.time_ns: int | None = state.get("time_ns")
        self._base: int = state.get("base", 0)  # number of connections before the last restart
        self._counts = counts
        self._links: dict[int, _Link] = {}
        self._streams: dict[int, _Stream] = {}
        for number, time_ns, note, next_bytes in state.get("links", ()):
            self._open(number, time_ns, note, next_bytes)

    @property
    def connecting_since_ns(self) -> int:
        """Time of the oldest client that waits for the connection to the robot; 0 for none."""
        waiting = [link.opened.time_ns for link in self._links.values() if link.connecting]
        return min(waiting, default=0)

    @property
    def state(self) -> dict[str, Any]:
        """State for JSON, from which another builder can continue."""
        return {
            "connections": self.connections,
            "time_ns": self.time_ns,
            "base": self._base,
            "links": [
                (
                    link.number,
                    link.opened.time_ns,
                    link.opened.note,
                    [link.streams[direction].next_bytes for direction in Direction],
                )
                for link in self._links.values()
            ],
        }

    def reopening_events(
        self, time_ns: int, lost: Mapping[tuple[str, Direction], int], note: str
    ) -> Iterator[WireEvent]:
        """Yield the events that open the current connections in a sink created at this time.

        After each opening, every direction with traffic gets an empty BYTES event with its offset:
        a reader sees that the earlier bytes are not missing.

        Args:
            time_ns: Time of the events.
            lost: Offsets from which on the bytes of a stream were recorded and are lost; they
                become a gap.
            note: Why they are lost.
        """
        for link in self._links.values():
            name = link.opened.connection
            ends = {direction: s.next_bytes or 0 for direction, s in link.streams.items()}
            begins = {
                direction: lost.get((name, direction), end) for direction, end in ends.items()
            }
            yield replace(link.opened, time_ns=time_ns, offset_bytes=begins[A2C])
            for direction, begin in begins.items():
                place = (time_ns, name, direction)
                if begin:
                    yield WireEvent(*place, Kind.BYTES, b"", begin)
                if size_bytes := ends[direction] - begin:
                    yield WireEvent(*place, Kind.GAP, b"", begin, size_bytes, note)

    def take(self, records: Sequence[Record]) -> list[WireEvent]:
        """Return the events of the next records."""
        if records:
            self.time_ns = records[-1].time_ns
        events: list[WireEvent] = []
        add, streams, bytes_kind = events.append, self._streams, Kind.BYTES
        for record in records:
            kind, number, time_ns, offset, payload, forwarded_ns, kernel_time = record
            stream = streams.get(number)
            if kind is bytes_kind and stream is not None and stream.next_bytes == offset:
                size_bytes = len(payload)
                stream.next_bytes = offset + size_bytes
                stream.count.recorded_bytes += size_bytes
                place = (time_ns, stream.name, stream.direction, bytes_kind, payload, offset)
                if forwarded_ns or kernel_time:
                    add(ForwardedChunk(*place, 0, "", forwarded_ns, kernel_time))
                else:
                    add(WireEvent(*place))
            else:
                events += self._take(record)
        return events

    def end_all(self, time_ns: int, reason: str) -> list[WireEvent]:
        """Close all open connections, with a gap of unknown length in each direction."""
        events: list[WireEvent] = []
        for link in self._links.values():
            events += [stream.gap(time_ns, -1, reason) for stream in link.streams.values()]
            first = link.streams[A2C]
            events.append(
                WireEvent(
                    time_ns, first.name, A2C, Kind.CLOSED, b"", first.next_bytes or 0, note=reason
                )
            )
        self._links.clear()
        self._streams.clear()
        return events

    def _take(self, record: Record) -> list[WireEvent]:
        """Convert one record of any kind."""
        kind, number, time_ns, offset, *_ = record
        if kind is ControlRecord.RESTART:
            events = self.end_all(time_ns, record.note)
            self._base = self.connections
            return events
        events = []
        if number not in self._streams:
            opening = kind is Kind.OPENED
            note, begin_bytes = (record.note, 0) if opening else (_NO_START, None)
            link = self._open(record.connection, time_ns, note, [begin_bytes, begin_bytes])
            link.connecting = opening
            events.append(link.opened)
        stream = self._streams[number]
        if kind in (ControlRecord.CONNECTED, ControlRecord.UNFORWARDED):
            self._links[record.connection].connecting = False
            if kind is ControlRecord.UNFORWARDED:
                self._drop(record, stream)
            return events
        if stream.next_bytes is not None and stream.next_bytes < offset:
            events.append(stream.gap(time_ns, offset - stream.next_bytes, _MISSING))
        stream.next_bytes = offset
        if kind is Kind.GAP:
            events.append(stream.gap(time_ns, record.length_bytes, record.note))
        elif kind is Kind.BYTES:
            events += self.take((record,))
        elif isinstance(kind, Kind) and kind is not Kind.OPENED:
            place = (time_ns, stream.name, stream.direction, kind, b"", offset)
            events.append(WireEvent(*place, note=self._note(record)))
        if kind in (Kind.CLOSED, Kind.RESET):
            self._close(record.connection)
        return events

    def _open(
        self, number: int, time_ns: int, note: str, next_bytes: Iterable[int | None]
    ) -> _Link:
        """Add a connection; `next_bytes` by direction."""
        self.connections = max(self.connections, self._base + number)
        name = str(self._base + number)
        link = _Link(number, WireEvent(time_ns, name, A2C, Kind.OPENED, note=note))
        for direction, offset in zip(Direction, next_bytes, strict=True):
            stream = _Stream(name, direction, self._counts[direction], offset)
            link.streams[direction] = self._streams[stream_number(number, direction)] = stream
        self._links[number] = link
        return link

    def _drop(self, record: Record, stream: _Stream) -> None:
        """Count bytes that were not forwarded."""
        dropped, reason = stream.count.unforwarded_bytes, record.note
        dropped[reason] = dropped.get(reason, 0) + record.length_bytes
        sender = "client" if stream.direction is A2C else "controller"
        notes = self._links[record.connection].dropped
        if len(notes) < _MOST_DROPPED:
            notes.append(f"not forwarded from the {sender}: {record.length_bytes} bytes, {reason}")

    def _note(self, record: Record) -> str:
        """Return the note of a record; at the end, with what the connection did not forward."""
        ended = record.kind in (Kind.CLOSED, Kind.RESET)
        dropped = self._links[record.connection].dropped if ended else ()
        return "; ".join(filter(None, (record.note, *dropped)))

    def _close(self, number: int) -> None:
        del self._links[number]
        for direction in Direction:
            del self._streams[stream_number(number, direction)]
