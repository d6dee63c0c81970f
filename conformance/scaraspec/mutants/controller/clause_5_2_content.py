"""Mutants of clause 5.2: the stored content of an upload and its size."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.transfers import (
    SendsAfterTheEnd,
    receives,
    sent_chunk,
    stored,
)
from scaraspec.mutants.operators.receivers import judging
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, HEAD_BYTES, Chunk, Receiver, TransferState
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

_FIRST_OF_TRANSFERS = 0x50


@mutant("serves-what-it-read-first", "5.2/12", subtle=True)
class CachesFiles(ControllerCore):
    """The content of the first download of a name is sent forever, even if the file is replaced."""

    _cache: Mapping[bytes, bytes] = MappingProxyType({})

    def download_name(self, request: Request) -> bool:
        name = request.value
        if name not in self.store:
            return super().download_name(request)
        content = self.store.read(name)
        self._cache = {name: content, **self._cache}
        self.store.write(name, self._cache[name])
        accepted = super().download_name(request)
        self.store.write(name, content)
        return accepted


def _blank_frame_ends(content: bytes) -> bytes:
    chunks = [content[at : at + BUFFER_BYTES] for at in range(0, len(content), BUFFER_BYTES)]
    later = (
        chunk[:-2] + bytes(2) if chunk.endswith(b"\xaa\xcc") else chunk for chunk in chunks[1:]
    )
    return b"".join((*chunks[:1], *later))


row(
    "spoils127-bytes",
    "5.2/16",
    "One bit of a file of 127 bytes is changed.",
    stored(
        lambda content: bytes((content[0] ^ 1,)) + content[1:] if len(content) == 0x7F else content
    ),
    subtle=True,
)
row(
    "takes-an-end-for-the-end",
    "5.2/14",
    "The bytes AA CC at the end of a chunk, except the first, are replaced by zeros.",
    stored(_blank_frame_ends),
    subtle=True,
)


@mutant("keeps-the-tail-of-the-old-file", "5.2/12", subtle=True)
class KeepsTailOfDeletedFile(ControllerCore):
    """A file that is shorter than a deleted file of this name keeps the end of the deleted one."""

    @cached_property
    def _deleted(self) -> dict[bytes, bytes]:
        return {}

    def remove(self, name: bytes) -> bool:
        if name in self.store:
            self._deleted[name] = self.store.read(name)
        return super().remove(name)

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, content + self._deleted.pop(name, b"")[len(content) :])


@mutant("serves-the-last-upload", "5.2/12")
class ServesLastUpload(SendsAfterTheEnd):
    """Any download of a stored file sends the file that was uploaded last."""

    _last = b""

    def uploaded(self, _session: Session, name: bytes) -> None:
        self._last = name

    def download_name(self, request: Request) -> bool:
        name = request.value
        if name in self.store and self._last in self.store:
            name = self._last
        return super().download_name(replace(request, value=name))


@mutant("serves-afile-twice", "5.2/12", "5.3/2", subtle=True)
class ServesFilesTwice(ControllerCore):
    """A file can be downloaded twice; after that its downloads are refused."""

    _requests: tuple[bytes, ...] = ()

    def download_name(self, request: Request) -> bool:
        self._requests += (request.value,)
        return self._requests.count(request.value) <= 2 and super().download_name(request)


@mutant("writes-the-last-chunk-late", "5.2/12", subtle=True)
class WritesLastChunkLate(SendsAfterTheEnd):
    """The last chunk of an upload is written when the next command arrives that is no transfer."""

    _pending: tuple[bytes, bytes] | None = None

    def uploaded(self, _session: Session, name: bytes) -> None:
        whole = self.store.read(name)
        if len(whole) > BUFFER_BYTES:
            self._pending = (name, whole)
            self.store.write(name, whole[: (len(whole) - 1) // BUFFER_BYTES * BUFFER_BYTES])

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if self._pending and frame.opcode < _FIRST_OF_TRANSFERS:
            (name, whole), self._pending = self._pending, None
            if name in self.store:
                self.store.write(name, whole)
        super().handle(session, frame, now_s)


class _SharedBuffer(Receiver):
    buffer: dict[int, bytes]

    @property
    def content(self) -> bytes:
        return b"".join(self.buffer[position] for position in sorted(self._pieces))

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        position = self.received_bytes
        taken = super().receive_chunk(data, now_s)
        if taken:
            self.buffer[position] = self._pieces[position]
        return taken


@mutant("one-buffer-for-all-uploads", "5.2/12", subtle=True)
class SharesBuffer(ControllerCore):
    """Two uploads at the same time are written into one buffer."""

    @cached_property
    def _buffer(self) -> dict[int, bytes]:
        return {}

    def upload_name(self, request: Request) -> bool:
        accepted = super().upload_name(request)
        if accepted:
            receiver = _SharedBuffer(request.now_s, self.dialect)
            receiver.buffer = self._buffer
            request.session.transfer = OpenTransfer(request.value, receiver)
        return accepted


class _Overwrites(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        again = chunk.legal and chunk.position < self.received_bytes
        return "" if again else super()._problem(chunk)

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        before = self.received_bytes
        taken = super().receive_chunk(data, now_s)
        if taken:
            self.received_bytes = max(before, *(p + len(d) for p, d in self._pieces.items()))
            self.state = (
                TransferState.DONE
                if self.received_bytes == self.size_bytes
                else TransferState.ACTIVE
            )
        return taken


class _JoinsUpload(ControllerCore):
    def upload_name(self, request: Request) -> bool:
        others = [s.transfer for s in self.sessions.values() if s is not request.session]
        shared = next((t for t in others if t and t.name == request.value), None)
        if shared is None:
            return super().upload_name(request)
        request.session.transfer = shared
        return True


row(
    "one-file-for-one-name",
    "5.2/12",
    "Two connections that upload the same name at the same time write into one file.",
    _JoinsUpload,
    receives(_Overwrites),
    subtle=True,
)

# Changed bytes

row(
    "content-ends-at-its-zeros",
    "5.2/14",
    "Zeros at the end of a file are removed as padding.",
    stored(lambda content: content.rstrip(b"\0") or content[:1]),
)
row(
    "content-is-text",
    "5.2/14",
    "Files are opened as text: CR LF becomes LF.",
    stored(lambda content: content.replace(b"\r\n", b"\n")),
)
row(
    "content-has-seven-bits",
    "5.2/14",
    "The highest bit of AA and CC in the content is cleared.",
    stored(lambda content: content.replace(b"\xaa", b"\x2a").replace(b"\xcc", b"\x4c")),
)
row(
    "frames-in-the-content-are-served",
    "5.2/14",
    "A request frame within the content of a file is removed from it.",
    stored(lambda content: content.replace(b"\xaa\x09\x00\xcc", b"")),
)
row(
    "bars-separate-content",
    "5.2/14",
    "A bar in the content is replaced by NUL.",
    stored(lambda content: content.replace(b"|", b"\0")),
)
row(
    "single-zero-is-nothing",
    "5.2/14",
    "A file that consists of a single NUL is stored as a space.",
    stored(lambda content: b" " if content == b"\0" else content),
    subtle=True,
)

# Sizes


def _lose_single_byte(content: bytes) -> bytes:
    return content[:-1] if len(content) > 1 and len(content) % BUFFER_BYTES == 1 else content


def _swap_last_bytes(content: bytes) -> bytes:
    rest = len(content) % BUFFER_BYTES
    return content[:-2] + content[:-3:-1] if 60 <= rest <= 110 else content


row(
    "loses-the-last-byte-of-full-chunks",
    "5.2/16 5.2/12",
    "A file of a multiple of 200 bytes loses its last byte.",
    stored(lambda content: content if len(content) % BUFFER_BYTES else content[:-1]),
    subtle=True,
)
row(
    "loses-asingle-last-byte",
    "5.2/16 5.2/12",
    "A last chunk of a single byte is lost if a full chunk precedes it.",
    stored(_lose_single_byte),
    subtle=True,
)
row(
    "loses-the-end-of-half-achunk",
    "5.2/16 5.2/12",
    "The last two bytes of a last chunk of 60 to 110 bytes are swapped.",
    stored(_swap_last_bytes),
    subtle=True,
)
row(
    "sixty-four-kibibytes-are-too-many",
    "5.2/16",
    "The end of a file of 65,536 bytes or more is refused: its size does not fit into 16 bits.",
    receives(
        judging(refuses=lambda _, chunk: chunk.position + chunk.length > chunk.file_size & 0xFFFF)
    ),
    subtle=True,
)
row(
    "counts-chunks-in-abyte",
    "5.2/16",
    "The 256th chunk of a file is refused: chunks are counted in one byte.",
    receives(judging(refuses=lambda _, chunk: chunk.position >= 255 * BUFFER_BYTES)),
    subtle=True,
)
row(
    "size-ffff-is-unknown",
    "5.2/16",
    "A file of exactly 65,535 bytes is refused: FFFF means an unknown size.",
    receives(judging(refuses=lambda _, chunk: chunk.file_size == 2**16 - 1)),
    subtle=True,
)
row(
    "positions-have-sixteen-bits",
    "5.2/16 5.1/4 5.1/8",
    "After 65,535 the positions of a download start again at 0.",
    sent_chunk(lambda chunk: chunk._replace(position=chunk.position & 0xFFFF)),
    subtle=True,
)


@mutant("loses-abyte-after-athousand-chunks", "5.2/16", "5.2/12", subtle=True)
class DamagesLateChunks(ControllerCore):
    """From the thousandth received chunk on, the first byte of each chunk is zero."""

    _chunks = 0

    def upload_chunk(self, request: Request) -> bool | Silence:
        self._chunks += 1
        if self._chunks >= 1000 and len(request.frame.data) > HEAD_BYTES:
            data = bytearray(request.frame.data)
            data[HEAD_BYTES] = 0
            request = replace(request, frame=request.frame._replace(data=bytes(data)))
        return super().upload_chunk(request)
