"""Mutants of clause 5.1: the structure fileData, sent and received."""

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

from scaraspec.client.core import ClientCore
from scaraspec.client.transfer import Download, Upload
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.transfers import (
    UPLOAD_CHUNK,
    AnyOrder,
    chunk_data,
    chunk_taken,
    chunks,
    chunks_checked_by,
    chunks_cut_by,
    downloads,
    ends_with,
    uploads,
)
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import (
    BUFFER_BYTES,
    FILE_DATA,
    FILE_DATA_BYTES,
    HEAD_BYTES,
    Chunk,
    Receiver,
    Sender,
    TransferState,
    chunks_of,
    read_as,
)

# The structure


def _padded(data: bytes) -> bytes:
    return data.ljust(FILE_DATA_BYTES, b"\0") if data else data


def _zeros_if_truncated(data: bytes) -> bytes:
    if HEAD_BYTES < len(data) < FILE_DATA_BYTES:
        return data[:HEAD_BYTES] + bytes(len(data) - HEAD_BYTES)
    return data


def _cut_to_words(chunk: Chunk, dialect: Dialect) -> bytes:
    return FILE_DATA.encode(chunk, dialect)[: HEAD_BYTES + -(-chunk.length // 4) * 4]


row(
    "numbers-of-eight-bytes",
    "5.1/1 5.1/2 5.2/5",
    "The three numbers of a chunk have eight bytes each.",
    chunk_data(lambda chunk, _: struct.pack("<QQQ", *chunk[:3]) + chunk.buffer),
)
row(
    "leaves-out-the-length",
    "5.1/1 5.1/2",
    "Chunks are sent without length.",
    chunk_data(lambda chunk, _: struct.pack("<II", *chunk[:2]) + chunk.data),
)
row(
    "position-ahead-of-file-size",
    "5.1/1 5.1/3 5.1/4",
    "position and fileSize are swapped in chunks.",
    chunk_data(
        lambda chunk, _: (
            struct.pack("<III", chunk.position, chunk.file_size, chunk.length) + chunk.buffer
        )
    ),
)
row(
    "pads-chunks-that-are-cut-off",
    "5.1/1",
    "A chunk with fewer bytes than its length is padded with zeros and accepted.",
    chunk_taken(_padded),
    subtle=True,
)
row(
    "aligns-the-structure",
    "5.1/2 5.1/1",
    "A chunk is sent with four bytes of padding at its end.",
    chunk_data(lambda chunk, dialect: FILE_DATA.encode(chunk, dialect) + bytes(4)),
)
row(
    "cuts-the-last-chunk-to-words",
    "5.1/2 5.1/1",
    "A chunk is cut after its content, rounded up to four bytes.",
    chunk_data(_cut_to_words),
    subtle=True,
)
row(
    "forgets-what-is-cut-off",
    "5.1/2 5.3/11",
    "The content of a chunk that is truncated after its content is stored as zeros.",
    chunk_taken(_zeros_if_truncated),
    subtle=True,
)

# fileSize


def _rounded_size(size_bytes: int) -> int:
    return -(-size_bytes // BUFFER_BYTES) * BUFFER_BYTES


row(
    "file-size-is-what-is-left",
    "5.1/3",
    "fileSize is the number of bytes that remain to be sent.",
    chunks(lambda chunk: chunk._replace(file_size=chunk.file_size - chunk.position)),
)
row(
    "file-size-counts-chunks",
    "5.1/3 5.1/6",
    "fileSize is the number of chunks.",
    chunks(lambda chunk: chunk._replace(file_size=-(-chunk.file_size // BUFFER_BYTES))),
)
row(
    "file-size-counts-the-nul",
    "5.1/3",
    "fileSize counts a zero at the end that is not sent.",
    chunks(lambda chunk: chunk._replace(file_size=chunk.file_size + 1)),
)
row(
    "file-size-of-full-chunks",
    "5.1/3",
    "fileSize is rounded up to full chunks, except in the last chunk.",
    chunks(
        lambda chunk: (
            chunk if chunk.last else chunk._replace(file_size=_rounded_size(chunk.file_size))
        )
    ),
    subtle=True,
)

# position


def _stored(
    join: Callable[[Mapping[int, bytes], int], bytes], base: type[Receiver] = Receiver
) -> type[ClientCore]:
    """The content of a download is joined from its chunks by position and from its size."""

    class Stored(base):  # type: ignore[valid-type, misc] # one of two receivers
        @property
        def content(self) -> bytes:
            return join(self._pieces, self.size_bytes or 0)

    return chunks_checked_by(Stored)


def _in_full_steps(pieces: Mapping[int, bytes], size_bytes: int) -> bytes:
    content = bytearray()
    for number, position in enumerate(sorted(pieces)):
        content = content.ljust(number * BUFFER_BYTES, b"\0") + pieces[position]
    return bytes(content[:size_bytes])


row(
    "positions-count-chunks",
    "5.1/4 5.1/8",
    "position is the number of the chunk.",
    chunks(lambda chunk: chunk._replace(position=chunk.position // BUFFER_BYTES)),
)
row(
    "positions-from-one",
    "5.1/4 5.1/8",
    "position is counted from 1.",
    chunks(lambda chunk: chunk._replace(position=chunk.position + 1)),
)
row(
    "position-is-the-end",
    "5.1/4 5.1/8",
    "position is the end of the chunk.",
    chunks(lambda chunk: chunk._replace(position=chunk.position + chunk.length)),
)
row(
    "stores-chunks-in-full-steps",
    "5.1/4 5.3/11 5.4/4",
    "Each chunk of a download is stored 200 bytes after the start of the previous one.",
    _stored(_in_full_steps),
)

# length


def _one_byte_longer_at_end(chunk: Chunk) -> Chunk:
    full = chunk.length == BUFFER_BYTES
    return chunk if full or not chunk.last else chunk._replace(length=chunk.length + 1)


row(
    "length-is-the-buffer",
    "5.1/5 5.1/6",
    "length is always 200.",
    chunks(lambda chunk: chunk._replace(length=BUFFER_BYTES)),
)
row(
    "length-counts-the-head",
    "5.1/5 5.4/3",
    "length also counts the twelve bytes before the buffer.",
    chunks(lambda chunk: chunk._replace(length=HEAD_BYTES + chunk.length)),
)
row(
    "last-length-counts-the-nul",
    "5.1/6 5.1/5",
    "The last chunk, unless it is full, extends one byte beyond the file.",
    chunks(_one_byte_longer_at_end),
    subtle=True,
)


# The end


class _DoneWhenSent(Upload):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        if any(FILE_DATA.decode(frame.data).value.last for frame in frames):
            self.settle(None)
        return frames


class _NeverDoneUpload(Upload):
    def settle(self, value: object) -> None:
        pass


class _NeverDoneDownload(Download):
    def settle(self, value: object) -> None:
        pass


row(
    "done-with-the-last-chunk",
    "5.1/7 5.2/19",
    "An upload is done as soon as its last chunk is sent.",
    uploads(_DoneWhenSent),
)
row(
    "waits-behind-the-last-answer",
    "5.1/7 5.2/19",
    "An upload waits for another reply after the reply to its last chunk.",
    uploads(_NeverDoneUpload),
)
row(
    "waits-behind-the-last-chunk",
    "5.1/7 5.3/11 5.4/4",
    "A download waits for another chunk after its last chunk.",
    downloads(_NeverDoneDownload),
)
row(
    "ends-one-byte-early",
    "5.1/7 5.3/11 5.4/4",
    "A download is done when all its bytes except one have arrived.",
    ends_with(lambda receiver, _: receiver.received_bytes + 1 == receiver.size_bytes),
    subtle=True,
)

# The order


def _cut(split: Callable[[bytes], Iterator[Chunk]]) -> type[ClientCore]:
    """Uploads are split into the chunks that `split` returns."""

    class Cut(Sender):
        def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
            super().__init__(content, now_s, dialect)
            self._chunks = split(content)

    return chunks_cut_by(Cut)


def _overlapping(content: bytes) -> Iterator[Chunk]:
    position = 0
    while position < len(content):
        piece = content[position : position + BUFFER_BYTES]
        yield Chunk(len(content), position, len(piece), piece)
        position += BUFFER_BYTES - 1 if position + len(piece) < len(content) else BUFFER_BYTES


def _without_fourth(content: bytes) -> Iterator[Chunk]:
    every = enumerate(chunks_of(content))
    return (chunk for number, chunk in every if number != 3 or chunk.last)


row(
    "sends-the-last-chunk-first",
    "5.1/8",
    "An upload sends its chunks in reverse order.",
    _cut(lambda content: reversed(tuple(chunks_of(content)))),
)
row(
    "repeats-the-last-byte",
    "5.1/8 5.1/4",
    "Each chunk begins with the last byte of the previous one.",
    _cut(_overlapping),
)
row(
    "skips-the-fourth-chunk",
    "5.1/8 5.2/20",
    "The fourth chunk of an upload is skipped, unless it is the last.",
    _cut(_without_fourth),
    subtle=True,
)

# The byte order


def _in_order(chunk: Chunk, dialect: Dialect, *, big: bool) -> bytes:
    return FILE_DATA.encode(chunk, dialect.replace(endian="big" if big else "little"))


def _swapped_words(data: bytes) -> bytes:
    if len(data) == FILE_DATA_BYTES and read_as(data, "big").legal:
        words = struct.unpack(f">{FILE_DATA_BYTES // 4}I", data)
        return struct.pack(f"<{FILE_DATA_BYTES // 4}I", *words)
    return data


def _unless_big(data: bytes) -> bytes:
    return b"" if len(data) == FILE_DATA_BYTES and read_as(data, "big").legal else data


row(
    "writes-big-and-reads-little-endian",
    "5.1/9",
    "Uploads are big-endian, but big-endian chunks of a download are refused.",
    type("Little", (chunk_data(partial(_in_order, big=True)), chunk_taken(_unless_big)), {}),
)
row(
    "last-chunk-is-big-endian",
    "5.1/9",
    "The last of several chunks is big-endian.",
    chunk_data(
        lambda chunk, dialect: _in_order(chunk, dialect, big=chunk.last and chunk.position > 0)
    ),
    subtle=True,
)


@mutant("second-upload-is-big-endian", "5.1/9", subtle=True)
class EveryOtherUploadIsBigEndian(ClientCore):
    """Every second upload of a connection is big-endian."""

    big = True

    def upload(self, name: bytes, content: bytes) -> Upload:
        self.big = not self.big
        return super().upload(name, content)

    def _send(self, frames: Iterable[Frame]) -> None:
        super()._send(map(self._written, frames))

    def _written(self, frame: Frame) -> Frame:
        if frame.opcode != UPLOAD_CHUNK:
            return frame
        chunk = FILE_DATA.decode(frame.data).value
        return frame._replace(data=_in_order(chunk, self.dialect, big=self.big))


row(
    "swaps-the-content-too",
    "5.1/9 5.3/11",
    "The content of a big-endian chunk is byte-swapped like its numbers.",
    chunk_taken(_swapped_words),
    subtle=True,
)


# The name first


class _ChunkWithName(Upload):
    def begin(self, now_s: float) -> list[Frame]:
        data = FILE_DATA.encode(next(chunks_of(self._content)), self._dialect)
        return [*super().begin(now_s), Frame(A2C, UPLOAD_CHUNK, data)]


class _ChunkBeforeName(_ChunkWithName):
    def begin(self, now_s: float) -> list[Frame]:
        return super().begin(now_s)[::-1]


row(
    "sends-content-with-the-name",
    "5.1/11 5.2/7 5.2/4",
    "The first chunk is sent together with the name.",
    uploads(_ChunkWithName),
)
row(
    "sends-content-ahead-of-the-name",
    "5.1/11",
    "The first chunk is sent before the name.",
    uploads(_ChunkBeforeName),
)


# The valid part of a buffer


class _StoresLastBufferUpToZeros(Receiver):
    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        taken = super().receive_chunk(data, now_s)
        if taken and self.state is TransferState.DONE and len(data) == FILE_DATA_BYTES:
            self._pieces[max(self._pieces)] = data[HEAD_BYTES:].rstrip(b"\0")
        return taken


row(
    "stores-whole-buffers",
    "5.1/12 5.3/11 5.2/16",
    "Each chunk of a download is stored as 200 bytes.",
    _stored(
        lambda pieces, _: b"".join(pieces[at].ljust(BUFFER_BYTES, b"\0") for at in sorted(pieces))
    ),
)
row(
    "stores-the-last-buffer-up-to-zeros",
    "5.1/12 5.3/11",
    "The last chunk of a download is stored up to the zeros that fill its buffer.",
    chunks_checked_by(_StoresLastBufferUpToZeros),
    subtle=True,
)


# Missing and repeated parts


def _sparse(pieces: Mapping[int, bytes], size_bytes: int) -> bytes:
    buffer = bytearray(size_bytes)
    for position, data in pieces.items():
        buffer[position : position + len(data)] = data
    return bytes(buffer)


class _CountsRepeatedBytes(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        repeated = chunk.position < self.received_bytes
        return "" if chunk.legal and repeated else super()._problem(chunk)


class _CountsOverlappingBytes(_CountsRepeatedBytes):
    def _problem(self, chunk: Chunk) -> str:
        return super()._problem(chunk) if chunk.position not in self._pieces else "repeated"


class _KeepsFirstFileSize(Receiver):
    first_bytes = 0

    def _problem(self, chunk: Chunk) -> str:
        if chunk.legal and chunk.position == self.received_bytes:
            self.first_bytes = self.first_bytes or chunk.file_size
            return ""
        return super()._problem(chunk)

    @property
    def content(self) -> bytes:
        return super().content.ljust(self.first_bytes, b"\0")[: self.first_bytes]


row(
    "appends-whatever-comes",
    "5.1/13",
    "Chunks of a download are accepted in any order, and one that reaches the end is the last.",
    chunks_checked_by(AnyOrder),
)
row(
    "fills-gaps-with-zeros",
    "5.1/13",
    "Chunks of a download are stored at their positions, and missing parts are zeros.",
    _stored(_sparse, AnyOrder),
)
row(
    "counts-repeated-bytes",
    "5.1/13",
    "A download is done when fileSize bytes have arrived, including repeated bytes.",
    chunks_checked_by(_CountsRepeatedBytes),
)
row(
    "counts-overlapping-bytes",
    "5.1/13",
    "A chunk that overlaps others is accepted and counted, unless its position is repeated.",
    chunks_checked_by(_CountsOverlappingBytes),
    subtle=True,
)
row(
    "keeps-the-first-file-size",
    "5.1/13",
    "A download has the size of the first fileSize, although a later one ends it.",
    chunks_checked_by(_KeepsFirstFileSize),
    subtle=True,
)
