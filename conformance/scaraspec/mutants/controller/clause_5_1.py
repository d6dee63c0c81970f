"""Mutants of clause 5.1: the structure fileData, sent and received."""

import struct
from typing import Any

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.requests import after, before
from scaraspec.mutants.operators.controller.transfers import (
    after_download,
    after_upload,
    chunk_data,
    receives,
    send_chunk,
    sent_chunk,
)
from scaraspec.mutants.operators.receivers import judging, taking
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import (
    BUFFER_BYTES,
    FILE_DATA,
    HEAD_BYTES,
    Chunk,
    Receiver,
    chunks_of,
    read_as,
)
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

# The structure

row(
    "chunk-without-file-size",
    "5.1/1 5.3/4",
    "Chunks of a download begin with the position: fileSize is missing.",
    chunk_data(lambda chunk, dialect: FILE_DATA.encode(chunk, dialect)[4:]),
)
row(
    "numbers-of-eight-bytes",
    "5.1/1 5.1/2 5.3/4",
    "The numbers in the chunks of a download have 64 bits each.",
    chunk_data(
        lambda chunk, _: struct.pack("<QQQ", *chunk[:3]) + chunk.buffer.ljust(BUFFER_BYTES, b"\0")
    ),
)
row(
    "takes-torn-chunks",
    "5.1/1",
    "A chunk that is shorter than its length field states is padded with zeros and accepted.",
    receives(
        taking(
            lambda chunk: chunk._replace(
                buffer=chunk.buffer and chunk.buffer.ljust(BUFFER_BYTES, b"\0")
            )
        )
    ),
)


def _cut_to_words(chunk: Chunk, dialect: Dialect) -> bytes:
    used = HEAD_BYTES + chunk.length
    return FILE_DATA.encode(chunk, dialect)[: used + -used % 4]


row(
    "last-chunk-cut-to-words",
    "5.1/1 5.1/2",
    "The last chunk of a download is cut off after its content and padded to 4 bytes.",
    chunk_data(_cut_to_words),
    subtle=True,
)
row(
    "buffer-of-two-hundred-and-one",
    "5.1/1 5.1/2",
    "The buffer has one more byte for a final NUL: every chunk has 213 bytes.",
    chunk_data(lambda chunk, dialect: FILE_DATA.encode(chunk, dialect) + b"\0"),
)

# fileSize, position, length

row(
    "file-size-is-what-is-left",
    "5.1/3",
    "FileSize is the number of bytes of the download that are not sent yet.",
    sent_chunk(lambda chunk: chunk._replace(file_size=chunk.file_size - chunk.position)),
)
row(
    "file-size-of-whole-buffers",
    "5.1/3",
    "FileSize is rounded up to whole buffers of 200 bytes.",
    sent_chunk(
        lambda chunk: chunk._replace(file_size=chunk.file_size + -chunk.file_size % BUFFER_BYTES)
    ),
)
row(
    "file-size-grows-with-the-heads",
    "5.1/3",
    "FileSize also counts the heads of the chunks sent so far.",
    sent_chunk(
        lambda chunk: chunk._replace(
            file_size=chunk.file_size + chunk.position // BUFFER_BYTES * HEAD_BYTES
        )
    ),
)
row(
    "position-counts-chunks",
    "5.1/4 5.1/8",
    "Position is the number of the chunk.",
    sent_chunk(lambda chunk: chunk._replace(position=chunk.position // BUFFER_BYTES)),
)
row(
    "position-from-one",
    "5.1/4 5.1/8",
    "Position counts from 1.",
    sent_chunk(lambda chunk: chunk._replace(position=chunk.position + 1)),
)
row(
    "position-is-the-end",
    "5.1/4 5.1/8",
    "Position is the offset of the end of the chunk.",
    sent_chunk(lambda chunk: chunk._replace(position=chunk.position + chunk.length)),
)
row(
    "length-counts-the-head",
    "5.1/5",
    "Length also counts the 12 bytes of the three numbers.",
    sent_chunk(lambda chunk: chunk._replace(length=chunk.length + HEAD_BYTES)),
)
row(
    "length-is-always-the-buffers",
    "5.1/5 5.1/6",
    "Length is 200 in the last chunk too.",
    sent_chunk(lambda chunk: chunk._replace(length=BUFFER_BYTES)),
)
row(
    "file-size-one-too-small",
    "5.1/6 5.1/3",
    "FileSize is the offset of the last byte: one less than the size.",
    sent_chunk(lambda chunk: chunk._replace(file_size=chunk.file_size - 1)),
)

# The end


def _send_empty_chunk(core: ControllerCore, session: Session, name: bytes) -> None:
    size_bytes = len(core.store.read(name))
    if size_bytes % BUFFER_BYTES == 0:
        send_chunk(core, session, Chunk(size_bytes, size_bytes, 0, b""))


row(
    "empty-chunk-behind-full-ones",
    "5.1/7 5.2/13",
    "A download of a multiple of 200 bytes ends with a chunk of length 0.",
    after_download(_send_empty_chunk),
    subtle=True,
)


@mutant("download-is-never-over", "5.1/7")
class KeepsDownloadsOpen(ControllerCore):
    """A download stays open after its last chunk was acknowledged, until it times out."""

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        reply = super().download_chunk(request)
        request.session.transfer = request.session.transfer or transfer
        return reply


def _reopen(core: ControllerCore, session: Session, name: bytes) -> None:
    session.transfer = OpenTransfer(name + b".open", Receiver(0.0, core.dialect))


row(
    "upload-is-never-over",
    "5.1/7",
    "An upload stays open after its last chunk: no other transfer begins on its connection.",
    after_upload(_reopen),
)

# Order


def _swap_last_two(chunk: Chunk) -> Chunk:
    rest = chunk.file_size % BUFFER_BYTES or BUFFER_BYTES
    last = chunk.file_size - rest
    if chunk.file_size <= 2 * BUFFER_BYTES or chunk.position < last - BUFFER_BYTES:
        return chunk
    return chunk._replace(position=2 * last - BUFFER_BYTES - chunk.position)


row(
    "sends-the-last-chunk-first",
    "5.1/8 5.1/4",
    "The positions of the last two chunks of a download of more than two chunks are swapped.",
    sent_chunk(_swap_last_two),
    subtle=True,
)
row(
    "repeats-the-fourth-chunk",
    "5.1/8",
    "The fifth chunk of a download has the position of the fourth.",
    sent_chunk(lambda chunk: chunk._replace(position=600) if chunk.position == 800 else chunk),
    subtle=True,
)

# Byte order


def _other_order(dialect: Dialect) -> Dialect:
    return dialect.replace(endian="big" if dialect["endian"] == "little" else "little")


row(
    "last-chunk-in-the-other-order",
    "5.1/9",
    "The last chunk of a download has the other byte order.",
    chunk_data(
        lambda chunk, dialect: FILE_DATA.encode(
            chunk, _other_order(dialect) if chunk.last else dialect
        )
    ),
    subtle=True,
)


class ReadsLittleEndian(Receiver):
    """Big-endian chunks are refused."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        if len(data) >= HEAD_BYTES and not read_as(data, "little").legal:
            self.fail("the chunk is out of bounds in this byte order")
            return False
        return super().receive_chunk(data, now_s)


row(
    "downloads-in-the-other-order",
    "5.1/9",
    "Downloads are big-endian, but uploads must be little-endian.",
    chunk_data(lambda chunk, dialect: FILE_DATA.encode(chunk, dialect.replace(endian="big"))),
    receives(ReadsLittleEndian),
)


@mutant("every-second-file-in-the-other-order", "5.1/9", subtle=True)
class AlternatesByteOrder(ControllerCore):
    """Every second download has the other byte order."""

    _downloads = 0

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        self._downloads += not chunk.position
        dialect = self.dialect if self._downloads % 2 else _other_order(self.dialect)
        self.send_after_reply(session, Frame(C2A, 0x56, FILE_DATA.encode(chunk, dialect)))


# A name that is taken, content without a name


def _begin_if_taken(core: ControllerCore, request: Request, accepted: Any) -> Any:
    if not accepted and request.value in core.store:
        receiver = Receiver(request.now_s, core.dialect)
        request.session.transfer = OpenTransfer(request.value, receiver)
    return accepted


def _begin_without_name(core: ControllerCore, request: Request) -> None:
    if request.session.transfer is None:
        receiver = Receiver(request.now_s, core.dialect)
        request.session.transfer = OpenTransfer(b"noname.rob", receiver)


def _send_first_chunk(core: ControllerCore, session: Session, name: bytes) -> None:
    send_chunk(core, session, next(chunks_of(core.store.read(name))))


row(
    "overwrites-files",
    "5.1/10 5.2/3 5.4/2",
    "A name that is taken is accepted, and its file is replaced.",
    before("upload_name", lambda core, request: core.remove(request.value)),
)
row(
    "goes-on-after-arefused-name",
    "5.1/10 5.2/11",
    "A name that is taken is answered 0, but the content that follows replaces its file.",
    after("upload_name", _begin_if_taken),
)
row(
    "takes-content-before-aname",
    "5.1/11 5.2/11",
    "Content without a name is stored in a file with a fixed name.",
    before("upload_chunk", _begin_without_name),
)
row(
    "sends-back-what-it-got",
    "5.1/11 5.2/13",
    "When an upload is complete, its first chunk is sent back without a request.",
    after_upload(_send_first_chunk),
)

# The valid part of a buffer


class _StoresBuffers(Receiver):
    @property
    def content(self) -> bytes:
        return b"".join(
            self._pieces[position].ljust(BUFFER_BYTES, b"\0") for position in sorted(self._pieces)
        )


class _StripsLastBuffer(Receiver):
    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        chunk = FILE_DATA.decode(data).value
        taken = super().receive_chunk(data, now_s)
        if taken and chunk is not None and chunk.last:
            self._pieces[chunk.position] = chunk.buffer.rstrip(b"\0") or chunk.data
        return taken


def _length_from_file_size(chunk: Chunk) -> Chunk:
    if not chunk.legal or len(chunk.buffer) != BUFFER_BYTES:
        return chunk
    return chunk._replace(length=min(BUFFER_BYTES, chunk.file_size - chunk.position))


row(
    "stores-whole-buffers",
    "5.1/12 5.2/12 5.2/16",
    "The whole buffer of each chunk is stored, not only its valid bytes.",
    receives(_StoresBuffers),
)
row(
    "ignores-length",
    "5.1/12",
    "The number of valid bytes is calculated from fileSize and position; length is ignored.",
    receives(taking(_length_from_file_size)),
)
row(
    "last-buffer-up-to-its-zeros",
    "5.1/12",
    "The last chunk is stored up to its trailing zeros; length is ignored.",
    receives(_StripsLastBuffer),
)

# Complete or not


class _WritesAtPositions(Receiver):
    @property
    def content(self) -> bytes:
        buffer = bytearray(self.size_bytes or 0)
        for position, data in self._pieces.items():
            buffer[position : position + len(data)] = data
        return bytes(buffer)


class _CountsOverlaps(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        new = chunk.legal and chunk.position not in self._pieces
        return "" if new and chunk.position < self.received_bytes else super()._problem(chunk)


class _KeepsFirstSize(Receiver):
    _first_bytes = 0

    def _problem(self, chunk: Chunk) -> str:
        if chunk.legal and chunk.position == self.received_bytes:
            self._first_bytes = self._first_bytes or chunk.file_size
            return ""
        return super()._problem(chunk)

    @property
    def content(self) -> bytes:
        return super().content.ljust(self._first_bytes, b"\0")


_AnyPosition = judging(accepts=lambda _, chunk: chunk.legal, complete=lambda _, chunk: chunk.last)

row(
    "appends-whatever-comes",
    "5.1/13",
    "Chunks of any position are appended; the one that reaches fileSize ends the file.",
    receives(_AnyPosition),
)
row(
    "fills-gaps-with-zeros",
    "5.1/13",
    "Chunks are written at their positions; bytes that were not received are zeros.",
    receives(_WritesAtPositions, _AnyPosition),
)
row(
    "counts-repeated-bytes",
    "5.1/13",
    "A file is complete when fileSize bytes have been received, repeated ones included.",
    receives(
        judging(accepts=lambda end, chunk: chunk.legal and chunk.position < end.received_bytes)
    ),
)
row(
    "counts-overlapping-bytes",
    "5.1/13",
    "A chunk that overlaps others is accepted and counted in full, unless its position repeats.",
    receives(_CountsOverlaps),
    subtle=True,
)
row(
    "keeps-the-first-file-size",
    "5.1/13",
    "Space is reserved for the first fileSize, but a later, smaller one ends the file.",
    receives(_KeepsFirstSize),
    subtle=True,
)
