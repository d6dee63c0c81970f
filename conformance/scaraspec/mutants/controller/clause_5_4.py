"""Faults of clause 5.4: the receiver, the end of a transfer, and what a broken one leaves."""

import struct
from functools import cached_property
from typing import ClassVar

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.transfers import JudgesChunks, SendsAfterTheEnd
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.transfer import (
    BUFFER_BYTES,
    FILE_DATA,
    HEAD_BYTES,
    Receiver,
    Sender,
    State,
)
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import OpenTransfer, Request, Session

_UPLOADS = (0x50, 0x52)
_TRANSFERS = (0x50, 0x52, 0x54, 0x56)
_LOGIN = 0x01

# The name


@mutant("deleted-names-stay-taken", "5.4/1", subtle=True)
class DeletedNamesStayTaken(ControllerCore):
    """A name that was once deleted is never accepted again."""

    @cached_property
    def deleted(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def delete_program(self, request: Request) -> bool:
        """Remember it."""
        deleted = super().delete_program(request)
        if deleted:
            self.deleted.add(request.value)
        return deleted

    def upload_name(self, request: Request) -> bool:
        """Refuse it."""
        return request.value not in self.deleted and super().upload_name(request)


@mutant("names-asked-for-in-vain-are-taken", "5.4/1", subtle=True)
class NamesAskedForInVainAreTaken(ControllerCore):
    """A name that was asked for in vain is entered in the directory, and then refused."""

    @cached_property
    def asked(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def download_name(self, request: Request) -> bool:
        """Enter it."""
        if request.value not in self.store:
            self.asked.add(request.value)
        return super().download_name(request)

    def upload_name(self, request: Request) -> bool:
        """Refuse it."""
        return request.value not in self.asked and super().upload_name(request)


@mutant("only-the-oldest-connection-creates", "5.4/1", subtle=True)
class OnlyTheOldestConnectionCreates(ControllerCore):
    """A file is created for the oldest connection only; the others are answered 0."""

    def upload_name(self, request: Request) -> bool:
        """Look who asks."""
        oldest = min(self.sessions)
        return request.session.connection == oldest and super().upload_name(request)


@mutant("broken-uploads-block-their-name", "5.4/1", subtle=True)
class BrokenUploadsBlockTheirName(ControllerCore):
    """The name of a broken upload stays taken for good, though there is no file."""

    @cached_property
    def blocked(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def abort_transfer(self, session: Session) -> None:
        """Block it."""
        if session.transfer is not None and isinstance(session.transfer.end, Receiver):
            self.blocked.add(session.transfer.name)
        super().abort_transfer(session)

    def upload_name(self, request: Request) -> bool:
        """Refuse it."""
        return request.value not in self.blocked and super().upload_name(request)


@mutant("fetched-names-are-free", "5.4/2", "5.2/3", "5.1/10", subtle=True)
class FetchedNamesAreFree(SendsAfterTheEnd):
    """A file that was fetched whole may be overwritten."""

    @cached_property
    def fetched(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def downloaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever it was
        """Remember it."""
        self.fetched.add(name)

    def upload_name(self, request: Request) -> bool:
        """Make room."""
        if request.value in self.fetched:
            self.remove(request.value)
        return super().upload_name(request)


@mutant("knows-the-last-ten-names", "5.4/2", "5.2/3", "5.1/10", subtle=True)
class KnowsTheLastTenNames(SendsAfterTheEnd):
    """Whether a name is taken is looked up among the last ten only."""

    @cached_property
    def latest(self) -> list[bytes]:
        """What it remembers."""
        return []

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever it was
        """Remember it."""
        self.latest = [*self.latest[-9:], name]

    def upload_name(self, request: Request) -> bool:
        """Look there."""
        if request.value not in self.latest:
            self.remove(request.value)
        return super().upload_name(request)


# The buffer and the end


@mutant("fills-the-frame", "5.4/3", "5.1/5")
class FillsTheFrame(ControllerCore):
    """The chunks of a download hold as much as a frame can: 243 bytes."""

    def download_name(self, request: Request) -> bool:
        """Keep the content at hand."""
        self.content = self.store.read(request.value) if request.value in self.store else b""
        return super().download_name(request)

    def emit(self, session: Session, frame: Frame) -> None:
        """Fill the first chunk."""
        if frame.opcode == 0x56 and len(self.content) > BUFFER_BYTES:
            length = min(243, len(self.content))
            order = "<III" if self.dialect["endian"] == "little" else ">III"
            head = struct.pack(order, len(self.content), 0, length)
            frame = frame._replace(data=head + self.content[:length])
        super().emit(session, frame)


class _WaitsForMore(Receiver):
    """Does not see the end by itself."""

    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if taken and self.state is State.DONE and self.waits():
            self.state = State.ACTIVE
        return taken

    def waits(self) -> bool:
        """Whether something more is waited for."""
        return True


@mutant("waits-for-an-end-mark", "5.4/4", "5.1/7", "5.2/12")
class WaitsForAnEndMark(JudgesChunks):
    """A file is complete only when something follows on its last chunk."""

    receiver: ClassVar[type[Receiver]] = _WaitsForMore


class _WaitsBehindFullChunks(_WaitsForMore):
    def waits(self) -> bool:
        return bool(self.size_bytes and self.size_bytes % BUFFER_BYTES == 0)


@mutant("full-last-chunk-is-not-the-end", "5.4/4", "5.1/7", "5.2/16", subtle=True)
class FullLastChunkIsNotTheEnd(JudgesChunks):
    """A file of a multiple of 200 bytes is complete only when a shorter chunk follows."""

    receiver: ClassVar[type[Receiver]] = _WaitsBehindFullChunks


class _EndsOnShortChunks(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        chunk = FILE_DATA.decode(data).value
        if taken and chunk is not None and chunk.length < BUFFER_BYTES:
            self.state = State.DONE
        return taken


@mutant("short-chunk-is-the-end", "5.4/4")
class ShortChunkIsTheEnd(JudgesChunks):
    """A chunk of less than 200 bytes ends the file, wherever it stands."""

    receiver: ClassVar[type[Receiver]] = _EndsOnShortChunks


# The time-out


class _Patient(Receiver):
    """Has another time-out."""

    timeout_s: ClassVar[float] = 90.0

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)  # type: ignore[arg-type] # they are the receiver's
        self._timeout_s = self.timeout_s


@mutant("waits-for-chunks-too-long", "5.4/5")
class WaitsForChunksTooLong(JudgesChunks):
    """An upload goes on after a silence of 90 s."""

    receiver: ClassVar[type[Receiver]] = _Patient


class _Impatient(_Patient):
    timeout_s: ClassVar[float] = 20.0


@mutant("gives-up-chunks-too-early", "5.4/5")
class GivesUpChunksTooEarly(JudgesChunks):
    """An upload is given up after a silence of 20 s."""

    receiver: ClassVar[type[Receiver]] = _Impatient


class _FromTheBeginning(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        last_frame_s = self._last_frame_s
        taken = super().take(data, now_s)
        self._last_frame_s = last_frame_s
        return taken


@mutant("uploads-last-thirty-seconds", "5.4/5", subtle=True)
class UploadsLastThirtySeconds(JudgesChunks):
    """An upload is given up 30 s after its name came, however many chunks have come since."""

    receiver: ClassVar[type[Receiver]] = _FromTheBeginning


class _FromTheFirstChunk(Receiver):
    @property
    def deadline_s(self) -> float | None:
        return super().deadline_s if self.received_bytes else None


@mutant("waits-for-the-first-chunk-for-ever", "5.4/5", subtle=True)
class WaitsForTheFirstChunkForEver(JudgesChunks):
    """An upload of which only the name came is never given up."""

    receiver: ClassVar[type[Receiver]] = _FromTheFirstChunk


# What is left of a broken transfer


class _Breaks(ControllerCore):
    """Does something when an upload breaks off."""

    def broken(self, session: Session, name: bytes, receiver: Receiver) -> None:
        """An upload has broken off."""

    def abort_transfer(self, session: Session) -> None:
        """Notice it."""
        transfer = session.transfer
        super().abort_transfer(session)
        if transfer is not None and isinstance(transfer.end, Receiver):
            self.broken(session, transfer.name, transfer.end)


@mutant("deaf-after-atime-out", "5.4/6", subtle=True)
class DeafAfterATimeOut(_Breaks):
    """After an upload was given up for silence, no request is answered any more."""

    deaf = False

    def broken(self, session: Session, name: bytes, receiver: Receiver) -> None:  # noqa: ARG002 - whoever it was
        """Hear no more."""
        self.deaf = self.deaf or "no frame for" in receiver.reason

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Hear nothing."""
        if not self.deaf:
            super().handle(session, frame, now_s)


@mutant("no-transfer-after-arefused-chunk", "5.4/6", subtle=True)
class NoTransferAfterARefusedChunk(_Breaks):
    """After a chunk was refused the transfer unit stays busy: no name is accepted any more."""

    stuck = False

    def broken(self, session: Session, name: bytes, receiver: Receiver) -> None:  # noqa: ARG002 - whoever it was
        """Stay busy."""
        self.stuck = self.stuck or "bounds" in receiver.reason

    def upload_name(self, request: Request) -> bool:
        """Refuse it."""
        return not self.stuck and super().upload_name(request)


@mutant("hangs-on-achunk-of-length-zero", "5.4/6")
class HangsOnAChunkOfLengthZero(ControllerCore):
    """After a chunk of length 0 in the middle of a file, no request is answered any more."""

    hangs = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Hang."""
        if frame.opcode == 0x52 and session.transfer and len(frame.data) >= HEAD_BYTES:
            self.hangs = self.hangs or frame.data[0:12] == frame.data[0:8] + bytes(4) != bytes(12)
        if not self.hangs:
            super().handle(session, frame, now_s)


@mutant("empty-files-block-transfers", "5.4/6", subtle=True)
class EmptyFilesBlockTransfers(ControllerCore):
    """After a file of no bytes was offered, files arrive without their first byte."""

    spoilt = False

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Notice it."""
        self.spoilt = self.spoilt or request.frame.data[:HEAD_BYTES] == bytes(HEAD_BYTES)
        return super().upload_chunk(request)

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, content[1:] if self.spoilt else content)


@mutant("fills-up-broken-files", "5.4/7")
class FillsUpBrokenFiles(_Breaks):
    """A broken upload leaves a file of its full size, zeros where nothing came."""

    def broken(self, session: Session, name: bytes, receiver: Receiver) -> None:  # noqa: ARG002 - whoever it was
        """Fill it up."""
        if receiver.size_bytes:
            self._write(name, receiver.content.ljust(receiver.size_bytes, b"\0"))


@mutant("keeps-what-it-refused", "5.4/7")
class KeepsWhatItRefused(ControllerCore):
    """The bytes of a chunk that was refused stay in the file that the upload leaves."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Keep them."""
        transfer = request.session.transfer
        taken = super().upload_chunk(request)
        if taken is False and transfer is not None and isinstance(transfer.end, Receiver):
            self._write(transfer.name, transfer.end.content + request.frame.data[HEAD_BYTES:])
        return taken


@mutant("resumes-broken-uploads", "5.4/7", subtle=True)
class ResumesBrokenUploads(_Breaks):
    """A new upload under the name of one that was closed begins with what was left of it."""

    @cached_property
    def left(self) -> dict[bytes, bytes]:
        """What it remembers."""
        return {}

    def broken(self, session: Session, name: bytes, receiver: Receiver) -> None:  # noqa: ARG002 - whoever it was
        """Keep it."""
        self.left[name] = receiver.content

    def _write(self, name: bytes, content: bytes) -> bool:
        return super()._write(name, self.left.pop(name, b"") + content)


# Other commands meanwhile


def _uploads(session: Session) -> bool:
    return session.transfer is not None and isinstance(session.transfer.end, Receiver)


@mutant("deaf-during-uploads", "5.4/8")
class DeafDuringUploads(ControllerCore):
    """During an upload other commands on its connection are not answered."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Hear transfers only."""
        if frame.opcode in _TRANSFERS or not _uploads(session):
            super().handle(session, frame, now_s)


@mutant("commands-break-uploads", "5.4/8")
class CommandsBreakUploads(ControllerCore):
    """Any other command ends an upload."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        if frame.opcode not in _TRANSFERS and _uploads(session):
            self.abort_transfer(session)
        super().handle(session, frame, now_s)


@mutant("commands-skip-achunk", "5.4/8", subtle=True)
class CommandsSkipAChunk(ControllerCore):
    """A list of programs that is asked for during a download makes it skip a chunk."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Skip it."""
        transfer = session.transfer
        if frame.opcode == 0x0B and transfer and isinstance(transfer.end, Sender):
            transfer.end.acknowledge(accepted=True, now_s=now_s)
            transfer.end.next_chunk()
        super().handle(session, frame, now_s)


@mutant("lists-nothing-during-uploads", "5.4/8", subtle=True)
class ListsNothingDuringUploads(ControllerCore):
    """Who asks for the programs within his own upload is told of none."""

    def list_programs(self, request: Request) -> NameListPart:
        """Tell of none."""
        return (
            NameListPart(more=False, names=())
            if _uploads(request.session)
            else super().list_programs(request)
        )


@mutant("lists-nothing-during-downloads", "5.4/8", subtle=True)
class ListsNothingDuringDownloads(ControllerCore):
    """Who asks for the programs while he fetches one is told of none."""

    def list_programs(self, request: Request) -> NameListPart:
        """Tell of none."""
        transfer = request.session.transfer
        if transfer is not None and isinstance(transfer.end, Sender):
            return NameListPart(more=False, names=())
        return super().list_programs(request)


@mutant("deaf-to-others-during-uploads", "5.4/8")
class DeafToOthersDuringUploads(ControllerCore):
    """During an upload the other connections are not served."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve the one that uploads."""
        busy = any(_uploads(s) for s in self.sessions.values())
        if not busy or _uploads(session) or frame.opcode == _LOGIN:
            super().handle(session, frame, now_s)


@mutant("refused-names-break-uploads", "5.4/8")
class RefusedNamesBreakUploads(ControllerCore):
    """A second name within an upload is refused, and ends the upload as well."""

    def upload_name(self, request: Request) -> bool:
        """End it."""
        uploads = _uploads(request.session)
        accepted = super().upload_name(request)
        if uploads:
            self.abort_transfer(request.session)
        return accepted


@mutant("refused-downloads-break-uploads", "5.4/8")
class RefusedDownloadsBreakUploads(ControllerCore):
    """A download within an upload is refused, and the rest of the upload is lost."""

    def download_name(self, request: Request) -> bool:
        """Lose it."""
        transfer = request.session.transfer
        accepted = super().download_name(request)
        if transfer is not None and isinstance(transfer.end, Receiver):
            transfer.end.fail("a download was asked for")
        return accepted


@mutant("second-name-takes-the-content", "5.4/8")
class SecondNameTakesTheContent(ControllerCore):
    """A second name within an upload is refused, but the content goes to it."""

    def upload_name(self, request: Request) -> bool:
        """Change the name."""
        transfer = request.session.transfer
        accepted = super().upload_name(request)
        if transfer is not None and _uploads(request.session):
            request.session.transfer = OpenTransfer(request.value, transfer.end)
        return accepted


@mutant("resumes-refused-downloads", "5.4/8", "5.1/8", subtle=True)
class ResumesRefusedDownloads(ControllerCore):
    """After a chunk of a download was refused, the next download of the file skips that chunk."""

    @cached_property
    def refused(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def download_name(self, request: Request) -> bool:
        """Skip it."""
        accepted = super().download_name(request)
        transfer = request.session.transfer
        if accepted and transfer and isinstance(transfer.end, Sender):
            if request.value not in self.refused:
                return accepted
            self.refused.discard(request.value)
            self._deferred.clear()
            transfer.end.acknowledge(accepted=True, now_s=request.now_s)
            self._send_next(request.session)
        return accepted

    def download_chunk(self, request: Request) -> Silence:
        """Remember it."""
        transfer = request.session.transfer
        if transfer is not None and request.value is False:
            self.refused.add(transfer.name)
        return super().download_chunk(request)


@mutant("refused-chunk-spoils-the-next-upload", "5.4/8", subtle=True)
class RefusedChunkSpoilsTheNextUpload(ControllerCore):
    """After a chunk of a download was refused, the next upload loses its last byte."""

    spoilt = False

    def download_chunk(self, request: Request) -> Silence:
        """Notice it."""
        self.spoilt = self.spoilt or request.value is False
        return super().download_chunk(request)

    def _write(self, name: bytes, content: bytes) -> bool:
        spoilt, self.spoilt = self.spoilt, False
        return super()._write(name, content[:-1] if spoilt else content)
