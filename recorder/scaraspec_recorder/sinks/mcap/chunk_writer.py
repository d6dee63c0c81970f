"""Writes the MCAP container: the mcap package encodes rare records, this module encodes messages.

With the writer of the mcap package an event costs about 30 % more processor time, and the writer of
foxglove-sdk is slower than this one, too. All data up to the last `flush` remains readable if the
process is killed (MCAP specification, "Data section").
"""

import struct
import zlib
from collections import defaultdict
from collections.abc import Mapping
from typing import Final, Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC: Final = b"\x89MCAP0\r\n"
CHUNK_BYTES: Final = 1 << 20
_MESSAGE: Final = struct.Struct(
    "<BQHIQQ"
)  # opcode, length, channel, sequence, log and publish time
_MESSAGE_HEAD_BYTES: Final = 22  # of these, what the length counts
_MESSAGE_OPCODE: Final = int(Opcode.MESSAGE)  # packing a member of an enumeration takes longer
_INDEX: Final = struct.Struct("<BQHI")  # opcode, length, channel, length of the entries
_INDEX_HEAD_BYTES: Final = 6
_FOOTER: Final = struct.Struct("<BQQQ")  # opcode, length, start of summary and of its offsets
_FOOTER_BYTES: Final = 20
_SUMMARY: Final = (
    (Schema, Opcode.SCHEMA),
    (Channel, Opcode.CHANNEL),
    (Statistics, Opcode.STATISTICS),
    (ChunkIndex, Opcode.CHUNK_INDEX),
    (AttachmentIndex, Opcode.ATTACHMENT_INDEX),
    (MetadataIndex, Opcode.METADATA_INDEX),
)
"""The groups of the summary section, in their order."""


class Output(Protocol):
    """The destination of the file."""

    def write(self, data: bytes, /) -> object:
        """Write the next bytes of the file."""

    def flush(self) -> None:
        """Pass the written bytes to the operating system."""


class ChunkWriter:
    """Writes one MCAP file.

    Exceptions of `Output` are not caught, and the lack of memory is a `MemoryError`. After either,
    the writer must not be used.

    Args:
        output: Receives the file.
        library: Name of the writing program, for the header.
        profile: Profile of the messages, for the header.
    """

    def __init__(self, output: Output, library: str, profile: str = "") -> None:
        self._output = output
        self._offset_bytes = 0
        self._summary: defaultdict[type[McapRecord], bytearray] = defaultdict(bytearray)
        self._statistics = Statistics(
            attachment_count=0,
            channel_count=0,
            channel_message_counts=defaultdict(int),
            chunk_count=0,
            message_count=0,
            message_start_time=0,
            message_end_time=0,
            metadata_count=0,
            schema_count=0,
        )
        self._compressor = zstandard.ZstdCompressor()
        self._begin_chunk()
        self._write(MAGIC)
        self._record(Header(profile=profile, library=library))

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Write a schema and return its number.

        The record is outside of the chunks, so that it remains readable if a chunk is damaged.
        """
        self._statistics.schema_count += 1
        schema = Schema(id=self._statistics.schema_count, name=name, encoding=encoding, data=data)
        self._record(schema)
        self._summarize(schema)
        return schema.id

    def channel(
        self, topic: str, encoding: str, schema_id: int, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Declare a channel and return its number."""
        self._statistics.channel_count += 1
        channel = Channel(
            id=self._statistics.channel_count,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema_id,
            metadata=dict(metadata or {}),
        )
        self._record(channel)
        self._summarize(channel)
        return channel.id

    def message(
        self,
        channel_id: int,
        time_ns: int,
        data: bytes,
        sequence: int = 0,
        publish_time_ns: int | None = None,
    ) -> None:
        """Add a message; it is written when its chunk is full or flushed."""
        head = _MESSAGE.pack(
            _MESSAGE_OPCODE,
            _MESSAGE_HEAD_BYTES + len(data),
            channel_id,
            sequence & 0xFFFFFFFF,
            time_ns,
            time_ns if publish_time_ns is None else publish_time_ns,
        )
        index = self._indices.get(channel_id)
        if index is None:
            index = self._indices[channel_id] = []
        index += (time_ns, self._chunk_bytes)
        self._chunk += (head, data)
        self._chunk_bytes += len(head) + len(data)
        if self._chunk_bytes >= CHUNK_BYTES:
            self._end_chunk()

    def attachment(
        self,
        time_ns: int,
        name: str,
        media_type: str,
        data: bytes,
        *,
        create_time_ns: int | None = None,
    ) -> None:
        """Add an attachment; its content was created at `create_time_ns`, or else `time_ns`."""
        created_ns = time_ns if create_time_ns is None else create_time_ns
        attachment = Attachment(
            create_time=created_ns, log_time=time_ns, name=name, media_type=media_type, data=data
        )
        offset, length = self._record(attachment)
        index = AttachmentIndex(
            offset=offset,
            length=length,
            log_time=time_ns,
            create_time=created_ns,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._summarize(index)
        self._statistics.attachment_count += 1

    def metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Add a metadata record."""
        offset, length = self._record(Metadata(name=name, metadata=dict(entries)))
        self._summarize(MetadataIndex(offset=offset, length=length, name=name))
        self._statistics.metadata_count += 1

    def flush(self) -> None:
        """End the chunk and flush all data to the operating system."""
        self._end_chunk()
        self._output.flush()

    def finish(self) -> None:
        """Write the end of the file: summary, footer. The output stays open."""
        self._end_chunk()
        self._record(DataEnd(data_section_crc=0))  # 0: not computed; chunks have their own
        start = self._offset_bytes
        self._summarize(self._statistics)
        data, offsets = b"", b""
        for kind, opcode in _SUMMARY:
            if group := self._summary[kind]:
                offsets += _serialize(SummaryOffset(opcode, start + len(data), len(group)))
            data += group
        offsets_start = start + len(data)
        data += offsets
        footer = _FOOTER.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offsets_start)
        self._write(data)
        self._record(Footer(start, offsets_start, zlib.crc32(footer, zlib.crc32(data))))
        self._write(MAGIC)
        self._output.flush()

    def _begin_chunk(self) -> None:
        self._chunk: list[bytes] = []
        self._chunk_bytes = 0
        self._indices: dict[int, list[int]] = {}  # by channel: time, offset, time, offset, …

    def _end_chunk(self) -> None:
        """Write the chunk and its index, unless it is empty."""
        if not self._chunk:
            return
        data, indices = b"".join(self._chunk), self._indices
        self._begin_chunk()
        first_ns = min(min(index[::2]) for index in indices.values())
        last_ns = max(max(index[::2]) for index in indices.values())
        try:
            compressed = self._compressor.compress(data)
        except zstandard.ZstdError as error:  # data of any content can be compressed
            raise MemoryError(str(error)) from error
        offset, length = self._record(
            Chunk(
                compression="zstd",
                data=compressed,
                message_start_time=first_ns,
                message_end_time=last_ns,
                uncompressed_crc=zlib.crc32(data),
                uncompressed_size=len(data),
            )
        )
        index_start, index_offsets = self._offset_bytes, {}
        for channel_id, index in indices.items():
            index_offsets[channel_id] = self._offset_bytes
            size = 8 * len(index)
            head = _INDEX.pack(Opcode.MESSAGE_INDEX, _INDEX_HEAD_BYTES + size, channel_id, size)
            self._write(head + struct.pack(f"<{len(index)}Q", *index))
            self._statistics.channel_message_counts[channel_id] += len(index) // 2
            self._statistics.message_count += len(index) // 2
        self._summarize(
            ChunkIndex(
                message_start_time=first_ns,
                message_end_time=last_ns,
                chunk_start_offset=offset,
                chunk_length=length,
                message_index_offsets=index_offsets,
                message_index_length=self._offset_bytes - index_start,
                compression="zstd",
                compressed_size=len(compressed),
                uncompressed_size=len(data),
            )
        )
        statistics = self._statistics
        if statistics.chunk_count == 0:
            statistics.message_start_time = first_ns
        statistics.chunk_count += 1
        statistics.message_start_time = min(statistics.message_start_time, first_ns)
        statistics.message_end_time = max(statistics.message_end_time, last_ns)

    def _summarize(self, record: McapRecord) -> None:
        """Keep a record for the summary section, encoded: about 200 bytes per chunk."""
        self._summary[type(record)] += _serialize(record)

    def _record(self, record: McapRecord) -> tuple[int, int]:
        """Write a record; return its offset and its length."""
        begin, data = self._offset_bytes, _serialize(record)
        self._write(data)
        return begin, len(data)

    def _write(self, data: bytes) -> None:
        self._output.write(data)
        self._offset_bytes += len(data)


def _serialize(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]  # mcap left this one out
    return data
