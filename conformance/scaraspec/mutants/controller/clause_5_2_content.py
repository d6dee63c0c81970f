"""Faults of clause 5.2: what is stored of an upload, its bytes and its size."""

from abc import ABC, abstractmethod
from dataclasses import replace
from functools import cached_property
from typing import ClassVar

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.transfers import (
    AltersChunks,
    AltersContent,
    JudgesChunks,
    SendsAfterTheEnd,
)
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, HEAD_BYTES, Chunk, Receiver, State
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_FIRST_OF_TRANSFERS = 0x50


@mutant("serves-what-it-read-first", "5.2/12", subtle=True)
class ServesWhatItReadFirst(ControllerCore):
    """What was once fetched under a name is served for ever, also when the file is another one."""

    @cached_property
    def cache(self) -> dict[bytes, bytes]:
        """What it remembers."""
        return {}

    def download_name(self, request: Request) -> bool:
        """Serve it."""
        name = request.value
        if name not in self.store:
            return super().download_name(request)
        now = self.store.read(name)
        self.store.write(name, self.cache.setdefault(name, now))
        accepted = super().download_name(request)
        self.store.write(name, now)
        return accepted


@mutant("spoils127-bytes", "5.2/16", subtle=True)
class Spoils127Bytes(AltersContent):
    """One bit of a file of 127 bytes, the most that seven bits count, is another one."""

    def kept(self, content: bytes) -> bytes:
        """Spoil it."""
        return bytes((content[0] ^ 1,)) + content[1:] if len(content) == 0x7F else content


@mutant("takes-an-end-for-the-end", "5.2/14", subtle=True)
class TakesAnEndForTheEnd(AltersContent):
    """The bytes AA CC at the end of a chunk behind the first are taken for those of its frame."""

    def kept(self, content: bytes) -> bytes:
        """Blank them out."""
        chunks = [content[at : at + BUFFER_BYTES] for at in range(0, len(content), BUFFER_BYTES)]
        later = (
            chunk[:-2] + bytes(2) if chunk.endswith(b"\xaa\xcc") else chunk for chunk in chunks[1:]
        )
        return b"".join((*chunks[:1], *later))


@mutant("keeps-the-tail-of-the-old-file", "5.2/12", subtle=True)
class KeepsTheTailOfTheOldFile(ControllerCore):
    """A shorter file under a name that was deleted keeps the end of the old one."""

    @cached_property
    def old(self) -> dict[bytes, bytes]:
        """What it remembers."""
        return {}

    def remove(self, name: bytes) -> bool:
        """Keep what was there."""
        if name in self.store:
            self.old[name] = self.store.read(name)
        return super().remove(name)

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, content + self.old.pop(name, b"")[len(content) :])


@mutant("serves-the-last-upload", "5.2/12")
class ServesTheLastUpload(SendsAfterTheEnd):
    """Whichever file is asked for, the one that was uploaded last is sent."""

    last = b""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever it was
        """Keep its name."""
        self.last = name

    def download_name(self, request: Request) -> bool:
        """Send that."""
        name = request.value
        if name in self.store and self.last in self.store:
            name = self.last
        return super().download_name(replace(request, value=name))


@mutant("serves-afile-twice", "5.2/12", "5.3/2", subtle=True)
class ServesAFileTwice(ControllerCore):
    """A file can be fetched twice; after that it cannot be sent any more."""

    @cached_property
    def served(self) -> dict[bytes, int]:
        """What it remembers."""
        return {}

    def download_name(self, request: Request) -> bool:
        """Count."""
        name = request.value
        self.served[name] = self.served.get(name, 0) + 1
        return self.served[name] <= 2 and super().download_name(request)


@mutant("writes-the-last-chunk-late", "5.2/12", subtle=True)
class WritesTheLastChunkLate(SendsAfterTheEnd):
    """The last chunk of an upload is written when the next command comes that is no transfer."""

    pending: tuple[bytes, bytes] | None = None

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever it was
        """Keep the end back."""
        whole = self.store.read(name)
        if len(whole) > BUFFER_BYTES:
            self.pending = (name, whole)
            self.store.write(name, whole[: (len(whole) - 1) // BUFFER_BYTES * BUFFER_BYTES])

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Write it."""
        if self.pending and frame.opcode < _FIRST_OF_TRANSFERS:
            (name, whole), self.pending = self.pending, None
            if name in self.store:
                self.store.write(name, whole)
        super().handle(session, frame, now_s)


class _Shared(Receiver):
    """Writes into a buffer that is not its own."""

    buffer: dict[int, bytes]

    @property
    def content(self) -> bytes:
        """What is in the buffer."""
        return b"".join(self.buffer[position] for position in sorted(self._pieces))

    def take(self, data: bytes, now_s: float) -> bool | None:
        position = self.received_bytes
        taken = super().take(data, now_s)
        if taken:
            self.buffer[position] = self._pieces[position]
        return taken


@mutant("one-buffer-for-all-uploads", "5.2/12", subtle=True)
class OneBufferForAllUploads(JudgesChunks):
    """Two uploads at the same time write into one buffer."""

    @cached_property
    def buffer(self) -> dict[int, bytes]:
        """The one buffer."""
        return {}

    def judge(self, request: Request) -> Receiver:
        """Share it."""
        receiver = _Shared(request.now_s, self.dialect)
        receiver.buffer = self.buffer
        return receiver


class _Overwriting(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        again = chunk.legal and chunk.position < self.received_bytes
        return "" if again else super()._problem(chunk)

    def take(self, data: bytes, now_s: float) -> bool | None:
        before = self.received_bytes
        taken = super().take(data, now_s)
        if taken:
            self.received_bytes = max(before, *(p + len(d) for p, d in self._pieces.items()))
            self.state = State.DONE if self.received_bytes == self.size_bytes else State.ACTIVE
        return taken


@mutant("one-file-for-one-name", "5.2/12", subtle=True)
class OneFileForOneName(JudgesChunks):
    """Two connections that upload under one name at the same time write into one file."""

    receiver: ClassVar[type[Receiver]] = _Overwriting

    def upload_name(self, request: Request) -> bool:
        """Join the other."""
        others = [s.transfer for s in self.sessions.values() if s is not request.session]
        shared = next((t for t in others if t and t.name == request.value), None)
        if shared is None:
            return super().upload_name(request)
        request.session.transfer = shared
        return True


# Bytes that are changed


@mutant("content-ends-at-its-zeros", "5.2/14")
class ContentEndsAtItsZeros(AltersContent):
    """Zeros at the end of a file are taken for filler and lost."""

    def kept(self, content: bytes) -> bytes:
        """Strip them."""
        return content.rstrip(b"\0") or content[:1]


@mutant("content-is-text", "5.2/14")
class ContentIsText(AltersContent):
    """Files are opened as text: CR LF becomes LF."""

    def kept(self, content: bytes) -> bytes:
        """Translate."""
        return content.replace(b"\r\n", b"\n")


@mutant("content-has-seven-bits", "5.2/14")
class ContentHasSevenBits(AltersContent):
    """The highest bit of AA and of CC is lost: they are taken for delimiters."""

    def kept(self, content: bytes) -> bytes:
        """Mask it."""
        return content.replace(b"\xaa", b"\x2a").replace(b"\xcc", b"\x4c")


@mutant("frames-in-the-content-are-served", "5.2/14")
class FramesInTheContentAreServed(AltersContent):
    """A request within the content of a file is cut out of it."""

    def kept(self, content: bytes) -> bytes:
        """Cut it out."""
        return content.replace(b"\xaa\x09\x00\xcc", b"")


@mutant("bars-separate-content", "5.2/14")
class BarsSeparateContent(AltersContent):
    """A bar in the content separates fields, and is replaced by NUL."""

    def kept(self, content: bytes) -> bytes:
        """Replace it."""
        return content.replace(b"|", b"\0")


@mutant("single-zero-is-nothing", "5.2/14", subtle=True)
class SingleZeroIsNothing(AltersContent):
    """A file of a single NUL is taken for an empty string."""

    def kept(self, content: bytes) -> bytes:
        """Say so."""
        return b" " if content == b"\0" else content


# Sizes


@mutant("loses-the-last-byte-of-full-chunks", "5.2/16", "5.2/12", subtle=True)
class LosesTheLastByteOfFullChunks(AltersContent):
    """A file of a multiple of 200 bytes loses its last byte."""

    def kept(self, content: bytes) -> bytes:
        """Lose it."""
        return content if len(content) % BUFFER_BYTES else content[:-1]


@mutant("loses-asingle-last-byte", "5.2/16", "5.2/12", subtle=True)
class LosesASingleLastByte(AltersContent):
    """A last chunk of a single byte behind a full one is lost."""

    def kept(self, content: bytes) -> bytes:
        """Lose it."""
        lost = len(content) > 1 and len(content) % BUFFER_BYTES == 1
        return content[:-1] if lost else content


@mutant("loses-the-end-of-half-achunk", "5.2/16", "5.2/12", subtle=True)
class LosesTheEndOfHalfAChunk(AltersContent):
    """A last chunk of 60 to 110 bytes is moved in words, and its last bytes change places."""

    def kept(self, content: bytes) -> bytes:
        """Move them."""
        rest = len(content) % BUFFER_BYTES
        return content[:-2] + content[:-3:-1] if 60 <= rest <= 110 else content


class _Bounded(Receiver, ABC):
    """Refuses some chunks."""

    def _problem(self, chunk: Chunk) -> str:
        return "it is too large" if self.refuses(chunk) else super()._problem(chunk)

    @abstractmethod
    def refuses(self, chunk: Chunk) -> bool:
        """Whether there is no room for such a chunk."""


class _SixteenBits(_Bounded):
    def refuses(self, chunk: Chunk) -> bool:
        return chunk.position + chunk.length > chunk.file_size & 0xFFFF


@mutant("sixty-four-kibibytes-are-too-many", "5.2/16", subtle=True)
class SixtyFourKibibytesAreTooMany(JudgesChunks):
    """Of a file of 65,536 bytes or more the end is refused: its size does not fit 16 bits."""

    receiver: ClassVar[type[Receiver]] = _SixteenBits


class _CountingChunks(_Bounded):
    def refuses(self, chunk: Chunk) -> bool:
        return chunk.position >= 255 * BUFFER_BYTES


@mutant("counts-chunks-in-abyte", "5.2/16", subtle=True)
class CountsChunksInAByte(JudgesChunks):
    """The 256th chunk of a file is refused: chunks are counted in a byte."""

    receiver: ClassVar[type[Receiver]] = _CountingChunks


class _SizeUnknown(_Bounded):
    def refuses(self, chunk: Chunk) -> bool:
        return chunk.file_size == 2**16 - 1


@mutant("size-ffff-is-unknown", "5.2/16", subtle=True)
class SizeFfffIsUnknown(JudgesChunks):
    """A file of just 65,535 bytes is refused: FFFF stands for a size that is not known."""

    receiver: ClassVar[type[Receiver]] = _SizeUnknown


@mutant("positions-have-sixteen-bits", "5.2/16", "5.1/4", "5.1/8", subtle=True)
class PositionsHaveSixteenBits(AltersChunks):
    """Behind 65,535 the positions of a download begin again at 0."""

    def altered(self, chunk: Chunk) -> tuple[Chunk]:
        """Wrap."""
        return (chunk._replace(position=chunk.position & 0xFFFF),)


@mutant("loses-abyte-after-athousand-chunks", "5.2/16", "5.2/12", subtle=True)
class LosesAByteAfterAThousandChunks(ControllerCore):
    """From the thousandth chunk on that a controller has taken, a byte of each is zero."""

    chunks = 0

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Count, and spoil."""
        self.chunks += 1
        if self.chunks >= 1000 and len(request.frame.data) > HEAD_BYTES:
            data = bytearray(request.frame.data)
            data[HEAD_BYTES] = 0
            frame = request.frame._replace(data=bytes(data))
            request = replace(request, frame=frame)
        return super().upload_chunk(request)
