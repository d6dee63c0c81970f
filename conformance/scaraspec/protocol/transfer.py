"""File transfer (clause 5): fileData, and both of its ends as state machines.

Sender and receiver know neither link nor opcode: an upload's sender is the client (0x52), a
download's the controller (0x56). Time comes in as seconds of any monotonic clock.
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
"""sizeof(fileData) under every packing (A-5-1)."""

_ORDERS: Final = {"little": struct.Struct("<III"), "big": struct.Struct(">III")}


class Chunk(NamedTuple):
    """One fileData (L718-723): the file's size, where this piece belongs, and its buffer.

    `length` is what the structure says, which a faulty peer may set to anything; `data` is the
    part of the buffer that it calls valid.
    """

    file_size: int
    position: int
    length: int
    buffer: bytes

    @property
    def data(self) -> bytes:
        """The valid bytes, as far as they are there."""
        return self.buffer[: self.length]

    @property
    def last(self) -> bool:
        """Whether this piece ends the file: position + length == fileSize (L737)."""
        return self.position + self.length == self.file_size

    @property
    def legal(self) -> bool:
        """Length 1 to 200, within the file (L735-737; A-5-6)."""
        return (
            1 <= self.length <= min(BUFFER_BYTES, len(self.buffer))
            and self.position + self.length <= self.file_size
        )


@dataclass(frozen=True, slots=True)
class FileData(Payload):
    """The structure fileData as data of a frame (L756, L780).

    The byte order is not stated (A-5-2). The one is taken in which length and position are in
    bounds, or, where both or neither are, in which the numbers are smaller.
    """

    @property
    def form(self) -> str:
        """The structure's members."""
        return "fileSize, position, length (uint32 each), data[200]"

    def read(self, data: bytes, notes: Diagnostics) -> Chunk | None:
        """Read the structure; an empty payload (the error signal of L787) is None."""
        if len(data) < HEAD_BYTES:
            notes.add(
                Defect.SIZE,
                UserMessage(
                    "{data_count} bytes are no fileData of {file_data_bytes}",
                    data_count=len(data),
                    file_data_bytes=FILE_DATA_BYTES,
                ),
            )
            return None
        chunks = {order: read_as(data, order) for order in _ORDERS}
        legal = [order for order, chunk in chunks.items() if chunk.legal]
        order = min(legal or chunks, key=lambda o: sum(chunks[o][:3]))
        chunk = chunks[order]
        if len(legal) == 1:
            notes.readings["endian"] = order
        if len(data) == FILE_DATA_BYTES:
            if chunk.length < BUFFER_BYTES:
                notes.readings["chunk_trunc"] = "full"
        elif len(data) == HEAD_BYTES + chunk.length:
            notes.readings["chunk_trunc"] = "truncated"
        else:
            notes.add(
                Defect.SIZE,
                UserMessage(
                    "{data_count} bytes are no fileData of {file_data_bytes}",
                    data_count=len(data),
                    file_data_bytes=FILE_DATA_BYTES,
                ),
            )
        if not chunk.legal:
            notes.add(
                Defect.CHUNK,
                UserMessage(
                    "length {length} at position {position} is out of bounds (buffer "
                    "{buffer_bytes}, file {file_size})",
                    length=chunk.length,
                    position=chunk.position,
                    buffer_bytes=BUFFER_BYTES,
                    file_size=chunk.file_size,
                ),
            )
        return chunk

    def write(self, value: Chunk, dialect: Dialect) -> bytes:
        """Write the structure, padded to 212 bytes unless the dialect truncates (A-5-3)."""
        try:
            head = _ORDERS[dialect["endian"]].pack(value.file_size, value.position, value.length)
        except struct.error:
            raise PayloadError(
                "fileSize, position and length must fit 32 bits (L719-721)"
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
    """Read a fileData of at least 12 bytes in the byte order ``little`` or ``big``."""
    file_size, position, length = _ORDERS[order].unpack_from(data)
    return Chunk(file_size, position, length, data[HEAD_BYTES:])


def chunks_of(content: bytes) -> Iterator[Chunk]:
    """Cut a file into chunks, in ascending order (A-5-8); an empty file has none (A-5-10)."""
    for position in range(0, len(content), BUFFER_BYTES):
        piece = content[position : position + BUFFER_BYTES]
        yield Chunk(len(content), position, len(piece), piece)


class State(Enum):
    """How far a transfer is."""

    ACTIVE = "active"
    DONE = "done"
    FAILED = "failed"


class _End:
    """What both ends share: a state, a reason, and the 30 s since the last frame (L763, L795)."""

    def __init__(self, dialect: Dialect, now_s: float) -> None:
        self.state = State.ACTIVE
        self.reason = ""
        """Why it failed, one clause of English."""
        self._timeout_s = dialect.seconds("xfer_timeout")
        self._heard_s = now_s

    @property
    def deadline_s(self) -> float | None:
        """When silence ends the transfer, or None where it never does or has ended already."""
        if self.state is not State.ACTIVE or self._timeout_s is None:
            return None
        return self._heard_s + self._timeout_s

    def expire(self, now_s: float) -> None:
        """Give up if nothing was heard for longer than the time-out (L763, L787, L795)."""
        deadline_s = self.deadline_s
        if deadline_s is not None and now_s > deadline_s:
            self.fail(UserMessage("nothing heard for {timeout_s:g} s", timeout_s=self._timeout_s))

    def fail(self, reason: str) -> None:
        """End the transfer without success; a transfer that has ended stays as it is."""
        if self.state is State.ACTIVE:
            self.state, self.reason = State.FAILED, reason


class Sender(_End):
    """The end that has the file: one chunk, its acknowledgement, the next chunk (A-5-9)."""

    def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
        super().__init__(dialect, now_s)
        self.size_bytes = len(content)
        self.acknowledged_bytes = 0
        self._chunks = chunks_of(content)
        self._outstanding: Chunk | None = None
        if not content:
            self.fail("an empty file cannot be transferred (A-5-10)")

    def next_chunk(self) -> Chunk | None:
        """The chunk to send now, or None while one is outstanding or the transfer has ended."""
        if self.state is not State.ACTIVE or self._outstanding:
            return None
        self._outstanding = next(self._chunks)
        return self._outstanding

    def acknowledge(self, accepted: bool, now_s: float) -> None:  # noqa: FBT001 - it is the flag on the wire
        """Take the answer to the outstanding chunk; ``0`` ends the transfer (A-5-14)."""
        if self.state is not State.ACTIVE or self._outstanding is None:
            return
        chunk, self._outstanding = self._outstanding, None
        self._heard_s = now_s
        if not accepted:
            self.fail(
                UserMessage("the receiver refused the chunk at {position}", position=chunk.position)
            )
            return
        self.acknowledged_bytes += chunk.length
        if chunk.last:
            self.state = State.DONE


class Receiver(_End):
    """The end that wants the file: it judges each chunk and finds the end itself (L793).

    Args:
        now_s: When the transfer began.
        dialect: Order, byte order of the answer to an empty file, and time-out.
        limit_bytes: The largest file that there is room for; a larger one is refused at its
            first chunk, where its size is first known (A-5-25).
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
        """The file's size, once a chunk has told it."""

    @property
    def content(self) -> bytes:
        """The file so far, without what is missing."""
        return b"".join(self._pieces[position] for position in sorted(self._pieces))

    def take(self, data: bytes, now_s: float) -> bool | None:
        """Judge the data of one chunk frame.

        Returns:
            The flag to answer: True ``1``, False ``0``; None for no answer at all, which is due
            to the error signal of length 0 (L787; A-5-10) and to a transfer that has ended.
        """
        if self.state is not State.ACTIVE:
            return None
        self._heard_s = now_s
        chunk = FILE_DATA.decode(data).value
        if chunk is None or chunk.length == 0:
            if chunk and chunk.file_size == 0 and self._empty_is_a_file:
                self.size_bytes, self.state = 0, State.DONE
                return True
            self.fail("the sender signalled an error with a length of 0 (L787)")
            return None
        problem = self._problem(chunk)
        if problem:
            self.fail(problem)
            return False
        self.size_bytes = chunk.file_size
        self._pieces[chunk.position] = chunk.data
        self.received_bytes += chunk.length
        if self.received_bytes == chunk.file_size:
            self.state = State.DONE
        return True

    def _problem(self, chunk: Chunk) -> str:
        """Why this chunk cannot be taken, or nothing."""
        if not chunk.legal:
            return f"length {chunk.length} at {chunk.position} is out of bounds (L735)"
        if self.size_bytes is not None and chunk.file_size != self.size_bytes:
            return f"the file size changed from {self.size_bytes} to {chunk.file_size} (A-5-7)"
        if chunk.file_size > self._limit_bytes:
            return f"no room for {chunk.file_size} bytes (A-5-25)"
        if self._any_order:
            end = chunk.position + chunk.length
            if any(p < end and chunk.position < p + len(d) for p, d in self._pieces.items()):
                return f"the chunk at {chunk.position} overlaps an earlier one (A-5-8)"
        elif chunk.position != self.received_bytes:
            return f"a chunk at {chunk.position} where {self.received_bytes} was due (A-5-8)"
        return ""
