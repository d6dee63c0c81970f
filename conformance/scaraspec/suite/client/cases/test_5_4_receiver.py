"""Clause 5.4: rules for both sides: buffer, end of a transfer, timeout (L789-795)."""

from collections.abc import Sequence
from contextlib import suppress

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.transfer import BUFFER_BYTES, Chunk, chunks_of
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.downloads import (
    Download,
    begin_download,
    send_download,
    split_content,
)
from scaraspec.suite.client.harness.files import expect_served, expect_transfer_failed
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.transfer_silence import (
    expect_given_up,
    expect_given_up_despite_queries,
    expect_survives_silence,
)
from scaraspec.suite.client.harness.two_stage import RUN, begin_and_accept, expect_finished
from scaraspec.suite.client.harness.uploads import Upload, receive_upload
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.chunks import chunk_of
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseSkipped, expect
from scaraspec.suite.engine.file_contents import content_of

_WHOLE = content_of(650)
_CHUNKS = tuple(chunks_of(_WHOLE))


@client_case("5.4/3")
def test_buffer_is_not_exceeded(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No chunk of an upload holds more than 200 bytes."""
    for size in examples((200, 201, 243, 255, 256, 400, 1000)):
        upload = Upload(subject, line, content_of(size))
        upload.accept_name()
        for frame in upload.chunk_frames():
            length = chunk_of(frame).length
            message = "a chunk exceeds the buffer"
            expect(length <= BUFFER_BYTES, message, expected="at most 200", observed=f"{length}")
        upload.expect_done()


# The end


@client_case("5.4/4")
def test_end_is_found(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download of any size is done with its last chunk, and the file is on the disk."""
    for size in examples((1, 199, 200, 201, 400, 401)):
        send_download(subject, line, content_of(size), "5.4/4")


@client_case("5.4/4", name="short-chunks")
@given(lengths=st.permutations([1, 7, 64, 128, 200]))
@example(lengths=[1, 1, 1, 1])
@example(lengths=[199, 199, 2])
def test_end_of_short_chunks(
    subject: ClientUnderTest, line: IncomingConnection, lengths: Sequence[int]
) -> None:
    """A download ends where position + length equals fileSize, not before."""
    download = begin_download(subject, line)
    for chunk in split_content(content_of(sum(lengths)), lengths):
        subject.expect_pending(download.call, "the client reports the end of a download too early")
        download.send_chunk(chunk, "5.4/4")
    download.expect_done("5.4/4")


# The timeout


@client_case("5.4/5")
def test_late_and_missing_chunks(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download survives two silences of 25 s and fails after 60 s; the link still works."""
    download = begin_download(subject, line)

    def first() -> None:
        download.send_chunk(_CHUNKS[0])

    def second() -> None:
        download.send_chunk(_CHUNKS[1])

    expect_survives_silence(subject, download.call, "5.4/5", first)
    expect_survives_silence(subject, download.call, "5.4/5", second)
    expect_given_up(subject, download.call, "5.4/5")
    _recovered(subject, line, download, 2)


@client_case("5.4/5", name="meanwhile")
def test_chunk_is_missing_amid_others(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A missing chunk ends a download while other requests are answered."""
    download = begin_download(subject, line)
    download.send_chunk(_CHUNKS[0])
    expect_given_up_despite_queries(subject, line, download.call, "5.4/5")


@client_case("5.4/5", name="promised")
def test_no_chunk_comes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download without any chunk times out; the link still works."""
    download = begin_download(subject, line)
    expect_given_up(subject, download.call, "5.4/5")
    _recovered(subject, line, download, 0)


@client_case("5.4/5", name="name")
def test_name_is_not_answered(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download whose name gets no answer times out; the link still works."""
    download = Download(subject, line)
    expect_given_up(subject, download.call, "5.4/5")
    if line.ending is None:
        line.reply("download_name")
    _recovered(subject, line, download, 0)


def _recovered(
    subject: ClientUnderTest, line: IncomingConnection, download: Download, count: int
) -> None:
    """Require that a late chunk is refused and another transfer works."""
    download.expect_failed("5.4/5")
    if line.ending is None:
        line.send_frame(download.chunk_frame(_CHUNKS[count]))
    line = expect_served(subject, line, "a silence")
    late = [seen for seen in line.inbox if seen.name == "download_chunk" and seen.value is True]
    message = "the client accepted a chunk after it aborted the download"
    expect(not late, message, expected="0 or silence", observed="1", requirement="5.4/5")
    line.inbox.clear()
    send_download(subject, line, _WHOLE, "5.4/6")
    with suppress(CaseSkipped):  # a client need not run programs
        call = begin_and_accept(subject, line, RUN)
        line.result(RUN.name)
        expect_finished(subject, call, requirement="5.4/6")


# After a failed transfer


@client_case("5.4/6", name="upload")
def test_served_after_a_broken_upload(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The link works after an upload was refused at its name or a chunk.

    The same file is then uploaded again from the beginning.
    """
    for count in examples((None, 0, 2)):
        name = "" if count is None else f"again{count}.rob"
        upload = Upload(subject, line, _WHOLE, name)
        if count is None:
            line.reply("upload_name", value=False)
            upload.expect_failed()
        else:
            upload.accept_name()
            for _ in range(count):
                upload.accept_chunk(upload.next_chunk().length)
            upload.refuse_chunk(upload.next_chunk())
        line = _next_transfers(subject, line, "a refused upload", sent=name)


@client_case("5.4/6", name="download")
def test_served_after_a_broken_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The link works after a download was refused or interrupted.

    The same file is then downloaded again from the beginning.
    """
    download = Download(subject, line)
    line.reply("download_name", value=False)
    expect_transfer_failed(subject, download.call)
    line = _next_transfers(subject, line, "a refused download")
    for bad in examples((Chunk(650, 200, 0, b""), Chunk(650, 200, 201, bytes(200)), _CHUNKS[3])):
        download = begin_download(subject, line, "again.rob")
        download.send_chunk(_CHUNKS[0])
        download.offer_chunk(bad)
        expect_transfer_failed(subject, download.call)
        line = _next_transfers(subject, line, "a failed download", fetched="again.rob")


def _next_transfers(
    subject: ClientUnderTest,
    line: IncomingConnection,
    what: str,
    *,
    sent: str = "",
    fetched: str = "",
) -> IncomingConnection:
    """Run a status query, an upload and a download with these names; return the connection."""
    line = expect_served(subject, line, what)
    receive_upload(subject, line, _WHOLE, sent)
    send_download(subject, line, _WHOLE, "5.4/6", fetched)
    return line
