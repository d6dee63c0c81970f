"""Files on their way: begun, put together, refused, resumed, torn, and given up."""

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
    """The valid bytes of all chunks, in the order in which they were sent."""
    return b"".join(x.chunk.data for x in record.exchanges if x.chunk)


@pytest.mark.parametrize("options", ["", " big", " cut", " big cut"])
@pytest.mark.parametrize("size", [1, 199, 200, 201, 400, 700])
def test_an_upload_is_put_together(judged: Judged, size: int, options: str) -> None:
    """Of any size, in either byte order, padded or cut."""
    chunks = [f"> chunk {at}/{size}{options}{ACK}" for at in range(0, size, 200)]
    record = judged(NAME + "".join(chunks))
    transfer = transfer_of(record)
    assert (transfer.state, transfer.received_bytes) == (TransferState.DONE, size)
    assert bytes(transfer.content) == sent(record)
    assert transfer.order == ("big" if "big" in options else "little")
    assert (transfer.upload, transfer.name, transfer.chunks) == (True, b"a.bin", len(chunks))
    assert transfer.certain
    assert transfer.whole_content


def test_a_download_is_put_together(judged: Judged) -> None:
    """The controller asks, the client answers."""
    record = judged(FETCH + "< chunk 0/300" + FETCHED + "< chunk 200/300" + FETCHED)
    transfer = transfer_of(record)
    assert (transfer.state, transfer.upload) == (TransferState.DONE, False)
    assert bytes(transfer.content) == sent(record)


def test_a_chunk_knows_its_transfer_and_its_place(judged: Judged) -> None:
    """Also where it was sent before the one before it was acknowledged."""
    record = judged(NAME + "> chunk 0/300\n> chunk 200/300" + ACK + ACK)
    chunks = [x for x in record.exchanges if x.chunk]
    assert [x.expected_position for x in chunks] == [0, 200]
    assert all(x.transfer is transfer_of(record) for x in chunks)
    assert transfer_of(record).state is TransferState.DONE


@pytest.mark.parametrize(
    ("positions", "expected"),
    [
        ((0, 200, 400), (0, 200, 400)),
        ((0, 400, 600), (0, 200, 600)),  # a gap: one step is wrong, the next is not
        ((0, 200, 200, 400), (0, 200, 400, 400)),  # one was sent twice
        ((0, 1, 2), (0, 200, 400)),  # they count chunks
    ],
)
def test_where_a_chunk_is_due(
    judged: Judged, positions: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    """After the previous one, as far as this is known."""
    chunks = "".join(f"> chunk {at}/9000{ACK}" for at in positions)
    record = judged(NAME + chunks)
    assert tuple(x.expected_position for x in record.exchanges if x.chunk) == expected


def test_the_file_name_may_be_answered_behind_the_first_chunk(judged: Judged) -> None:
    """The chunk belongs to what was named last."""
    record = judged("login\n> upload_name a\n> chunk 0/300\n< upload_name 1" + ACK)
    assert record.exchange("upload_chunk").transfer.name == b"a"


def test_a_last_chunk_does_not_complete_a_file_with_holes(judged: Judged) -> None:
    """Position + length == fileSize, but bytes of it are missing."""
    transfer = transfer_of(judged(NAME + "> chunk 0/700" + ACK + "> chunk 600/700" + ACK))
    assert (transfer.state, transfer.received_bytes) == (TransferState.FAILED, 200)
    assert "missing" in transfer.reason


def test_a_refused_chunk_ends_the_transfer(judged: Judged) -> None:
    """Unless its sender repeats it: then it is resumed, and what had ended stays as it was."""
    refused = NAME + "> chunk 0/300" + ACK + "> chunk 200/300\n< upload_chunk 0\n"
    assert transfer_of(judged(refused)).reason == "a chunk was refused"
    first, second = judged(refused + "> chunk 200/300" + ACK).transfers
    assert (first.state, first.received_bytes, first.resumed) == (TransferState.FAILED, 200, False)
    assert (second.state, second.received_bytes, second.resumed) == (TransferState.DONE, 300, True)


def test_a_resumption_has_an_end(judged: Judged) -> None:
    """Each costs a copy of the file."""
    retry = "> chunk 0/300\n< upload_chunk 0\n"
    assert len(judged(NAME + retry * 40).transfers) == 17


def test_a_refused_name_begins_nothing(judged: Judged) -> None:
    """The chunk after it has a known predecessor."""
    record = judged("login\n> upload_name a\n< upload_name 0\n> chunk 0/300\n< upload_chunk 0")
    x = record.exchange("upload_chunk")
    assert x.transfer is None
    assert (x.previous_transfer.name, x.previous_transfer.reason) == (b"a", "its name was refused")
    assert not record.transfers


def test_another_name_ends_the_transfer(judged: Judged) -> None:
    """One at a time and connection (A-5-17)."""
    record = judged(NAME + "> chunk 0/300" + ACK + FETCH.removeprefix("login\n"))
    assert [t.reason for t in record.transfers] == [
        "another transfer began",
        "the link or the capture ended",
    ]


@pytest.mark.parametrize("signal", ["> upload_chunk", "> chunk 200/300 len=0"])
def test_a_length_of_zero_gives_the_transfer_up(judged: Judged, signal: str) -> None:
    """In the frame or in the structure; no answer is due (L787, A-5-10)."""
    record = judged(f"{NAME}> chunk 0/300{ACK}{signal}\n+40\n> get_status\n< get_status 00")
    assert "length of 0" in transfer_of(record).reason
    assert not record.failed


def test_an_empty_file_may_be_one_empty_chunk(judged: Judged) -> None:
    """A reading of the length 0 (A-5-10)."""
    transfer = transfer_of(judged(NAME + "> chunk 0/0" + ACK))
    assert (transfer.state, transfer.size_bytes) == (TransferState.DONE, 0)


def test_silence_ends_the_transfer(judged: Judged) -> None:
    """After twice the time-out, which a subject may claim; shorter pauses do not."""
    session = NAME + "> chunk 0/300" + ACK + "+{}\n> chunk 200/300" + ACK
    assert transfer_of(judged(session.format(59))).state is TransferState.DONE
    assert transfer_of(judged(session.format(61))).reason == "silence"
    claimed = Dialect.of(xfer_timeout="5")
    assert transfer_of(judged(session.format(11), claimed)).reason == "silence"


def test_the_end_of_the_link_ends_the_transfer(judged: Judged) -> None:
    """Whatever has come by then is in it."""
    transfer = transfer_of(judged(NAME + "> chunk 0/300" + ACK + "> close"))
    assert (transfer.state, transfer.received_bytes) == (TransferState.FAILED, 200)


@pytest.mark.parametrize("gap", ["> gap 216", "< gap 5", "< gap"])
def test_a_gap_ends_the_transfer_in_doubt(judged: Judged, gap: str) -> None:
    """Its content is unknown; later chunks belong to an unknown transfer."""
    record = judged(f"{NAME}> chunk 0/900{ACK}{gap}\n+6\n> chunk 400/900{ACK}> chunk 600/900{ACK}")
    transfer = transfer_of(record)
    assert not transfer.certain
    assert "missing" in transfer.reason
    behind = [x for x in record.exchanges if x.chunk][-1]
    assert behind.transfer is None
    assert not behind.previous_transfer.certain
    assert not record.failed


def test_a_transfer_in_doubt_is_not_certain_to_be_stored(judged: Judged) -> None:
    """Begun or continued while a gap may hide what else is done to the file."""
    doubtful = "login\n2> login password\n2< login 1\n" + NAME.removeprefix("login\n")
    session = doubtful + "> chunk 0/300" + ACK + "2> gap 9\n> chunk 200/300" + ACK
    record = judged(session)
    assert transfer_of(record).state is TransferState.DONE
    assert not transfer_of(record).certain
    assert not record.robot.files


def test_a_file_that_is_replaced_is_open_until_it_is_complete(judged: Judged) -> None:
    """From the first chunk on, which a faulty controller may have taken."""
    whole = NAME + "> chunk 0/9" + ACK
    again = NAME.removeprefix("login\n") + "> chunk 0/300" + ACK
    assert list(judged(whole).robot.files) == [b"a.bin"]
    assert not judged(whole + again).robot.files


def test_content_is_kept_up_to_a_limit(judged: Judged, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is beyond it is counted."""
    monkeypatch.setattr("scaraspec.traffic.transfers._CONTENT_LIMIT_BYTES", 250)
    transfer = transfer_of(judged(NAME + "> chunk 0/300" + ACK + "> chunk 200/300" + ACK))
    assert (transfer.state, transfer.received_bytes) == (TransferState.DONE, 300)
    assert (len(transfer.content), transfer.whole_content) == (200, False)


def test_the_byte_order_is_that_of_the_session(judged: Judged) -> None:
    """What one chunk proves holds for those that prove nothing."""
    palindrome = r"> upload_chunk \x01\x00\x00\x01\x00\x00\x00\x00\x00\x00\x00\x01A"
    record = judged(NAME + "> chunk 0/9 big" + ACK + NAME.removeprefix("login\n") + palindrome)
    assert [x.chunk.length for x in record.exchanges if x.chunk] == [9, 1]
