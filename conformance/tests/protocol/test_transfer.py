"""The structure fileData, and sender and receiver with injected time (clause 5)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.fields import Defect
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import (
    FILE_DATA,
    Chunk,
    Receiver,
    Sender,
    TransferState,
    chunks_of,
)

contents = st.binary(min_size=1, max_size=1000) | st.sampled_from(
    [bytes(n) for n in (1, 199, 200, 201, 400, 65_536, 70_000)]
)
dialects = st.sampled_from(
    [Dialect.of(endian=e, chunk_trunc=t) for e in ("little", "big") for t in ("full", "truncated")]
)


def transfer(content: bytes, dialect: Dialect) -> tuple[Sender, Receiver]:
    """Run a complete transfer and return its sender and receiver."""
    sender, receiver = Sender(content, 0, dialect), Receiver(0, dialect)
    while chunk := sender.next_chunk():
        assert sender.next_chunk() is None  # one outstanding
        sender.acknowledge(bool(receiver.receive_chunk(FILE_DATA.encode(chunk, dialect), 1)), 1)
    return sender, receiver


@given(contents, dialects)
def test_file_arrives_unchanged(content: bytes, dialect: Dialect) -> None:
    """Any file arrives unchanged in every dialect, and both sides detect the end (A-5-15)."""
    sender, receiver = transfer(content, dialect)
    assert (sender.state, receiver.state) == (TransferState.DONE, TransferState.DONE)
    assert receiver.content == content
    assert sender.acknowledged_bytes == len(content)


def test_structure_is_212_bytes() -> None:
    """sizeof(fileData), little-endian, padded with zeros (A-5-1, A-5-2, A-5-4)."""
    data = FILE_DATA.encode(Chunk(3, 0, 3, b"abc"))
    assert data == bytes.fromhex("03000000 00000000 03000000") + b"abc" + bytes(197)


@pytest.mark.parametrize("order", ["little", "big"])
def test_byte_order_is_detected(order: str) -> None:
    """Length and position are in bounds in only one byte order."""
    chunk = Chunk(51_200, 400, 200, bytes(200))
    decoded = FILE_DATA.decode(FILE_DATA.encode(chunk, Dialect.of(endian=order)))
    assert decoded.value == chunk
    assert ("endian", order) in decoded.readings


@pytest.mark.parametrize(
    ("chunk", "reason"),
    [
        (Chunk(300, 0, 201, bytes(200)), "out of bounds"),
        (Chunk(100, 0, 101, bytes(200)), "out of bounds"),
        (Chunk(600, 400, 200, bytes(200)), "expected 200"),
        (Chunk(600, 100, 200, bytes(200)), "expected 200"),
        (Chunk(601, 200, 200, bytes(200)), "file size changed"),
    ],
)
def test_invalid_chunks_are_refused(chunk: Chunk, reason: str) -> None:
    """Wrong lengths, gaps, overlaps and a changed size get the reply "0" (A-5-6 to 8)."""
    receiver = Receiver(0)
    assert receiver.receive_chunk(FILE_DATA.encode(Chunk(600, 0, 200, bytes(200))), 0) is True
    assert receiver.receive_chunk(FILE_DATA.encode(chunk), 0) is False
    assert receiver.state is TransferState.FAILED
    assert reason in receiver.reason


@pytest.mark.parametrize("signal", [b"", FILE_DATA.encode(Chunk(600, 200, 0, b""))])
def test_length_0_is_the_error_signal(signal: bytes) -> None:
    """A frame or a chunk of length 0 ends the transfer without a reply (L787; A-5-10)."""
    receiver = Receiver(0)
    assert receiver.receive_chunk(signal, 0) is None
    assert receiver.state is TransferState.FAILED


def test_empty_file_by_reading() -> None:
    """The default reading refuses an empty file; another one allows one chunk (A-5-10)."""
    assert Sender(b"", 0).state is TransferState.FAILED
    empty = FILE_DATA.encode(Chunk(0, 0, 0, b""))
    receiver = Receiver(0, Dialect.of(empty_file="chunk"))
    assert receiver.receive_chunk(empty, 0) is True
    assert receiver.state is TransferState.DONE


def test_any_order_by_reading() -> None:
    """One reading allows any chunk order; the transfer ends when all bytes are there (A-5-8)."""
    content = bytes(range(256)) * 3
    receiver = Receiver(0, Dialect.of(chunk_order="any"))
    for chunk in reversed(list(chunks_of(content))):
        assert receiver.state is TransferState.ACTIVE
        assert receiver.receive_chunk(FILE_DATA.encode(chunk), 0) is True
    assert receiver.content == content


def test_no_room() -> None:
    """A file larger than the limit is refused at its first chunk (A-5-25)."""
    receiver = Receiver(0, limit_bytes=100)
    assert receiver.receive_chunk(FILE_DATA.encode(Chunk(101, 0, 101, bytes(101))), 0) is False


@pytest.mark.parametrize(
    ("silence_s", "state"), [(30.0, TransferState.ACTIVE), (30.1, TransferState.FAILED)]
)
def test_thirty_seconds(silence_s: float, state: TransferState) -> None:
    """Both sides time out more than 30 s after the last frame (L763, L795)."""
    sender, receiver = Sender(bytes(500), 0), Receiver(0)
    chunk = sender.next_chunk()
    assert chunk
    assert receiver.receive_chunk(FILE_DATA.encode(chunk), 100) is True
    sender.acknowledge(accepted=True, now_s=100)
    for end in (sender, receiver):
        end.expire(100 + silence_s)
        assert end.state is state


def test_timeout_by_reading() -> None:
    """The dialect sets the timeout, and `deadline_s` reports when it expires."""
    sender = Sender(b"x", 0, Dialect.of(xfer_timeout="1"))
    assert sender.deadline_s == 1
    assert Sender(b"x", 0, DEFAULT).deadline_s == 30


def test_refusal_ends_the_transfer() -> None:
    """After the reply "0" the sender sends no more chunks (A-5-14)."""
    sender = Sender(bytes(500), 0)
    sender.next_chunk()
    sender.acknowledge(accepted=False, now_s=0)
    assert sender.next_chunk() is None
    assert "refused the chunk at position 0" in sender.reason


@given(st.lists(st.binary(max_size=255), max_size=8))
def test_receiver_never_raises(stream: list[bytes]) -> None:
    """A receiver never raises, and its content stays within its limit."""
    receiver = Receiver(0, limit_bytes=1000)
    for data in stream:
        receiver.receive_chunk(data, 0)
    assert len(receiver.content) <= 1000


def test_issues() -> None:
    """A structure of a wrong size or out of bounds gives issues, and is decoded."""
    decoded = FILE_DATA.decode(FILE_DATA.encode(Chunk(100, 90, 20, bytes(20)))[:50])
    assert {c.defect for c in decoded.issues} == {Defect.SIZE, Defect.CHUNK}
    assert decoded.value[:3] == (100, 90, 20)
