"""Encoding of spool records and blocks.

Belongs here: the layout of records and blocks. `spool` manages the files that contain them.

A block consists of a header (magic, length, CRC-32) and whole records. It is written by one write
call: a killed writer leaves at most one incomplete block, which readers detect.
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
"""First part of the note of a connection that cannot reach the robot; the reason follows."""

_HEADER: Final = struct.Struct("<4sII")
_MAGIC: Final = b"SPL2"  # version of the layout; blocks of other versions count as damage
_RECORD: Final = struct.Struct("<IBQQQQ?")
_LENGTH: Final = struct.Struct("<q")


class ControlRecord(Enum):
    """Records that are not events on the wire."""

    RESTART = "restart"  # records before and after it are unrelated: connection numbers start again
    TOTAL = "total"  # `offset_bytes` is the tap's count of received bytes in this direction
    CONNECTED = "connected"  # the connection to the robot is made
    UNFORWARDED = "unforwarded"  # bytes that the tap dropped, see `unforwarded_record`

    __hash__ = object.__hash__


_KINDS: Final[tuple[Kind | ControlRecord, ...]] = (*Kind, *ControlRecord)
CODES: Final = {kind: code for code, kind in enumerate(_KINDS)}
"""Code of a kind in a record header."""

HEAD_BYTES: Final = _RECORD.size

pack_head: Final = _RECORD.pack
"""Encode a record header: payload size, code of the kind, then the other fields in order."""


class Record(NamedTuple):
    """One observation of the tap process.

    Attributes:
        kind: What happened.
        stream: Connection and direction, see `stream_number`.
        time_ns: Nanoseconds since the Unix epoch.
        offset_bytes: Stream offset where it happened.
        payload: The bytes, or the note in UTF-8; for a gap, its length and its note.
        forwarded_ns: Time at which the bytes had been forwarded; 0 for other kinds or if unknown.
        kernel_time: Whether `time_ns` is a kernel timestamp; otherwise it is the time of the read
            call.
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
        """The connection's number, counted from 1 since the last restart record."""
        return self.stream >> 1

    @property
    def direction(self) -> Direction:
        """The direction of the stream."""
        return C2A if self.stream & 1 else A2C

    @property
    def length_bytes(self) -> int:
        """Length of a gap, or of bytes that were not forwarded; 0 for every other kind."""
        if self.kind in (Kind.GAP, ControlRecord.UNFORWARDED):
            return int(_LENGTH.unpack_from(self.payload)[0])
        return 0

    @property
    def note(self) -> str:
        """The note of a record without bytes of the wire."""
        counted = self.kind in (Kind.GAP, ControlRecord.UNFORWARDED)
        text = self.payload[_LENGTH.size :] if counted else self.payload
        return text.decode("utf-8", "replace")


def stream_number(connection: int, direction: Direction) -> int:
    """Return the stream number of one direction of a connection."""
    return connection << 1 | (direction is C2A)


def gap_record(
    stream: int, time_ns: int, offset_bytes: int, length_bytes: int, reason: str
) -> Record:
    """Return the record of bytes that were forwarded but not recorded."""
    payload = _LENGTH.pack(length_bytes) + reason.encode()
    return Record(Kind.GAP, stream, time_ns, offset_bytes, payload)


def unforwarded_record(stream: int, time_ns: int, length_bytes: int, reason: str) -> Record:
    """Return the record of bytes that the tap received, but could not forward."""
    payload = _LENGTH.pack(length_bytes) + reason.encode()
    return Record(ControlRecord.UNFORWARDED, stream, time_ns, 0, payload)


class Block:
    """A block under construction. Its parts are joined once, when it is sealed.

    Attributes:
        parts: Space for the header, then header and payload of each record.
        size_bytes: Total size.
    """

    def __init__(self) -> None:
        self.parts: list[bytes] = []  # always the same list object
        self.clear()

    @property
    def empty(self) -> bool:
        """Whether it contains no record."""
        return self.size_bytes == _HEADER.size

    def add(self, record: Record) -> None:
        """Add a record."""
        kind, stream, time_ns, offset_bytes, payload, *passage = record
        head = pack_head(len(payload), CODES[kind], stream, time_ns, offset_bytes, *passage)
        self.parts += (head, payload)
        self.size_bytes += HEAD_BYTES + len(payload)

    def seal(self) -> bytearray:
        """Return the encoded block."""
        data = bytearray().join(self.parts)
        with memoryview(data)[_HEADER.size :] as body:
            _HEADER.pack_into(data, 0, _MAGIC, len(body), zlib.crc32(body))
        return data

    def records(self) -> Iterator[Record]:
        """Yield its records."""
        return _records(b"".join(self.parts[1:]))

    def clear(self) -> None:
        """Remove all records."""
        self.parts[:] = (bytes(_HEADER.size),)
        self.size_bytes = _HEADER.size


def read_blocks(data: bytes) -> tuple[list[Record], int]:
    """Return the records of the valid blocks at the start of `data`, and their size."""
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


def is_truncated(data: bytes) -> bool:
    """Whether `data` is empty or the start of an incomplete block.

    Any other rest that `read_blocks` leaves is damage.
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
