"""Faults of clause 5.2: the names of uploads and their chunks, and how they are answered."""

import posixpath
from functools import cached_property
from typing import ClassVar

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.transfers import (
    JudgesChunks,
    SendsAfterTheEnd,
)
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, Receiver, State
from scaraspec.virtual_controller.behaviour.base import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

UPLOAD_NAME, UPLOAD_CHUNK, DOWNLOAD_NAME, DELETE = 0x50, 0x52, 0x54, 0x0C
_NAMING = (UPLOAD_NAME, DOWNLOAD_NAME, DELETE)

# The name


@mutant("refuses-capitals", "5.2/2")
class RefusesCapitals(ControllerCore):
    """A name with a capital letter in it is refused."""

    def upload_name(self, request: Request) -> bool:
        """Look for one."""
        name: bytes = request.value
        return name == name.lower() and super().upload_name(request)


@mutant("refuses-thirty-bytes", "5.2/2", subtle=True)
class RefusesThirtyBytes(ControllerCore):
    """A name of 30 bytes is one too long: the limit is off by one."""

    def upload_name(self, request: Request) -> bool:
        """Count."""
        return len(request.value) < 30 and super().upload_name(request)


@mutant("cuts-names-to-thirty-bytes", "5.2/2")
class CutsNamesToThirtyBytes(ControllerCore):
    """A name is taken as its first 30 bytes, and answered as if it were whole."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Cut it."""
        if frame.opcode in _NAMING:
            frame = frame._replace(data=frame.data[:30])
        super().handle(session, frame, now_s)


@mutant("accepts-no-name", "5.2/2")
class AcceptsNoName(ControllerCore):
    """An upload without a name is accepted, under a name of the controller's own."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Name it."""
        if frame.opcode == UPLOAD_NAME and not frame.data:
            frame = frame._replace(data=b"noname.rob")
        super().handle(session, frame, now_s)


@mutant("runs-out-of-file-numbers", "5.2/2", "5.4/1", subtle=True)
class RunsOutOfFileNumbers(ControllerCore):
    """After 30 uploads no name is accepted any more, though files were deleted meanwhile."""

    uploads = 0

    def upload_name(self, request: Request) -> bool:
        """Count."""
        accepted = self.uploads < 30 and super().upload_name(request)
        self.uploads += accepted
        return accepted


@mutant("answers-names-twice", "5.2/2", subtle=True)
class AnswersNamesTwice(ControllerCore):
    """After the tenth name is accepted, each one is answered a second time."""

    names = 0

    def upload_name(self, request: Request) -> bool:
        """Answer again, later."""
        accepted = super().upload_name(request)
        self.names += accepted
        if accepted and self.names > 10:
            self.send_after_reply(request.session, Frame(C2A, UPLOAD_NAME, b"1"))
        return accepted


@mutant("empties-before-it-refuses", "5.2/3")
class EmptiesBeforeItRefuses(ControllerCore):
    """A name that is taken is answered 0, but its file has been opened for writing and is lost."""

    def upload_name(self, request: Request) -> bool:
        """Keep one byte."""
        if request.value in self.store:
            self.store.write(request.value, self.store.read(request.value)[:1])
        return super().upload_name(request)


@mutant("refuses-ataken-name-once", "5.2/3", "5.1/10", "5.4/2", subtle=True)
class RefusesATakenNameOnce(ControllerCore):
    """A name that is taken is refused the first time; the second time it is accepted."""

    @cached_property
    def refused(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def upload_name(self, request: Request) -> bool:
        """Remember refusals."""
        name = request.value
        if name in self.refused:
            self.refused.discard(name)
            self.remove(name)
        elif name in self.store:
            self.refused.add(name)
        return super().upload_name(request)


@mutant("knows-only-its-own-files", "5.2/3", subtle=True)
class KnowsOnlyItsOwnFiles(SendsAfterTheEnd):
    """Only a name that this connection has uploaded counts as taken."""

    @cached_property
    def owners(self) -> dict[bytes, int]:
        """What it remembers."""
        return {}

    def uploaded(self, session: Session, name: bytes) -> None:
        """Remember whose it is."""
        self.owners[name] = session.connection

    def upload_name(self, request: Request) -> bool:
        """Look whose it is."""
        if self.owners.get(request.value) != request.session.connection:
            self.remove(request.value)
        return super().upload_name(request)


# Names that are paths


def _resolved(name: bytes) -> bytes:
    return posixpath.basename(posixpath.normpath(name))


@mutant("resolves-paths", "5.2/15")
class ResolvesPaths(ControllerCore):
    """A path in a new name is followed."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Follow it."""
        if frame.opcode == UPLOAD_NAME:
            frame = frame._replace(data=_resolved(frame.data))
        super().handle(session, frame, now_s)


@mutant("follows-paths-to-files", "5.2/15")
class FollowsPathsToFiles(ControllerCore):
    """A path that leads to a stored file fetches it."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Follow it."""
        if frame.opcode == DOWNLOAD_NAME:
            frame = frame._replace(data=_resolved(frame.data))
        super().handle(session, frame, now_s)


@mutant("backslashes-are-paths", "5.2/15")
class BackslashesArePaths(ControllerCore):
    """A backslash in a name is followed as a path, a slash is not."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Follow it."""
        if frame.opcode == DOWNLOAD_NAME:
            frame = frame._replace(data=frame.data.rpartition(b"\\")[2])
        super().handle(session, frame, now_s)


@mutant("backslashes-of-new-names-are-paths", "5.2/15", subtle=True)
class BackslashesOfNewNamesArePaths(ControllerCore):
    """A backslash in a new name is followed as a path, a slash is not."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Follow it."""
        if frame.opcode == UPLOAD_NAME:
            frame = frame._replace(data=frame.data.rpartition(b"\\")[2])
        super().handle(session, frame, now_s)


@mutant("serves-the-whole-disk", "5.2/15")
class ServesTheWholeDisk(ControllerCore):
    """A path that leaves the store fetches files of the operating system."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve the usual one."""
        if frame.opcode != DOWNLOAD_NAME or not frame.data.endswith(b"/etc/passwd"):
            super().handle(session, frame, now_s)
            return
        self.emit(session, Frame(C2A, DOWNLOAD_NAME, b"1"))
        self._send_chunk(session, Chunk(12, 0, 12, b"root:x:0:0::"))
        self._send_deferred()


# The answers to chunks


@mutant("answers-the-last-chunk-twice", "5.2/6")
class AnswersTheLastChunkTwice(SendsAfterTheEnd):
    """The last chunk is answered as a chunk, and once more as the end of the file."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whichever it was
        """Answer again."""
        self.send_after_reply(session, Frame(C2A, UPLOAD_CHUNK, b"1"))


@mutant("answers-chunks-with-their-length", "5.2/6")
class AnswersChunksWithTheirLength(ControllerCore):
    """A chunk that was taken is answered with the number of bytes written."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write the number."""
        if frame.opcode == UPLOAD_CHUNK and frame.data == b"1":
            frame = frame._replace(data=b"200")
        super().emit(session, frame)


@mutant("silent-about-bad-chunks", "5.2/6")
class SilentAboutBadChunks(ControllerCore):
    """A chunk that cannot be taken gets no answer."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Say nothing."""
        return super().upload_chunk(request) or SILENCE


# Bounds


class _Clipping(Receiver):
    """Takes what fits of a chunk that is too long."""

    def take(self, data: bytes, now_s: float) -> bool | None:
        chunk = FILE_DATA.decode(data).value
        if chunk is not None and self.clips(chunk):
            length = min(BUFFER_BYTES, chunk.file_size - chunk.position)
            buffer = chunk.buffer[:BUFFER_BYTES]
            data = FILE_DATA.encode(chunk._replace(length=max(length, 0), buffer=buffer))
        return super().take(data, now_s)

    def clips(self, chunk: Chunk) -> bool:
        """Whether this one is cut to what fits."""
        return chunk.length > BUFFER_BYTES


@mutant("clips-long-chunks", "5.2/10")
class ClipsLongChunks(JudgesChunks):
    """Of a chunk with a length over 200 the first 200 bytes are taken."""

    receiver: ClassVar[type[Receiver]] = _Clipping


class _ClippingFrames(_Clipping):
    def clips(self, chunk: Chunk) -> bool:
        return BUFFER_BYTES < chunk.length == len(chunk.buffer)


@mutant("takes-long-frames", "5.2/10", subtle=True)
class TakesLongFrames(JudgesChunks):
    """A chunk is taken with as many bytes as a frame can hold, if it really brings them."""

    receiver: ClassVar[type[Receiver]] = _ClippingFrames


class _ClippingEnds(_Clipping):
    def clips(self, chunk: Chunk) -> bool:
        return chunk.length <= BUFFER_BYTES and 0 < chunk.file_size - chunk.position < chunk.length


@mutant("clips-at-the-end-of-the-file", "5.2/10", subtle=True)
class ClipsAtTheEndOfTheFile(JudgesChunks):
    """Of a chunk that reaches beyond fileSize the part that fits is taken."""

    receiver: ClassVar[type[Receiver]] = _ClippingEnds


class _ThirtyTwoBits(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        end = (chunk.position + chunk.length) % 2**32
        in_bounds = 1 <= chunk.length <= BUFFER_BYTES and end <= chunk.file_size
        overflows = chunk.position + chunk.length >= 2**32
        return "" if in_bounds and overflows else super()._problem(chunk)


@mutant("adds-in-thirty-two-bits", "5.2/10", subtle=True)
class AddsInThirtyTwoBits(JudgesChunks):
    """Position and length are added in 32 bits: a sum that overflows passes the check."""

    receiver: ClassVar[type[Receiver]] = _ThirtyTwoBits


# Chunks that belong to nothing


@mutant("answers-stray-chunks-with-one", "5.2/11", subtle=True)
class AnswersStrayChunksWithOne(ControllerCore):
    """After a first upload, a chunk that belongs to no transfer is answered 1 and dropped."""

    uploaded = False

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Say yes."""
        self.uploaded = self.uploaded or request.session.transfer is not None
        stray = request.session.transfer is None and bool(request.value and request.value.legal)
        return super().upload_chunk(request) or (self.uploaded and stray)


@mutant("appends-behind-the-end", "5.2/11")
class AppendsBehindTheEnd(SendsAfterTheEnd):
    """A chunk behind the last one is appended to the file."""

    last = b""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever it was
        """Keep the name."""
        self.last = name

    def upload_name(self, request: Request) -> bool:
        """Forget the name."""
        self.last = b""
        return super().upload_name(request)

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Append."""
        if request.session.transfer is None and self.last in self.store and request.value:
            self.store.write(self.last, self.store.read(self.last) + request.value.data)
            return True
        return super().upload_chunk(request)


@mutant("refused-names-take-chunks", "5.2/11")
class RefusedNamesTakeChunks(ControllerCore):
    """A chunk behind a refused name is answered 1, though nothing is written."""

    refused = False

    def upload_name(self, request: Request) -> bool:
        """Remember it."""
        accepted = super().upload_name(request)
        self.refused = not accepted
        return accepted

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Say yes once."""
        refused, self.refused = self.refused, False
        return super().upload_chunk(request) or refused


@mutant("takes-chunks-while-it-sends", "5.2/11")
class TakesChunksWhileItSends(ControllerCore):
    """A chunk that comes during a download is answered 1."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Say yes."""
        transfer = request.session.transfer
        sends = transfer is not None and not isinstance(transfer.end, Receiver)
        return super().upload_chunk(request) or sends


@mutant("one-upload-for-all-connections", "5.2/11", subtle=True)
class OneUploadForAllConnections(ControllerCore):
    """A chunk goes into whatever upload is under way, on whichever connection it comes."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Lend it."""
        session = request.session
        owner = next((s for s in self.sessions.values() if s.transfer), session)
        if session.transfer is None and owner is not session:
            session.transfer = owner.transfer
            taken = super().upload_chunk(request)
            session.transfer = None
            return taken
        return super().upload_chunk(request)


@mutant("uploads-outlive-their-connection", "5.2/11", subtle=True)
class UploadsOutliveTheirConnection(ControllerCore):
    """An upload whose connection is lost goes on on the next one."""

    orphan: OpenTransfer | None = None

    def abort_transfer(self, session: Session) -> None:
        """Keep it."""
        transfer = session.transfer
        if transfer and isinstance(transfer.end, Receiver) and transfer.end.received_bytes:
            self.orphan = transfer if transfer.end.state is State.ACTIVE else None
        super().abort_transfer(session)

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Take it up."""
        if request.session.transfer is None and self.orphan:
            request.session.transfer, self.orphan = self.orphan, None
        return super().upload_chunk(request)


@mutant("tells-the-result-of-uploads", "5.2/13")
class TellsTheResultOfUploads(SendsAfterTheEnd):
    """Behind the last answer of an upload comes a final result, as of a two-stage command."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whichever it was
        """Send one."""
        self.send_after_reply(session, Frame(C2A, UPLOAD_CHUNK, b"11", tagged=True))


@mutant("confirms-downloads", "5.2/13")
class ConfirmsDownloads(SendsAfterTheEnd):
    """Behind the last answer of a download comes a 0x54 with 1: the file has been sent."""

    def downloaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whichever it was
        """Send one."""
        self.send_after_reply(session, Frame(C2A, DOWNLOAD_NAME, b"1"))
