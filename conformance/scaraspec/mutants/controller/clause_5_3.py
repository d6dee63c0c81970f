"""Faults of clause 5.3: downloads, their course and their end."""

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.transfers import CHUNK, AltersChunks
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, Receiver, Sender, chunks_of
from scaraspec.virtual_controller.behaviour.base import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, OpenTransfer, Request, Session

DOWNLOAD_NAME = 0x54


# Whether a file can be sent


@mutant("answers-downloads-with-the-size", "5.3/2")
class AnswersDownloadsWithTheSize(ControllerCore):
    """A file that can be sent is answered with its size."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write the size."""
        transfer = session.transfer
        if frame.opcode == DOWNLOAD_NAME and frame.data == b"1" and transfer:
            frame = frame._replace(data=b"%d" % len(self.store.read(transfer.name)))
        super().emit(session, frame)


@mutant("sends-afile-once", "5.3/2", "5.2/12", subtle=True)
class SendsAFileOnce(ControllerCore):
    """A connection can fetch a file once; the second time it is answered 0."""

    @cached_property
    def sent(self) -> set[tuple[Session, bytes]]:
        """What it remembers."""
        return set()

    def download_name(self, request: Request) -> bool:
        """Remember it."""
        key = (request.session, request.value)
        if key in self.sent:
            return False
        accepted = super().download_name(request)
        if accepted:
            self.sent.add(key)
        return accepted


@mutant("one-reading-position-for-all", "5.3/4", "5.1/8", subtle=True)
class OneReadingPositionForAll(ControllerCore):
    """Two connections that fetch one file share the place where it is read."""

    def download_name(self, request: Request) -> bool:
        """Join the other."""
        others = [s.transfer for s in self.sessions.values() if s is not request.session]
        shared = next((t for t in others if t and t.name == request.value), None)
        accepted = super().download_name(request)
        if accepted and shared is not None and isinstance(shared.end, Sender):
            request.session.transfer = shared
        return accepted

    def download_chunk(self, request: Request) -> Silence:
        """Skip what the other has not answered yet."""
        transfer = request.session.transfer
        sharers = [s for s in self.sessions.values() if transfer and s.transfer is transfer]
        if len(sharers) > 1 and transfer is not None and isinstance(transfer.end, Sender):
            transfer.end.acknowledge(accepted=True, now_s=request.now_s)
            transfer.end.next_chunk()
        return super().download_chunk(request)


@mutant("promises-every-file", "5.3/3", "5.3/2")
class PromisesEveryFile(ControllerCore):
    """A file that is not there is answered 1, and nothing follows."""

    def download_name(self, request: Request) -> bool:
        """Say yes."""
        return super().download_name(request) or request.session.transfer is None


@mutant("finds-files-by-their-beginning", "5.3/3")
class FindsFilesByTheirBeginning(ControllerCore):
    """The beginning of a file's name is enough to fetch it."""

    def download_name(self, request: Request) -> bool:
        """Find the first that fits."""
        fitting = (n for n in self.store.names() if n.startswith(request.value))
        return super().download_name(replace(request, value=next(fitting, request.value)))


@mutant("finds-files-by-pattern", "5.3/3")
class FindsFilesByPattern(ControllerCore):
    """A name with an asterisk fetches the first file that fits."""

    def download_name(self, request: Request) -> bool:
        """Find it."""
        start, star, end = request.value.partition(b"*")
        names = self.store.names() if star else []
        fitting = (n for n in names if n.startswith(start) and n.endswith(end))
        return super().download_name(replace(request, value=next(fitting, request.value)))


@mutant("no-name-is-the-first-file", "5.3/3")
class NoNameIsTheFirstFile(ControllerCore):
    """A request without a name fetches the first file of the list."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Name it."""
        if frame.opcode == DOWNLOAD_NAME and not frame.data and self.store.names():
            frame = frame._replace(data=self.store.names()[0])
        super().handle(session, frame, now_s)


@mutant("keeps-fetched-files", "5.3/3")
class KeepsFetchedFiles(ControllerCore):
    """A file that was fetched can be fetched again after it was deleted."""

    @cached_property
    def fetched(self) -> dict[bytes, bytes]:
        """What it remembers."""
        return {}

    def download_name(self, request: Request) -> bool:
        """Serve it from memory."""
        name = request.value
        if name in self.store:
            self.fetched[name] = self.store.read(name)
        elif name in self.fetched:
            self.store.write(name, self.fetched[name])
            accepted = super().download_name(request)
            self.store.delete(name)
            return accepted
        return super().download_name(request)


@mutant("serves-unfinished-files-as-whole", "5.3/3", subtle=True)
class ServesUnfinishedFilesAsWhole(ControllerCore):
    """A file that is still being uploaded is served in its full size, zeros where nothing came."""

    def download_name(self, request: Request) -> bool:
        """Fill it up."""
        for session in self.sessions.values():
            transfer = session.transfer
            if transfer and transfer.name == request.value and isinstance(transfer.end, Receiver):
                content = transfer.end.content.ljust(transfer.end.size_bytes or 0, b"\0")
                sender = Sender(content, request.now_s, self.dialect)
                request.session.transfer = OpenTransfer(request.value, sender)
                self._send_next(request.session)
                return True
        return super().download_name(request)


# The content


@mutant("sends-the-file-asked-for-last", "5.3/4", "5.2/12", subtle=True)
class SendsTheFileAskedForLast(ControllerCore):
    """Every download goes on with the file that any connection asked for last."""

    last = b""

    def download_name(self, request: Request) -> bool:
        """Keep its content."""
        if request.value in self.store:
            self.last = self.store.read(request.value)
        return super().download_name(request)

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        other = self.last[chunk.position : chunk.position + chunk.length]
        super()._send_chunk(session, chunk._replace(buffer=other))


@mutant("chunk-before-the-answer", "5.3/4")
class ChunkBeforeTheAnswer(ControllerCore):
    """The first chunk of a download is sent ahead of the answer to its name."""

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        if chunk.position:
            super()._send_chunk(session, chunk)
        else:
            self.emit(session, Frame(C2A, CHUNK, FILE_DATA.encode(chunk, self.dialect)))


@mutant("promises-and-sends-nothing", "5.3/4")
class PromisesAndSendsNothing(ControllerCore):
    """Behind the 1 to a name no content comes."""

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        """Send none."""


@mutant("content-under-the-opcode-of-uploads", "5.3/4")
class ContentUnderTheOpcodeOfUploads(ControllerCore):
    """The content of a download comes in 0x52 frames."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Change the opcode."""
        if frame.opcode == CHUNK:
            frame = frame._replace(opcode=0x52)
        super().emit(session, frame)


@mutant("sends-only-full-chunks", "5.3/4", "5.1/3")
class SendsOnlyFullChunks(AltersChunks):
    """The rest of a file behind its last full chunk is not sent."""

    def altered(self, chunk: Chunk) -> Iterable[Chunk]:
        """Leave it away."""
        full = chunk.file_size - chunk.file_size % BUFFER_BYTES
        return (chunk._replace(file_size=full or chunk.file_size),) * (
            chunk.length == BUFFER_BYTES or not full
        )


# One at a time


@mutant("sends-everything-at-once", "5.3/6")
class SendsEverythingAtOnce(ControllerCore):
    """The chunks of a download are sent without waiting for answers."""

    def _send_next(self, session: Session) -> None:
        while (transfer := session.transfer) is not None and isinstance(transfer.end, Sender):
            chunk = transfer.end.next_chunk()
            if chunk is None:
                return
            self._send_chunk(session, chunk)
            if not chunk.last:
                transfer.end.acknowledge(accepted=True, now_s=0.0)


@mutant("second-chunk-comes-unasked", "5.3/6")
class SecondChunkComesUnasked(ControllerCore):
    """The second chunk of a download is sent right behind the first."""

    def _send_next(self, session: Session) -> None:
        super()._send_next(session)
        transfer = session.transfer
        if transfer and isinstance(transfer.end, Sender) and not transfer.end.acknowledged_bytes:
            transfer.end.acknowledge(accepted=True, now_s=math.inf)
            super()._send_next(session)


@mutant("any-request-brings-the-next-chunk", "5.3/6")
class AnyRequestBringsTheNextChunk(ControllerCore):
    """Any request of the client brings the next chunk, not just the answer to the last."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take it for the answer."""
        transfer = session.transfer
        super().handle(session, frame, now_s)
        sends = transfer is not None and isinstance(transfer.end, Sender)
        if sends and frame.opcode != CHUNK:
            super().handle(session, Frame(frame.direction, CHUNK, b"1"), now_s)


@mutant("repeats-unanswered-chunks", "5.3/6")
class RepeatsUnansweredChunks(ControllerCore):
    """A chunk that is not answered for three seconds is sent again."""

    due_s = math.inf

    @cached_property
    def unanswered(self) -> list[tuple[Session, Frame]]:
        """What it remembers."""
        return []

    @property
    def next_event_s(self) -> float | None:
        """The repetition too."""
        soonest_s = super().next_event_s
        times_s = [self.due_s] if soonest_s is None else [self.due_s, soonest_s]
        return None if min(times_s) == math.inf else min(times_s)

    def emit(self, session: Session, frame: Frame) -> None:
        """Remember the chunk."""
        if frame.opcode == CHUNK:
            self.unanswered = [(session, frame)]
        super().emit(session, frame)

    def download_name(self, request: Request) -> bool:
        """Wait for the answer to the first."""
        self.due_s = request.now_s + 3.0
        return super().download_name(request)

    def download_chunk(self, request: Request) -> Silence:
        """Wait for the answer to the next."""
        self.due_s, self.unanswered = request.now_s + 3.0, []
        return super().download_chunk(request)

    def advance(self, now_s: float) -> list[Action]:
        """Repeat it, once."""
        if now_s >= self.due_s:
            again, self.unanswered, self.due_s = self.unanswered, [], math.inf
            self._deferred += again
            self._send_deferred()
        return super().advance(now_s)


# Silence of the client


class _OtherTimeOut(ControllerCore):
    """Gives a download up after another silence."""

    timeout_s = 90

    def download_name(self, request: Request) -> bool:
        """Put another sender in; its first chunk is on its way."""
        accepted = super().download_name(request)
        transfer = request.session.transfer
        if accepted and transfer is not None:
            dialect = self.dialect.replace(xfer_timeout=f"{self.timeout_s}")
            sender = Sender(self.store.read(transfer.name), request.now_s, dialect)
            sender.next_chunk()
            request.session.transfer = transfer._replace(end=sender)
        return accepted


@mutant("waits-for-answers-too-long", "5.3/7", subtle=True)
class WaitsForAnswersTooLong(_OtherTimeOut):
    """A download that is not answered goes on after 90 s."""


@mutant("gives-up-answers-too-early", "5.3/7", subtle=True)
class GivesUpAnswersTooEarly(_OtherTimeOut):
    """A download that is not answered for 20 s is given up."""

    timeout_s = 20


@mutant("downloads-last-thirty-seconds", "5.3/7", subtle=True)
class DownloadsLastThirtySeconds(ControllerCore):
    """A download is given up 30 s after it began, however often it was answered."""

    @cached_property
    def begun_s(self) -> dict[Session, float]:
        """What it remembers."""
        return {}

    def download_name(self, request: Request) -> bool:
        """Remember when."""
        self.begun_s[request.session] = request.now_s
        return super().download_name(request)

    def download_chunk(self, request: Request) -> Silence:
        """Look at the clock."""
        if request.now_s - self.begun_s.get(request.session, math.inf) > 30:
            request.session.transfer = None
        return super().download_chunk(request)


@mutant("late-answers-revive-downloads", "5.3/7", subtle=True)
class LateAnswersReviveDownloads(ControllerCore):
    """A download that was given up goes on when its answer comes after all."""

    @cached_property
    def given_up(self) -> dict[Session, OpenTransfer]:
        """What it remembers."""
        return {}

    def abort_transfer(self, session: Session) -> None:
        """Keep it."""
        if session.transfer is not None and isinstance(session.transfer.end, Sender):
            self.given_up[session] = session.transfer
        super().abort_transfer(session)

    def download_chunk(self, request: Request) -> Silence:
        """Send what would have been next."""
        if request.session.transfer is None and request.session in self.given_up:
            transfer = self.given_up.pop(request.session)
            chunks = list(chunks_of(self.store.read(transfer.name)))
            self._send_chunk(request.session, chunks[1])
        return super().download_chunk(request)


# A chunk that was refused


@mutant("ignores-refusals", "5.3/9")
class IgnoresRefusals(ControllerCore):
    """A download goes on whatever its chunks are answered."""

    def download_chunk(self, request: Request) -> Silence:
        """Take it for a yes."""
        return super().download_chunk(replace(request, value=True))


@mutant("refusals-start-over", "5.3/9", subtle=True)
class RefusalsStartOver(ControllerCore):
    """After a later chunk was refused, a download begins again with the first."""

    def download_chunk(self, request: Request) -> Silence:
        """Begin again."""
        transfer = request.session.transfer
        answer = super().download_chunk(request)
        if request.value is not False or transfer is None:
            return answer
        if isinstance(transfer.end, Sender) and transfer.end.acknowledged_bytes:
            sender = Sender(self.store.read(transfer.name), request.now_s, self.dialect)
            request.session.transfer = transfer._replace(end=sender)
            self._send_next(request.session)
        return answer


@mutant("forgets-refusals", "5.3/9", subtle=True)
class ForgetsRefusals(ControllerCore):
    """After a chunk was refused nothing comes, until a later 1 brings the next."""

    def download_chunk(self, request: Request) -> Silence:
        """Drop the refusal."""
        return SILENCE if request.value is False else super().download_chunk(request)


@mutant("refused-last-chunk-spoils-the-file", "5.3/9", subtle=True)
class RefusedLastChunkSpoilsTheFile(ControllerCore):
    """A file whose last chunk was refused is taken for damaged, and cut there."""

    def download_chunk(self, request: Request) -> Silence:
        """Cut it."""
        transfer = request.session.transfer
        answer = super().download_chunk(request)
        if request.value is False and transfer and isinstance(transfer.end, Sender):
            done_bytes, content = transfer.end.acknowledged_bytes, self.store.read(transfer.name)
            if len(content) - done_bytes <= BUFFER_BYTES < len(content):
                self.store.write(transfer.name, content[:done_bytes])
        return answer


@mutant("empty-chunk-behind-arefusal", "5.3/10")
class EmptyChunkBehindARefusal(ControllerCore):
    """Behind the 0 to a name comes a chunk of length 0."""

    def download_name(self, request: Request) -> bool:
        """Send one."""
        accepted = super().download_name(request)
        if not accepted:
            self._send_chunk(request.session, Chunk(0, 0, 0, b""))
        return accepted


@mutant("stray-answers-bring-the-last-file", "5.3/10", subtle=True)
class StrayAnswersBringTheLastFile(ControllerCore):
    """An answer to no chunk brings the first chunk of the file that was fetched last."""

    last = b""

    def download_name(self, request: Request) -> bool:
        """Keep its name."""
        accepted = super().download_name(request)
        self.last = request.value if accepted else self.last
        return accepted

    def download_chunk(self, request: Request) -> Silence:
        """Send it."""
        if request.session.transfer is None and self.last in self.store and request.value:
            self._send_chunk(request.session, next(chunks_of(self.store.read(self.last))))
        return super().download_chunk(request)
