"""Faults of clause 5.4: the buffer, the end of a transfer, its time-out, and what comes then."""

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, Stage
from scaraspec.client.transfer import Download, FileTransfer, Upload, chunk_reply
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.transfers import (
    UPLOAD_CHUNK,
    DownloadsOtherwise,
    Forever,
    ForeverAtFirst,
    Hurried,
    InAll,
    JudgesChunks,
    Lazy,
    PutsOff,
    UploadsOtherwise,
)
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame
from scaraspec.protocol.transfer import (
    BUFFER_BYTES,
    FILE_DATA,
    HEAD_BYTES,
    Chunk,
    Receiver,
    State,
)

_ROOM_BYTES = MAX_DATA_BYTES - HEAD_BYTES

# The buffer


class _Stuffed(Upload):
    def room_bytes(self, left_bytes: int) -> int:  # noqa: ARG002 - others look at it
        """How much goes into a chunk."""
        return _ROOM_BYTES

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        if parsed.decoded.value is not True:
            return super().take(parsed, data, now_s)
        self._restart_timeout(now_s)
        self.accepted, self.stage = True, Stage.EXECUTING
        left = self._content[self.moved_bytes :]
        if not left:
            self.settle(None)
            return []
        piece = left[: self.room_bytes(len(left))]
        chunk = Chunk(len(self._content), self.moved_bytes, len(piece), b"")
        head = FILE_DATA.encode(chunk, self._dialect)[:HEAD_BYTES]
        self.moved_bytes += len(piece)
        return [Frame(A2C, UPLOAD_CHUNK, head + piece.ljust(BUFFER_BYTES, b"\0"))]


@mutant("fills-the-frame", "5.4/3", "5.1/5")
class FillsTheFrame(UploadsOtherwise):
    """A chunk holds as much as goes into its frame, 243 bytes."""

    way = _Stuffed


class _StuffedAtTheEnd(_Stuffed):
    def room_bytes(self, left_bytes: int) -> int:
        """The rest, where its frame holds that."""
        return left_bytes if left_bytes <= _ROOM_BYTES else BUFFER_BYTES


@mutant("stuffs-the-rest-in", "5.4/3", "5.1/5", subtle=True)
class StuffsTheRestIn(UploadsOtherwise):
    """The last chunk holds more than 200 bytes where that saves another one."""

    way = _StuffedAtTheEnd


# The end


class _UpToAShortOne(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if taken and FILE_DATA.decode(data).value.length < BUFFER_BYTES:
            self.state = State.DONE
        return taken


@mutant("short-chunks-are-the-last", "5.4/4", "5.1/7", "5.3/11")
class ShortChunksAreTheLast(JudgesChunks):
    """A chunk that is not full ends a download."""

    receiver = _UpToAShortOne


class _Counting(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if taken and len(self._pieces) * BUFFER_BYTES >= (self.size_bytes or 0):
            self.state = State.DONE
        return taken


@mutant("counts-chunks-to-the-end", "5.4/4", "5.3/11", subtle=True)
class CountsChunksToTheEnd(JudgesChunks):
    """A download is done when as many chunks have come as full ones would have been."""

    receiver = _Counting


class _OnlyFull(Receiver):
    def take(self, data: bytes, now_s: float) -> bool | None:
        taken = super().take(data, now_s)
        if self.state is State.DONE and self.received_bytes % BUFFER_BYTES == 0:
            self.state = State.ACTIVE
        return taken


@mutant("full-chunks-are-never-the-last", "5.4/4", "5.1/7", subtle=True)
class FullChunksAreNeverTheLast(JudgesChunks):
    """A download does not end with a chunk that is full."""

    receiver = _OnlyFull


# The time-out


class _Forever(Forever, Download):
    pass


@mutant("downloads-wait-for-ever", "5.4/5")
class DownloadsWaitForEver(DownloadsOtherwise):
    """A download waits for its next chunk without end."""

    way = _Forever


class _Hurried(Hurried, Download):
    pass


@mutant("downloads-wait-five-seconds", "5.4/5")
class DownloadsWaitFiveSeconds(DownloadsOtherwise):
    """A download waits for a chunk as long as other commands do for a reply, 5 s."""

    way = _Hurried


class _Lazy(Lazy, Download):
    pass


@mutant("downloads-wait-too-long", "5.4/5", subtle=True)
class DownloadsWaitTooLong(DownloadsOtherwise):
    """A download is given up after 75 s."""

    way = _Lazy


class _InAll(InAll, Download):
    pass


@mutant("downloads-have-thirty-seconds-in-all", "5.4/5", subtle=True)
class DownloadsHaveThirtySecondsInAll(DownloadsOtherwise):
    """The 30 s count from the name on, for all of a download."""

    way = _InAll


class _ForeverAtFirst(ForeverAtFirst, Download):
    pass


@mutant("download-names-wait-for-ever", "5.4/5", subtle=True)
class DownloadNamesWaitForEver(DownloadsOtherwise):
    """The answer to the name of a download is awaited without end."""

    way = _ForeverAtFirst


class _ForeverForTheFirst(Download):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        if not self.moved_bytes:
            self.deadline_s = None
        return frames


@mutant("first-chunks-are-awaited-for-ever", "5.4/5", subtle=True)
class FirstChunksAreAwaitedForEver(DownloadsOtherwise):
    """The first chunk of a download is awaited without end."""

    way = _ForeverForTheFirst


@mutant("other-replies-put-off-downloads", "5.4/5", subtle=True)
class OtherRepliesPutOffDownloads(PutsOff):
    """The 30 s of a download count anew from whatever comes."""

    way = Download


@mutant("takes-late-chunks", "5.4/5", "5.3/5", subtle=True)
class TakesLateChunks(ClientCore):
    """A chunk that comes after a download was given up is answered 1."""

    late = False

    def tick(self, now_s: float) -> list[Event]:
        """Remember that one is given up."""
        waiting = [each for each in self._open if isinstance(each, Download)]
        events = super().tick(now_s)
        self.late = self.late or any(each.settled for each in waiting)
        return events

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        if self.late and parsed.part == "request":
            self._send([chunk_reply(accepted=True, dialect=self.dialect)])
        else:
            super()._refuse_stray_chunk(parsed)


# What comes then


class _Stuck(ClientCore):
    """Goes on waiting where `stuck` says so."""

    busy = False

    def stuck(self, transfer: FileTransfer) -> bool:
        """Whether this one leaves it stuck."""
        return transfer.error is not None

    def is_free(self, slot: str) -> bool:
        """Not where it is stuck."""
        return super().is_free(slot) and not (self.busy and slot == "transfer")

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        if isinstance(operation, FileTransfer) and operation.settled:
            self.busy = self.busy or self.stuck(operation)
        return super()._after_step(operation, now_s)


@mutant("busy-once-transfers-fail", "5.4/6")
class BusyOnceTransfersFail(_Stuck):
    """After a transfer has failed no other one begins."""


@mutant("busy-once-downloads-break", "5.4/6", subtle=True)
class BusyOnceDownloadsBreak(_Stuck):
    """After a download has failed on its way no other transfer begins."""

    def stuck(self, transfer: FileTransfer) -> bool:
        """Only then."""
        return (
            super().stuck(transfer) and isinstance(transfer, Download) and bool(transfer.accepted)
        )
