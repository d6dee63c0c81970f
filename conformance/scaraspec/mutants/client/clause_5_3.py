"""Faults of clause 5.3: downloads, their answers, and what is on the disk then."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import Progress
from scaraspec.client.transfer import Download, chunk_reply
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.transfers import (
    DOWNLOAD_CHUNK,
    DOWNLOAD_NAME,
    AltersFrames,
    Careless,
    DownloadsOtherwise,
    JudgesChunks,
    KeepsOtherwise,
    MeetsFiles,
)
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, Chunk, Receiver, State

# The name


@mutant("names-of-eight-bytes", "5.3/1")
class NamesOfEightBytes(AltersFrames):
    """Of a name that is asked for eight bytes are sent, as the document prints it."""

    def altered(self, frame: Frame) -> Iterable[Frame]:
        """Cut it."""
        return (frame._replace(data=frame.data[:8]) if frame.opcode == DOWNLOAD_NAME else frame,)


@mutant("downloads-under-its-own-name", "5.3/1")
class DownloadsUnderItsOwnName(AsyncClient):
    """A download asks for the name that the file is to have on the client's disk."""

    async def download(
        self,
        remote: Text,
        local: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        """Forget the other name."""
        return await super().download(Path(local).name if local else remote, local, progress)


@mutant("fetches-once", "5.3/11", subtle=True)
class FetchesOnce(AsyncClient):
    """What was downloaded once is copied from there when it is ordered again."""

    _had: dict[Text, bytes] | None = None

    async def download(
        self,
        remote: Text,
        local: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        """Copy it."""
        had = self._had = self._had or {}
        if local and remote in had:
            return _copied(had[remote], Path(local))
        path = await super().download(remote, local, progress)
        had[remote] = path.read_bytes()
        return path


def _copied(content: bytes, path: Path) -> Path:
    path.write_bytes(content)
    return path


# The answers


@mutant("answers-each-chunk-twice", "5.3/5")
class AnswersEachChunkTwice(AltersFrames):
    """Each chunk is answered twice."""

    def altered(self, frame: Frame) -> Iterable[Frame]:
        """Repeat it."""
        return (frame,) * (2 if frame.opcode == DOWNLOAD_CHUNK else 1)


class _Silent(Download):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        return [] if self.settled and not self.error else frames


@mutant("leaves-the-last-chunk-unanswered", "5.3/5")
class LeavesTheLastChunkUnanswered(DownloadsOtherwise):
    """The last chunk of a download is not answered."""

    way = _Silent


class _Asking(Download):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        asked = self._receiver is None
        frames = super().take(parsed, data, now_s)
        go_on = chunk_reply(accepted=True, dialect=self._dialect)
        return [go_on] if asked and not self.settled else frames


@mutant("asks-for-the-first-chunk", "5.3/5")
class AsksForTheFirstChunk(DownloadsOtherwise):
    """The promise of a file is answered like a chunk, to make the first one come."""

    way = _Asking


class _Sulking(Download):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        return [] if self.error else frames


@mutant("never-answers-no", "5.3/5", subtle=True)
class NeverAnswersNo(DownloadsOtherwise):
    """A chunk that cannot be taken gets no answer."""

    way = _Sulking


@mutant("takes-unasked-chunks", "5.3/5")
class TakesUnaskedChunks(ClientCore):
    """A chunk of no download is answered 1."""

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        if parsed.part == "request":
            self._send([chunk_reply(accepted=True, dialect=self.dialect)])


@mutant("drops-what-comes-with-the-promise", "5.3/5", subtle=True)
class DropsWhatComesWithThePromise(ClientCore):
    """What comes in one segment with the promise of a file is lost."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Lose it."""
        promise = bytes((0xCC, DOWNLOAD_NAME, 1)) + b"1\xaa"
        return super().feed(promise if data.startswith(promise) else data, now_s)


@mutant("answers-pieces-of-chunks", "5.3/5", subtle=True)
class AnswersPiecesOfChunks(ClientCore):
    """A chunk that comes in pieces is answered with each of them that is long."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Answer it."""
        events = super().feed(data, now_s)
        if data[1:2] == bytes((DOWNLOAD_CHUNK,)) and self._framer.held_bytes:
            self._send([chunk_reply(accepted=True, dialect=self.dialect)])
        return events


# The error signal


def _is_empty(data: bytes) -> bool:
    chunk = FILE_DATA.decode(data).value
    return chunk is None or chunk.length == 0


class _Final(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        if self.state is State.ACTIVE and _is_empty(data):
            self.state = State.DONE
            return True
        return super().take(data, now_s)


@mutant("empty-chunks-are-the-end", "5.3/8", "5.2/19")
class EmptyChunksAreTheEnd(JudgesChunks):
    """A chunk of length 0 ends a download as done."""

    receiver = _Final


class _Patient(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        return None if _is_empty(data) else super().take(data, now_s)


@mutant("ignores-empty-chunks", "5.3/8")
class IgnoresEmptyChunks(JudgesChunks):
    """A chunk of length 0 is ignored, and the next one awaited."""

    receiver = _Patient


class _Polite(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        return True if data and _is_empty(data) else super().take(data, now_s)


@mutant("takes-empty-chunks", "5.3/8", "5.3/5", subtle=True)
class TakesEmptyChunks(JudgesChunks):
    """A chunk of length 0 is answered 1, and the next one awaited; a frame without data ends."""

    receiver = _Polite


class _Hollow(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        return None if not data else super().take(data, now_s)


@mutant("ignores-frames-without-data", "5.3/8", subtle=True)
class IgnoresFramesWithoutData(JudgesChunks):
    """A chunk frame without any data is ignored, and the next one awaited."""

    receiver = _Hollow


# The file


@mutant("writes-text-files", "5.3/11", "5.2/16")
class WritesTextFiles(KeepsOtherwise):
    """A file is written as text: a carriage return is put before each line feed."""

    def kept(self, content: bytes) -> bytes:
        """Write it so."""
        return content.replace(b"\n", b"\r\n")


@mutant("drops-zeros-at-the-end", "5.3/11", subtle=True)
class DropsZerosAtTheEnd(KeepsOtherwise):
    """Zeros at the end of a file are taken for padding, and not stored."""

    def kept(self, content: bytes) -> bytes:
        """Drop them."""
        return content.rstrip(b"\0")


class _Narrow(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        return super()._problem(chunk._replace(position=chunk.position % 2**16))


@mutant("positions-of-sixteen-bits", "5.3/11", subtle=True)
class PositionsOfSixteenBits(JudgesChunks):
    """Of the position of a chunk that comes only 16 bits are read."""

    receiver = _Narrow


@mutant("loses-the-last-byte", "5.3/11")
class LosesTheLastByte(KeepsOtherwise):
    """The last byte of a file is not stored."""

    def kept(self, content: bytes) -> bytes:
        """Drop it."""
        return content[:-1]


@mutant("keeps-the-end-of-the-file-before", "5.3/11", subtle=True)
class KeepsTheEndOfTheFileBefore(KeepsOtherwise):
    """A file that is shorter than the one before ends like that one: its memory is used again."""

    memory = b""

    def kept(self, content: bytes) -> bytes:
        """Lay it over the other."""
        self.memory = content + self.memory[len(content) :]
        return self.memory


# Local files


@mutant("overwrites-local-files", "5.3/12")
class OverwritesLocalFiles(MeetsFiles):
    """A local file that exists is overwritten."""

    def makes(self, local: Path) -> bool:
        """Take it away first."""
        local.unlink(missing_ok=True)
        return True


@mutant("overwrites-empty-files", "5.3/12", subtle=True)
class OverwritesEmptyFiles(MeetsFiles):
    """A local file that exists and is empty is overwritten."""

    def makes(self, local: Path) -> bool:
        """Take it away first."""
        if local.exists() and not local.stat().st_size:
            local.unlink()
        return True


@mutant("empties-refused-files", "5.3/12")
class EmptiesRefusedFiles(MeetsFiles):
    """A local file that exists is opened for writing, which empties it, and then refused."""

    def makes(self, local: Path) -> bool:
        """Empty it."""
        if local.exists():
            local.write_bytes(b"")
        return True


@mutant("existing-files-are-done", "5.3/12", "5.2/19", subtle=True)
class ExistingFilesAreDone(MeetsFiles):
    """A local file that exists is kept, and the download is told as done."""

    def makes(self, local: Path) -> bool:
        """Say so."""
        return not local.exists()


# What is out of bounds


class _Clamping(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        chunk = FILE_DATA.decode(data).value
        if chunk is not None and chunk.length > BUFFER_BYTES:
            room = max(0, min(BUFFER_BYTES, chunk.file_size - chunk.position))
            clamped = chunk._replace(length=room, buffer=chunk.buffer[:BUFFER_BYTES])
            data = FILE_DATA.encode(clamped)
        return super().take(data, now_s)


@mutant("clamps-lengths", "5.3/13")
class ClampsLengths(JudgesChunks):
    """A chunk longer than the buffer is taken as if it had as many bytes as there is room for."""

    receiver = _Clamping


class _LongBuffers(Careless):
    def _problem(self, chunk: Chunk) -> str:
        within = chunk.position + chunk.length <= chunk.file_size
        return "" if within and chunk.length <= len(chunk.buffer) else super()._problem(chunk)


@mutant("takes-what-the-frame-holds", "5.3/13")
class TakesWhatTheFrameHolds(JudgesChunks):
    """A chunk longer than 200 bytes is taken if its frame holds as many."""

    receiver = _LongBuffers


class _Boundless(Careless):
    def _problem(self, chunk: Chunk) -> str:
        return "" if chunk.length <= BUFFER_BYTES else super()._problem(chunk)


@mutant("takes-chunks-beyond-the-end", "5.3/13", "5.1/13")
class TakesChunksBeyondTheEnd(JudgesChunks):
    """Whether a chunk lies within the file is not looked at."""

    receiver = _Boundless


class _OneBeyond(Receiver):
    def _problem(self, chunk: Chunk) -> str:
        beyond = chunk.position + chunk.length == chunk.file_size + 1
        return super()._problem(chunk._replace(file_size=chunk.file_size + beyond))


@mutant("takes-one-byte-too-many", "5.3/13", subtle=True)
class TakesOneByteTooMany(JudgesChunks):
    """A chunk may reach one byte beyond the end of the file."""

    receiver = _OneBeyond


class _Wrapping(Careless):
    def _problem(self, chunk: Chunk) -> str:
        wrapped = chunk._replace(position=0, length=(chunk.position + chunk.length) % 2**32)
        wraps = chunk.position + chunk.length >= 2**32 and wrapped.length <= chunk.file_size
        return "" if wraps else super()._problem(chunk)


@mutant("adds-in-thirty-two-bits", "5.3/13", subtle=True)
class AddsInThirtyTwoBits(JudgesChunks):
    """position + length is computed in 32 bits, and wraps round."""

    receiver = _Wrapping
