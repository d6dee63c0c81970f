"""Faults of clause 5.1: the structure fileData, sent and taken."""

import struct
from collections.abc import Iterator

from scaraspec.client.transfer import Download, Upload
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.transfers import (
    UPLOAD_CHUNK,
    AltersChunkData,
    AltersChunks,
    Careless,
    CutsOtherwise,
    DownloadsOtherwise,
    JudgesChunks,
    UploadsOtherwise,
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
    State,
    chunks_of,
    read_as,
)

# The structure


@mutant("numbers-of-eight-bytes", "5.1/1", "5.1/2", "5.2/5")
class NumbersOfEightBytes(AltersChunkData):
    """The three numbers of a chunk have eight bytes each."""

    def data(self, chunk: Chunk) -> bytes:
        """Write them so."""
        return struct.pack("<QQQ", *chunk[:3]) + chunk.buffer


@mutant("leaves-out-the-length", "5.1/1", "5.1/2")
class LeavesOutTheLength(AltersChunkData):
    """Chunks have no length: the frame has one."""

    def data(self, chunk: Chunk) -> bytes:
        """Write two numbers."""
        return struct.pack("<II", *chunk[:2]) + chunk.data


@mutant("position-ahead-of-file-size", "5.1/1", "5.1/3", "5.1/4")
class PositionAheadOfFileSize(AltersChunkData):
    """The position stands where fileSize belongs, and the other way round."""

    def data(self, chunk: Chunk) -> bytes:
        """Write them so."""
        return struct.pack("<III", chunk.position, chunk.file_size, chunk.length) + chunk.buffer


class _Filled(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        return super().take(data.ljust(FILE_DATA_BYTES, b"\0") if data else data, now_s)


@mutant("pads-chunks-that-are-cut-off", "5.1/1", subtle=True)
class PadsChunksThatAreCutOff(JudgesChunks):
    """A chunk of fewer bytes than its length says is filled up with zeros and taken."""

    receiver = _Filled


@mutant("aligns-the-structure", "5.1/2", "5.1/1")
class AlignsTheStructure(AltersChunkData):
    """A chunk is sent with four bytes of padding at its end."""

    def data(self, chunk: Chunk) -> bytes:
        """Pad it."""
        return super().data(chunk) + bytes(4)


@mutant("cuts-the-last-chunk-to-words", "5.1/2", "5.1/1", subtle=True)
class CutsTheLastChunkToWords(AltersChunkData):
    """A last chunk is cut off behind its content, rounded up to four bytes."""

    def data(self, chunk: Chunk) -> bytes:
        """Cut it."""
        return super().data(chunk)[: HEAD_BYTES + -(-chunk.length // 4) * 4]


class _FromTheEnd(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        if HEAD_BYTES < len(data) < FILE_DATA_BYTES:
            data = data[:HEAD_BYTES] + bytes(len(data) - HEAD_BYTES)
        return super().take(data, now_s)


@mutant("forgets-what-is-cut-off", "5.1/2", "5.3/11", subtle=True)
class ForgetsWhatIsCutOff(JudgesChunks):
    """Of a chunk that is cut off behind its content zeros are kept."""

    receiver = _FromTheEnd


# fileSize


@mutant("file-size-is-what-is-left", "5.1/3")
class FileSizeIsWhatIsLeft(AltersChunks):
    """fileSize is what is left to send, and shrinks from chunk to chunk."""

    def other(self, chunk: Chunk) -> Chunk:
        """Subtract what has been sent."""
        return chunk._replace(file_size=chunk.file_size - chunk.position)


@mutant("file-size-counts-chunks", "5.1/3", "5.1/6")
class FileSizeCountsChunks(AltersChunks):
    """fileSize is the number of chunks."""

    def other(self, chunk: Chunk) -> Chunk:
        """Count them."""
        return chunk._replace(file_size=-(-chunk.file_size // BUFFER_BYTES))


@mutant("file-size-counts-the-nul", "5.1/3")
class FileSizeCountsTheNul(AltersChunks):
    """fileSize counts a zero at the end that is not sent."""

    def other(self, chunk: Chunk) -> Chunk:
        """Count it."""
        return chunk._replace(file_size=chunk.file_size + 1)


@mutant("file-size-of-full-chunks", "5.1/3", subtle=True)
class FileSizeOfFullChunks(AltersChunks):
    """fileSize is rounded up to full chunks, but in the last one."""

    def other(self, chunk: Chunk) -> Chunk:
        """Round it."""
        rounded = -(-chunk.file_size // BUFFER_BYTES) * BUFFER_BYTES
        return chunk if chunk.last else chunk._replace(file_size=rounded)


# position


@mutant("positions-count-chunks", "5.1/4", "5.1/8")
class PositionsCountChunks(AltersChunks):
    """position is the number of the chunk."""

    def other(self, chunk: Chunk) -> Chunk:
        """Count them."""
        return chunk._replace(position=chunk.position // BUFFER_BYTES)


@mutant("positions-from-one", "5.1/4", "5.1/8")
class PositionsFromOne(AltersChunks):
    """position is counted from 1."""

    def other(self, chunk: Chunk) -> Chunk:
        """Count so."""
        return chunk._replace(position=chunk.position + 1)


@mutant("position-is-the-end", "5.1/4", "5.1/8")
class PositionIsTheEnd(AltersChunks):
    """position is where the chunk ends."""

    def other(self, chunk: Chunk) -> Chunk:
        """Add the length."""
        return chunk._replace(position=chunk.position + chunk.length)


class _InFullSteps(Receiver):
    @property
    def content(self) -> bytes:
        """Every chunk at a multiple of 200."""
        content = bytearray()
        for number, position in enumerate(sorted(self._pieces)):
            content = content.ljust(number * BUFFER_BYTES, b"\0") + self._pieces[position]
        return bytes(content[: self.size_bytes])


@mutant("stores-chunks-in-full-steps", "5.1/4", "5.3/11", "5.4/4")
class StoresChunksInFullSteps(JudgesChunks):
    """Each chunk of a download is written 200 bytes behind the one before."""

    receiver = _InFullSteps


# length


@mutant("length-is-the-buffer", "5.1/5", "5.1/6")
class LengthIsTheBuffer(AltersChunks):
    """length is always 200."""

    def other(self, chunk: Chunk) -> Chunk:
        """Say so."""
        return chunk._replace(length=BUFFER_BYTES)


@mutant("length-counts-the-head", "5.1/5", "5.4/3")
class LengthCountsTheHead(AltersChunks):
    """length is the size of the structure."""

    def other(self, chunk: Chunk) -> Chunk:
        """Add the head."""
        return chunk._replace(length=HEAD_BYTES + chunk.length)


@mutant("last-length-counts-the-nul", "5.1/6", "5.1/5", subtle=True)
class LastLengthCountsTheNul(AltersChunks):
    """The last chunk, unless it is full, reaches one byte beyond the file."""

    def other(self, chunk: Chunk) -> Chunk:
        """Add one."""
        full = chunk.length == BUFFER_BYTES
        return chunk if full or not chunk.last else chunk._replace(length=chunk.length + 1)


# The end


class _Hasty(Upload):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        if any(FILE_DATA.decode(frame.data).value.last for frame in frames):
            self.settle(None)
        return frames


@mutant("done-with-the-last-chunk", "5.1/7", "5.2/19")
class DoneWithTheLastChunk(UploadsOtherwise):
    """An upload is done when its last chunk has been sent."""

    way = _Hasty


class _Endless(Upload):
    def settle(self, value: object) -> None:
        """Wait for more."""


@mutant("waits-behind-the-last-answer", "5.1/7", "5.2/19")
class WaitsBehindTheLastAnswer(UploadsOtherwise):
    """An upload waits for another answer behind that to its last chunk."""

    way = _Endless


class _Unended(Download):
    def settle(self, value: object) -> None:
        """Wait for more."""


@mutant("waits-behind-the-last-chunk", "5.1/7", "5.3/11", "5.4/4")
class WaitsBehindTheLastChunk(DownloadsOtherwise):
    """A download waits for another chunk behind its last one."""

    way = _Unended


class _ByteEarly(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if taken and self.received_bytes + 1 == self.size_bytes:
            self.state = State.DONE
        return taken


@mutant("ends-one-byte-early", "5.1/7", "5.3/11", "5.4/4", subtle=True)
class EndsOneByteEarly(JudgesChunks):
    """A download is done when all its bytes but one have come."""

    receiver = _ByteEarly


# The order


class _Backwards(Sender):
    def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
        super().__init__(content, now_s, dialect)
        self._chunks = reversed(tuple(chunks_of(content)))


@mutant("sends-the-last-chunk-first", "5.1/8")
class SendsTheLastChunkFirst(CutsOtherwise):
    """An upload begins with its last chunk."""

    sender = _Backwards


class _Overlapping(Sender):
    def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
        super().__init__(content, now_s, dialect)
        self._chunks = self._cut(content)

    @staticmethod
    def _cut(content: bytes) -> Iterator[Chunk]:
        position = 0
        while position < len(content):
            piece = content[position : position + BUFFER_BYTES]
            yield Chunk(len(content), position, len(piece), piece)
            position += BUFFER_BYTES - 1 if position + len(piece) < len(content) else BUFFER_BYTES


@mutant("repeats-the-last-byte", "5.1/8", "5.1/4")
class RepeatsTheLastByte(CutsOtherwise):
    """Each chunk begins with the last byte of the one before."""

    sender = _Overlapping


class _Gapped(Sender):
    def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
        super().__init__(content, now_s, dialect)
        every = enumerate(chunks_of(content))
        self._chunks = (chunk for number, chunk in every if number != 3 or chunk.last)


@mutant("skips-the-fourth-chunk", "5.1/8", "5.2/20", subtle=True)
class SkipsTheFourthChunk(CutsOtherwise):
    """The fourth chunk of an upload is left out, unless it is the last."""

    sender = _Gapped


# The byte order


@mutant("last-chunk-is-big-endian", "5.1/9", subtle=True)
class LastChunkIsBigEndian(AltersChunkData):
    """The last of several chunks is big-endian."""

    def data(self, chunk: Chunk) -> bytes:
        """Write it so."""
        order = "big" if chunk.last and chunk.position else "little"
        return FILE_DATA.encode(chunk, self.dialect.replace(endian=order))


@mutant("second-upload-is-big-endian", "5.1/9", subtle=True)
class SecondUploadIsBigEndian(AltersChunkData):
    """Every other upload of a connection is big-endian."""

    uploads = 0

    def upload(self, name: bytes, content: bytes) -> Upload:
        """Count them."""
        self.uploads += 1
        return super().upload(name, content)

    def data(self, chunk: Chunk) -> bytes:
        """Write it so."""
        order = "little" if self.uploads % 2 else "big"
        return FILE_DATA.encode(chunk, self.dialect.replace(endian=order))


class _SwapsAll(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        if len(data) == FILE_DATA_BYTES and read_as(data, "big").legal:
            words = struct.unpack(f">{FILE_DATA_BYTES // 4}I", data)
            data = struct.pack(f"<{FILE_DATA_BYTES // 4}I", *words)
        return super().take(data, now_s)


@mutant("swaps-the-content-too", "5.1/9", "5.3/11", subtle=True)
class SwapsTheContentToo(JudgesChunks):
    """Of a big-endian chunk the content is swapped like the numbers."""

    receiver = _SwapsAll


# The name first


class _AllAtOnce(Upload):
    def begin(self, now_s: float) -> list[Frame]:
        data = FILE_DATA.encode(next(chunks_of(self._content)), self._dialect)
        return [*super().begin(now_s), Frame(A2C, UPLOAD_CHUNK, data)]


@mutant("sends-content-with-the-name", "5.1/11", "5.2/7", "5.2/4")
class SendsContentWithTheName(UploadsOtherwise):
    """The first chunk is sent together with the name."""

    way = _AllAtOnce


class _ContentFirst(_AllAtOnce):
    def begin(self, now_s: float) -> list[Frame]:
        return super().begin(now_s)[::-1]


@mutant("sends-content-ahead-of-the-name", "5.1/11")
class SendsContentAheadOfTheName(UploadsOtherwise):
    """The first chunk is sent ahead of the name."""

    way = _ContentFirst


# What is valid of a buffer


class _WholeBuffers(Receiver):
    @property
    def content(self) -> bytes:
        """Every chunk as long as its buffer."""
        pieces = (self._pieces[position] for position in sorted(self._pieces))
        return b"".join(piece.ljust(BUFFER_BYTES, b"\0") for piece in pieces)


@mutant("stores-whole-buffers", "5.1/12", "5.3/11", "5.2/16")
class StoresWholeBuffers(JudgesChunks):
    """Each chunk of a download is stored as 200 bytes."""

    receiver = _WholeBuffers


class _WholeLastBuffer(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if taken and self.state is State.DONE and len(data) == FILE_DATA_BYTES:
            self._pieces[max(self._pieces)] = data[HEAD_BYTES:].rstrip(b"\0")
        return taken


@mutant("stores-the-last-buffer-up-to-zeros", "5.1/12", "5.3/11", subtle=True)
class StoresTheLastBufferUpToZeros(JudgesChunks):
    """The last chunk of a download is stored up to the zeros that fill it."""

    receiver = _WholeLastBuffer


# What is missing


@mutant("appends-whatever-comes", "5.1/13")
class AppendsWhateverComes(JudgesChunks):
    """Chunks of a download are appended in any order, and the one that reaches the end ends it."""

    receiver = Careless


class _Sparse(Careless):
    @property
    def content(self) -> bytes:
        """What was sent, zeros elsewhere."""
        buffer = bytearray(self.size_bytes or 0)
        for position, data in self._pieces.items():
            buffer[position : position + len(data)] = data
        return bytes(buffer)


@mutant("fills-gaps-with-zeros", "5.1/13")
class FillsGapsWithZeros(JudgesChunks):
    """Chunks of a download are written where they belong; what is missing at the end stays zero."""

    receiver = _Sparse


class _Counting(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        repeated = chunk.position < self.received_bytes
        return "" if chunk.legal and repeated else super()._problem(chunk)


@mutant("counts-repeated-bytes", "5.1/13")
class CountsRepeatedBytes(JudgesChunks):
    """A download is done when as many bytes have come as it has, repeated ones counted too."""

    receiver = _Counting


class _Overlapped(_Counting):
    def _problem(self, chunk: Chunk) -> str:
        return super()._problem(chunk) if chunk.position not in self._pieces else "repeated"


@mutant("counts-overlapping-bytes", "5.1/13", subtle=True)
class CountsOverlappingBytes(JudgesChunks):
    """A chunk that overlaps others is taken and counted in full, unless it begins as one did."""

    receiver = _Overlapped


class _Preallocated(Receiver):
    first_bytes = 0

    def _problem(self, chunk: Chunk) -> str:
        if chunk.legal and chunk.position == self.received_bytes:
            self.first_bytes = self.first_bytes or chunk.file_size
            return ""
        return super()._problem(chunk)

    @property
    def content(self) -> bytes:
        """As large as the first chunk said."""
        return super().content.ljust(self.first_bytes, b"\0")[: self.first_bytes]


@mutant("keeps-the-first-file-size", "5.1/13", subtle=True)
class KeepsTheFirstFileSize(JudgesChunks):
    """Room is made for the first fileSize, though a later one ends the download."""

    receiver = _Preallocated
