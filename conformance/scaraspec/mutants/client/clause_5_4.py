"""Mutants of clause 5.4: the buffer, the end of a transfer, its timeout, and the next transfer."""

from collections.abc import Callable

from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation, Stage
from scaraspec.client.transfer import Download, FileTransfer, Upload, chunk_reply
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.transfers import (
    UPLOAD_CHUNK,
    LongTimeout,
    NoTimeout,
    NoTimeoutForName,
    OneTimeout,
    ShortTimeout,
    chunks_checked_by,
    downloads,
    ends_with,
    timeout_restarts,
    uploads,
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
    TransferState,
)

_ROOM_BYTES = MAX_DATA_BYTES - HEAD_BYTES

# The buffer


def _chunk_size(size_bytes: Callable[[int], int]) -> type[ClientCore]:
    """`size_bytes` returns the length of the next chunk for the number of remaining bytes."""

    class ChunkSize(Upload):
        def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
            if parsed.decoded.value is not True:
                return super().take(parsed, data, now_s)
            self._restart_timeout(now_s)
            self.accepted, self.stage = True, Stage.EXECUTING
            left = self._content[self.moved_bytes :]
            if not left:
                self.settle(None)
                return []
            piece = left[: size_bytes(len(left))]
            chunk = Chunk(len(self._content), self.moved_bytes, len(piece), b"")
            head = FILE_DATA.encode(chunk, self._dialect)[:HEAD_BYTES]
            self.moved_bytes += len(piece)
            return [Frame(A2C, UPLOAD_CHUNK, head + piece.ljust(BUFFER_BYTES, b"\0"))]

    return uploads(ChunkSize)


row(
    "fills-the-frame",
    "5.4/3 5.1/5",
    "A chunk contains 243 bytes, as many as fit into its frame.",
    _chunk_size(lambda _: _ROOM_BYTES),
)
row(
    "stuffs-the-rest-in",
    "5.4/3 5.1/5",
    "The last chunk contains up to 243 bytes if that saves another chunk.",
    _chunk_size(lambda left_bytes: left_bytes if left_bytes <= _ROOM_BYTES else BUFFER_BYTES),
    subtle=True,
)


# The end


class _EndsByChunkCount(Receiver):
    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        taken = super().receive_chunk(data, now_s)
        if taken and len(self._pieces) * BUFFER_BYTES >= (self.size_bytes or 0):
            self.state = TransferState.DONE
        return taken


class _FullChunkIsNotLast(Receiver):
    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        taken = super().receive_chunk(data, now_s)
        if self.state is TransferState.DONE and self.received_bytes % BUFFER_BYTES == 0:
            self.state = TransferState.ACTIVE
        return taken


row(
    "short-chunks-are-the-last",
    "5.4/4 5.1/7 5.3/11",
    "A chunk of less than 200 bytes ends a download.",
    ends_with(lambda _, chunk: chunk.length < BUFFER_BYTES),
)
row(
    "counts-chunks-to-the-end",
    "5.4/4 5.3/11",
    "A download is done after as many chunks as it would have if all were full.",
    chunks_checked_by(_EndsByChunkCount),
    subtle=True,
)
row(
    "full-chunks-are-never-the-last",
    "5.4/4 5.1/7",
    "A download does not end with a full chunk.",
    chunks_checked_by(_FullChunkIsNotLast),
    subtle=True,
)


# The timeout


class _NoTimeoutForFirstChunk(Download):
    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        frames = super().take(parsed, data, now_s)
        if not self.moved_bytes:
            self.deadline_s = None
        return frames


row(
    "downloads-wait-for-ever",
    "5.4/5",
    "A download waits for its next chunk without a timeout.",
    downloads(NoTimeout, Download),
)
row(
    "downloads-wait-five-seconds",
    "5.4/5",
    "A download waits for a chunk only 5 s, like other commands for a reply.",
    downloads(ShortTimeout, Download),
)
row(
    "downloads-wait-too-long",
    "5.4/5",
    "A download is given up after 75 s.",
    downloads(LongTimeout, Download),
    subtle=True,
)
row(
    "downloads-have-thirty-seconds-in-all",
    "5.4/5",
    "The timeout of 30 s applies to the whole download.",
    downloads(OneTimeout, Download),
    subtle=True,
)
row(
    "download-names-wait-for-ever",
    "5.4/5",
    "A download waits for the reply to its name without a timeout.",
    downloads(NoTimeoutForName, Download),
    subtle=True,
)
row(
    "first-chunks-are-awaited-for-ever",
    "5.4/5",
    "A download waits for its first chunk without a timeout.",
    downloads(_NoTimeoutForFirstChunk),
    subtle=True,
)
row(
    "other-replies-put-off-downloads",
    "5.4/5",
    "Any received bytes restart the 30 s of a download.",
    timeout_restarts(Download),
    subtle=True,
)


@mutant("takes-late-chunks", "5.4/5", "5.3/5", subtle=True)
class AcceptsLateChunks(ClientCore):
    """A chunk that arrives after the timeout of a download is answered with 1."""

    late = False

    def tick(self, now_s: float) -> list[Event]:
        waiting = [each for each in self._open if isinstance(each, Download)]
        events = super().tick(now_s)
        self.late = self.late or any(each.settled for each in waiting)
        return events

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        if self.late and parsed.part == "request":
            self._send([chunk_reply(accepted=True, dialect=self.dialect)])
        else:
            super()._refuse_stray_chunk(parsed)


# The next transfer


def _busy_after(condition: Callable[[FileTransfer], bool]) -> type[ClientCore]:
    """No transfer begins after one that satisfies the condition."""

    class BusyAfter(ClientCore):
        busy = False

        def is_free(self, slot: str) -> bool:
            return super().is_free(slot) and not (self.busy and slot == "transfer")

        def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
            if isinstance(operation, FileTransfer) and operation.settled:
                self.busy = self.busy or condition(operation)
            return super()._after_step(operation, now_s)

    return BusyAfter


row(
    "busy-once-transfers-fail",
    "5.4/6",
    "After a failed transfer, no other transfer begins.",
    _busy_after(lambda transfer: transfer.error is not None),
)
row(
    "busy-once-downloads-break",
    "5.4/6",
    "After a download that failed after its first reply, no other transfer begins.",
    _busy_after(
        lambda transfer: (
            transfer.error is not None
            and isinstance(transfer, Download)
            and bool(transfer.accepted)
        )
    ),
    subtle=True,
)
