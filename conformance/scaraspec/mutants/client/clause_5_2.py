"""Faults of clause 5.2: uploads, and what is said of transfers."""

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from scaraspec.client.base import LINK_LOST_REASONS
from scaraspec.client.core import DOWNLOAD_LIMIT_BYTES, ClientCore, Event
from scaraspec.client.errors import ClientError, LinkLost, TransferFailed
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import Stage
from scaraspec.client.transfer import Download, Upload
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.transfers import (
    DOWNLOAD_NAME,
    UPLOAD_CHUNK,
    UPLOAD_NAME,
    AltersChunks,
    AltersContent,
    AltersFrames,
    CutsOtherwise,
    DownloadsOtherwise,
    Forever,
    ForeverAtFirst,
    Hurried,
    InAll,
    Lazy,
    MeetsFiles,
    PutsOff,
    UploadsOtherwise,
)
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import NAME_MAX_BYTES, PayloadError
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, HEAD_BYTES, Chunk, Sender
from scaraspec.transports.link import Ending

# The name


class _Names(AltersFrames):
    def named(self, name: bytes) -> bytes:
        """What is sent in place of a name."""
        return name

    def altered(self, frame: Frame) -> Iterable[Frame]:
        if frame.opcode in (UPLOAD_NAME, DOWNLOAD_NAME):
            frame = frame._replace(data=self.named(frame.data))
        return (frame,)


@mutant("uploads-under-its-own-name", "5.2/1")
class UploadsUnderItsOwnName(MeetsFiles):
    """A file is uploaded under the name that it has on the client's disk."""

    def sends(self, local: Path, remote: Text | None) -> Text | None:  # noqa: ARG002 - that is the fault
        """Forget the other name."""
        return local.name


@mutant("adds-the-extension", "5.2/1", "5.3/1")
class AddsTheExtension(_Names):
    """A name without .rob gets one."""

    def named(self, name: bytes) -> bytes:
        """Add it."""
        return name if name.endswith(b".rob") else name[: NAME_MAX_BYTES - 4] + b".rob"


@mutant("lowers-names", "5.2/1", "5.3/1")
class LowersNames(_Names):
    """Names are sent in lower case."""

    def named(self, name: bytes) -> bytes:
        """Lower it."""
        return name.lower()


@mutant("names-of-fixed-size", "5.2/1", "5.3/1")
class NamesOfFixedSize(_Names):
    """Names are sent in a field of 30 bytes, filled up with zeros."""

    def named(self, name: bytes) -> bytes:
        """Fill it up."""
        return name.ljust(NAME_MAX_BYTES, b"\0")


@mutant("question-marks-for-chinese", "5.2/1", subtle=True)
class QuestionMarksForChinese(_Names):
    """What is no ASCII in a name is sent as a question mark."""

    def named(self, name: bytes) -> bytes:
        """Replace it."""
        return name.decode().encode("ascii", "replace")


@mutant("cuts-upload-names", "5.2/18")
class CutsUploadNames(MeetsFiles):
    """A name of more than 30 bytes is cut, and sent so."""

    def sends(self, local: Path, remote: Text | None) -> Text | None:
        """Cut it."""
        return (remote or local.name)[:NAME_MAX_BYTES]


@mutant("refuses-names-of-thirty-bytes", "5.2/18", subtle=True)
class RefusesNamesOfThirtyBytes(MeetsFiles):
    """A name of 30 bytes is refused as too long."""

    def sends(self, local: Path, remote: Text | None) -> Text | None:
        """Refuse it."""
        if len(remote or local.name) >= NAME_MAX_BYTES:
            raise PayloadError("the name is too long")
        return remote


# A name that is refused


class _Deaf(Upload):
    """Takes every answer for a yes where `deaf` says so."""

    def deaf(self, data: bytes) -> bool:  # noqa: ARG002 - others look at it
        return True

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        if self.deaf(data):
            decoded = parsed.decoded._replace(value=True, issues=())
            parsed = parsed._replace(decoded=decoded)
        return super().take(parsed, data, now_s)


class _DeafToNames(_Deaf):
    def deaf(self, data: bytes) -> bool:  # noqa: ARG002 - whatever it is
        return self.stage is Stage.REQUESTED


@mutant("sends-content-after-refusal", "5.2/4", "5.2/19")
class SendsContentAfterRefusal(UploadsOtherwise):
    """Content is sent although the controller has refused the name."""

    way = _DeafToNames


@mutant("remembers-the-first-yes", "5.2/4", subtle=True)
class RemembersTheFirstYes(ClientCore):
    """A name that was accepted once is taken for accepted ever after."""

    @cached_property
    def known(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def upload(self, name: bytes, content: bytes) -> Upload:
        """Remember it."""
        known = self.known

        class Remembering(_Deaf):
            def deaf(self, data: bytes) -> bool:
                if self.stage is not Stage.REQUESTED:
                    return False
                remembered = name in known
                if data == b"1":
                    known.add(name)
                return remembered

        return Remembering(name, content, self.dialect)


class _Contented(Upload):
    def fail(self, error: ClientError) -> None:
        if self.stage is Stage.REQUESTED and isinstance(error, TransferFailed):
            self.settle(None)
        else:
            super().fail(error)


@mutant("uploads-without-yes-are-done", "5.2/19", "5.2/9")
class UploadsWithoutYesAreDone(UploadsOtherwise):
    """An upload whose name was refused, or not answered, is told as done."""

    way = _Contented


# The content


@mutant("head-and-buffer-apart", "5.2/5", "5.1/1")
class HeadAndBufferApart(AltersFrames):
    """The numbers of a chunk are sent in one frame, its buffer in the next."""

    def altered(self, frame: Frame) -> Iterable[Frame]:
        """Cut it."""
        if frame.opcode != UPLOAD_CHUNK:
            return (frame,)
        pieces = frame.data[:HEAD_BYTES], frame.data[HEAD_BYTES:]
        return tuple(frame._replace(data=piece) for piece in pieces)


@mutant("escapes-end-bytes", "5.2/5", "5.1/1", subtle=True)
class EscapesEndBytes(AltersFrames):
    """A chunk with 0xCC in it ends there, and the rest goes into another frame."""

    def altered(self, frame: Frame) -> Iterator[Frame]:
        """Cut it."""
        head, end, rest = frame.data.partition(b"\xcc")
        if frame.opcode != UPLOAD_CHUNK or not end:
            yield frame
            return
        yield frame._replace(data=head + end)
        if rest:
            yield frame._replace(data=rest)


class _Window(Upload):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        return [*frames, *self.ahead()] if frames else []

    def ahead(self) -> Iterator[Frame]:
        """One chunk more."""
        position = self.moved_bytes + BUFFER_BYTES
        piece = self._content[position : position + BUFFER_BYTES]
        if piece:
            chunk = Chunk(len(self._content), position, len(piece), piece)
            yield Frame(A2C, UPLOAD_CHUNK, FILE_DATA.encode(chunk, self._dialect))


@mutant("sends-one-chunk-ahead", "5.2/7")
class SendsOneChunkAhead(UploadsOtherwise):
    """The next chunk is sent together with one that is not answered yet."""

    way = _Window


class _LateWindow(_Window):
    def ahead(self) -> Iterator[Frame]:
        """Only behind the second chunk."""
        return super().ahead() if self.moved_bytes > BUFFER_BYTES else iter(())


@mutant("sends-ahead-once-it-runs", "5.2/7", subtle=True)
class SendsAheadOnceItRuns(UploadsOtherwise):
    """From the third chunk on, the next one is not held back."""

    way = _LateWindow


class _DeafToChunks(_Deaf):
    def deaf(self, data: bytes) -> bool:  # noqa: ARG002 - whatever it is
        return self.stage is not Stage.REQUESTED


@mutant("ignores-refused-chunks", "5.2/8", "5.2/19")
class IgnoresRefusedChunks(UploadsOtherwise):
    """A chunk that is refused counts like one that was taken."""

    way = _DeafToChunks


class _DeafToTheLast(_Deaf):
    def deaf(self, data: bytes) -> bool:  # noqa: ARG002 - whatever it is
        return self.moved_bytes + BUFFER_BYTES >= len(self._content) > 0


@mutant("ignores-the-last-refusal", "5.2/19", subtle=True)
class IgnoresTheLastRefusal(UploadsOtherwise):
    """The answer to the last chunk is awaited, but not read."""

    way = _DeafToTheLast


class _OneMore(_Window):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        executing = self.stage is Stage.EXECUTING
        frames = Upload.take(self, parsed, data, now_s)
        return list(self.ahead()) if executing and self.error else frames


@mutant("stops-one-chunk-late", "5.2/8", subtle=True)
class StopsOneChunkLate(UploadsOtherwise):
    """After a chunk was refused the next one is sent still."""

    way = _OneMore


# Time


class _Forever(Forever, Upload):
    pass


@mutant("uploads-wait-for-ever", "5.2/9")
class UploadsWaitForEver(UploadsOtherwise):
    """An upload waits for an answer without end."""

    way = _Forever


class _Hurried(Hurried, Upload):
    pass


@mutant("uploads-wait-five-seconds", "5.2/9")
class UploadsWaitFiveSeconds(UploadsOtherwise):
    """An upload waits for an answer as long as other commands do, 5 s."""

    way = _Hurried


class _Lazy(Lazy, Upload):
    pass


@mutant("uploads-wait-too-long", "5.2/9", subtle=True)
class UploadsWaitTooLong(UploadsOtherwise):
    """An upload is given up after 75 s."""

    way = _Lazy


class _InAll(InAll, Upload):
    pass


@mutant("uploads-have-thirty-seconds-in-all", "5.2/9", subtle=True)
class UploadsHaveThirtySecondsInAll(UploadsOtherwise):
    """The 30 s count from the name on, for all of an upload."""

    way = _InAll


class _ForeverAtFirst(ForeverAtFirst, Upload):
    pass


@mutant("upload-names-wait-for-ever", "5.2/9", subtle=True)
class UploadNamesWaitForEver(UploadsOtherwise):
    """The answer to the name of an upload is awaited without end."""

    way = _ForeverAtFirst


@mutant("other-replies-put-off-uploads", "5.2/9", subtle=True)
class OtherRepliesPutOffUploads(PutsOff):
    """The 30 s of an upload count anew from whatever comes."""

    way = Upload


@mutant("late-answers-revive-uploads", "5.2/9", subtle=True)
class LateAnswersReviveUploads(ClientCore):
    """An answer that comes after an upload was given up makes it go on."""

    given_up: Upload | None = None

    def tick(self, now_s: float) -> list[Event]:
        """Remember what is given up."""
        waiting = [each for each in self._open if isinstance(each, Upload)]
        events = super().tick(now_s)
        for upload in waiting:
            if upload.settled:
                self.given_up = upload
        return events

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        upload, self.given_up = self.given_up, None
        if upload is not None and frame.opcode in (UPLOAD_NAME, UPLOAD_CHUNK):
            data = FILE_DATA.encode(Chunk(upload.total_bytes or 0, 0, 1, b"!"), self.dialect)
            self._send([Frame(A2C, UPLOAD_CHUNK, data)])
        return super()._dispatch(frame, now_s)


# The end


class _Thorough(Upload):
    """Sends something behind the last answer."""

    def behind(self) -> Chunk | None:
        """What."""
        return Chunk(len(self._content), len(self._content), 0, b"")

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        chunk = self.behind() if self.settled and not self.error else None
        if chunk is not None:
            frames.append(Frame(A2C, UPLOAD_CHUNK, FILE_DATA.encode(chunk, self._dialect)))
        return frames


@mutant("empty-chunk-at-the-end", "5.2/13", "5.2/17")
class EmptyChunkAtTheEnd(UploadsOtherwise):
    """An upload ends with a chunk of length 0."""

    way = _Thorough


class _OnFullChunks(_Thorough):
    def behind(self) -> Chunk | None:
        """Only there."""
        return None if len(self._content) % BUFFER_BYTES else super().behind()


@mutant("empty-chunk-behind-full-ones", "5.2/13", "5.2/17", subtle=True)
class EmptyChunkBehindFullOnes(UploadsOtherwise):
    """An upload of a multiple of 200 bytes ends with a chunk of length 0."""

    way = _OnFullChunks


class _LastTwice(_Thorough):
    def behind(self) -> Chunk | None:
        """The last again."""
        position = (len(self._content) - 1) // BUFFER_BYTES * BUFFER_BYTES
        piece = self._content[position:]
        return Chunk(len(self._content), position, len(piece), piece)


@mutant("sends-the-last-chunk-twice", "5.2/13")
class SendsTheLastChunkTwice(UploadsOtherwise):
    """When an upload is over, its last chunk is sent again."""

    way = _LastTwice


# Sizes and contents


@mutant("sizes-of-sixteen-bits", "5.2/16", "5.1/3", subtle=True)
class SizesOfSixteenBits(AltersChunks):
    """fileSize and position have only 16 bits that count."""

    def other(self, chunk: Chunk) -> Chunk:
        """Forget the others."""
        return chunk._replace(file_size=chunk.file_size & 0xFFFF, position=chunk.position & 0xFFFF)


@mutant("cuts-large-files", "5.2/16", "5.1/3", subtle=True)
class CutsLargeFiles(AltersContent):
    """Of a larger file only the first 65,535 bytes are sent."""

    def read(self, content: bytes) -> bytes:
        """Cut it."""
        return content[:0xFFFF]


class _CountsToByte(Sender):
    def next_chunk(self) -> Chunk | None:
        if self.acknowledged_bytes // BUFFER_BYTES >= 255:
            return None
        return super().next_chunk()


@mutant("counts-chunks-in-one-byte", "5.2/16", "5.2/20", subtle=True)
class CountsChunksInOneByte(CutsOtherwise):
    """An upload stops behind 255 chunks."""

    sender = _CountsToByte


@mutant("loses-start-bytes", "5.2/16", "5.2/20")
class LosesStartBytes(AltersContent):
    """What is 0xAA in a file is sent as 0x55."""

    def read(self, content: bytes) -> bytes:
        """Replace it."""
        return content.replace(b"\xaa", b"\x55")


@mutant("stops-at-zeros", "5.2/20", "5.2/16")
class StopsAtZeros(AltersContent):
    """What stands behind a zero in a chunk is sent as zeros: it is copied as a string."""

    def read(self, content: bytes) -> bytes:
        """Copy each piece as a string."""
        pieces = (content[i : i + BUFFER_BYTES] for i in range(0, len(content), BUFFER_BYTES))
        return b"".join(p.partition(b"\0")[0].ljust(len(p), b"\0") for p in pieces)


@mutant("reads-text-files", "5.2/20", subtle=True)
class ReadsTextFiles(AltersContent):
    """A file is read as text: its ends of lines become line feeds."""

    def read(self, content: bytes) -> bytes:
        """Read it so."""
        return content.replace(b"\r\n", b"\n")


@mutant("drops-the-byte-order-mark", "5.2/20", subtle=True)
class DropsTheByteOrderMark(AltersContent):
    """The mark with which some texts in UTF-8 begin is left out."""

    def read(self, content: bytes) -> bytes:
        """Leave it out."""
        return content.removeprefix(b"\xef\xbb\xbf") or content


@mutant("strips-the-end", "5.2/20", subtle=True)
class StripsTheEnd(AltersContent):
    """Blanks and zeros at the end of a file are not sent."""

    def read(self, content: bytes) -> bytes:
        """Strip it."""
        return content.rstrip(b"\0 \n") or content


# Empty files


@mutant("empty-files-are-done-at-once", "5.2/17", "5.2/19")
class EmptyFilesAreDoneAtOnce(MeetsFiles):
    """An empty file is told as sent, and nothing is sent."""

    def sends(self, local: Path, remote: Text | None) -> Text | None:
        """Say so."""
        return super().sends(local, remote) if local.stat().st_size else None


@mutant("missing-files-are-done", "5.2/19", subtle=True)
class MissingFilesAreDone(MeetsFiles):
    """A file that does not exist is told as sent."""

    def sends(self, local: Path, remote: Text | None) -> Text | None:
        """Say so."""
        return super().sends(local, remote) if local.exists() else None


@mutant("empty-files-become-one-zero", "5.2/17", subtle=True)
class EmptyFilesBecomeOneZero(AltersContent):
    """An empty file is sent as one zero."""

    def read(self, content: bytes) -> bytes:
        """Make one."""
        return content or b"\0"


# What is said


@mutant("any-answer-is-yes", "5.2/19")
class AnyAnswerIsYes(UploadsOtherwise):
    """Whatever is not a plain 0 is taken for a yes."""

    def upload(self, name: bytes, content: bytes) -> Upload:
        """Take it so."""

        class Credulous(_Deaf):
            def deaf(self, data: bytes) -> bool:
                return data != b"0"

        return Credulous(name, content, self.dialect)


class _AnyOpcode(Upload):
    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        return parsed.part == "reply" and frame.data == b"1"


@mutant("answers-of-any-opcode", "5.2/19", "3/33")
class AnswersOfAnyOpcode(UploadsOtherwise):
    """A 1 under any opcode is taken for the answer to a name or a chunk."""

    way = _AnyOpcode


@mutant("ignores-the-tag", "5.2/19", "3/33", subtle=True)
class IgnoresTheTag(UploadsOtherwise):
    """A 1 behind the tag of results is taken for the answer to a name or a chunk."""

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.opcode in (UPLOAD_NAME, UPLOAD_CHUNK):
            frame = frame._replace(tagged=False)
        return super()._dispatch(frame, now_s)


class _Optimistic(Upload):
    lost: Callable[[ClientError], bool] = staticmethod(lambda _: True)

    def fail(self, error: ClientError) -> None:
        if isinstance(error, LinkLost) and self.lost(error) and self.moved_bytes:
            self.settle(None)
        else:
            super().fail(error)


@mutant("lost-uploads-are-done", "5.2/19")
class LostUploadsAreDone(UploadsOtherwise):
    """An upload whose connection ends behind its first chunk is told as done."""

    way = _Optimistic


class _CutOff(_Optimistic):
    lost = staticmethod(lambda error: LINK_LOST_REASONS[Ending.RESET] in str(error))


@mutant("uploads-cut-off-are-done", "5.2/19", subtle=True)
class UploadsCutOffAreDone(UploadsOtherwise):
    """An upload whose connection is cut off, and not closed, is told as done."""

    way = _CutOff


class _Whatever(Download):
    def fail(self, error: ClientError) -> None:
        if isinstance(error, LinkLost) and self.moved_bytes and self._receiver is not None:
            self.settle(self._receiver.content)
        else:
            super().fail(error)


@mutant("lost-downloads-are-done", "5.2/19", "5.3/11")
class LostDownloadsAreDone(DownloadsOtherwise):
    """A download whose connection ends on the way is told as done, with what has come."""

    way = _Whatever


class _Denied(Download):
    def fail(self, error: ClientError) -> None:
        if self.stage is Stage.REQUESTED and isinstance(error, TransferFailed):
            self.settle(b"")
        else:
            super().fail(error)


@mutant("refused-downloads-are-empty", "5.2/19")
class RefusedDownloadsAreEmpty(DownloadsOtherwise):
    """A download that the controller refuses is told as done: an empty file."""

    way = _Denied


@mutant("remembers-refusals", "5.2/19", subtle=True)
class RemembersRefusals(ClientCore):
    """A name that could not be downloaded once never can be again."""

    @cached_property
    def refused(self) -> set[bytes]:
        """What it remembers."""
        return set()

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        """Remember it."""
        refused = self.refused

        class Resentful(Download):
            def fail(self, error: ClientError) -> None:
                if self.stage is Stage.REQUESTED:
                    refused.add(name)
                super().fail(error)

            def settle(self, value: Any) -> None:
                if name in refused:
                    self._fail_transfer("there is no such file")
                else:
                    super().settle(value)

        return Resentful(name, limit_bytes, self.dialect)
