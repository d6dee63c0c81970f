"""Reads capture.mcap: the raw layer as wire events, even from a damaged file.

Only the raw layer is read; everything else is decoded again. A damaged file yields all its intact
records and notes about what is missing. Nothing is written.
"""

import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

import zstandard
from mcap.exceptions import McapError, UnsupportedCompressionError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.byte_accounting import ByteAccountingCheck
from scaraspec_recorder.sinks.gap_filler import GapFiller
from scaraspec_recorder.sinks.mcap import schemas
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC
from scaraspec_recorder.sinks.mcap.mcap_sink import LINK, SCHEMA, SERIAL, SESSION
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk

_MAX_RECORD_BYTES: Final = 1 << 26  # more than any chunk or attachment of the recorder: damage
_SEQUENCES: Final = 1 << 32
_DAMAGE: Final = (
    McapError,
    ValueError,  # invalid text or checksum
    struct.error,
    OverflowError,
    MemoryError,
    zstandard.ZstdError,
    zlib.error,
)
_RAW_KINDS: Final[dict[str, type[schemas.Message]]] = {
    schemas.full_name(kind): kind
    for kind in (schemas.RawChunk, schemas.ConnectionEvent, schemas.Gap)
}


@dataclass(slots=True)
class McapSummary:
    """Summary of a recording and of its unreadable parts.

    Attributes:
        events: Number of wire events.
        last_ns: Time of the last event; 0 without events.
        finished: Whether the file was closed properly.
        wrong_accounts: Streams whose account in the file differs from the content.
        notes: One sentence for each kind of missing data.
    """

    events: int = 0
    last_ns: int = 0
    finished: bool = False
    wrong_accounts: int = 0
    notes: list[str] = field(default_factory=list)

    @property
    def whole(self) -> bool:
        """Whether the file is closed properly and complete."""
        return self.finished and not self.notes


class RawLayerReader:
    """Converts records of the raw layer to wire events."""

    def __init__(self) -> None:
        self._schemas: dict[int, str] = {}
        self._kinds: dict[int, type[schemas.Message]] = {}  # by channel
        self._sequence = 0
        self._missing = 0

    def take(self, record: McapRecord) -> WireEvent | None:
        """Return the event of a record; None if it has no readable event."""
        if isinstance(record, Message):
            if kind := self._kinds.get(record.channel_id):
                with suppress(ValueError):
                    event = _event(record.log_time, schemas.decode(kind, record.data))
                    self._missing += (record.sequence - self._sequence - 1) % _SEQUENCES
                    self._sequence = record.sequence
                    return event
        elif isinstance(record, Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, Channel) and (
            kind := _RAW_KINDS.get(self._schemas.get(record.schema_id, ""))
        ):
            self._kinds[record.id] = kind
        return None

    def finish(self, path: Path, summary: McapSummary) -> None:
        """Finish: add a note about missing events.

        Raises:
            CaptureError: The file has no raw layer.
        """
        if not self._kinds:
            ours = _RAW_KINDS.keys() & set(self._schemas.values())
            if summary.finished or (self._schemas and not ours):
                raise CaptureError(
                    UserMessage(
                        "{path} has no raw bytes of a link: it was not written by scaraspec record",
                        path=path,
                    )
                )
            raise CaptureError(UserMessage("{path} ends before anything was recorded", path=path))
        if self._missing:
            summary.notes.append(f"{self._missing} raw events are missing in the file")


def _event(time_ns: int, message: schemas.Message) -> WireEvent:
    """Convert a message of the raw layer to an event.

    Raises:
        ValueError: The direction or the kind of the message is unknown.
    """
    match message:
        case schemas.RawChunk(connection, direction, offset, data, note, forwarded_ns, kernel):
            kind, length = Kind.BYTES, 0
            if forwarded_ns or kernel:
                raw = (time_ns, connection, Direction(direction), kind, data, offset, length, note)
                return ForwardedChunk(*raw, forwarded_ns or 0, kernel)
        case schemas.Gap(connection, direction, offset, length, note):
            kind, data = Kind.GAP, b""
        case schemas.ConnectionEvent(connection, direction, offset, name, note):
            kind, data, length = Kind(name), b"", 0
        case _:
            raise ValueError("no message of the raw layer")
    return WireEvent(time_ns, connection, Direction(direction), kind, data, offset, length, note)


class McapCapture:
    """The wire events of a recording, in order. Each iteration reads the file again.

    Missing bytes between two events of a stream become a gap.

    Attributes:
        path: The file.
        summary: Complete when an iteration has ended.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.summary = McapSummary()

    @property
    def session(self) -> Mapping[str, str]:
        """The description of the session; see `mcap_sink`. Empty if the file has none.

        Raises:
            CaptureError: The file cannot be opened, is not an MCAP file, or its description has
                another version.
        """
        for record in read_records(self.path, McapSummary()):
            if isinstance(record, Metadata) and record.name == SESSION:
                if (schema := record.metadata.get("schema", SCHEMA)) != SCHEMA:
                    raise CaptureError(
                        UserMessage(
                            "{path} describes its session as {schema!r}, but this version of "
                            "scaraspec reads {supported}: use the version that wrote it",
                            path=self.path,
                            schema=schema[:40],
                            supported=SCHEMA,
                        )
                    )
                return record.metadata
            if isinstance(record, Message):
                break
        return {}

    @property
    def needs_login(self) -> bool:
        """Whether the link needs a login; False if the file states that it was serial (L83).

        Raises:
            CaptureError: See `session`.
        """
        return self.session.get(LINK) != SERIAL

    def __iter__(self) -> Iterator[WireEvent]:
        """Read the file.

        Raises:
            CaptureError: The file cannot be opened, is not an MCAP file, or has no raw layer.
        """
        self.summary = summary = McapSummary()
        raw, gap_filler, audit = RawLayerReader(), GapFiller(), ByteAccountingCheck()
        for record in read_records(self.path, summary):
            if isinstance(record, Metadata):
                audit.add_metadata(record.name, record.metadata)
            elif event := raw.take(record):
                audit.count(event)
                for filled in gap_filler.fill(event):
                    summary.events += 1
                    summary.last_ns = max(summary.last_ns, filled.time_ns)
                    yield filled
        raw.finish(self.path, summary)
        if summary.finished:  # else its last accounts were not written
            audit.close()
        summary.wrong_accounts = audit.wrong
        if audit.wrong:
            summary.notes.append(
                f"{audit.wrong} streams are not what the file's own accounts say of them: "
                "it was damaged or changed after the recording"
            )


def read_mcap(path: Path) -> McapCapture:
    """Open a recording.

    Returns:
        Its events; see `McapCapture`.

    Raises:
        CaptureError: The file cannot be opened or is not an MCAP file.
    """
    with _open(path):
        return McapCapture(path)


def read_records(path: Path, summary: McapSummary) -> Iterator[McapRecord]:
    """Yield all intact records of an MCAP file, including those in chunks, in order.

    Args:
        path: The file.
        summary: Receives whether the file was finished, and notes about damage.

    Raises:
        CaptureError: The file cannot be opened or is not an MCAP file.
    """
    damaged_chunks = 0
    with _open(path) as file:
        reader = StreamReader(file, emit_chunks=True, record_size_limit=_MAX_RECORD_BYTES).records
        whole_bytes = len(MAGIC)
        while True:
            try:
                record = next(reader)
            except StopIteration:
                summary.finished = True
                break
            except _DAMAGE:
                break
            whole_bytes = file.tell()
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                inner = _records_of(record)
            except _DAMAGE:
                damaged_chunks += 1
                continue
            yield from inner
        unread_bytes = file.seek(0, os.SEEK_END) - whole_bytes
    if damaged_chunks:
        summary.notes.append(f"{damaged_chunks} damaged chunks of the file were skipped")
    if not summary.finished:
        summary.notes.append("the file was not closed: what came after its last flush is missing")
        if unread_bytes:
            summary.notes.append(f"its last {unread_bytes} bytes are torn or damaged")


@contextmanager
def _open(path: Path) -> Iterator[BinaryIO]:
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


def _records_of(chunk: Chunk) -> list[McapRecord]:
    """Return the records in a chunk. Its size is checked before it is decompressed."""
    if chunk.compression not in ("", "zstd"):
        raise UnsupportedCompressionError(chunk.compression)
    packed_bytes = zstandard.frame_content_size(chunk.data) if chunk.compression else 0
    if max(chunk.uncompressed_size, packed_bytes) > _MAX_RECORD_BYTES:
        raise ValueError("a chunk too large to be one")
    return breakup_chunk(chunk, validate_crc=True)
