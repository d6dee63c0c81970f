"""Mutants of clause 5.2: the names of uploads, their chunks and the replies."""

import posixpath
from collections.abc import Callable, Mapping
from types import MappingProxyType
from urllib.parse import unquote_to_bytes

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    after,
    answer,
    answer_when,
    before,
    reads,
)
from scaraspec.mutants.operators.controller.transfers import (
    SendsAfterTheEnd,
    after_download,
    after_upload,
    receives,
    sender_of,
)
from scaraspec.mutants.operators.receivers import judging, taking
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, Chunk, Receiver, TransferState
from scaraspec.virtual_controller.behaviour.base import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

UPLOAD_NAME, UPLOAD_CHUNK, DOWNLOAD_NAME = 0x50, 0x52, 0x54

# The name


def _first_thirty(data: bytes) -> bytes:
    return data[:30]


row(
    "refuses-capitals",
    "5.2/2",
    "A name that contains a capital letter is refused.",
    answer_when(
        "upload_name", lambda _, request: request.value != request.value.lower(), value=False
    ),
)


def _in_names(change: Callable[[bytes], bytes]) -> tuple[Core, ...]:
    """File names are changed in the requests of uploads, downloads and deletions."""
    names = ("upload_name", "download_name", "delete_program")
    return tuple(reads(name, change) for name in names)


def _overwrite_other_case(core: ControllerCore, request: Request) -> None:
    if request.frame.data != request.value:
        core.remove(request.value)


row(
    "drops-blanks-in-new-names",
    "5.2/12",
    "A file whose name has a blank is stored under the name without it.",
    reads("upload_name", lambda data: data.replace(b" ", b"")),
    subtle=True,
)
row(
    "decodes-percent-signs",
    "4.10/11",
    "A percent sign with two digits in a name is decoded, as in URLs.",
    *_in_names(unquote_to_bytes),
    subtle=True,
)
row(
    "ignores-letter-case",
    "5.2/12",
    "Names are stored in lower case; a name in another case overwrites the file.",
    *_in_names(bytes.lower),
    before("upload_name", _overwrite_other_case),
    subtle=True,
)
row(
    "refuses-thirty-bytes",
    "5.2/2",
    "A name of 30 bytes is refused as too long.",
    answer_when("upload_name", lambda _, request: len(request.value) >= 30, value=False),
    subtle=True,
)
row(
    "cuts-names-to-thirty-bytes",
    "5.2/2",
    "Only the first 30 bytes of a name are used, and the request is answered as usual.",
    reads("upload_name", _first_thirty),
    reads("download_name", _first_thirty),
    reads("delete_program", _first_thirty),
)
row(
    "accepts-no-name",
    "5.2/2",
    "An upload without a name is accepted and gets a fixed name.",
    reads("upload_name", lambda data: data or b"noname.rob"),
)


@mutant("runs-out-of-file-numbers", "5.2/2", "5.4/1", subtle=True)
class AcceptsThirtyUploads(ControllerCore):
    """After 30 uploads every name is refused, although files have been deleted."""

    _uploads = 0

    def upload_name(self, request: Request) -> bool:
        accepted = self._uploads < 30 and super().upload_name(request)
        self._uploads += accepted
        return accepted


@mutant("answers-names-twice", "5.2/2", subtle=True)
class AnswersNamesTwice(ControllerCore):
    """After ten accepted names, the reply to each accepted name is sent twice."""

    _names = 0

    def upload_name(self, request: Request) -> bool:
        accepted = super().upload_name(request)
        self._names += accepted
        if accepted and self._names > 10:
            self.send_after_reply(request.session, Frame(C2A, UPLOAD_NAME, b"1"))
        return accepted


def _truncate_file(core: ControllerCore, request: Request) -> None:
    if request.value in core.store:
        core.store.write(request.value, core.store.read(request.value)[:1])


row(
    "empties-before-it-refuses",
    "5.2/3",
    "A name that is taken is answered 0, but its file is opened for writing and loses its content.",
    before("upload_name", _truncate_file),
)


@mutant("refuses-ataken-name-once", "5.2/3", "5.1/10", "5.4/2", subtle=True)
class RefusesTakenNamesOnce(ControllerCore):
    """A name that is taken is refused the first time; the second time it is accepted."""

    _refused: frozenset[bytes] = frozenset()

    def upload_name(self, request: Request) -> bool:
        name = request.value
        if name in self._refused:
            self._refused -= {name}
            self.remove(name)
        elif name in self.store:
            self._refused |= {name}
        return super().upload_name(request)


@mutant("knows-only-its-own-files", "5.2/3", subtle=True)
class OverwritesFilesOfOthers(SendsAfterTheEnd):
    """Only a name that the same connection has uploaded counts as taken."""

    _owners: Mapping[bytes, int] = MappingProxyType({})

    def uploaded(self, session: Session, name: bytes) -> None:
        self._owners = {**self._owners, name: session.connection}

    def upload_name(self, request: Request) -> bool:
        if self._owners.get(request.value) != request.session.connection:
            self.remove(request.value)
        return super().upload_name(request)


# Names that are paths


def _resolved(name: bytes) -> bytes:
    return posixpath.basename(posixpath.normpath(name))


def _after_backslash(name: bytes) -> bytes:
    return name.rpartition(b"\\")[2]


row(
    "resolves-paths",
    "5.2/15",
    "A path in the name of an upload is followed.",
    reads("upload_name", _resolved),
)
row(
    "follows-paths-to-files",
    "5.2/15",
    "A path to a stored file in a download request is followed.",
    reads("download_name", _resolved),
)
row(
    "backslashes-are-paths",
    "5.2/15",
    "A backslash in a download request separates folders; a slash does not.",
    reads("download_name", _after_backslash),
)
row(
    "backslashes-of-new-names-are-paths",
    "5.2/15",
    "A backslash in the name of an upload separates folders; a slash does not.",
    reads("upload_name", _after_backslash),
    subtle=True,
)


@mutant("serves-the-whole-disk", "5.2/15")
class ServesSystemFiles(ControllerCore):
    """A path that leads out of the store downloads files of the operating system."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode != DOWNLOAD_NAME or not frame.data.endswith(b"/etc/passwd"):
            super().handle(session, frame, now_s)
            return
        self.emit(session, Frame(C2A, DOWNLOAD_NAME, b"1"))
        self._send_chunk(session, Chunk(12, 0, 12, b"root:x:0:0::"))
        self._send_deferred()


# Replies to chunks

row(
    "answers-the-last-chunk-twice",
    "5.2/6",
    "The last chunk is answered twice: as a chunk and as the end of the file.",
    after_upload(
        lambda core, session, _: core.send_after_reply(session, Frame(C2A, UPLOAD_CHUNK, b"1"))
    ),
)
row(
    "answers-chunks-with-their-length",
    "5.2/6",
    "An accepted chunk is answered with the number of bytes written.",
    first_reply("upload_chunk", {b"1": b"200"}),
)
row(
    "silent-about-bad-chunks",
    "5.2/6",
    "A chunk that cannot be accepted is not answered.",
    answer("upload_chunk", lambda taken: taken or SILENCE),
)

# Bounds


def _clips(when: Callable[[Chunk], bool]) -> Core:
    """Chunks are cut to the buffer and the end of the file, if the condition holds."""

    def clip(chunk: Chunk) -> Chunk:
        if not when(chunk):
            return chunk
        length = max(min(BUFFER_BYTES, chunk.file_size - chunk.position), 0)
        return chunk._replace(length=length, buffer=chunk.buffer[:BUFFER_BYTES])

    return receives(taking(clip))


def _overflows(_: Receiver, chunk: Chunk) -> bool:
    end = chunk.position + chunk.length
    return 1 <= chunk.length <= BUFFER_BYTES and 2**32 <= end <= 2**32 + chunk.file_size


row(
    "clips-long-chunks",
    "5.2/10",
    "The first 200 bytes of a chunk with a length over 200 are accepted.",
    _clips(lambda chunk: chunk.length > BUFFER_BYTES),
)
row(
    "takes-long-frames",
    "5.2/10",
    "A chunk whose frame really contains more than 200 bytes is accepted with the first 200.",
    _clips(lambda chunk: BUFFER_BYTES < chunk.length == len(chunk.buffer)),
    subtle=True,
)
row(
    "clips-at-the-end-of-the-file",
    "5.2/10",
    "The part that fits of a chunk that reaches beyond fileSize is accepted.",
    _clips(
        lambda chunk: (
            chunk.length <= BUFFER_BYTES and 0 < chunk.file_size - chunk.position < chunk.length
        )
    ),
    subtle=True,
)
row(
    "adds-in-thirty-two-bits",
    "5.2/10",
    "Position and length are added in 32 bits: a sum that overflows passes the check.",
    receives(judging(accepts=_overflows)),
    subtle=True,
)

# Chunks without an upload


@mutant("answers-stray-chunks-with-one", "5.2/11", subtle=True)
class AcceptsStrayChunks(ControllerCore):
    """After the first upload, a chunk that belongs to no transfer is answered 1 and discarded."""

    _uploaded = False

    def upload_chunk(self, request: Request) -> bool | Silence:
        self._uploaded = self._uploaded or request.session.transfer is not None
        stray = request.session.transfer is None and bool(request.value and request.value.legal)
        return super().upload_chunk(request) or (self._uploaded and stray)


@mutant("appends-behind-the-end", "5.2/11")
class AppendsAfterTheEnd(SendsAfterTheEnd):
    """A chunk that follows the last one is appended to the file."""

    _last = b""

    def uploaded(self, _session: Session, name: bytes) -> None:
        self._last = name

    def upload_name(self, request: Request) -> bool:
        self._last = b""
        return super().upload_name(request)

    def upload_chunk(self, request: Request) -> bool | Silence:
        if request.session.transfer is None and self._last in self.store and request.value:
            self.store.write(self._last, self.store.read(self._last) + request.value.data)
            return True
        return super().upload_chunk(request)


@mutant("refused-names-take-chunks", "5.2/11")
class AcceptsChunksAfterRefusedNames(ControllerCore):
    """A chunk that follows a refused name is answered 1, although nothing is written."""

    _refused = False

    def upload_name(self, request: Request) -> bool:
        accepted = super().upload_name(request)
        self._refused = not accepted
        return accepted

    def upload_chunk(self, request: Request) -> bool | Silence:
        refused, self._refused = self._refused, False
        return super().upload_chunk(request) or refused


row(
    "takes-chunks-while-it-sends",
    "5.2/11",
    "A chunk that arrives during a download is answered 1.",
    after(
        "upload_chunk",
        lambda _, request, taken: taken or sender_of(request.session) is not None,
    ),
)


@mutant("one-upload-for-all-connections", "5.2/11", subtle=True)
class SharesUploads(ControllerCore):
    """A chunk goes into any upload in progress, whichever connection it arrives on."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        session = request.session
        owner = next((s for s in self.sessions.values() if s.transfer), session)
        if session.transfer is None and owner is not session:
            session.transfer = owner.transfer
            taken = super().upload_chunk(request)
            session.transfer = None
            return taken
        return super().upload_chunk(request)


@mutant("uploads-outlive-their-connection", "5.2/11", subtle=True)
class ResumesLostUploads(ControllerCore):
    """An upload whose connection was lost continues on the next connection."""

    _orphan: OpenTransfer | None = None

    def abort_transfer(self, session: Session) -> None:
        transfer = session.transfer
        if transfer and isinstance(transfer.end, Receiver) and transfer.end.received_bytes:
            self._orphan = transfer if transfer.end.state is TransferState.ACTIVE else None
        super().abort_transfer(session)

    def upload_chunk(self, request: Request) -> bool | Silence:
        if request.session.transfer is None and self._orphan:
            request.session.transfer, self._orphan = self._orphan, None
        return super().upload_chunk(request)


# Frames after the end

row(
    "tells-the-result-of-uploads",
    "5.2/13",
    "A final result follows the last reply of an upload, as for a two-stage command.",
    after_upload(
        lambda core, session, _: core.send_after_reply(
            session, Frame(C2A, UPLOAD_CHUNK, b"11", tagged=True)
        )
    ),
)
row(
    "confirms-downloads",
    "5.2/13",
    "A 0x54 frame with 1 follows the last acknowledgement of a download.",
    after_download(
        lambda core, session, _: core.send_after_reply(session, Frame(C2A, DOWNLOAD_NAME, b"1"))
    ),
)
