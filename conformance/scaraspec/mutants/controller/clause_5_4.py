"""Mutants of clause 5.4: the receiver, the end of a transfer, and aborted transfers."""

import struct
from collections.abc import Callable
from functools import cached_property
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.requests import after, answer_when
from scaraspec.mutants.operators.controller.transfers import (
    SendsAfterTheEnd,
    receiver_of,
    receives,
    sender_of,
)
from scaraspec.mutants.operators.receivers import judging, timing_out
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.transfer import BUFFER_BYTES, HEAD_BYTES, Receiver, TransferState
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

_TRANSFERS = (0x50, 0x52, 0x54, 0x56)
_LOGIN = 0x01
_NO_PROGRAMS = NameListPart(more=False, names=())

# The name


class _RefusesNames(ControllerCore):
    """Refuses the names of uploads that are in `refused`."""

    refused: frozenset[bytes] = frozenset()

    def upload_name(self, request: Request) -> bool:
        return request.value not in self.refused and super().upload_name(request)


@mutant("deleted-names-stay-taken", "5.4/1", subtle=True)
class RefusesDeletedNames(_RefusesNames):
    """A name that was once deleted is never accepted again."""

    def delete_program(self, request: Request) -> bool:
        deleted = super().delete_program(request)
        if deleted:
            self.refused |= {request.value}
        return deleted


@mutant("names-asked-for-in-vain-are-taken", "5.4/1", subtle=True)
class RefusesMissingNames(_RefusesNames):
    """The name of a missing file is refused for uploads after a download of it was requested."""

    def download_name(self, request: Request) -> bool:
        if request.value not in self.store:
            self.refused |= {request.value}
        return super().download_name(request)


row(
    "only-the-oldest-connection-creates",
    "5.4/1",
    "A file is created for the oldest connection only; the others are answered 0.",
    answer_when(
        "upload_name",
        lambda core, request: request.session.connection != min(core.sessions),
        value=False,
    ),
    subtle=True,
)


@mutant("broken-uploads-block-their-name", "5.4/1", subtle=True)
class RefusesAbortedNames(_RefusesNames):
    """The name of an aborted upload stays taken forever, although there is no file."""

    def abort_transfer(self, session: Session) -> None:
        if session.transfer is not None and receiver_of(session):
            self.refused |= {session.transfer.name}
        super().abort_transfer(session)


@mutant("signalled-uploads-block-their-name", "5.4/1", subtle=True)
class RefusesSignalledNames(_RefusesNames):
    """The name of an upload that ended with an empty chunk stays taken forever."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        if not request.frame.data and request.session.transfer is not None:
            self.refused |= {request.session.transfer.name}
        return super().upload_chunk(request)


@mutant("fetched-names-are-free", "5.4/2", "5.2/3", "5.1/10", subtle=True)
class OverwritesDownloadedFiles(SendsAfterTheEnd):
    """A file that was completely downloaded may be overwritten."""

    _downloaded: frozenset[bytes] = frozenset()

    def downloaded(self, _session: Session, name: bytes) -> None:
        self._downloaded |= {name}

    def upload_name(self, request: Request) -> bool:
        if request.value in self._downloaded:
            self.remove(request.value)
        return super().upload_name(request)


@mutant("knows-the-last-ten-names", "5.4/2", "5.2/3", "5.1/10", subtle=True)
class OverwritesOldFiles(SendsAfterTheEnd):
    """Only the names of the last ten uploads count as taken."""

    _latest: tuple[bytes, ...] = ()

    def uploaded(self, _session: Session, name: bytes) -> None:
        self._latest = (*self._latest[-9:], name)

    def upload_name(self, request: Request) -> bool:
        if request.value not in self._latest:
            self.remove(request.value)
        return super().upload_name(request)


# The buffer and the end


@mutant("fills-the-frame", "5.4/3", "5.1/5")
class FillsFrames(ControllerCore):
    """The chunks of a download contain up to 243 bytes, as many as fit into a frame."""

    def download_name(self, request: Request) -> bool:
        self._content = self.store.read(request.value) if request.value in self.store else b""
        return super().download_name(request)

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == 0x56 and len(self._content) > BUFFER_BYTES:
            length = min(243, len(self._content))
            order = "<III" if self.dialect["endian"] == "little" else ">III"
            head = struct.pack(order, len(self._content), 0, length)
            frame = frame._replace(data=head + self._content[:length])
        super().emit(session, frame)


row(
    "waits-for-an-end-mark",
    "5.4/4 5.1/7 5.2/12",
    "A file is complete only when another chunk follows its last chunk.",
    receives(judging(complete=lambda *_: False)),
)
row(
    "full-last-chunk-is-not-the-end",
    "5.4/4 5.1/7 5.2/16",
    "A file of a multiple of 200 bytes is complete only when a shorter chunk follows.",
    receives(
        judging(
            complete=lambda receiver, _: (
                receiver.state is TransferState.DONE
                and bool(not receiver.size_bytes or receiver.size_bytes % BUFFER_BYTES)
            )
        )
    ),
    subtle=True,
)
row(
    "short-chunk-is-the-end",
    "5.4/4",
    "A chunk of less than 200 bytes ends the file at any position.",
    receives(
        judging(
            complete=lambda receiver, chunk: (
                receiver.state is TransferState.DONE or chunk.length < BUFFER_BYTES
            )
        )
    ),
)

# The timeout


class _ExpiresAfterBegin(Receiver):
    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        last_frame_s = self._last_frame_s
        taken = super().receive_chunk(data, now_s)
        self._last_frame_s = last_frame_s
        return taken


class _ExpiresAfterChunks(Receiver):
    @property
    def deadline_s(self) -> float | None:
        return super().deadline_s if self.received_bytes else None


row(
    "waits-for-chunks-too-long",
    "5.4/5",
    "An upload continues after 90 s without a chunk.",
    receives(timing_out(90)),
)
row(
    "gives-up-chunks-too-early",
    "5.4/5",
    "An upload is aborted after 20 s without a chunk.",
    receives(timing_out(20)),
)
row(
    "uploads-last-thirty-seconds",
    "5.4/5",
    "An upload is aborted 30 s after its name arrived, even if chunks have arrived since.",
    receives(_ExpiresAfterBegin),
    subtle=True,
)
row(
    "waits-for-the-first-chunk-for-ever",
    "5.4/5",
    "An upload of which only the name arrived never times out.",
    receives(_ExpiresAfterChunks),
    subtle=True,
)

# What an aborted transfer leaves


class _NoticesAborts(ControllerCore):
    """Base class: calls `aborted` when an upload is aborted."""

    def aborted(self, name: bytes, receiver: Receiver) -> None:
        """Called when an upload was aborted."""

    def abort_transfer(self, session: Session) -> None:
        transfer = session.transfer
        super().abort_transfer(session)
        if transfer is not None and isinstance(transfer.end, Receiver):
            self.aborted(transfer.name, transfer.end)


@mutant("deaf-after-atime-out", "5.4/6", subtle=True)
class HangsAfterTimeout(_NoticesAborts):
    """After an upload timed out, no request is answered."""

    _hangs = False

    def aborted(self, _name: bytes, receiver: Receiver) -> None:
        self._hangs = self._hangs or "no frame for" in receiver.reason

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if not self._hangs:
            super().handle(session, frame, now_s)


@mutant("no-transfer-after-arefused-chunk", "5.4/6", subtle=True)
class RefusesNamesAfterRefusedChunk(_NoticesAborts):
    """After a chunk that is out of bounds was refused, every name is refused."""

    _stuck = False

    def aborted(self, _name: bytes, receiver: Receiver) -> None:
        self._stuck = self._stuck or "bounds" in receiver.reason

    def upload_name(self, request: Request) -> bool:
        return not self._stuck and super().upload_name(request)


@mutant("hangs-on-achunk-of-length-zero", "5.4/6")
class HangsOnEmptyChunk(ControllerCore):
    """After a chunk of length 0 in the middle of a file, no request is answered."""

    _hangs = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x52 and session.transfer and len(frame.data) >= HEAD_BYTES:
            self._hangs = self._hangs or frame.data[0:12] == frame.data[0:8] + bytes(4) != bytes(12)
        if not self._hangs:
            super().handle(session, frame, now_s)


@mutant("empty-files-block-transfers", "5.4/6", subtle=True)
class DamagesFilesAfterEmptyFile(ControllerCore):
    """After a file of no bytes was offered, files are stored without their first byte."""

    _damages = False

    def upload_chunk(self, request: Request) -> bool | Silence:
        self._damages = self._damages or request.frame.data[:HEAD_BYTES] == bytes(HEAD_BYTES)
        return super().upload_chunk(request)

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, content[1:] if self._damages else content)


@mutant("fills-up-broken-files", "5.4/7")
class FillsAbortedFiles(_NoticesAborts):
    """An aborted upload leaves a file of its full size, with zeros for the missing bytes."""

    def aborted(self, name: bytes, receiver: Receiver) -> None:
        if receiver.size_bytes:
            self._write(name, receiver.content.ljust(receiver.size_bytes, b"\0"))


class _MixesContents(ControllerCore):
    """The next upload keeps the bytes of an interrupted one, where `_keeps` is true."""

    _left = b""

    def _keeps(self, end: Receiver) -> bool:  # noqa: ARG002 - overridden
        return True

    def abort_transfer(self, session: Session) -> None:
        end = receiver_of(session)
        if end is not None and self._keeps(end):
            self._left = end.content
        super().abort_transfer(session)

    def _write(self, name: bytes, content: bytes) -> bool:
        left, self._left = self._left[: len(content)], b""
        return super()._write(name, left + content[len(left) :])


@mutant("next-upload-begins-with-the-broken-one", "5.4/7", "5.2/12", "5.4/6")
class KeepsBrokenContent(_MixesContents):
    """After an interrupted upload, the next file begins with the bytes of that upload."""


@mutant("next-upload-begins-with-the-signalled-one", "5.4/7", "5.4/6", subtle=True)
class KeepsSignalledContent(_MixesContents):
    """After an upload with an error signal, the next file begins with the bytes of that upload."""

    def _keeps(self, end: Receiver) -> bool:
        return "signalled" in end.reason


@mutant("broken-uploads-stay-listed", "4.10/11", subtle=True)
class ListsBrokenUploads(ControllerCore):
    """The name of an interrupted upload is listed, although there is no file."""

    _broken: frozenset[bytes] = frozenset()

    def abort_transfer(self, session: Session) -> None:
        if session.transfer is not None and receiver_of(session):
            self._broken |= {session.transfer.name}
        super().abort_transfer(session)

    def list_programs(self, request: Request) -> NameListPart:
        part = super().list_programs(request)
        return part._replace(names=(*part.names, *sorted(self._broken - {*part.names})))


@mutant("keeps-what-it-refused", "5.4/7")
class KeepsRefusedChunk(ControllerCore):
    """The bytes of a refused chunk stay in the file that the upload leaves."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        transfer = request.session.transfer
        taken = super().upload_chunk(request)
        if taken is False and transfer is not None and isinstance(transfer.end, Receiver):
            self._write(transfer.name, transfer.end.content + request.frame.data[HEAD_BYTES:])
        return taken


@mutant("resumes-broken-uploads", "5.4/7", subtle=True)
class ResumesAbortedUploads(_NoticesAborts):
    """A new upload begins with the bytes that an aborted upload of the same name has left."""

    @cached_property
    def _left(self) -> dict[bytes, bytes]:
        return {}

    def aborted(self, name: bytes, receiver: Receiver) -> None:
        self._left[name] = receiver.content

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, self._left.pop(name, b"") + content)


# Other commands during a transfer


def _ignores_frames(when: Callable[[ControllerCore, Session, Frame], bool]) -> Core:
    """Requests are neither executed nor answered, if the condition holds."""

    class IgnoresFrames(ControllerCore):
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            if not when(self, session, frame):
                super().handle(session, frame, now_s)

    return IgnoresFrames


def _ignores_others(core: ControllerCore, session: Session, frame: Frame) -> bool:
    uploads = [s for s in core.sessions.values() if receiver_of(s)]
    return bool(uploads) and session not in uploads and frame.opcode != _LOGIN


row(
    "deaf-during-uploads",
    "5.4/8",
    "During an upload other commands on its connection are not answered.",
    _ignores_frames(
        lambda _, session, frame: (
            frame.opcode not in _TRANSFERS and receiver_of(session) is not None
        )
    ),
)


@mutant("commands-break-uploads", "5.4/8")
class AbortsUploadsOnCommands(ControllerCore):
    """Any other command aborts an upload."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode not in _TRANSFERS and receiver_of(session):
            self.abort_transfer(session)
        super().handle(session, frame, now_s)


@mutant("commands-skip-achunk", "5.4/8", subtle=True)
class SkipsChunkAfterList(ControllerCore):
    """A request for the list of programs during a download makes it skip a chunk."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        sender = sender_of(session)
        if frame.opcode == 0x0B and sender:
            sender.acknowledge(accepted=True, now_s=now_s)
            sender.next_chunk()
        super().handle(session, frame, now_s)


def _fail_upload(_core: ControllerCore, request: Request, accepted: Any) -> Any:
    receiver = receiver_of(request.session)
    if receiver:
        receiver.fail("a download was requested")
    return accepted


row(
    "lists-nothing-during-uploads",
    "5.4/8",
    "The list of programs is empty on a connection that uploads a file.",
    answer_when(
        "list_programs",
        lambda _, request: receiver_of(request.session) is not None,
        _NO_PROGRAMS,
    ),
    subtle=True,
)
row(
    "lists-nothing-during-downloads",
    "5.4/8",
    "The list of programs is empty on a connection that downloads a file.",
    answer_when(
        "list_programs", lambda _, request: sender_of(request.session) is not None, _NO_PROGRAMS
    ),
    subtle=True,
)
row(
    "deaf-to-others-during-uploads",
    "5.4/8",
    "During an upload requests of other connections are ignored.",
    _ignores_frames(_ignores_others),
)


@mutant("refused-names-break-uploads", "5.4/8")
class AbortsUploadsOnNames(ControllerCore):
    """A second name during an upload is refused and also aborts the upload."""

    def upload_name(self, request: Request) -> bool:
        uploads = receiver_of(request.session)
        accepted = super().upload_name(request)
        if uploads:
            self.abort_transfer(request.session)
        return accepted


row(
    "refused-downloads-break-uploads",
    "5.4/8",
    "A download during an upload is refused, and the rest of the upload is lost.",
    after("download_name", _fail_upload),
)


@mutant("second-name-takes-the-content", "5.4/8")
class ChangesNameDuringUpload(ControllerCore):
    """A second name during an upload is refused, but the content is stored with this name."""

    def upload_name(self, request: Request) -> bool:
        transfer = request.session.transfer
        accepted = super().upload_name(request)
        if transfer is not None and receiver_of(request.session):
            request.session.transfer = OpenTransfer(request.value, transfer.end)
        return accepted


@mutant("resumes-refused-downloads", "5.4/8", "5.1/8", subtle=True)
class SkipsRefusedChunk(ControllerCore):
    """After a chunk was refused, the next download of the file begins with the second chunk."""

    _refused: frozenset[bytes] = frozenset()

    def download_name(self, request: Request) -> bool:
        accepted = super().download_name(request)
        sender = sender_of(request.session)
        if accepted and sender and request.value in self._refused:
            self._refused -= {request.value}
            self._deferred.clear()
            sender.acknowledge(accepted=True, now_s=request.now_s)
            self._send_next(request.session)
        return accepted

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        if transfer is not None and request.value is False:
            self._refused |= {transfer.name}
        return super().download_chunk(request)


@mutant("refused-chunk-spoils-the-next-upload", "5.4/8", subtle=True)
class DamagesUploadAfterRefusal(ControllerCore):
    """After a chunk of a download was refused, the next upload loses its last byte."""

    _damages = False

    def download_chunk(self, request: Request) -> Silence:
        self._damages = self._damages or request.value is False
        return super().download_chunk(request)

    def _write(self, name: bytes, content: bytes) -> bool:
        damages, self._damages = self._damages, False
        return super()._write(name, content[:-1] if damages else content)
