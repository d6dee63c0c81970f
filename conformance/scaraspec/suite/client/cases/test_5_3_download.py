"""Clause 5.3: downloading a file (0x54, 0x56; L765-787), and the file on the disk."""

import itertools
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.transfer import BUFFER_BYTES, HEAD_BYTES, Chunk, chunks_of
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.downloads import (
    Download,
    begin_download,
    send_download,
    split_content,
)
from scaraspec.suite.client.harness.files import (
    expect_no_transfer_frames,
    expect_served,
    expect_transfer_failed,
    request_or_none,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import reopen
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.strategies import NAME_CHARACTERS
from scaraspec.user_message import UserMessage

_WHOLE = content_of(650)
_CHUNKS = tuple(chunks_of(_WHOLE))
_SHORT_S = 0.1
_LARGE_BYTES = 65_936  # 400 in a 16-bit counter; a chunk ends at 400


def _sent(subject: ClientUnderTest, line: IncomingConnection, count: int) -> Download:
    """Return a download of which this number of chunks was accepted."""
    download = begin_download(subject, line)
    for chunk in _CHUNKS[:count]:
        download.send_chunk(chunk)
    return download


# The name


@client_case("5.3/1")
@given(name=st.text(f"{NAME_CHARACTERS}.", min_size=1, max_size=30).filter(lambda n: n.strip(".")))
@example(name="file2.txt")
@example(name="x")
@example(name="a" * 26 + ".rob")
def test_names(subject: ClientUnderTest, line: IncomingConnection, name: str) -> None:
    """A download requests the name at its real length, for any name of the local file."""
    with subject.allow_refusal():
        download = Download(subject, line, name)
        download.accept_name()
        download.send_chunk(Chunk(1, 0, 1, b"!"))
        download.expect_done()


# The answers


@client_case("5.3/5", attended=True)
def test_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client downloads a file and answers each chunk with 1."""
    send_download(subject, line, _WHOLE)


@client_case("5.3/5", name="once")
def test_one_answer_each(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client answers each chunk exactly once."""
    download = begin_download(subject, line)
    message = "the client answered a chunk before it was sent"
    expect_no_transfer_frames(line, message, "5.3/5", _SHORT_S)
    for chunk in _CHUNKS:
        download.send_chunk(chunk)
        expect_no_transfer_frames(line, "the client answered a chunk twice", "5.3/5", _SHORT_S)
    download.expect_done()


@client_case("5.3/5", name="together")
def test_chunk_with_the_name_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client answers a first chunk that arrives in one segment with the name answer."""
    for size in examples((1, 200, 450)):
        download = Download(subject, line)
        first, *rest = chunks_of(content_of(size))
        line.send_bytes(line.frame("download_name").encode() + download.chunk_frame(first).encode())
        download.expect_taken(first)
        for chunk in rest:
            download.send_chunk(chunk)
        download.expect_done()


@client_case("5.3/5", name="in-pieces")
def test_chunk_in_pieces(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client answers a chunk once whose frame arrives in pieces."""
    chunk = Chunk(200, 0, BUFFER_BYTES, content_of(200))
    for at in examples((*range(1, HEAD_BYTES + 4), 100, 213, 214, 215)):
        download = begin_download(subject, line)
        data = download.chunk_frame(chunk).encode()
        for piece in (data[:at], data[at : at + 1], data[at + 1 :]):
            line.send_bytes(piece)
            line.wait(0.005)
        download.expect_taken(chunk)
        expect_no_transfer_frames(line, "the client answered a chunk in pieces twice", "5.3/5")
        download.expect_done()


@client_case("5.3/5", name="refused")
def test_refusal_is_an_answer(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client answers an invalid chunk with 0, or ends the connection."""
    for count in examples(range(3)):
        download = _sent(subject, line, count)
        answered = download.offer_chunk(Chunk(650, 200 * count, 201, bytes(200)))
        expect(
            answered is False or (answered is None and line.ended),
            "the client did not answer an invalid chunk with 0",
            expected="0",
            observed="1" if answered else "silence",
        )
        download.expect_failed()
        line = expect_served(subject, line, "a refused chunk")
        expect_no_transfer_frames(line, "the client answered a chunk twice", "5.3/5")


@client_case("5.3/5", name="unasked")
def test_unsolicited_chunk(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client does not take a chunk without a download, before and after one."""
    download = Download(subject, line)
    line.reply("download_name", value=False)
    download.expect_failed()
    line = expect_served(subject, line, "a refused download")
    for _ in range(2):
        line = _refuses_stray(subject, line, download)
        download = _sent(subject, line, len(_CHUNKS))
        download.expect_done()
    expect_equal(download.stored, _WHOLE, "a chunk without a download changed the previous file")


@client_case("5.3/5", "5.2/19", name="after-refusal")
def test_chunk_after_a_refusal(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A chunk with the refusal of a download, or 0.1 s after it, is not taken."""
    content = content_of(BUFFER_BYTES)
    for size, together in examples(itertools.product((BUFFER_BYTES, 450), (True, False))):
        download = Download(subject, line)
        refusal = line.frame("download_name", value=False).encode()
        chunk = download.chunk_frame(Chunk(size, 0, BUFFER_BYTES, content)).encode()
        with suppress(NoReply):  # the client has closed the connection
            line.send_bytes(refusal + chunk if together else refusal)
            if not together:
                line.wait(_SHORT_S)
                line.send_bytes(chunk)
        message = "the client accepted a chunk of a refused download"
        expect(not download.await_answer(), message, expected="0 or silence", observed="1")
        download.expect_failed()
        line = expect_served(subject, line, "a chunk of a refused download")
        line.inbox.clear()


def _refuses_stray(
    subject: ClientUnderTest, line: IncomingConnection, download: Download
) -> IncomingConnection:
    """Send a chunk without a download and require no answer 1; return the connection."""
    line.send_frame(download.chunk_frame(_CHUNKS[0]))
    line = expect_served(subject, line, "a chunk without a download")
    taken = [s for s in line.inbox if s.name == "download_chunk" and s.value is True]
    message = "the client accepted a chunk without a download"
    expect(not taken, message, expected="0 or silence", observed="1")
    line.inbox.clear()
    return line


# The error signal


@client_case("5.3/8", attended=True)
def test_error_signal(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A chunk frame without data ends a download with a failure."""
    download = begin_download(subject, line)
    line.reply("download_chunk", data=b"")
    subject.expect_failure(download.call)


@client_case("5.3/8")
@pytest.mark.parametrize("signal", ["no-data", "length-0", "numbers-only"])
def test_error_signals(subject: ClientUnderTest, line: IncomingConnection, signal: str) -> None:
    """An error signal of this form, before or after any chunk, ends the download.

    Its position may be the end of the file (L737), but bytes are still missing.
    """
    for count in examples(range(4)):
        download = _sent(subject, line, count)
        chunk = Chunk(650, 650 if count % 2 else 200 * count, 0, b"")
        whole = download.chunk_frame(chunk).data
        data = {"no-data": b"", "length-0": whole, "numbers-only": whole[:HEAD_BYTES]}[signal]
        taken = download.offer_chunk(chunk, data=data)
        expect(
            not taken, "the client took the error signal for content", expected="0", observed="1"
        )
        if not line.ended:
            again = download.offer_chunk(_CHUNKS[count])
            message = "the client continues a download after the error signal"
            expect(not again, message, expected="0 or silence", observed="1")
        download.expect_failed("5.3/8")
        line = expect_served(subject, line, "the error signal")
        line.inbox.clear()


@client_case("5.3/8", name="empty-file")
def test_empty_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A chunk of length 0 with fileSize 0 ends the download: a failure or an empty file."""
    download = begin_download(subject, line)
    taken = download.offer_chunk(Chunk(0, 0, 0, b""))
    if taken or subject.wait_for_answer(download.call).ok:
        download.expect_done("5.3/8")
        message = "the client takes a chunk of length 0 for an empty file"
        subject.tolerate("5.3/8", "empty_file", "chunk", message)
        return
    download.expect_failed("5.3/8")


# The file


@client_case("5.3/11")
@given(lengths=st.lists(st.integers(1, BUFFER_BYTES), min_size=1, max_size=6))
@example(lengths=[200, 200, 1])
@example(lengths=[1, 1, 1])
@example(lengths=[199, 200])
def test_whole_file(
    subject: ClientUnderTest, line: IncomingConnection, lengths: Sequence[int]
) -> None:
    """The client stores a download in chunks of any lengths byte for byte."""
    download = begin_download(subject, line)
    for chunk in split_content(content_of(sum(lengths)), lengths):
        download.send_chunk(chunk)
    download.expect_done()


@client_case("5.3/11", name="content")
@given(content=st.binary(min_size=1, max_size=500))
@example(content=bytes(range(256)))
@example(content=b"\r\n".join([b"line"] * 60) + b"\n\n\r\n")
@example(content=b"\xef\xbb\xbfwith a mark\x1aand an end\x1a\x04")
@example(content=b"  blanks and zeros \t\n\0\0\0")
@example(content="控制层".encode("gb18030") * 50)
def test_content(subject: ClientUnderTest, line: IncomingConnection, content: bytes) -> None:
    """The client stores a file with any content byte for byte."""
    send_download(subject, line, content)


@client_case("5.3/11", name="large")
def test_large_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client stores a file larger than 65535 bytes, or refuses it at its first chunk."""
    download = begin_download(subject, line)
    first, *rest = chunks_of(content_of(_LARGE_BYTES))
    if not download.offer_chunk(first):
        download.expect_failed()
        message = UserMessage(
            "the client does not accept a file of {large_bytes} bytes", large_bytes=_LARGE_BYTES
        )
        subject.tolerate("5.3/11", "A-5-25", "limit", message)
        return
    for chunk in rest:
        download.send_chunk(chunk, "5.3/11")
    download.expect_done()


@client_case("5.3/11", name="one-after-another")
def test_one_after_another(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A short file after a long file of the same name contains nothing of the long file."""
    for size in examples((650, 10, 400, 1)):
        send_download(subject, line, content_of(size, size), remote="zs-each-time.rob")


@client_case("5.3/12", attended=True)
def test_existing_local_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client does not overwrite an existing local file."""
    local = subject.make_file(b"mine")
    call = subject.begin("download", remote="zs-theirs.rob", local=local)
    sent = request_or_none(subject, line, call, "download_name") is not None
    if sent:
        line.reply("download_name")
        line.send_chunk(Chunk(6, 0, 6, b"theirs"))
    subject.expect_failure(call)
    expect_equal(Path(local).read_bytes(), b"mine", "the client overwrote a local file")
    line = reopen(subject, line) if sent else line
    send_download(subject, line, _WHOLE)


@client_case("5.3/12", name="kept")
@pytest.mark.parametrize("mine", [b"", b"mine", _WHOLE, _WHOLE + b"more"], ids=len)
def test_local_file_stays(subject: ClientUnderTest, line: IncomingConnection, mine: bytes) -> None:
    """An existing local file of any size stays unchanged, and the download fails."""
    local = subject.make_file(mine)
    call = subject.begin("download", remote="zs-theirs.rob", local=local)
    if request_or_none(subject, line, call, "download_name") is not None:
        line.reply("download_name")
        for chunk in _CHUNKS:
            line.send_chunk(chunk)
            if request_or_none(subject, line, call, "download_chunk", subject.silence_s) is None:
                break
    expect_transfer_failed(subject, call, "5.3/12")
    expect(
        Path(local).exists() and Path(local).read_bytes() == mine,
        "a download changed an existing local file",
        expected=UserMessage("its {count} bytes", count=len(mine)),
        observed="another file, or none",
    )


# Chunks out of bounds


_MOST = 2**32 - 1
_OUT_OF_BOUNDS = {
    "length-201": Chunk(650, 0, 201, _WHOLE[:200]),
    "length-201-sent": Chunk(650, 0, 201, _WHOLE[:201]),
    "length-243-sent": Chunk(650, 0, 243, _WHOLE[:243]),
    "whole-file-of-201": Chunk(201, 0, 201, _WHOLE[:201]),
    "length-above-2-to-the-31": Chunk(650, 0, 2**31 + 1, _WHOLE[:200]),  # in any byte order (A-5-2)
    "length-most": Chunk(650, 0, _MOST, _WHOLE[:200]),
    "beyond-a-small-file": Chunk(100, 0, 200, _WHOLE[:200]),
    "beyond-by-one": Chunk(199, 0, 200, _WHOLE[:200]),
    "at-the-end": Chunk(650, 650, 1, b"!"),
    "sum-wraps-round": Chunk(184, 2**32 - 16, 200, _WHOLE[:200]),
}


@client_case("5.3/13")
@pytest.mark.parametrize("chunk", _OUT_OF_BOUNDS.values(), ids=_OUT_OF_BOUNDS)
def test_first_chunk_out_of_bounds(
    subject: ClientUnderTest, line: IncomingConnection, chunk: Chunk
) -> None:
    """The client rejects a first chunk that is out of bounds, and the download fails."""
    download = begin_download(subject, line)
    _rejected(download, chunk)


@client_case("5.3/13", name="later")
def test_later_chunk_out_of_bounds(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client rejects a later chunk that exceeds the buffer or fileSize."""
    for count, size, length in examples(
        ((1, 650, 201), (2, 650, 243), (3, 650, 51), (3, 650, 200), (1, 650, 256 + 200))
    ):
        download = _sent(subject, line, count)
        position = 200 * count
        _rejected(download, Chunk(size, position, length, content_of(min(max(length, 200), 243))))
        line = expect_served(subject, line, "a chunk out of bounds")


def _rejected(download: Download, chunk: Chunk) -> None:
    taken = download.offer_chunk(chunk)
    expect(
        not taken,
        UserMessage(
            "the client accepted a chunk of length {length} at {position} of a file of {file_size}"
            " bytes",
            length=chunk.length,
            position=chunk.position,
            file_size=chunk.file_size,
        ),
        expected="0",
        observed="1",
    )
    download.expect_failed("5.3/13")
