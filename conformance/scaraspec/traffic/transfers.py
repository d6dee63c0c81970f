"""Tracks the file transfers (clause 5) of a connection, which has one at a time (A-5-17).

A transfer begins when its name is accepted. A chunk belongs to the transfer that was named last.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import HEAD_BYTES, Chunk, TransferState, read_as
from scaraspec.traffic.events import Exchange, FrameSeen, Transfer
from scaraspec.traffic.robot_state import RobotState

NAMES: Final = ("upload_name", "download_name")
CHUNKS: Final = ("upload_chunk", "download_chunk")

_NS: Final = 1_000_000_000
_SAFE_SILENCE: Final = 25 / 30  # of the timeout: a longer silence may end a transfer (A-5-13)
_CONTENT_LIMIT_BYTES: Final = 16 * 2**20
_MAX_RESUMPTIONS: Final = 16  # each copies the content

# Reasons of a failed transfer that rules compare.
REFUSED_NAME: Final = "its name was refused"
REFUSED_CHUNK: Final = "a chunk was refused"
SILENCE: Final = "silence"
_UNCERTAIN: Final = "bytes of the capture are missing, or a fault was injected"


def refuses_reply(frame: Frame) -> bool:
    """Whether the controller refuses a reply to a chunk that it did not expect (A-5-16).

    If it expected the reply, or no reply was sent, the frame is an invalid chunk.
    """
    is_0x56 = frame.opcode == BY_NAME["download_chunk"].opcode and not frame.tagged
    return is_0x56 and frame.direction is C2A and frame.data == b"0"


@dataclass(eq=False, slots=True)
class _TransferProgress:
    """A transfer, and the expected position of its next chunk."""

    transfer: Transfer
    expected_position: int = 0
    position: int = -1  # of the last chunk
    resumptions: int = 0

    def join(self, chunk: Chunk) -> int:
        """Process a chunk of a transfer whose beginning is missing; return its expected position.

        The first chunk is where it should be. If its position counts chunks, so do later ones.
        """
        if self.position < 0:
            self.transfer.chunks = self.expected_position = chunk.position
        expected = self.expected_position
        self.advance(chunk)
        return expected

    def advance(self, chunk: Chunk) -> None:
        """Process a chunk: the next one is expected after it, unless it was sent before."""
        self.transfer.chunks += 1
        if chunk.position >= self.expected_position:
            self.expected_position = chunk.position + chunk.length
        elif chunk.position != self.position:  # the position does not count bytes
            self.expected_position += chunk.length
        self.position = chunk.position


class TransferTracker:
    """Tracks the transfer of one connection.

    Args:
        robot: Stores every complete upload.
        dialect: The transfer timeout; a transfer ends after twice that silence (A-5-13).
    """

    def __init__(self, robot: RobotState, dialect: Dialect) -> None:
        self._robot = robot
        timeout_s = dialect.seconds("xfer_timeout")
        self._timeout_ns = 2 * int((timeout_s if timeout_s is not None else 1e9) * _NS)
        self._safe_silence_ns = int(_SAFE_SILENCE * self._timeout_ns / 2)
        self._unexpected_replies = 0  # replies without a chunk, each of which may be refused
        self._opened: dict[bool, _TransferProgress] = {}  # key: is upload
        self._active: _TransferProgress | None = None
        self._connection = ""
        self._previous: dict[bool, _TransferProgress] = {}
        self._byte_orders: dict[bool, str] = {}
        self._aborted = False  # whether the last transfer was aborted
        self._last_activity_ns = 0

    @property
    def unfinished(self) -> bool:
        """Whether a transfer may be active: after an abort, the other side may continue it."""
        return bool(self._active or self._opened or self._aborted)

    def request(self, exchange: Exchange) -> Iterator[Transfer]:
        """Process a name or a chunk: assign it to its transfer."""
        upload = exchange.name.startswith("upload")
        if exchange.name in NAMES:
            name = exchange.request_value if isinstance(exchange.request_value, bytes) else b""
            transfer = Transfer(upload, name, exchange.time_ns, exchange, certain=exchange.certain)
            self._opened[upload] = _TransferProgress(transfer)
        elif exchange.name in CHUNKS:
            silence_ns = exchange.time_ns - self._last_activity_ns
            exchange.after_silence = self._active is not None and silence_ns > self._safe_silence_ns
            self._last_activity_ns = exchange.time_ns
            yield from self._assign(exchange, upload)

    def _assign(self, exchange: Exchange, upload: bool) -> Iterator[Transfer]:  # noqa: FBT001 - the key of all tables here
        active = self._active if self._active and self._active.transfer.upload is upload else None
        progress, before = self._opened.get(upload) or active, self._previous.get(upload)
        chunk = exchange.chunk = self._read(exchange, upload)
        if progress is None and before and chunk and _is_resumption(before, chunk):
            progress = self._begin(_resume_transfer(before), exchange)
        if progress is None:
            exchange.previous_transfer = before.transfer if before else None
            if before and chunk and before.transfer.reason == _UNCERTAIN:
                exchange.expected_position = before.join(chunk)
            return
        transfer = exchange.transfer = progress.transfer
        transfer.order = transfer.order or self._byte_orders.get(upload, "")
        exchange.expected_position = progress.expected_position
        if chunk and (chunk.length or not chunk.file_size):
            progress.advance(chunk)
        elif progress is active:
            yield from self.end("the sender gave it up with a length of 0", exchange.time_ns)

    def _read(self, exchange: Exchange, upload: bool) -> Chunk | None:  # noqa: FBT001 - as above
        """Decode the chunk in the byte order that it proves, else in that of earlier chunks."""
        chunk, parsed = exchange.request.value, exchange.request.parsed
        if not isinstance(chunk, Chunk) or parsed is None:
            return None
        proved = dict(parsed.decoded.readings).get("endian", "")
        if proved:
            self._byte_orders.setdefault(upload, proved)
            return chunk
        data, order = exchange.request.frame.data, self._byte_orders.get(upload)
        return read_as(data, order) if order and len(data) >= HEAD_BYTES else chunk

    def reply(self, exchange: Exchange) -> Iterator[Transfer]:
        """Process the reply to a name or a chunk: begin, continue or end a transfer."""
        if exchange.name not in NAMES and exchange.name not in CHUNKS:
            return
        time_ns = exchange.reply.place.time_ns if exchange.reply else exchange.time_ns
        active = self._active
        if exchange.name in NAMES:
            yield from self._name_reply(exchange, time_ns)
        elif exchange.transfer is None and not exchange.accepted:
            if before := self._previous.get(exchange.name == CHUNKS[0]):
                before.position = -1  # how the sender continues is open (A-5-14)
        elif active and exchange.transfer is active.transfer:
            self._last_activity_ns = time_ns
            active.transfer.certain = active.transfer.certain and exchange.certain
            if not exchange.accepted:
                yield from self.end(REFUSED_CHUNK, time_ns)
            elif exchange.chunk:
                if not active.transfer.upload and not active.transfer.differing_chunk:
                    self._compare(active.transfer, exchange.request, exchange.chunk)
                active.transfer.last_chunk = exchange.request
                yield from self._chunk_accepted(active.transfer, exchange.chunk, time_ns)

    def chunk_reply_sent(self, exchange: Exchange | None, time_ns: int) -> None:
        """Process a reply of the client to this chunk; None if no chunk was pending."""
        if exchange is None or time_ns - exchange.time_ns > self._safe_silence_ns:
            self._unexpected_replies += 1

    def extra_reply_seen(self, name: str) -> None:
        """Store that a reply without a pending chunk was sent."""
        if self._active and name == CHUNKS[not self._active.transfer.upload]:
            self._active.transfer.extra_reply_seen = True

    def take_unexpected_reply(self) -> bool:
        """Whether a refused reply was unexpected; each unexpected reply counts once."""
        unexpected = self._unexpected_replies > 0
        self._unexpected_replies -= unexpected
        return unexpected

    def _compare(self, transfer: Transfer, seen: FrameSeen, chunk: Chunk) -> None:
        """Compare a chunk of a download with the upload of the same name."""
        stored, data, at = self._robot.files.get(transfer.name), chunk.data, chunk.position
        if stored is None or not stored.whole_content:
            return
        sent = bytes(stored.content[at : at + len(data)])
        if sent != data:
            same = (a == b for a, b in zip(sent, data, strict=False))
            transfer.first_difference = at + next(
                (i for i, s in enumerate(same) if not s), len(sent)
            )
            transfer.differing_chunk = seen

    def _name_reply(self, exchange: Exchange, time_ns: int) -> Iterator[Transfer]:
        upload = exchange.name == "upload_name"
        progress = self._opened.get(upload)
        if progress is None or progress.transfer.opening is not exchange:
            return
        del self._opened[upload]
        transfer = progress.transfer
        if exchange.accepted:
            yield from self.end("another transfer began", time_ns)
            exchange.transfer, transfer.begun_ns = transfer, time_ns
            transfer.certain = exchange.certain
            self._begin(progress, exchange)
            self._last_activity_ns = time_ns
        else:
            transfer.state, transfer.reason = TransferState.FAILED, REFUSED_NAME
            self._previous[upload] = progress

    def _chunk_accepted(self, transfer: Transfer, chunk: Chunk, time_ns: int) -> Iterator[Transfer]:
        if transfer.size_bytes < 0:
            transfer.size_bytes = chunk.file_size
            if transfer.upload:
                self._robot.forget(transfer.name)
        if chunk.position == transfer.received_bytes:
            transfer.received_bytes += len(chunk.data)
            if len(transfer.content) + len(chunk.data) <= _CONTENT_LIMIT_BYTES:
                transfer.content += chunk.data
            else:
                transfer.whole_content = False
        if not chunk.last:
            return
        if transfer.received_bytes != chunk.file_size:
            yield from self.end("its last chunk came while bytes were missing", time_ns)
            return
        transfer.state = TransferState.DONE
        if transfer.upload and transfer.certain:
            self._robot.stored(transfer)
        yield self._ended(transfer, time_ns)

    def expire(self, now_ns: int) -> Iterator[Transfer]:
        """End the transfer after a longer silence than any reading allows (L763, L795)."""
        if self._active and now_ns - self._last_activity_ns > self._timeout_ns:
            yield from self.end(SILENCE, now_ns)

    def mark_uncertain(self, now_ns: int) -> Iterator[Transfer]:
        """End the transfer with an unknown result: chunks or names may be lost or changed."""
        if self._active:
            self._active.transfer.certain = False
        yield from self.end(_UNCERTAIN, now_ns)
        self._opened.clear()
        for upload in (True, False):
            unknown = Transfer(
                upload, b"", now_ns, state=TransferState.FAILED, reason=_UNCERTAIN, certain=False
            )
            self._previous[upload] = _TransferProgress(unknown)

    def end(self, reason: str, now_ns: int) -> Iterator[Transfer]:
        """End the active transfer, if there is one, as failed."""
        if self._active:
            transfer = self._active.transfer
            transfer.state, transfer.reason = TransferState.FAILED, reason
            yield self._ended(transfer, now_ns)

    def _begin(self, progress: _TransferProgress, exchange: Exchange) -> _TransferProgress:
        self._active, self._connection = progress, exchange.request.place.connection
        self._robot.transferring.add(self._connection)
        return progress

    def _ended(self, transfer: Transfer, now_ns: int) -> Transfer:
        progress, self._active = self._active, None
        self._robot.transferring.discard(self._connection)
        if progress:
            self._previous[transfer.upload] = progress
        transfer.ended_ns = now_ns
        self._aborted = transfer.state is not TransferState.DONE and transfer.reason != SILENCE
        return transfer


def _is_resumption(before: _TransferProgress, chunk: Chunk) -> bool:
    """Whether a chunk continues a transfer after a refused chunk (A-5-14)."""
    return (
        before.transfer.reason == REFUSED_CHUNK
        and chunk.position == before.transfer.received_bytes
        and chunk.length > 0
        and before.resumptions < _MAX_RESUMPTIONS
    )


def _resume_transfer(before: _TransferProgress) -> _TransferProgress:
    """Return a copy of a transfer that continues after its refused chunk."""
    old = before.transfer
    transfer = replace(
        old, state=TransferState.ACTIVE, reason="", content=bytearray(old.content), resumed=True
    )
    return _TransferProgress(transfer, old.received_bytes, resumptions=before.resumptions + 1)
