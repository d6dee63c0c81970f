"""Faults of clause 5.1: the structure fileData, sent and taken."""

import struct
from collections.abc import Iterable
from dataclasses import replace
from typing import ClassVar

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.transfers import (
    AltersChunkData,
    AltersChunks,
    JudgesChunks,
    SendsAfterTheEnd,
)
from scaraspec.protocol.transfer import (
    BUFFER_BYTES,
    FILE_DATA,
    FILE_DATA_BYTES,
    HEAD_BYTES,
    Chunk,
    Receiver,
    State,
    chunks_of,
)
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

# The structure


@mutant("chunk-without-file-size", "5.1/1", "5.3/4")
class ChunkWithoutFileSize(AltersChunkData):
    """Chunks of a download begin with the position: fileSize is missing."""

    def data(self, chunk: Chunk) -> bytes:
        """Leave the first number away."""
        return super().data(chunk)[4:]


@mutant("numbers-of-eight-bytes", "5.1/1", "5.1/2", "5.3/4")
class NumbersOfEightBytes(AltersChunkData):
    """The numbers of a download's chunks have 64 bits each, as on a larger processor."""

    def data(self, chunk: Chunk) -> bytes:
        """Write a size_t each."""
        return struct.pack("<QQQ", *chunk[:3]) + chunk.buffer.ljust(BUFFER_BYTES, b"\0")


@mutant("takes-torn-chunks", "5.1/1")
class TakesTornChunks(ControllerCore):
    """A chunk that is shorter than its own length says is filled up with zeros and taken."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Fill it up."""
        data = request.frame.data
        if HEAD_BYTES < len(data) < FILE_DATA_BYTES:
            frame = request.frame._replace(data=data.ljust(FILE_DATA_BYTES, b"\0"))
            request = replace(request, frame=frame)
        return super().upload_chunk(request)


@mutant("last-chunk-cut-to-words", "5.1/1", "5.1/2", subtle=True)
class LastChunkCutToWords(AltersChunkData):
    """The last chunk of a download is cut off behind its content, and then filled to 4 bytes."""

    def data(self, chunk: Chunk) -> bytes:
        """Cut and fill."""
        used = HEAD_BYTES + chunk.length
        return super().data(chunk)[: used + -used % 4]


@mutant("buffer-of-two-hundred-and-one", "5.1/1", "5.1/2")
class BufferOfTwoHundredAndOne(AltersChunkData):
    """The buffer has room for a closing NUL: 213 bytes in every chunk."""

    def data(self, chunk: Chunk) -> bytes:
        """Add one."""
        return super().data(chunk) + b"\0"


# fileSize


@mutant("file-size-is-what-is-left", "5.1/3")
class FileSizeIsWhatIsLeft(AltersChunks):
    """FileSize tells how many bytes of the download are still to come."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Count down."""
        return (chunk._replace(file_size=chunk.file_size - chunk.position),)


@mutant("file-size-of-whole-buffers", "5.1/3")
class FileSizeOfWholeBuffers(AltersChunks):
    """FileSize is rounded up to whole buffers of 200 bytes."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Round up."""
        return (chunk._replace(file_size=chunk.file_size + -chunk.file_size % BUFFER_BYTES),)


@mutant("file-size-grows-with-the-heads", "5.1/3")
class FileSizeGrowsWithTheHeads(AltersChunks):
    """FileSize counts the heads of the chunks sent so far as well."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Count them."""
        heads = chunk.position // BUFFER_BYTES * HEAD_BYTES
        return (chunk._replace(file_size=chunk.file_size + heads),)


# position


@mutant("position-counts-chunks", "5.1/4", "5.1/8")
class PositionCountsChunks(AltersChunks):
    """Position is the number of the chunk."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Divide."""
        return (chunk._replace(position=chunk.position // BUFFER_BYTES),)


@mutant("position-from-one", "5.1/4", "5.1/8")
class PositionFromOne(AltersChunks):
    """Position counts from 1."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Add one."""
        return (chunk._replace(position=chunk.position + 1),)


@mutant("position-is-the-end", "5.1/4", "5.1/8")
class PositionIsTheEnd(AltersChunks):
    """Position is the offset behind the chunk."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Add the length."""
        return (chunk._replace(position=chunk.position + chunk.length),)


# length


@mutant("length-counts-the-head", "5.1/5")
class LengthCountsTheHead(AltersChunks):
    """Length counts the three numbers too."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Add twelve."""
        return (chunk._replace(length=chunk.length + HEAD_BYTES),)


@mutant("length-is-always-the-buffers", "5.1/5", "5.1/6")
class LengthIsAlwaysTheBuffers(AltersChunks):
    """Length is 200 in the last chunk too."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Take the buffer's."""
        return (chunk._replace(length=BUFFER_BYTES),)


@mutant("file-size-one-too-small", "5.1/6", "5.1/3")
class FileSizeOneTooSmall(AltersChunks):
    """FileSize is the offset of the last byte: one less than the size."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Subtract one."""
        return (chunk._replace(file_size=chunk.file_size - 1),)


# The end


@mutant("empty-chunk-behind-full-ones", "5.1/7", "5.2/13", subtle=True)
class EmptyChunkBehindFullOnes(SendsAfterTheEnd):
    """A download of a multiple of 200 bytes ends with a chunk of length 0."""

    def downloaded(self, session: Session, name: bytes) -> None:
        """Send one more."""
        size_bytes = len(self.store.read(name))
        if size_bytes % BUFFER_BYTES == 0:
            self._send_chunk(session, Chunk(size_bytes, size_bytes, 0, b""))


@mutant("download-is-never-over", "5.1/7")
class DownloadIsNeverOver(ControllerCore):
    """A download stays open after its last chunk was answered, until it times out."""

    def download_chunk(self, request: Request) -> Silence:
        """Keep it."""
        transfer = request.session.transfer
        answer = super().download_chunk(request)
        request.session.transfer = request.session.transfer or transfer
        return answer


@mutant("upload-is-never-over", "5.1/7")
class UploadIsNeverOver(SendsAfterTheEnd):
    """An upload stays open after its last chunk: no other transfer begins on its connection."""

    def uploaded(self, session: Session, name: bytes) -> None:
        """Begin it anew."""
        session.transfer = OpenTransfer(name + b".open", Receiver(0.0, self.dialect))


# Order


@mutant("sends-the-last-chunk-first", "5.1/8", "5.1/4", subtle=True)
class SendsTheLastChunkFirst(AltersChunks):
    """The last two chunks of a download of more than two change places."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Change what they tell of themselves."""
        rest = chunk.file_size % BUFFER_BYTES or BUFFER_BYTES
        last = chunk.file_size - rest
        if chunk.file_size <= 2 * BUFFER_BYTES or chunk.position < last - BUFFER_BYTES:
            return (chunk,)
        return (chunk._replace(position=2 * last - BUFFER_BYTES - chunk.position),)


@mutant("repeats-the-fourth-chunk", "5.1/8", subtle=True)
class RepeatsTheFourthChunk(AltersChunks):
    """The fourth chunk of a download is sent a second time in place of the fifth."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Send the offset of the fourth again."""
        return (chunk._replace(position=600) if chunk.position == 800 else chunk,)


# Byte order


@mutant("last-chunk-in-the-other-order", "5.1/9", subtle=True)
class LastChunkInTheOtherOrder(AltersChunkData):
    """The last chunk of a download is made elsewhere, in the other byte order."""

    def data(self, chunk: Chunk) -> bytes:
        """Change the order."""
        other = "big" if self.dialect["endian"] == "little" else "little"
        dialect = self.dialect.replace(endian=other) if chunk.last else self.dialect
        return FILE_DATA.encode(chunk, dialect)


@mutant("every-second-file-in-the-other-order", "5.1/9", subtle=True)
class EverySecondFileInTheOtherOrder(AltersChunkData):
    """Every second download has the other byte order."""

    downloads = 0

    def data(self, chunk: Chunk) -> bytes:
        """Change the order."""
        self.downloads += not chunk.position
        other = "big" if self.dialect["endian"] == "little" else "little"
        dialect = self.dialect if self.downloads % 2 else self.dialect.replace(endian=other)
        return FILE_DATA.encode(chunk, dialect)


# A name that is taken, content without a name


@mutant("overwrites-files", "5.1/10", "5.2/3", "5.4/2")
class OverwritesFiles(ControllerCore):
    """A name that is taken is accepted, and its file replaced."""

    def upload_name(self, request: Request) -> bool:
        """Delete it first."""
        self.remove(request.value)
        return super().upload_name(request)


@mutant("goes-on-after-arefused-name", "5.1/10", "5.2/11")
class GoesOnAfterARefusedName(ControllerCore):
    """A name that is taken is answered 0, but the content that follows is written over its file."""

    def upload_name(self, request: Request) -> bool:
        """Begin, whatever the answer."""
        accepted = super().upload_name(request)
        if not accepted and request.value in self.store:
            request.session.transfer = OpenTransfer(
                request.value, Receiver(request.now_s, self.dialect)
            )
        return accepted


@mutant("takes-content-before-aname", "5.1/11", "5.2/11")
class TakesContentBeforeAName(ControllerCore):
    """Content without a name is taken, into a file of the controller's own."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Make a name."""
        if request.session.transfer is None:
            receiver = Receiver(request.now_s, self.dialect)
            request.session.transfer = OpenTransfer(b"noname.rob", receiver)
        return super().upload_chunk(request)


@mutant("sends-back-what-it-got", "5.1/11", "5.2/13")
class SendsBackWhatItGot(SendsAfterTheEnd):
    """When an upload is complete, its first chunk is sent back unasked."""

    def uploaded(self, session: Session, name: bytes) -> None:
        """Send it."""
        self._send_chunk(session, next(chunks_of(self.store.read(name))))


# What is valid of a buffer


class _WholeBuffers(Receiver):
    @property
    def content(self) -> bytes:
        """Every chunk as long as its buffer."""
        return b"".join(
            self._pieces[position].ljust(BUFFER_BYTES, b"\0") for position in sorted(self._pieces)
        )


@mutant("stores-whole-buffers", "5.1/12", "5.2/12", "5.2/16")
class StoresWholeBuffers(JudgesChunks):
    """Of each chunk the whole buffer is stored, not just its valid bytes."""

    receiver: ClassVar[type[Receiver]] = _WholeBuffers


class _ByTheFileSize(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        """Take as many bytes as the file should still have."""
        chunk = FILE_DATA.decode(data).value
        if chunk is not None and chunk.legal and len(data) == FILE_DATA_BYTES:
            length = min(BUFFER_BYTES, chunk.file_size - chunk.position)
            data = FILE_DATA.encode(chunk._replace(length=length))
        return super().take(data, now_s)


@mutant("ignores-length", "5.1/12")
class IgnoresLength(JudgesChunks):
    """How much of a buffer is valid is worked out from fileSize and position: length is ignored."""

    receiver: ClassVar[type[Receiver]] = _ByTheFileSize


class _FillerIsContent(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        """Take the buffer up to its last byte that is not zero."""
        chunk = FILE_DATA.decode(data).value
        taken = super().take(data, now_s)
        if taken and chunk is not None and chunk.last:
            self._pieces[chunk.position] = chunk.buffer.rstrip(b"\0") or chunk.data
        return taken


@mutant("last-buffer-up-to-its-zeros", "5.1/12")
class LastBufferUpToItsZeros(JudgesChunks):
    """The last chunk is stored up to where its zeros begin, whatever length says."""

    receiver: ClassVar[type[Receiver]] = _FillerIsContent


# Complete or not


class _Careless(Receiver):
    """Takes chunks wherever they lie, and ends with the one that reaches the end."""

    def _problem(self, chunk: Chunk) -> str:
        return "" if chunk.legal else "it is out of bounds"

    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        chunk = FILE_DATA.decode(data).value
        if taken and chunk is not None:
            self.state = State.DONE if chunk.last else State.ACTIVE
        return taken


@mutant("appends-whatever-comes", "5.1/13")
class AppendsWhateverComes(JudgesChunks):
    """Chunks are appended wherever they belong, and the one that reaches the end ends the file."""

    receiver: ClassVar[type[Receiver]] = _Careless


class _Sparse(_Careless):
    @property
    def content(self) -> bytes:
        """What was sent, zeros elsewhere."""
        buffer = bytearray(self.size_bytes or 0)
        for position, data in self._pieces.items():
            buffer[position : position + len(data)] = data
        return bytes(buffer)


@mutant("fills-gaps-with-zeros", "5.1/13")
class FillsGapsWithZeros(JudgesChunks):
    """Chunks are written where they belong; what is missing at the end stays zero."""

    receiver: ClassVar[type[Receiver]] = _Sparse


class _Counting(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        repeated = chunk.position < self.received_bytes
        return "" if chunk.legal and repeated else super()._problem(chunk)


@mutant("counts-repeated-bytes", "5.1/13")
class CountsRepeatedBytes(JudgesChunks):
    """A file is complete when as many bytes have come as it has, repeated ones counted too."""

    receiver: ClassVar[type[Receiver]] = _Counting


class _Overlapping(_Counting):
    def _problem(self, chunk: Chunk) -> str:
        return super()._problem(chunk) if chunk.position not in self._pieces else "repeated"


@mutant("counts-overlapping-bytes", "5.1/13", subtle=True)
class CountsOverlappingBytes(JudgesChunks):
    """A chunk that overlaps others is taken and counted in full, unless it begins as one did."""

    receiver: ClassVar[type[Receiver]] = _Overlapping


class _Preallocated(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        if chunk.legal and chunk.position == self.received_bytes:
            self._first_bytes = self.__dict__.get("_first_bytes", chunk.file_size)
            return ""
        return super()._problem(chunk)

    @property
    def content(self) -> bytes:
        """As large as the first chunk said."""
        return super().content.ljust(self._first_bytes, b"\0")


@mutant("keeps-the-first-file-size", "5.1/13", subtle=True)
class KeepsTheFirstFileSize(JudgesChunks):
    """Room is made for the first fileSize, but a later, smaller one ends the file."""

    receiver: ClassVar[type[Receiver]] = _Preallocated
