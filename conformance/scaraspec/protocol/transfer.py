"""File transfer (clause 5): the structure fileData, and state machines for sender and receiver.

Sender and receiver do not depend on a link or an opcode: the client sends an upload (0x52), the
controller sends a download (0x56). Times are seconds of any monotonic clock.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple

from scaraspec.protocol.fields import Defect, Diagnostics, PayloadError
from scaraspec.protocol.payloads import Payload
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.user_message import UserMessage

BUFFER_BYTES: Final = 200
"""缓冲区最多 200 个字节 (L735)."""

HEAD_BYTES: Final = 12
FILE_DATA_BYTES: Final = HEAD_BYTES + BUFFER_BYTES
"""sizeof(fileData), the same for every packing (A-5-1)."""

_ORDERS: Final = {"little": struct.Struct("<III"), "big": struct.Struct(">III")}


class Chunk(NamedTuple):
    """One fileData (L718-723): the size of the file, the position of the chunk, and its buffer.

    `length` is the value in the structure; a faulty peer may send any value. `data` is the valid
    part of the buffer according to `length`.
    """

    file_size: int
    position: int
    length: int
    buffer: bytes

    @property
    def data(self) -> bytes:
        """The valid bytes, as far as they are present."""
        return self.buffer[: self.length]

    @property
    def last(self) -> bool:
        """Whether this chunk ends the file: position + length == fileSize (L737)."""
        return self.position + self.length == self.file_size

    @property
    def legal(self) -> bool:
        """Whether the length is 1 to 200 and the chunk is within the file (L735-737; A-5-6)."""
        return (
            1 <= self.length <= min(BUFFER_BYTES, len(self.buffer))
            and self.position + self.length <= self.file_size
        )


@dataclass(frozen=True, slots=True)
class FileData(Payload):
    """The structure fileData as data of a frame (L756, L780).

    The document does not state the byte order (A-5-2). Decoding chooses the order in which length
    and position are in bounds. If both or neither are, it chooses the order with smaller numbers.
    """

    @property
    def form(self) -> str:
        """The members of the structure."""
        return "fileSize, position, length (uint32 each), data[200]"

    def read(self, data: bytes, diagnostics: Diagnostics) -> Chunk | None:
        """Decode the structure; the value is None for less than 12 bytes.

        An empty payload is the error signal of L787.
        """
        if len(data) < HEAD_BYTES:
            diagnostics.add(
                Defect.SIZE,
                UserMessage(
                    "{byte_count} bytes, but fileData has {file_data_bytes} bytes",
                    byte_count=len(data),
                    file_data_bytes=FILE_DATA_BYTES,
                ),
            )
            return None
        chunks = {order: read_as(data, order) for order in _ORDERS}
        legal = [order for order, chunk in chunks.items() if chunk.legal]
        order = min(legal or chunks, key=lambda o: sum(chunks[o][:3]))
        chunk = chunks[order]
        if len(legal) == 1:
            diagnostics.readings["endian"] = order
        if len(data) == FILE_DATA_BYTES:
            if chunk.length < BUFFER_BYTES:
                diagnostics.readings["chunk_trunc"] = "full"
        elif len(data) == HEAD_BYTES + chunk.length:
            diagnostics.readings["chunk_trunc"] = "truncated"
        else:
            diagnostics.add(
                Defect.SIZE,
                UserMessage(
                    "{byte_count} bytes, but fileData has {file_data_bytes} bytes",
                    byte_count=len(data),
                    file_data_bytes=FILE_DATA_BYTES,
                ),
            )
        if not chunk.legal:
            diagnostics.add(
                Defect.CHUNK,
                UserMessage(
                    "length {length} at position {position} is out of bounds (buffer "
                    "{buffer_bytes} bytes, file {file_size} bytes)",
                    length=chunk.length,
                    position=chunk.position,
                    buffer_bytes=BUFFER_BYTES,
                    file_size=chunk.file_size,
                ),
            )
        return chunk

    def write(self, value: Chunk, dialect: Dialect) -> bytes:
        """Encode the structure, padded to 212 bytes unless the dialect truncates it (A-5-3)."""
        try:
            head = _ORDERS[dialect["endian"]].pack(value.file_size, value.position, value.length)
        except struct.error:
            raise PayloadError(
                "fileSize, position and length must fit into 32 bits (L719-721)"
            ) from None
        if len(value.buffer) > BUFFER_BYTES:
            raise PayloadError(
                UserMessage(
                    "a chunk holds at most {buffer_bytes} bytes (L735)", buffer_bytes=BUFFER_BYTES
                )
            )
        if dialect["chunk_trunc"] == "truncated":
            return head + value.data
        return head + value.buffer.ljust(BUFFER_BYTES, b"\0")


FILE_DATA: Final = FileData()


def read_as(data: bytes, order: str) -> Chunk:
    """Decode a fileData of at least 12 bytes in the byte order ``little`` or ``big``."""
    file_size, position, length = _ORDERS[order].unpack_from(data)
    return Chunk(file_size, position, length, data[HEAD_BYTES:])


def chunks_of(content: bytes) -> Iterator[Chunk]:
    """Split a file into chunks, in ascending order (A-5-8); an empty file has none (A-5-10)."""
    for position in range(0, len(content), BUFFER_BYTES):
        data = content[position : position + BUFFER_BYTES]
        yield Chunk(len(content), position, len(data), data)


class TransferState(Enum):
    """The state of a transfer."""

    ACTIVE = "active"
    DONE = "done"
    FAILED = "failed"


class _TransferEnd:
    """Common part of sender and receiver: state, failure reason, and timeout (L763, L795)."""

    def __init__(self, dialect: Dialect, now_s: float) -> None:
        self.state = TransferState.ACTIVE
        self.reason = ""
        """Why the transfer failed, without a final period; empty unless it failed."""
        self._timeout_s = dialect.seconds("xfer_timeout")
        self._last_frame_s = now_s

    @property
    def deadline_s(self) -> float | None:
        """When the transfer times out; None if it never does or has ended."""
        if self.state is not TransferState.ACTIVE or self._timeout_s is None:
            return None
        return self._last_frame_s + self._timeout_s

    def expire(self, now_s: float) -> None:
        """Fail if no frame has arrived for longer than the timeout (L763, L787, L795)."""
        deadline_s = self.deadline_s
        if deadline_s is not None and now_s > deadline_s:
            self.fail(UserMessage("no frame for {timeout_s:g} s", timeout_s=self._timeout_s))

    def fail(self, reason: str) -> None:
        """End the transfer as failed; no effect if it has already ended."""
        if self.state is TransferState.ACTIVE:
            self.state, self.reason = TransferState.FAILED, reason


class Sender(_TransferEnd):
    """Sends a file: one chunk, its acknowledgement, the next chunk (A-5-9)."""

    def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
        super().__init__(dialect, now_s)
        self.size_bytes = len(content)
        self.acknowledged_bytes = 0
        self._chunks = chunks_of(content)
        self._outstanding: Chunk | None = None
        if not content:
            self.fail("an empty file cannot be transferred (A-5-10)")

    def next_chunk(self) -> Chunk | None:
        """Return the chunk to send now; None if one is unacknowledged or the transfer has ended."""
        if self.state is not TransferState.ACTIVE or self._outstanding:
            return None
        self._outstanding = next(self._chunks)
        return self._outstanding

    def acknowledge(self, accepted: bool, now_s: float) -> None:  # noqa: FBT001 - it is the flag on the wire
        """Process the acknowledgement of the last chunk; ``0`` ends the transfer (A-5-14)."""
        if self.state is not TransferState.ACTIVE or self._outstanding is None:
            return
        chunk, self._outstanding = self._outstanding, None
        self._last_frame_s = now_s
        if not accepted:
            self.fail(
                UserMessage(
                    "the receiver refused the chunk at position {position}", position=chunk.position
                )
            )
            return
        self.acknowledged_bytes += chunk.length
        if chunk.last:
            self.state = TransferState.DONE


class Receiver(_TransferEnd):
    """Receives a file: it checks each chunk and detects the end of the file itself (L793).

    Args:
        now_s: When the transfer began.
        dialect: Determines the allowed chunk order, the handling of an empty file, and the timeout.
        limit_bytes: The maximum file size. A larger file is refused at its first chunk, which is
            the first message that contains the size (A-5-25).
    """

    def __init__(
        self, now_s: float, dialect: Dialect = DEFAULT, *, limit_bytes: int = 16 * 2**20
    ) -> None:
        super().__init__(dialect, now_s)
        self._any_order = dialect["chunk_order"] == "any"
        self._empty_is_a_file = dialect["empty_file"] == "chunk"
        self._limit_bytes = limit_bytes
        self._pieces: dict[int, bytes] = {}
        self.received_bytes = 0
        self.size_bytes: int | None = None
        """The size of the file; None before the first valid chunk."""

    @property
    def content(self) -> bytes:
        """The bytes received so far, in the order of their positions."""
        return b"".join(self._pieces[position] for position in sorted(self._pieces))

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        """Process the data of one chunk frame.

        Returns:
            The flag of the reply: True for ``1``, False for ``0``. None if no reply must be sent:
            after the error signal of length 0 (L787; A-5-10) and after the end of the transfer.
        """
        if self.state is not TransferState.ACTIVE:
            return None
        self._last_frame_s = now_s
        chunk = FILE_DATA.decode(data).value
        if chunk is None or chunk.length == 0:
            if chunk and chunk.file_size == 0 and self._empty_is_a_file:
                self.size_bytes, self.state = 0, TransferState.DONE
                return True
            self.fail("the sender signalled an error with length 0 (L787)")
            return None
        problem = self._problem(chunk)
        if problem:
            self.fail(problem)
            return False
        self.size_bytes = chunk.file_size
        self._pieces[chunk.position] = chunk.data
        self.received_bytes += chunk.length
        if self.received_bytes == chunk.file_size:
            self.state = TransferState.DONE
        return True

    def _problem(self, chunk: Chunk) -> str:
        """Return why this chunk is refused; empty if it is accepted."""
        if not chunk.legal:
            return UserMessage(
                "length {length} at position {position} is out of bounds (L735)",
                length=chunk.length,
                position=chunk.position,
            )
        if self.size_bytes is not None and chunk.file_size != self.size_bytes:
            return UserMessage(
                "the file size changed from {before_bytes} to {file_bytes} bytes (A-5-7)",
                before_bytes=self.size_bytes,
                file_bytes=chunk.file_size,
            )
        if chunk.file_size > self._limit_bytes:
            return UserMessage(
                "no room for {file_bytes} bytes (A-5-25)", file_bytes=chunk.file_size
            )
        if self._any_order:
            end = chunk.position + chunk.length
            if any(p < end and chunk.position < p + len(d) for p, d in self._pieces.items()):
                return UserMessage(
                    "the chunk at position {position} overlaps an earlier one (A-5-8)",
                    position=chunk.position,
                )
        elif chunk.position != self.received_bytes:
            return UserMessage(
                "the chunk is at position {position}, expected {expected_position} (A-5-8)",
                position=chunk.position,
                expected_position=self.received_bytes,
            )
        return ""
