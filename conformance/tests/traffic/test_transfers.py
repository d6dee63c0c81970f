"""Transfers: started, joined, refused, resumed, damaged, aborted."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.readings import Dialect
from scaraspec.protocol.transfer import TransferState
from scaraspec.traffic.events import Transfer

Judged = Callable[..., Any]

NAME = "login\n> upload_name a.bin\n< upload_name 1\n"
FETCH = "login\n> download_name a.bin\n< download_name 1\n"
ACK = "\n< upload_chunk 1\n"
FETCHED = "\n> download_chunk 1\n"


def transfer_of(record: Any) -> Transfer:
    """The only transfer."""
    (transfer,) = record.transfers
    return transfer


def sent(record: Any) -> bytes:
    """The valid bytes of all chunks, in the order of sending."""
    return b"".join(x.chunk.data for x in record.exchanges if x.chunk)


@pytest.mark.parametrize("options", ["", " big", " cut", " big cut"])
@pytest.mark.parametrize("size", [1, 199, 200, 201, 400, 700])
def test_chunks_of_an_upload_are_joined(judged: Judged, size: int, options: str) -> None:
    """The size, the byte order, and the form of the last chunk may be any."""
    chunks = [f"> chunk {at}/{size}{options}{ACK}" for at in range(0, size, 200)]
    record = judged(NAME + "".join(chunks))
    transfer = transfer_of(record)
    assert (transfer.state, transfer.received_bytes) == (TransferState.DONE, size)
    assert bytes(transfer.content) == sent(record)
    assert transfer.order == ("big" if "big" in options else "little")
    assert (transfer.upload, transfer.name, transfer.chunks) == (True, b"a.bin", len(chunks))
    assert transfer.certain
    assert transfer.whole_content


def test_chunks_of_a_download_are_joined(judged: Judged) -> None:
    """The controller sends requests, the client replies."""
    record = judged(FETCH + "< chunk 0/300" + FETCHED + "< chunk 200/300" + FETCHED)
    transfer = transfer_of(record)
    assert (transfer.state, transfer.upload) == (TransferState.DONE, False)
    assert bytes(transfer.content) == sent(record)


def test_a_chunk_knows_its_transfer_and_its_place(judged: Judged) -> None:
    """This also holds for a chunk that was sent before the previous one was acknowledged."""
    record = judged(NAME + "> chunk 0/300\n> chunk 200/300" + ACK + ACK)
    chunks = [x for x in record.exchanges if x.chunk]
    assert [x.expected_position for x in chunks] == [0, 200]
    assert all(x.transfer is transfer_of(record) for x in chunks)
    assert transfer_of(record).state is TransferState.DONE


@pytest.mark.parametrize(
    ("positions", "expected"),
    [
        ((0, 200, 400), (0, 200, 400)),
        # A gap in the positions: one chunk is wrong, the next is not.
        ((0, 400, 600), (0, 200, 600)),
        ((0, 200, 200, 400), (0, 200, 400, 400)),  # one chunk was sent twice
        ((0, 1, 2), (0, 200, 400)),  # positions count chunks instead of bytes
    ],
)
def test_expected_position_of_a_chunk(
    judged: Judged, positions: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    """After the previous chunk, if its position is known."""
    chunks = "".join(f"> chunk {at}/9000{ACK}" for at in positions)
    record = judged(NAME + chunks)
    assert tuple(x.expected_position for x in record.exchanges if x.chunk) == expected


def test_the_reply_to_the_name_may_come_after_the_first_chunk(judged: Judged) -> None:
    """The chunk belongs to the name of the latest request."""
    record = judged("login\n> upload_name a\n> chunk 0/300\n< upload_name 1" + ACK)
    assert record.exchange("upload_chunk").transfer.name == b"a"


def test_a_last_chunk_does_not_complete_a_file_with_holes(judged: Judged) -> None:
    """Position + length is fileSize, but earlier bytes are missing."""
    transfer = transfer_of(judged(NAME + "> chunk 0/700" + ACK + "> chunk 600/700" + ACK))
    assert (transfer.state, transfer.received_bytes) == (TransferState.FAILED, 200)
    assert "missing" in transfer.reason


def test_a_refused_chunk_ends_the_transfer(judged: Judged) -> None:
    """If the client repeats the chunk, the transfer is resumed in a new record."""
    refused = NAME + "> chunk 0/300" + ACK + "> chunk 200/300\n< upload_chunk 0\n"
    assert transfer_of(judged(refused)).reason == "a chunk was refused"
    first, second = judged(refused + "> chunk 200/300" + ACK).transfers
    assert (first.state, first.received_bytes, first.resumed) == (TransferState.FAILED, 200, False)
    assert (second.state, second.received_bytes, second.resumed) == (TransferState.DONE, 300, True)


def test_number_of_resumptions_is_limited(judged: Judged) -> None:
    """The number is limited, because each resumed transfer has a copy of the file."""
    retry = "> chunk 0/300\n< upload_chunk 0\n"
    assert len(judged(NAME + retry * 40).transfers) == 17


def test_a_refused_name_begins_nothing(judged: Judged) -> None:
    """The next chunk still has a known predecessor."""
    record = judged("login\n> upload_name a\n< upload_name 0\n> chunk 0/300\n< upload_chunk 0")
    x = record.exchange("upload_chunk")
    assert x.transfer is None
    assert (x.previous_transfer.name, x.previous_transfer.reason) == (b"a", "its name was refused")
    assert not record.transfers


def test_another_name_ends_the_transfer(judged: Judged) -> None:
    """A connection has one transfer at a time (A-5-17)."""
    record = judged(NAME + "> chunk 0/300" + ACK + FETCH.removeprefix("login\n"))
    assert [t.reason for t in record.transfers] == [
        "another transfer began",
        "the link or the capture ended",
    ]


@pytest.mark.parametrize("signal", ["> upload_chunk", "> chunk 200/300 len=0"])
def test_a_length_of_zero_aborts_the_transfer(judged: Judged, signal: str) -> None:
    """A length of 0 in the frame or in the structure needs no reply (L787, A-5-10)."""
    record = judged(f"{NAME}> chunk 0/300{ACK}{signal}\n+40\n> get_status\n< get_status 00")
    assert "length of 0" in transfer_of(record).reason
    assert not record.failed


def test_an_empty_file_may_be_one_empty_chunk(judged: Judged) -> None:
    """A reading of the length 0 (A-5-10)."""
    transfer = transfer_of(judged(NAME + "> chunk 0/0" + ACK))
    assert (transfer.state, transfer.size_bytes) == (TransferState.DONE, 0)


def test_silence_ends_the_transfer(judged: Judged) -> None:
    """After twice the timeout, which a subject may claim; not after shorter pauses."""
    session = NAME + "> chunk 0/300" + ACK + "+{}\n> chunk 200/300" + ACK
    assert transfer_of(judged(session.format(59))).state is TransferState.DONE
    assert transfer_of(judged(session.format(61))).reason == "silence"
    claimed = Dialect.of(xfer_timeout="5")
    assert transfer_of(judged(session.format(11), claimed)).reason == "silence"


def test_the_end_of_the_link_ends_the_transfer(judged: Judged) -> None:
    """The transfer contains all chunks that were received."""
    transfer = transfer_of(judged(NAME + "> chunk 0/300" + ACK + "> close"))
    assert (transfer.state, transfer.received_bytes) == (TransferState.FAILED, 200)


@pytest.mark.parametrize("gap", ["> gap 216", "< gap 5", "< gap"])
def test_a_gap_makes_the_transfer_uncertain(judged: Judged, gap: str) -> None:
    """The content is unknown; later chunks belong to an unknown transfer."""
    record = judged(f"{NAME}> chunk 0/900{ACK}{gap}\n+6\n> chunk 400/900{ACK}> chunk 600/900{ACK}")
    transfer = transfer_of(record)
    assert not transfer.certain
    assert "missing" in transfer.reason
    later = [x for x in record.exchanges if x.chunk][-1]
    assert later.transfer is None
    assert not later.previous_transfer.certain
    assert not record.failed


def test_an_uncertain_transfer_is_not_stored_for_certain(judged: Judged) -> None:
    """A gap may hide another change of the file."""
    doubtful = "login\n2> login password\n2< login 1\n" + NAME.removeprefix("login\n")
    session = doubtful + "> chunk 0/300" + ACK + "2> gap 9\n> chunk 200/300" + ACK
    record = judged(session)
    assert transfer_of(record).state is TransferState.DONE
    assert not transfer_of(record).certain
    assert not record.robot.files


def test_a_replaced_file_is_uncertain_until_complete(judged: Judged) -> None:
    """The content is unknown from the first chunk on, which a faulty controller may have stored."""
    complete = NAME + "> chunk 0/9" + ACK
    again = NAME.removeprefix("login\n") + "> chunk 0/300" + ACK
    assert list(judged(complete).robot.files) == [b"a.bin"]
    assert not judged(complete + again).robot.files


def test_stored_content_is_limited(judged: Judged, monkeypatch: pytest.MonkeyPatch) -> None:
    """Further bytes are only counted."""
    monkeypatch.setattr("scaraspec.traffic.transfers._CONTENT_LIMIT_BYTES", 250)
    transfer = transfer_of(judged(NAME + "> chunk 0/300" + ACK + "> chunk 200/300" + ACK))
    assert (transfer.state, transfer.received_bytes) == (TransferState.DONE, 300)
    assert (len(transfer.content), transfer.whole_content) == (200, False)


def test_byte_order_of_a_session(judged: Judged) -> None:
    """The byte order that one chunk proves applies to all chunks of the session."""
    palindrome = r"> upload_chunk \x01\x00\x00\x01\x00\x00\x00\x00\x00\x00\x00\x01A"
    record = judged(NAME + "> chunk 0/9 big" + ACK + NAME.removeprefix("login\n") + palindrome)
    assert [x.chunk.length for x in record.exchanges if x.chunk] == [9, 1]
