"""Byte accounting: for each stream, bytes received = bytes recorded + bytes lost.

Only raw events are counted, so that the numbers in a file can be verified from its content. A
*stream* is one direction of a connection.
"""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable
from hashlib import sha256
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent

STREAM: Final = "stream"
"""Metadata records of a stream are named ``stream/<connection>/<direction>``."""

Entries = dict[str, str]
_Key = tuple[str, Direction]


class _Stream:
    """Counts of one stream in this file."""

    def __init__(self, offset_bytes: int) -> None:
        self.begin_bytes = self.end_bytes = offset_bytes
        self.recorded_bytes = self.lost_bytes = self.gaps = self.unknown_gaps = 0
        self.sha256 = sha256()

    def add(self, event: WireEvent) -> None:
        length_bytes = 0
        if event.kind is Kind.BYTES:
            length_bytes = len(event.data)
            self.recorded_bytes += length_bytes
            self.sha256.update(event.data)
        elif event.kind is Kind.GAP:
            length_bytes = max(event.length_bytes, 0)
            self.gaps += 1
            self.unknown_gaps += event.length_bytes < 0
            self.lost_bytes += length_bytes
        else:
            return
        self.end_bytes = event.offset_bytes + length_bytes

    def entries(self) -> Entries:
        return {
            "first_offset_bytes": str(self.begin_bytes),
            "received_bytes": str(self.end_bytes - self.begin_bytes),
            "recorded_bytes": str(self.recorded_bytes),
            "lost_bytes": str(self.lost_bytes),
            "gaps": str(self.gaps),
            "gaps_of_unknown_length": str(self.unknown_gaps),
            "sha256_recorded": self.sha256.hexdigest(),
        }


class ByteAccounting:
    """Byte counts of all streams of open connections.

    Attributes:
        recorded_bytes: Recorded bytes of all connections, also of closed ones, by direction.
    """

    def __init__(self) -> None:
        self.recorded_bytes: Counter[Direction] = Counter()
        self._streams: dict[_Key, _Stream] = {}

    @property
    def begins(self) -> dict[tuple[str, Direction], int]:
        """The first offset of each stream of an open connection, by connection and direction."""
        return {key: stream.begin_bytes for key, stream in self._streams.items()}

    def add(self, event: WireEvent) -> dict[str, Entries]:
        """Count an event. Return the accounts of the streams that it closes, by metadata name."""
        key = (event.connection, event.direction)
        stream = self._streams.get(key)
        if stream is None:
            stream = self._streams[key] = _Stream(event.offset_bytes)
        stream.add(event)
        if event.kind is Kind.BYTES:
            self.recorded_bytes[event.direction] += len(event.data)
        if event.kind not in (Kind.CLOSED, Kind.RESET):
            return {}
        return self._pop((event.connection, direction) for direction in Direction)

    def close(self) -> dict[str, Entries]:
        """Return the accounts of the remaining streams."""
        return self._pop(list(self._streams))

    def _pop(self, keys: Iterable[_Key]) -> dict[str, Entries]:
        ended = ((key, self._streams.pop(key, None)) for key in keys)
        return {
            f"{STREAM}/{connection}/{direction.value}": stream.entries()
            for (connection, direction), stream in ended
            if stream
        }


class ByteAccountingCheck:
    """Compares the accounts stored in a file with its raw events.

    A stream may have several accounts, one for each end of its connection, in order.

    Attributes:
        wrong: Number of accounts that differ from the events, are missing or have no stream.
    """

    def __init__(self) -> None:
        self.wrong = 0
        self._counted = ByteAccounting()
        self._expected: defaultdict[str, deque[Entries]] = defaultdict(deque)
        self._stored: defaultdict[str, deque[Entries]] = defaultdict(deque)

    def count(self, event: WireEvent) -> None:
        """Count a raw event of the file."""
        if accounts := self._counted.add(event):
            self._count(accounts)

    def add_metadata(self, name: str, entries: Entries) -> None:
        """Process a metadata record of the file; records other than accounts are ignored."""
        if name.startswith(f"{STREAM}/"):
            self._stored[name].append(entries)
            self._match(name)

    def close(self) -> None:
        """Finish: count accounts without a counterpart as wrong."""
        self._count(self._counted.close())
        self.wrong += sum(
            len(rest) for side in (self._expected, self._stored) for rest in side.values()
        )

    def _count(self, accounts: dict[str, Entries]) -> None:
        for name, entries in accounts.items():
            self._expected[name].append(entries)
            self._match(name)

    def _match(self, name: str) -> None:
        expected, stored = self._expected[name], self._stored[name]
        if expected and stored:
            self.wrong += expected.popleft() != stored.popleft()
        for side in (self._expected, self._stored):
            if not side[name]:
                del side[name]
