"""File transfers: with the receiver and sender of `protocol.transfer`, and with invalid chunks."""

from typing import Any

import pytest

from scaraspec.client.errors import LinkLost, TransferFailed
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, TransferState, chunks_of

SIZES = (1, 199, 200, 201, 400, 51_200, 65_535, 65_536, 70_000)
UP, UP_CHUNK, DOWN, DOWN_CHUNK = 0x50, 0x52, 0x54, 0x56


def content_of(size: int) -> bytes:
    """Return bytes of all values, including start and end bytes."""
    return bytes(i * 7 % 256 for i in range(size))


def chunk(file_size: int, position: int, length: int, data: bytes = b"") -> bytes:
    """Return a valid or invalid chunk of a controller."""
    return FILE_DATA.encode(Chunk(file_size, position, length, data), DEFAULT)


def upload(play: Any, content: bytes, name: bytes = b"a.rob") -> Any:
    """Return a started upload."""
    return play.begin(play.core.upload(name, content))


def download(play: Any, name: bytes = b"a.rob", **options: int) -> Any:
    """Return a download whose name was accepted."""
    operation = play.begin(play.core.download(name, **options))
    play.receive_frame(DOWN, b"1")
    return operation


@pytest.mark.parametrize("size", SIZES)
def test_an_upload_is_complete(play: Any, size: int) -> None:
    """5.2/16, 5.1, 5.2/7: one chunk at a time, and nothing after the last reply."""
    content, receiver = content_of(size), Receiver(0.0)
    transfer = upload(play, content)
    assert play.sent() == [(UP, b"a.rob")]
    play.receive_frame(UP, b"1")
    while receiver.state is TransferState.ACTIVE:
        ((opcode, data),) = play.sent()
        assert (opcode, len(data)) == (UP_CHUNK, 212)
        assert receiver.receive_chunk(data, 0.0)
        play.receive_frame(UP_CHUNK, b"1")
    assert receiver.content == content
    assert transfer.outcome() is None
    assert play.sent() == []
    assert (transfer.moved_bytes, transfer.total_bytes) == (size, size)


@pytest.mark.parametrize("endian", ["little", "big"])
@pytest.mark.parametrize("trunc", ["full", "truncated"])
@pytest.mark.parametrize("size", SIZES)
def test_a_download_is_complete(play: Any, size: int, trunc: str, endian: str) -> None:
    """5.2/16, 5.3/5, A-5-2, A-5-3: for every form of chunk."""
    dialect = Dialect.of(endian=endian, chunk_trunc=trunc)
    content, transfer = content_of(size), download(play)
    sender = Sender(content, 0.0, dialect)
    assert play.sent() == [(DOWN, b"a.rob")]
    while sender.state is TransferState.ACTIVE:
        piece = sender.next_chunk()
        assert piece is not None
        play.receive_frame(DOWN_CHUNK, FILE_DATA.encode(piece, dialect))
        assert play.sent() == [(DOWN_CHUNK, b"1")]
        sender.acknowledge(accepted=True, now_s=0.0)
    assert transfer.outcome() == content
    assert (transfer.moved_bytes, transfer.total_bytes) == (size, size)


def test_other_commands_work_during_a_transfer(play: Any) -> None:
    """A-5-17; a second transfer must wait."""
    upload(play, content_of(500))
    play.receive_frame(UP, b"1")
    status = play.ask("get_status")
    play.receive_frame(0x09, b"00")
    assert status.settled
    assert not play.core.is_free("transfer")


@pytest.mark.parametrize("answer", [b"0", b"", b"2", b"\x01", b"11"])
def test_a_refused_name_is_not_followed_by_content(play: Any, answer: bytes) -> None:
    """No chunk is sent after a refused name (5.2/4, 5.2/19)."""
    transfer = upload(play, b"content")
    play.receive_frame(UP, answer)
    assert play.sent() == [(UP, b"a.rob")]
    with pytest.raises(TransferFailed, match=r"the upload of 'a.rob' failed: .+"):
        transfer.outcome()


@pytest.mark.parametrize("answer", [b"0", b"", b"2", b"11"])
def test_a_refused_chunk_ends_an_upload(play: Any, answer: bytes) -> None:
    """5.2/8, 5.2/19: also the last chunk; nothing is sent after it."""
    transfer = upload(play, content_of(300))
    play.receive_frame(UP, b"1")
    play.receive_frame(UP_CHUNK, b"1")
    play.sent()
    play.receive_frame(UP_CHUNK, answer)
    assert play.sent() == []
    assert isinstance(transfer.error, TransferFailed)
    assert play.core.is_free("transfer")


def test_a_refused_first_chunk_names_the_likely_reading(play: Any) -> None:
    upload = play.begin(play.core.upload(b"a.rob", b"content"))
    play.receive_frame(0x50, b"1")
    play.receive_frame(0x52, b"0")
    with pytest.raises(TransferFailed, match=r"byte 0 \(L758\); .* may be endian=big"):
        upload.outcome()


@pytest.mark.parametrize("answers", [[], [UP], [UP, UP_CHUNK]])
def test_an_upload_times_out_between_25_and_60_s(play: Any, answers: list[int]) -> None:
    """5.2/9, 5.4/5: for the name and every chunk; the link stays usable."""
    transfer = upload(play, content_of(500))
    for opcode in answers:
        play.wait_for(25)
        play.receive_frame(opcode, b"1")
    play.wait_for(30)
    assert not transfer.settled
    play.wait_for(5)
    with pytest.raises(TransferFailed, match="no frame for 30 s"):
        transfer.outcome()
    assert [opcode for opcode, _ in play.sent()] == [UP, UP_CHUNK, UP_CHUNK][: len(answers) + 1]
    version = play.ask("get_version")
    play.receive_frame(0x08, b"1.0.0")
    assert version.settled


@pytest.mark.parametrize("granted", [False, True])
def test_a_download_times_out_between_25_and_60_s(play: Any, granted: bool) -> None:  # noqa: FBT001 - a parameter of the test
    """A missing chunk ends the download (5.4/5, 5.4/6)."""
    transfer = play.begin(play.core.download(b"a.rob"))
    if granted:
        play.wait_for(25)
        play.receive_frame(DOWN, b"1")
        play.wait_for(25)
        play.receive_frame(DOWN_CHUNK, chunk(300, 0, 200, content_of(200)))
    play.wait_for(30)
    assert not transfer.settled
    play.wait_for(5)
    assert isinstance(transfer.error, TransferFailed)
    version = play.ask("get_version")
    play.receive_frame(0x08, b"1.0.0")
    assert version.settled


def test_the_timeout_follows_the_dialect(new_play: Any) -> None:
    """A SUT may claim another timeout than the tentative 30 s (A-5-13)."""
    play = new_play(Dialect.of(xfer_timeout="2"))
    transfer = upload(play, b"content")
    play.wait_for(2)
    assert not transfer.settled
    play.wait_for(0.1)
    assert transfer.settled


def test_a_refused_download_fails(play: Any) -> None:
    """A refused name raises an error (L772)."""
    transfer = play.begin(play.core.download(b"a.rob"))
    play.receive_frame(DOWN, b"0")
    with pytest.raises(TransferFailed, match="refused the name"):
        transfer.outcome()


BAD_CHUNKS = {
    "longer than the buffer": chunk(1000, 200, 201, content_of(200)),
    "beyond the end of the file": chunk(300, 200, 101, content_of(101)),
    "of another file size": chunk(301, 200, 101, content_of(101)),
    "a gap": chunk(300, 201, 99, content_of(99)),
    "a duplicate": chunk(300, 0, 200, content_of(200)),
}


@pytest.mark.parametrize("bad", BAD_CHUNKS.values(), ids=BAD_CHUNKS)
def test_a_bad_chunk_is_rejected_once(play: Any, bad: bytes) -> None:
    """5.3/13, 5.1/13: the reply is ``0``, and the download fails."""
    transfer = download(play)
    play.receive_frame(DOWN_CHUNK, chunk(300, 0, 200, content_of(200)))
    play.sent()
    play.receive_frame(DOWN_CHUNK, bad)
    assert play.sent() == [(DOWN_CHUNK, b"0")]
    assert isinstance(transfer.error, TransferFailed)


@pytest.mark.parametrize("signal", [b"", chunk(300, 0, 0), chunk(0, 0, 0), chunk(300, 200, 0)])
def test_a_length_of_zero_ends_a_download_without_reply(play: Any, signal: bytes) -> None:
    """A chunk of length 0 is the error signal (5.3/8, A-5-10)."""
    transfer = download(play)
    play.sent()
    play.receive_frame(DOWN_CHUNK, signal)
    assert play.sent() == []
    with pytest.raises(TransferFailed, match="length 0"):
        transfer.outcome()


def test_padding_is_ignored(play: Any) -> None:
    """5.1/12: exactly `length` bytes of the buffer are the file's."""
    transfer = download(play)
    play.receive_frame(DOWN_CHUNK, chunk(3, 0, 3, b"abc" + b"\xcc" * 197))
    assert transfer.outcome() == b"abc"


def test_a_file_that_is_too_large_is_refused_at_once(play: Any) -> None:
    """A-5-25: the memory is limited."""
    transfer = download(play, limit_bytes=1000)
    play.sent()
    play.receive_frame(DOWN_CHUNK, chunk(1001, 0, 200, content_of(200)))
    assert play.sent() == [(DOWN_CHUNK, b"0")]
    assert isinstance(transfer.error, TransferFailed)


def test_chunks_in_any_order_if_the_dialect_allows_it(new_play: Any) -> None:
    """A-5-8: a file without gaps is complete."""
    play = new_play(Dialect.of(chunk_order="any"))
    content, transfer = content_of(500), download(play)
    for piece in reversed(list(chunks_of(content))):
        assert not transfer.settled
        play.receive_frame(DOWN_CHUNK, FILE_DATA.encode(piece, DEFAULT))
    assert transfer.outcome() == content


def test_a_chunk_without_transfer_is_refused(play: Any) -> None:
    """5.3/5: each chunk gets one reply."""
    play.receive_frame(DOWN_CHUNK, chunk(3, 0, 3, b"abc"))
    assert play.sent() == [(DOWN_CHUNK, b"0")]
    play.receive_frame(DOWN_CHUNK, b"")
    play.receive_frame(DOWN_CHUNK, chunk(3, 0, 0))
    assert play.sent() == []


def test_a_chunk_before_the_reply_to_the_name_is_refused(play: Any) -> None:
    """A-5-23: the reply comes first."""
    transfer = play.begin(play.core.download(b"a.rob"))
    play.receive_frame(DOWN_CHUNK, chunk(3, 0, 3, b"abc"))
    assert not transfer.settled
    assert play.sent() == [(DOWN, b"a.rob"), (DOWN_CHUNK, b"0")]


@pytest.mark.parametrize("name", [b"", b"n" * 31, b"a|b", b"a/b", b"..", b"a\\b", b"a\0"])
def test_names_are_checked_before_anything_is_sent(play: Any, name: bytes) -> None:
    """An invalid name raises an error (5.2/18, T/6, A-5-20)."""
    with pytest.raises(PayloadError):
        upload(play, b"x", name)
    with pytest.raises(PayloadError):
        play.core.download(name)
    assert play.sent() == []


def test_an_empty_file_is_not_sent(play: Any) -> None:
    """An empty file raises an error by default (5.2/17, A-5-10)."""
    with pytest.raises(PayloadError, match="empty file"):
        upload(play, b"")
    assert play.sent() == []


@pytest.mark.parametrize(
    ("reading", "answers", "sent"),
    [("name-only", [UP], []), ("chunk", [UP, UP_CHUNK], [(UP_CHUNK, chunk(0, 0, 0))])],
)
def test_an_empty_file_is_sent_as_in_the_dialect(
    new_play: Any, reading: str, answers: list[int], sent: list[Any]
) -> None:
    """An empty file is sent as its name alone, or with one empty chunk (A-5-10 b and c)."""
    play = new_play(Dialect.of(empty_file=reading))
    transfer = upload(play, b"")
    for opcode in answers:
        assert not transfer.settled
        play.receive_frame(opcode, b"1")
    assert transfer.outcome() is None
    assert play.sent() == [(UP, b"a.rob"), *sent]


def test_an_empty_file_is_accepted_if_the_dialect_allows_it(new_play: Any) -> None:
    """A chunk of length 0 completes an empty file (A-5-10 c)."""
    play = new_play(Dialect.of(empty_file="chunk"))
    transfer = download(play)
    play.receive_frame(DOWN_CHUNK, chunk(0, 0, 0))
    assert transfer.outcome() == b""


def test_an_aborted_upload_sends_the_error_signal(play: Any) -> None:
    """L787, 5.2/7: a length of 0 instead of the next chunk, after the reply to the previous one."""
    transfer = upload(play, content_of(500))
    play.receive_frame(UP, b"1")
    transfer.abort()
    assert len(play.sent()) == 2
    play.receive_frame(UP_CHUNK, b"1")
    assert play.sent() == [(UP_CHUNK, chunk(500, 200, 0))]
    with pytest.raises(TransferFailed, match="aborted"):
        transfer.outcome()


def test_an_abort_after_the_last_chunk_has_no_effect(play: Any) -> None:
    """A complete upload succeeds (5.2/19)."""
    transfer = upload(play, b"content")
    play.receive_frame(UP, b"1")
    transfer.abort()
    play.receive_frame(UP_CHUNK, b"1")
    assert transfer.outcome() is None


def test_an_aborted_download_is_refused_at_the_next_chunk(play: Any) -> None:
    """The reply to the next chunk is 0 (5.3/5)."""
    transfer = download(play)
    transfer.abort()
    play.sent()
    play.receive_frame(DOWN_CHUNK, chunk(3, 0, 3, b"abc"))
    assert play.sent() == [(DOWN_CHUNK, b"0")]
    with pytest.raises(TransferFailed, match="aborted"):
        transfer.outcome()


def test_a_lost_link_fails_a_transfer(play: Any) -> None:
    """5.2/19: the transfer fails."""
    transfer = upload(play, b"content")
    play.core.connection_lost("the cable is out", play.now_s)
    with pytest.raises(LinkLost):
        transfer.outcome()
