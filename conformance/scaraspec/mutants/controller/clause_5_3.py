"""Mutants of clause 5.3: downloads: requests, chunks and the end."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.requests import (
    after,
    decoded,
    ignores,
)
from scaraspec.mutants.operators.controller.transfers import (
    receiver_of,
    send_chunk,
    sender_of,
    sent_chunk,
)
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, Sender, chunks_of
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, OpenTransfer, Request, Session

DOWNLOAD_NAME, CHUNK = 0x54, 0x56

# Whether a file can be sent


@mutant("answers-downloads-with-the-size", "5.3/2")
class AnswersDownloadsWithSize(ControllerCore):
    """The reply to the name of a stored file is the size of the file."""

    def emit(self, session: Session, frame: Frame) -> None:
        transfer = session.transfer
        if frame.opcode == DOWNLOAD_NAME and frame.data == b"1" and transfer:
            frame = frame._replace(data=b"%d" % len(self.store.read(transfer.name)))
        super().emit(session, frame)


@mutant("sends-afile-once", "5.3/2", "5.2/12", subtle=True)
class SendsFilesOnce(ControllerCore):
    """A connection can download a file once; the second request is answered 0."""

    _sent: frozenset[tuple[Session, bytes]] = frozenset()

    def download_name(self, request: Request) -> bool:
        key = (request.session, request.value)
        if key in self._sent:
            return False
        accepted = super().download_name(request)
        if accepted:
            self._sent |= {key}
        return accepted


@mutant("one-reading-position-for-all", "5.3/4", "5.1/8", subtle=True)
class SharesReadingPosition(ControllerCore):
    """Two connections that download the same file share one reading position."""

    def download_name(self, request: Request) -> bool:
        others = [s.transfer for s in self.sessions.values() if s is not request.session]
        shared = next((t for t in others if t and t.name == request.value), None)
        accepted = super().download_name(request)
        if accepted and shared is not None and isinstance(shared.end, Sender):
            request.session.transfer = shared
        return accepted

    def download_chunk(self, request: Request) -> Silence:
        sender = sender_of(request.session)
        sharers = [s for s in self.sessions.values() if s.transfer is request.session.transfer]
        if sender and len(sharers) > 1:
            sender.acknowledge(accepted=True, now_s=request.now_s)
            sender.next_chunk()
        return super().download_chunk(request)


def _first_that_starts_with(core: ControllerCore, _: Frame, name: bytes | None) -> bytes | None:
    return name and next((n for n in core.store.names() if n.startswith(name)), name)


def _first_that_matches(core: ControllerCore, _: Frame, name: bytes | None) -> bytes | None:
    start, star, end = (name or b"").partition(b"*")
    names = core.store.names() if star else []
    return next((n for n in names if n.startswith(start) and n.endswith(end)), name)


def _first_without_name(core: ControllerCore, frame: Frame, name: bytes | None) -> bytes | None:
    return name if frame.data else next(iter(core.store.names()), name)


row(
    "promises-every-file",
    "5.3/3 5.3/2",
    "The name of a missing file is answered 1, and nothing follows.",
    after(
        "download_name",
        lambda _, request, accepted: accepted or request.session.transfer is None,
    ),
)
row(
    "finds-files-by-their-beginning",
    "5.3/3",
    "The beginning of the name of a file is enough to download it.",
    decoded("download_name", _first_that_starts_with),
)
row(
    "finds-files-by-pattern",
    "5.3/3",
    "A name with an asterisk downloads the first file that matches.",
    decoded("download_name", _first_that_matches),
)
row(
    "no-name-is-the-first-file",
    "5.3/3",
    "A request without a name downloads the first file of the list.",
    decoded("download_name", _first_without_name),
)


@mutant("keeps-fetched-files", "5.3/3")
class KeepsSentFiles(ControllerCore):
    """A file that was downloaded can be downloaded again after it was deleted."""

    _files: Mapping[bytes, bytes] = MappingProxyType({})

    def download_name(self, request: Request) -> bool:
        name = request.value
        if name in self.store:
            self._files = {**self._files, name: self.store.read(name)}
        elif name in self._files:
            self.store.write(name, self._files[name])
            accepted = super().download_name(request)
            self.store.delete(name)
            return accepted
        return super().download_name(request)


@mutant("serves-unfinished-files-as-whole", "5.3/3", subtle=True)
class SendsUnfinishedFiles(ControllerCore):
    """A file that is being uploaded is sent in full size, with zeros for the missing bytes."""

    def download_name(self, request: Request) -> bool:
        for session in self.sessions.values():
            receiver = receiver_of(session)
            if receiver and session.transfer and session.transfer.name == request.value:
                content = receiver.content.ljust(receiver.size_bytes or 0, b"\0")
                sender = Sender(content, request.now_s, self.dialect)
                request.session.transfer = OpenTransfer(request.value, sender)
                self._send_next(request.session)
                return True
        return super().download_name(request)


# The content


@mutant("sends-the-file-asked-for-last", "5.3/4", "5.2/12", subtle=True)
class SendsLastRequestedFile(ControllerCore):
    """Every download continues with the file that any connection requested last."""

    _last = b""

    def download_name(self, request: Request) -> bool:
        if request.value in self.store:
            self._last = self.store.read(request.value)
        return super().download_name(request)

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        other = self._last[chunk.position : chunk.position + chunk.length]
        super()._send_chunk(session, chunk._replace(buffer=other))


@mutant("chunk-before-the-answer", "5.3/4")
class SendsChunkBeforeReply(ControllerCore):
    """The first chunk of a download is sent before the reply to its name."""

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        if chunk.position:
            super()._send_chunk(session, chunk)
        else:
            self.emit(session, Frame(C2A, CHUNK, FILE_DATA.encode(chunk, self.dialect)))


row(
    "promises-and-sends-nothing",
    "5.3/4",
    "No content follows the 1 to a name.",
    sent_chunk(lambda _: None),
)


@mutant("content-under-the-opcode-of-uploads", "5.3/4")
class SendsChunksAsUpload(ControllerCore):
    """The content of a download is sent in 0x52 frames."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame._replace(opcode=0x52) if frame.opcode == CHUNK else frame)


def _only_full(chunk: Chunk) -> Chunk | None:
    full = chunk.file_size - chunk.file_size % BUFFER_BYTES
    if full and chunk.length != BUFFER_BYTES:
        return None
    return chunk._replace(file_size=full or chunk.file_size)


row(
    "sends-only-full-chunks",
    "5.3/4 5.1/3",
    "The rest of a file after its last full chunk is not sent.",
    sent_chunk(_only_full),
)

# One at a time


@mutant("sends-everything-at-once", "5.3/6")
class SendsEverythingAtOnce(ControllerCore):
    """The chunks of a download are sent without waiting for acknowledgements."""

    def _send_next(self, session: Session) -> None:
        while (sender := sender_of(session)) and (chunk := sender.next_chunk()):
            self._send_chunk(session, chunk)
            if not chunk.last:
                sender.acknowledge(accepted=True, now_s=0.0)


@mutant("second-chunk-comes-unasked", "5.3/6")
class SendsTwoChunks(ControllerCore):
    """The second chunk of a download is sent directly after the first."""

    def _send_next(self, session: Session) -> None:
        super()._send_next(session)
        sender = sender_of(session)
        if sender and not sender.acknowledged_bytes:
            sender.acknowledge(accepted=True, now_s=math.inf)
            super()._send_next(session)


@mutant("any-request-brings-the-next-chunk", "5.3/6")
class SendsChunkOnAnyRequest(ControllerCore):
    """The next chunk follows any request of the client, not only the acknowledgement."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        sender = sender_of(session)
        super().handle(session, frame, now_s)
        if sender and frame.opcode != CHUNK:
            super().handle(session, Frame(frame.direction, CHUNK, b"1"), now_s)


@mutant("repeats-unanswered-chunks", "5.3/6")
class RepeatsChunks(ControllerCore):
    """A chunk that is not acknowledged for three seconds is sent again."""

    _due_s = math.inf
    _unanswered: tuple[tuple[Session, Frame], ...] = ()

    @property
    def next_event_s(self) -> float | None:
        other_s = super().next_event_s
        next_s = min(self._due_s, math.inf if other_s is None else other_s)
        return None if next_s == math.inf else next_s

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.opcode == CHUNK:
            self._unanswered = ((session, frame),)
        super().emit(session, frame)

    def download_name(self, request: Request) -> bool:
        self._due_s = request.now_s + 3.0
        return super().download_name(request)

    def download_chunk(self, request: Request) -> Silence:
        self._due_s, self._unanswered = request.now_s + 3.0, ()
        return super().download_chunk(request)

    def advance(self, now_s: float) -> list[Action]:
        if now_s >= self._due_s:
            self._deferred += self._unanswered
            self._unanswered, self._due_s = (), math.inf
            self._send_deferred()
        return super().advance(now_s)


# Silence of the client


def _timing_out(timeout_s: int) -> Core:
    """Downloads have another timeout."""

    def replace_sender(core: ControllerCore, request: Request, accepted: Any) -> Any:
        transfer = request.session.transfer
        if accepted and transfer is not None:
            dialect = core.dialect.replace(xfer_timeout=f"{timeout_s}")
            sender = Sender(core.store.read(transfer.name), request.now_s, dialect)
            sender.next_chunk()  # it is sent already
            request.session.transfer = transfer._replace(end=sender)
        return accepted

    return after("download_name", replace_sender)


row(
    "waits-for-answers-too-long",
    "5.3/7",
    "A download without an acknowledgement continues after 90 s.",
    _timing_out(90),
    subtle=True,
)
row(
    "gives-up-answers-too-early",
    "5.3/7",
    "A download without an acknowledgement is aborted after 20 s.",
    _timing_out(20),
    subtle=True,
)


@mutant("downloads-last-thirty-seconds", "5.3/7", subtle=True)
class LimitsDownloadDuration(ControllerCore):
    """A download is aborted 30 s after it began, even if its chunks were acknowledged."""

    _begun_s: Mapping[Session, float] = MappingProxyType({})

    def download_name(self, request: Request) -> bool:
        self._begun_s = {**self._begun_s, request.session: request.now_s}
        return super().download_name(request)

    def download_chunk(self, request: Request) -> Silence:
        if request.now_s - self._begun_s.get(request.session, math.inf) > 30:
            request.session.transfer = None
        return super().download_chunk(request)


@mutant("late-answers-revive-downloads", "5.3/7", subtle=True)
class ResumesAbortedDownloads(ControllerCore):
    """A download that timed out continues when its acknowledgement arrives."""

    _aborted: Mapping[Session, OpenTransfer] = MappingProxyType({})

    def abort_transfer(self, session: Session) -> None:
        if session.transfer is not None and sender_of(session):
            self._aborted = {**self._aborted, session: session.transfer}
        super().abort_transfer(session)

    def download_chunk(self, request: Request) -> Silence:
        session = request.session
        if session.transfer is None and session in self._aborted:
            aborted = dict(self._aborted)
            transfer, self._aborted = aborted.pop(session), aborted
            self._send_chunk(session, list(chunks_of(self.store.read(transfer.name)))[1])
        return super().download_chunk(request)


# A chunk that was refused

row(
    "ignores-refusals",
    "5.3/9",
    "A download continues after any reply to its chunks.",
    decoded("download_chunk", lambda *_: True),
)


@mutant("refusals-start-over", "5.3/9", subtle=True)
class RestartsRefusedDownloads(ControllerCore):
    """After a later chunk was refused, a download starts again with the first."""

    def download_chunk(self, request: Request) -> Silence:
        transfer, sender = request.session.transfer, sender_of(request.session)
        reply = super().download_chunk(request)
        if request.value is False and transfer and sender and sender.acknowledged_bytes:
            sender = Sender(self.store.read(transfer.name), request.now_s, self.dialect)
            request.session.transfer = transfer._replace(end=sender)
            self._send_next(request.session)
        return reply


row(
    "forgets-refusals",
    "5.3/9",
    "After a chunk was refused nothing is sent, until a later 1 brings the next chunk.",
    ignores("download_chunk", lambda _, request: request.value is False),
    subtle=True,
)


@mutant("refused-last-chunk-spoils-the-file", "5.3/9", subtle=True)
class CutsRefusedFiles(ControllerCore):
    """If the last chunk of a download is refused, the stored file is cut off before that chunk."""

    def download_chunk(self, request: Request) -> Silence:
        transfer, sender = request.session.transfer, sender_of(request.session)
        reply = super().download_chunk(request)
        if request.value is False and transfer and sender:
            done_bytes, content = sender.acknowledged_bytes, self.store.read(transfer.name)
            if len(content) - done_bytes <= BUFFER_BYTES < len(content):
                self.store.write(transfer.name, content[:done_bytes])
        return reply


def _send_empty_chunk(core: ControllerCore, request: Request, accepted: Any) -> Any:
    if not accepted:
        send_chunk(core, request.session, Chunk(0, 0, 0, b""))
    return accepted


row(
    "empty-chunk-behind-arefusal",
    "5.3/10",
    "A chunk of length 0 follows the 0 to a name.",
    after("download_name", _send_empty_chunk),
)


@mutant("stray-answers-bring-the-last-file", "5.3/10", subtle=True)
class AnswersStrayAcknowledgements(ControllerCore):
    """An unexpected acknowledgement brings the first chunk of the file that was downloaded last."""

    _last = b""

    def download_name(self, request: Request) -> bool:
        accepted = super().download_name(request)
        self._last = request.value if accepted else self._last
        return accepted

    def download_chunk(self, request: Request) -> Silence:
        if request.session.transfer is None and self._last in self.store and request.value:
            self._send_chunk(request.session, next(chunks_of(self.store.read(self._last))))
        return super().download_chunk(request)
