"""Records: what the forwarding process saw, as bytes in blocks.

Lives here: the layout of records and blocks, both ways. Where blocks lie, and who writes and reads
them, stands in `spool`.

A block is a header (magic, length, CRC-32) and whole records. It is written by one write, so that a
writer that is killed leaves at most one torn block, which no reader takes for a whole one.
"""

import struct
import zlib
from collections.abc import Iterator
from enum import Enum
from typing import Final, NamedTuple

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind

MAX_BLOCK_BYTES: Final = 1 << 20

UNREACHABLE: Final = "no connection: "
"""How the note begins of a connection whose client found no robot; the reason follows."""

_HEADER: Final = struct.Struct("<4sII")
_MAGIC: Final = b"SPL2"  # counts the layouts: another one's blocks are damage
_RECORD: Final = struct.Struct("<IBQQQQ?")
_LENGTH: Final = struct.Struct("<q")


class ControlRecord(Enum):
    """What is told beside what happened on the wire."""

    RESTART = "restart"  # what follows is not joined to what came before: connections begin anew
    TOTAL = "total"  # `offset_bytes` were received in this direction, by the forwarder's count

    __hash__ = object.__hash__


_KINDS: Final[tuple[Kind | ControlRecord, ...]] = (*Kind, *ControlRecord)
CODES: Final = {kind: code for code, kind in enumerate(_KINDS)}
"""What stands for a kind in a record's head."""

HEAD_BYTES: Final = _RECORD.size

pack_head: Final = _RECORD.pack
"""Return a record's head: the payload's size, the kind's code, then the other fields in order."""


class Record(NamedTuple):
    """One thing that the forwarding process saw.

    Attributes:
        kind: What happened.
        stream: Connection and direction, see `stream_number`.
        time_ns: Nanoseconds since the Unix epoch.
        offset_bytes: Stream offset where it happened.
        payload: The bytes; or the note, in UTF-8; of a gap its length and its note.
        forwarded_ns: When the bytes had been passed on; 0 for every other kind, and where nobody
            knows.
        kernel_time: Whether `time_ns` is when the system received the bytes; else it is when the
            forwarding process read them.
    """

    kind: Kind | ControlRecord
    stream: int
    time_ns: int
    offset_bytes: int = 0
    payload: bytes = b""
    forwarded_ns: int = 0
    kernel_time: bool = False

    @property
    def connection(self) -> int:
        """The connection's number, counted from 1 since the last seam."""
        return self.stream >> 1

    @property
    def direction(self) -> Direction:
        """The direction of the stream."""
        return C2A if self.stream & 1 else A2C

    @property
    def length_bytes(self) -> int:
        """Length of a gap; 0 for every other kind."""
        return int(_LENGTH.unpack_from(self.payload)[0]) if self.kind is Kind.GAP else 0

    @property
    def note(self) -> str:
        """The words of a record that holds no bytes of the wire."""
        text = self.payload[_LENGTH.size :] if self.kind is Kind.GAP else self.payload
        return text.decode("utf-8", "replace")


def stream_number(connection: int, direction: Direction) -> int:
    """Return the number by which records name one direction of a connection."""
    return connection << 1 | (direction is C2A)


def gap_record(
    stream: int, time_ns: int, offset_bytes: int, length_bytes: int, reason: str
) -> Record:
    """Return the record of bytes that passed unrecorded."""
    payload = _LENGTH.pack(length_bytes) + reason.encode()
    return Record(Kind.GAP, stream, time_ns, offset_bytes, payload)


class Block:
    """A block in the making: pieces that are joined once, for bulk is as large as the reads were.

    Attributes:
        parts: Room for the header, then of each record its head and its payload.
        size_bytes: Of all of them.
    """

    def __init__(self) -> None:
        self.parts: list[bytes] = []  # the same list for good
        self.clear()

    @property
    def empty(self) -> bool:
        """Whether it holds no record."""
        return self.size_bytes == _HEADER.size

    def add(self, record: Record) -> None:
        """Add a record."""
        kind, stream, time_ns, offset_bytes, payload, *passage = record
        head = pack_head(len(payload), CODES[kind], stream, time_ns, offset_bytes, *passage)
        self.parts += (head, payload)
        self.size_bytes += HEAD_BYTES + len(payload)

    def seal(self) -> bytearray:
        """Return the finished block."""
        data = bytearray().join(self.parts)
        with memoryview(data)[_HEADER.size :] as body:
            _HEADER.pack_into(data, 0, _MAGIC, len(body), zlib.crc32(body))
        return data

    def records(self) -> Iterator[Record]:
        """Give its records back."""
        return _records(b"".join(self.parts[1:]))

    def clear(self) -> None:
        """Begin anew."""
        self.parts[:] = (bytes(_HEADER.size),)
        self.size_bytes = _HEADER.size


def read_blocks(data: bytes) -> tuple[list[Record], int]:
    """Return the records of the whole and sound blocks that `data` begins with, and their size."""
    records: list[Record] = []
    at = 0
    while len(data) - at >= _HEADER.size:
        magic, size_bytes, crc = _HEADER.unpack_from(data, at)
        body = data[at + _HEADER.size : at + _HEADER.size + size_bytes]
        if magic != _MAGIC or len(body) != size_bytes or zlib.crc32(body) != crc:
            break
        records += _records(body)
        at += _HEADER.size + size_bytes
    return records, at


def is_torn(data: bytes) -> bool:
    """Whether `data` is the beginning of a block that was never finished, or nothing.

    Anything else that `read_blocks` leaves is damage.
    """
    if len(data) < _HEADER.size:
        return _MAGIC.startswith(data[: len(_MAGIC)])
    magic, size_bytes, _ = _HEADER.unpack_from(data)
    return bool(magic == _MAGIC) and _HEADER.size + size_bytes > len(data)


def _records(body: bytes) -> Iterator[Record]:
    at = 0
    while at < len(body):
        size_bytes, code, stream, time_ns, offset_bytes, *passage = _RECORD.unpack_from(body, at)
        at += _RECORD.size + size_bytes
        payload = body[at - size_bytes : at]
        yield Record(_KINDS[code], stream, time_ns, offset_bytes, payload, *passage)
