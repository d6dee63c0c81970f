"""Reads the records of an MCAP file of any writer, also of a damaged one. Nothing is written.

If the length of a record is wrong, the lengths inside the record are used. If they are wrong, too,
the next record is searched for. No record is loaded that is larger than `MAX_RECORD_BYTES`; a chunk
may be larger, because its records are read one by one.
"""

import io
import os
import re
import struct
import zlib
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, cast

import lz4.frame  # type: ignore[import-untyped]  # it ships no types
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC

RECOVERED: Final = "recovered"
"""Name of the metadata record of a repaired file; it has one entry for each kind of loss."""

MAX_RECORD_BYTES: Final = 1 << 26

_HEAD: Final = struct.Struct("<BQ")  # opcode, length
_CHUNK: Final = struct.Struct("<QQQII")  # times, size, checksum, length of the compression's name
_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_LENGTH: Final = struct.Struct("<Q")
_FOOTER_BYTES: Final = _HEAD.size + 20
_FIRST_PRIVATE_OPCODE: Final = 0x80
_MAX_LENGTH_BYTES: Final = 1 << 40
_HEAD_PATTERN: Final = re.compile(rb"(?=[\x01-\x0f].{5}\x00{3})", re.DOTALL)  # below 1 << 40
_WINDOW_BYTES: Final = 1 << 20
_CHAIN: Final = 4  # so many records in a row are no coincidence
_IN_MEMORY_BYTES: Final = 8 << 20  # a larger chunk is read twice: checksum first, then records
_MAX_RATIO: Final = 1024  # of a compressed chunk over 64 MiB; a greater one is an attack
_TOO_LARGE: Final = "a record of more than 64 MiB"
_COMPRESSIONS: Final = {"", "zstd", "lz4"}
_KINDS: Final[dict[int, Any]] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT: Attachment,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
    Opcode.DATA_END: DataEnd,
}
_DAMAGE: Final = (
    McapError,
    ValueError,  # invalid text, length or checksum
    EOFError,
    RuntimeError,  # lz4
    struct.error,
    OverflowError,
    MemoryError,
    zstandard.ZstdError,
)


@dataclass(slots=True)
class McapSummary:
    """Summary of a recording and of its unreadable parts.

    Attributes:
        read_bytes: How much of the file has been read.
        events: Number of wire events.
        losses: Number of gaps.
        messages: Number of messages, also of those that the reader did not need.
        last_ns: Time of the last event; 0 without events.
        finished: Whether the file was closed properly.
        damaged: Whether anything but the end of the file is damaged.
        merged: Whether the file holds several recordings with connections of the same names.
        wrong_accounts: Streams whose account in the file differs from the content.
        unsupported: What this version cannot read, although it is not damaged.
        repairs: What earlier repairs noted in the file.
        notes: One sentence for each kind of missing data.
        clock_events: Steps of the recorder's clock, and suspends of its machine.
    """

    read_bytes: int = 0
    messages: int = 0
    events: int = 0
    losses: int = 0
    last_ns: int = 0
    finished: bool = False
    damaged: bool = False
    merged: bool = False
    wrong_accounts: int = 0
    unsupported: set[str] = field(default_factory=set)
    repairs: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    clock_events: list[str] = field(default_factory=list)

    @property
    def intact(self) -> bool:
        """Whether the file needs no repair."""
        return self.finished and not self.damaged

    def earlier_losses(self) -> Iterator[str]:
        """Yield a sentence if the file was repaired."""
        if self.repairs:
            why = "; ".join(self.repairs)
            yield UserMessage("the file was repaired earlier: {why}", why=why)

    @property
    def whole(self) -> bool:
        """Whether the file is intact and complete."""
        return self.finished and not self.notes

    @property
    def complete(self) -> bool:
        """Whether nothing is missing in what was recorded."""
        return self.whole and not self.losses

    def add(self, other: "McapSummary", path: Path) -> None:
        """Add the summary of the next file of the same recording."""
        self.events += other.events
        self.losses += other.losses
        self.last_ns = max(self.last_ns, other.last_ns)
        self.finished = self.finished and other.finished
        self.damaged = self.damaged or other.damaged
        self.merged = self.merged or other.merged
        self.wrong_accounts += other.wrong_accounts
        self.unsupported |= other.unsupported
        self.repairs += other.repairs
        self.clock_events += other.clock_events
        self.notes += [
            UserMessage("{file}: {note}", file=path.name, note=note) for note in other.notes
        ]


def read_records(
    path: Path,
    summary: McapSummary,
    wait: Callable[[], bool] | None = None,
    *,
    channels: Container[int] | None = None,
) -> Iterator[McapRecord]:
    """Yield all intact records of an MCAP file, including those in chunks, in order.

    Args:
        path: The file.
        summary: Receives whether the file was finished, and notes about damage.
        wait: Called when a file that is not finished has no further complete record; returns
            whether to look again. None to read what there is.
        channels: The channels whose messages are yielded; it may grow while their declarations are
            read. None for all.

    Raises:
        CaptureError: The file cannot be opened or is not an MCAP file.
    """
    with open_mcap(path) as file:
        yield from _Scanner(file, summary, wait, channels).records()


@contextmanager
def open_mcap(path: Path) -> Iterator[BinaryIO]:
    """Open an MCAP file.

    Raises:
        CaptureError: The file cannot be read or is not an MCAP file.
    """
    try:
        with path.open("rb") as file:
            magic = file.peek(len(MAGIC))[: len(MAGIC)]
            if not magic:
                raise CaptureError(UserMessage("{path} is empty: nothing was recorded", path=path))
            if magic != MAGIC:
                raise CaptureError(UserMessage("{path} is not an MCAP file", path=path))
            yield file
    except OSError as error:
        raise CaptureError(
            UserMessage(
                "{path} cannot be read: {reason}", path=path, reason=error.strerror or error
            )
        ) from None


class _TooLargeError(ValueError):
    """A record is larger than `MAX_RECORD_BYTES`."""


class _Bounded(ReadDataStream):
    """A stream for the parsers of the mcap package: it never returns fewer bytes than requested."""

    def read(self, length: int) -> bytes:
        if length > MAX_RECORD_BYTES:
            raise _TooLargeError
        data = super().read(length)  # type: ignore[no-untyped-call, unused-ignore]  # no types there
        if len(data) < length:
            raise EOFError
        return data


class _Section(io.RawIOBase):
    """A part of the file with a position of its own."""

    def __init__(self, file: BinaryIO, start: int, end: int) -> None:
        self._file, self._at, self._end = file, start, end

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._file.seek(self._at)
        data = self._file.read(min(len(buffer), self._end - self._at))
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)


class _Chunk(NamedTuple):
    """The head of a chunk record, and where its content is."""

    compression: str
    size_bytes: int  # not compressed
    crc: int
    start: int
    end: int

    def open(self, file: BinaryIO) -> BinaryIO:
        """Return the content, not compressed."""
        packed = io.BufferedReader(_Section(file, self.start, self.end))
        content: Any = packed
        if self.compression == "zstd":
            decompressor = zstandard.ZstdDecompressor()
            content = decompressor.stream_reader(packed, read_across_frames=True)
            content = io.BufferedReader(content, _WINDOW_BYTES)
        elif self.compression == "lz4":
            content = lz4.frame.LZ4FrameFile(packed)
        return cast("BinaryIO", content)


class _Scanner:
    """Reads one file from its start to its end."""

    def __init__(
        self,
        file: BinaryIO,
        summary: McapSummary,
        wait: Callable[[], bool] | None,
        channels: Container[int] | None,
    ) -> None:
        self._file, self._summary, self._wait = file, summary, wait
        self._wanted = channels
        self._size = file.seek(0, os.SEEK_END)
        self._window, self._window_at = b"", 0
        self._expected_messages = 0
        self._damaged_chunks = self._skipped_bytes = self._wrong_lengths = 0
        self._truncated_bytes = 0
        self._data_ended = False
        self._unsupported: set[str] = summary.unsupported

    def records(self) -> Iterator[McapRecord]:
        """Yield the intact records; then complete the summary."""
        at, declared = len(MAGIC), False
        while not self._summary.finished:
            self._summary.read_bytes = at
            self._wait_for_record(at)
            if at >= self._size:
                break
            record, end = self._record_at(at)
            if end is None:
                following = self._search(at + 1)
                if following is None:
                    self._truncated_bytes = self._size - at
                    break
                self._skipped_bytes += following - at
                at = following
                if not declared:
                    declared = True
                    yield from self._declarations()
                continue
            if isinstance(record, _Chunk):
                yield from self._records_of(record)
            elif record is not None:
                self._notice(record, end)
                yield record
            at = end
        self._describe()

    def _wait_for_record(self, at: int) -> None:
        """Wait until a growing file has a complete record at a position."""
        while self._wait and not self._is_complete(at) and self._wait():
            self._size = self._file.seek(0, os.SEEK_END)

    def _is_complete(self, at: int) -> bool:
        self._file.seek(at)
        head = self._file.read(_HEAD.size)
        return len(head) == _HEAD.size and at + _HEAD.size + _HEAD.unpack(head)[1] <= self._size

    def _record_at(self, at: int) -> tuple[McapRecord | _Chunk | None, int | None]:
        """Return the record at a position, if it is of use, and its end, if it is reliable."""
        self._file.seek(at)
        head = self._file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            return None, None
        opcode, length = _HEAD.unpack(head)
        start = at + _HEAD.size
        end = start + length
        if opcode == Opcode.MESSAGE:
            return self._message(start, length) if self._may_follow(end) else (None, None)
        if opcode in _KINDS or opcode == Opcode.CHUNK:
            return self._structured(opcode, start, end)
        return None, end if opcode >= _FIRST_PRIVATE_OPCODE and self._may_follow(end) else None

    def _structured(
        self, opcode: int, start: int, stated_end: int
    ) -> tuple[McapRecord | _Chunk | None, int | None]:
        """Read a record that has lengths inside, which correct the one in its head."""
        end, length = stated_end if self._may_follow(stated_end) else None, stated_end - start
        if end and opcode == Opcode.MESSAGE_INDEX:
            return None, end
        try:
            record, inner_end = self._parse(opcode, start)
        except _DAMAGE as error:
            if end and isinstance(error, _TooLargeError) and length > MAX_RECORD_BYTES:
                self._unsupported.add(_TOO_LARGE)
            elif end:
                self._skipped_bytes += length
            return None, end
        if inner_end == stated_end or self._may_follow(inner_end):
            end = inner_end
        elif end and isinstance(record, _Chunk):
            record = record._replace(end=end)
        if end and (end != stated_end or inner_end > end):
            self._wrong_lengths += 1
        return record if end else None, end

    def _message(self, start: int, length: int) -> tuple[McapRecord | None, int | None]:
        if length < _MESSAGE.size:
            return None, None
        if length > MAX_RECORD_BYTES:
            self._unsupported.add(_TOO_LARGE)
            return None, start + length
        self._file.seek(start)
        return _message(self._file.read(length)), start + length

    def _parse(self, opcode: int, start: int) -> tuple[McapRecord | _Chunk, int]:
        """Parse a record by the lengths inside it; return it and its end."""
        if opcode == Opcode.CHUNK:
            chunk = self._chunk(start)
            return chunk, chunk.end
        self._file.seek(start)
        stream = _Bounded(self._file)
        record = _KINDS[opcode].read(stream)
        return record, start + stream.count

    def _chunk(self, start: int) -> _Chunk:
        self._file.seek(start)
        _, _, size_bytes, crc, name_bytes = _CHUNK.unpack(self._file.read(_CHUNK.size))
        if name_bytes > 1 << 6:
            raise ValueError("no name of a compression")
        compression = self._file.read(name_bytes).decode()
        (packed_bytes,) = _LENGTH.unpack(self._file.read(_LENGTH.size))
        start += _CHUNK.size + name_bytes + _LENGTH.size
        if start + packed_bytes > self._size:
            raise ValueError("a chunk that is longer than the file")
        return _Chunk(compression, size_bytes, crc, start, start + packed_bytes)

    def _records_of(self, chunk: _Chunk) -> Iterator[McapRecord]:
        """Yield the records of a chunk if its checksum is right."""
        if chunk.compression not in _COMPRESSIONS:
            self._unsupported.add(f"the compression {chunk.compression[:20]!r}")
            return
        try:
            content, left = self._checked(chunk)
            while left:
                opcode, length = _HEAD.unpack(content.read(_HEAD.size))
                left -= _HEAD.size + length
                if left < 0 or length > MAX_RECORD_BYTES:
                    raise ValueError("a record that is longer than its chunk")
                data = content.read(length)
                if opcode == Opcode.MESSAGE:
                    self._summary.messages += 1
                    if self._is_wanted(data):
                        yield _message(data)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    yield _KINDS[opcode].read(_Bounded(io.BytesIO(data)))
        except _DAMAGE:
            self._damaged_chunks += 1

    def _is_wanted(self, message: bytes) -> bool:
        if self._wanted is None or len(message) < _MESSAGE.size:
            return True
        return int.from_bytes(message[:2], "little") in self._wanted

    def _checked(self, chunk: _Chunk) -> tuple[BinaryIO, int]:
        """Return the content of a chunk, and its size, after its checksum was verified."""
        content, crc, size_bytes, parts = chunk.open(self._file), 0, 0, []
        limit_bytes = min(chunk.size_bytes, _MAX_RATIO * (chunk.end - chunk.start))
        while data := content.read(_WINDOW_BYTES):
            crc = zlib.crc32(data, crc)
            size_bytes += len(data)
            if size_bytes > max(limit_bytes, MAX_RECORD_BYTES):
                raise ValueError("a chunk of another size")
            if size_bytes <= _IN_MEMORY_BYTES:
                parts.append(data)
            else:
                parts.clear()
        # Without a checksum the size decides.
        if crc != chunk.crc if chunk.crc else size_bytes != chunk.size_bytes:
            raise ValueError("a chunk of another content")
        self._wrong_lengths += size_bytes != chunk.size_bytes
        return io.BytesIO(b"".join(parts)) if parts else chunk.open(self._file), size_bytes

    def _notice(self, record: McapRecord, end: int) -> None:
        """Use what a record states about the file."""
        match record:
            case Message():
                self._summary.messages += 1
            case Statistics():
                self._expected_messages = record.message_count
            case DataEnd():
                self._data_ended = True
            case Metadata() if record.name == RECOVERED:
                self._summary.repairs += record.metadata.values()
            case Footer():
                self._file.seek(end)
                self._summary.finished = self._file.read(len(MAGIC)) == MAGIC

    def _may_follow(self, at: int) -> bool:
        """Whether a record, a part of one or the end of the file may be at a position."""
        if at > self._size:
            return False
        self._file.seek(at)
        head = self._file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            return True
        opcode, length = _HEAD.unpack(head)
        known: bool = 0 < opcode <= Opcode.DATA_END or opcode >= _FIRST_PRIVATE_OPCODE
        return known and 0 <= length < _MAX_LENGTH_BYTES

    def _search(self, at: int) -> int | None:
        """Return the position of the next record; None if there is none."""
        while at + _HEAD.size <= self._size:
            if not self._window_at <= at <= self._window_at + len(self._window) - _HEAD.size:
                self._file.seek(at)
                self._window, self._window_at = self._file.read(_WINDOW_BYTES), at
            for found in _HEAD_PATTERN.finditer(self._window, at - self._window_at):
                position = self._window_at + found.start()
                if self._is_record(position):
                    return position
            at = self._window_at + len(self._window) - _HEAD.size + 1
        return None

    def _is_record(self, at: int) -> bool:
        """Whether a record is at a position: a chunk, or the first one of several."""
        start = at + _HEAD.size
        for _ in range(_CHAIN):
            self._file.seek(at)
            head = self._file.read(_HEAD.size)
            if len(head) < _HEAD.size:
                return head == MAGIC and at + len(MAGIC) == self._size
            opcode, length = _HEAD.unpack(head)
            end: int = at + _HEAD.size + length
            if not 0 < opcode <= Opcode.DATA_END or end > self._size:
                return False
            if opcode == Opcode.CHUNK and at + _HEAD.size == start:
                try:
                    return self._chunk(start).end == end
                except _DAMAGE:
                    return False
            at = end
        return True

    def _declarations(self) -> Iterator[McapRecord]:
        """Yield the schemas and channels of the summary: their records may be among the damage."""
        self._file.seek(max(self._size - _FOOTER_BYTES - len(MAGIC) + _HEAD.size, 0))
        at = int.from_bytes(self._file.read(_LENGTH.size), "little")
        self._file.seek(self._size - len(MAGIC))
        if self._file.read() != MAGIC or not len(MAGIC) < at < self._size:
            return
        while at < self._size - _FOOTER_BYTES - len(MAGIC):
            record, end = self._record_at(at)
            if end is None:
                return
            if isinstance(record, Schema | Channel):
                yield record
            at = end

    def _describe(self) -> None:
        """Write the notes."""
        summary = self._summary
        lost = self._expected_messages - self._summary.messages
        damage = (
            (self._damaged_chunks, "{count} damaged chunks of the file were skipped"),
            (self._skipped_bytes, "{count} damaged bytes of the file were skipped"),
            (
                self._wrong_lengths,
                "the length of {count} records was wrong; their content was read",
            ),
            (max(lost, 0), "{count} messages are missing by the file's own statistics"),
        )
        for count, template in damage:
            if count:
                summary.damaged = True
                summary.notes.append(UserMessage(template, count=count))
        summary.notes += [
            UserMessage("{what} cannot be read by this version", what=what)
            for what in sorted(self._unsupported)
        ]
        if not summary.finished and self._data_ended:
            summary.notes.append(
                "the file was not closed: its end, after all data, is torn or damaged"
            )
        elif not summary.finished:
            summary.notes.append(
                "the file was not closed: what came after its last flush is missing"
            )
            if self._truncated_bytes:
                summary.notes.append(
                    UserMessage(
                        "its last {count} bytes are torn or damaged", count=self._truncated_bytes
                    )
                )


def _message(content: bytes) -> Message:
    channel_id, sequence, log_time, publish_time = _MESSAGE.unpack_from(content)
    data = content[_MESSAGE.size :]
    return Message(channel_id, log_time, data, publish_time, sequence)
