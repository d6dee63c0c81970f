"""Clause 5.1: the structure fileData, sent and received by the client (L710-739)."""

from collections.abc import Iterable, Iterator, Sequence

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.transfer import (
    BUFFER_BYTES,
    FILE_DATA_BYTES,
    HEAD_BYTES,
    Chunk,
    chunks_of,
)
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.downloads import begin_download, split_content
from scaraspec.suite.client.harness.files import (
    expect_no_transfer_frames,
    expect_served,
    expect_transfer_failed,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.uploads import Upload
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.chunks import (
    chunk_of,
    expect_chunk_content,
    expect_chunk_length,
    expect_chunk_position,
    expect_within,
)
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.user_message import UserMessage

_SIZES = (1, 200, 201, 400, 450)
_WHOLE = content_of(450)
_SHORT_S = 0.1
_REPORT_S = 2.0


def _frames(
    subject: ClientUnderTest, line: IncomingConnection, content: bytes
) -> Iterator[ReceivedFrame]:
    """Yield the chunk frames that the client sends for a file, valid or not."""
    upload = Upload(subject, line, content)
    upload.accept_name()
    yield from upload.chunk_frames()
    upload.expect_done()


def _chunks(subject: ClientUnderTest, line: IncomingConnection, content: bytes) -> Iterator[Chunk]:
    return (chunk_of(frame) for frame in _frames(subject, line, content))


# As a sender


@client_case("5.1/1")
def test_structure(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every chunk of an upload is one fileData."""
    for size in examples(_SIZES):
        for frame in _frames(subject, line, content_of(size)):
            chunk_of(frame)


@client_case("5.1/2")
def test_size_of_the_structure(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A chunk of an upload has 212 data bytes; the last may be truncated after its content."""
    for size in examples(_SIZES):
        for frame in _frames(subject, line, content_of(size)):
            chunk, sent_bytes = frame.value, len(frame.frame.data)
            if sent_bytes == FILE_DATA_BYTES:
                continue
            expect(
                isinstance(chunk, Chunk) and sent_bytes == HEAD_BYTES + chunk.length,
                "a chunk does not have the size of fileData",
                expected=UserMessage("{count} bytes", count=FILE_DATA_BYTES),
                observed=UserMessage("{count} bytes", count=sent_bytes),
            )
            message = "the client truncates chunks after their content"
            subject.tolerate("5.1/2", "chunk_trunc", "truncated", message)


@client_case("5.1/3")
def test_file_size(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every chunk of an upload carries the size of the whole file."""
    for size in examples(_SIZES):
        for chunk in _chunks(subject, line, content_of(size)):
            expect_equal(chunk.file_size, size, "fileSize is not the size of the file")


@client_case("5.1/4")
def test_position(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every chunk of an upload carries its byte offset in the file."""
    for chunk in _chunks(subject, line, _WHOLE):
        expect_chunk_position(chunk, _WHOLE)


@client_case("5.1/5")
def test_length(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Every chunk of an upload carries its number of valid buffer bytes, 1 to 200."""
    for size in examples(_SIZES):
        content = content_of(size)
        for chunk in _chunks(subject, line, content):
            expect_chunk_length(chunk)
            expect_chunk_content(chunk, content)


@client_case("5.1/6")
def test_within_the_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No chunk of an upload exceeds its fileSize."""
    for size in examples(_SIZES):
        for chunk in _chunks(subject, line, content_of(size)):
            expect_within(chunk, size)


@client_case("5.1/7", name="upload")
def test_end_of_an_upload(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload is done when its last chunk is answered, not before; another may begin."""
    for size in examples((1, 200, 201)):
        upload = Upload(subject, line, content_of(size))
        upload.accept_name()
        while upload.received_bytes < size:
            chunk = upload.next_chunk()
            line.wait(_SHORT_S if chunk.last else 0)
            subject.expect_pending(
                upload.call,
                "the client reports the end of an upload before its last chunk is answered",
            )
            upload.accept_chunk(chunk.length)
        upload.expect_done()


@client_case("5.1/8")
@given(size=st.integers(1, 1000))
@example(size=1000)
def test_ascending(subject: ClientUnderTest, line: IncomingConnection, size: int) -> None:
    """An upload of any size arrives in ascending order, without gap or overlap."""
    due = 0
    for chunk in _chunks(subject, line, content_of(size)):
        expect_equal(chunk.position, due, "a chunk does not follow the previous chunk")
        due += chunk.length
    expect_equal(due, size, "an upload does not reach the end of its file")


@client_case("5.1/9")
def test_one_byte_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The chunks of all uploads of a session use one byte order."""
    byte_orders = set()
    for size in examples((1, 450, 70)):
        for frame in _frames(subject, line, content_of(size)):
            byte_orders |= _byte_orders_of(frame)
            expect(len(byte_orders) <= 1, "the byte order changes", expected="one", observed="both")
    if "big" in byte_orders:
        subject.tolerate("5.1/9", "endian", "big", "the client sends big-endian file data")


def _byte_orders_of(frame: ReceivedFrame) -> set[str]:
    """Return the byte order of a chunk; empty if its numbers are valid in both orders or none."""
    parsed = frame.seen.parsed
    return {v for k, v in parsed.decoded.readings if k == "endian"} if parsed else set()


@client_case("5.1/11")
def test_name_first(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the name first and waits for its answer, also the second time."""
    for _ in range(2):
        upload = Upload(subject, line, _WHOLE)
        message = "the client sent content before the name was answered"
        expect_no_transfer_frames(line, message, "5.1/11", _SHORT_S)
        upload.accept_name()
        upload.finish()


# As a receiver


@client_case("5.1/1", name="cut-off")
def test_incomplete_structure(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses a chunk that announces 200 bytes and carries fewer."""
    chunk = Chunk(200, 0, BUFFER_BYTES, content_of(200))
    for size in examples((HEAD_BYTES + 50, HEAD_BYTES + 199, HEAD_BYTES, HEAD_BYTES - 1, 1)):
        download = begin_download(subject, line)
        taken = download.offer_chunk(chunk, data=download.chunk_frame(chunk).data[:size])
        message = UserMessage(
            "the client accepted {size_bytes} bytes as a fileData", size_bytes=size
        )
        expect(not taken, message, expected="0", observed="1")
        download.expect_failed("5.1/1")
        line = expect_served(subject, line, "a truncated chunk")


@client_case("5.1/2", name="truncated")
def test_truncated_last_chunk(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A last chunk of a download that is truncated after its content is taken or refused."""
    for size in examples((1, 237, 450)):
        download = begin_download(subject, line)
        *full, last = chunks_of(content_of(size))
        for chunk in full:
            download.send_chunk(chunk)
        if download.offer_chunk(
            last, data=download.chunk_frame(last).data[: HEAD_BYTES + last.length]
        ):
            download.expect_done("5.1/2")
            continue
        download.expect_failed("5.1/2")
        message = "the client refuses a chunk that is truncated after its content"
        subject.tolerate("5.1/2", "chunk_trunc", "full", message)
        line = expect_served(subject, line, "a truncated chunk")


@client_case("5.1/4", name="download")
@given(lengths=st.permutations([1, 7, 64, 128, 200]))
def test_positions_taken(
    subject: ClientUnderTest, line: IncomingConnection, lengths: Sequence[int]
) -> None:
    """The client stores each chunk of a download at the byte offset of the chunk."""
    download = begin_download(subject, line)
    for chunk in split_content(content_of(sum(lengths)), lengths):
        download.send_chunk(chunk, "5.1/4")
    download.expect_done("5.1/4")


@client_case("5.1/7", name="download")
def test_end_of_a_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download is done with its last chunk, not before; another may begin at once."""
    for size in examples((1, 200, 201)):
        download = begin_download(subject, line)
        for chunk in chunks_of(content_of(size)):
            line.wait(_SHORT_S if chunk.last else 0)
            subject.expect_pending(
                download.call, "the client reports the end of a download before its last chunk"
            )
            download.send_chunk(chunk)
        download.expect_done("5.1/7")


@client_case("5.1/9", name="big-endian")
def test_other_byte_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download in the other byte order is understood, or fails."""
    byte_order = "little" if subject.dialect["endian"] == "big" else "big"
    for size in examples((1, 256, 450)):
        download = begin_download(subject, line)
        if all(
            download.offer_chunk(chunk, byte_order=byte_order)
            for chunk in chunks_of(content_of(size))
        ):
            download.expect_done("5.1/9")
            continue
        download.expect_failed("5.1/9")
        message = UserMessage(
            "the client does not understand {byte_order}-endian file data", byte_order=byte_order
        )
        subject.tolerate("5.1/9", "endian", subject.dialect["endian"], message)
        line = expect_served(subject, line, "a download in the other byte order")


@client_case("5.1/9", name="own")
def test_own_byte_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client understands a download in the byte order of its own uploads."""
    frames = list(_frames(subject, line, _WHOLE))
    byte_orders = set[str]().union(*map(_byte_orders_of, frames))
    for byte_order in byte_orders:
        for size in examples((1, 256, 450)):
            download = begin_download(subject, line)
            try:
                for chunk in chunks_of(content_of(size)):
                    line.send_frame(download.chunk_frame(chunk, byte_order))
                    download.expect_taken(chunk)
                download.expect_done()
            except (
                CaseFailed
            ) as error:  # the same chunks in the other order have cases of their own
                error.requirement = "5.1/9"
                raise


@client_case("5.1/12")
@given(lengths=st.lists(st.integers(1, BUFFER_BYTES), min_size=1, max_size=6), filler=st.binary())
@example(lengths=[50], filler=b"\xaa")
@example(lengths=[200, 1], filler=b"\xcc")
@example(lengths=[1, 199, 1], filler=b"!")
def test_rest_of_the_buffer(
    subject: ClientUnderTest, line: IncomingConnection, lengths: list[int], filler: bytes
) -> None:
    """The client stores the valid bytes of a chunk and ignores the rest of the buffer."""
    download = begin_download(subject, line)
    for chunk in split_content(content_of(sum(lengths)), lengths):
        download.send_chunk(_filled(chunk, filler), "5.1/12")
    download.expect_done("5.1/12")


def _filled(chunk: Chunk, filler: bytes) -> Chunk:
    """Return the chunk with a filler after its valid bytes."""
    return chunk._replace(buffer=(chunk.buffer + filler * BUFFER_BYTES)[:BUFFER_BYTES])


def _not_complete(
    subject: ClientUnderTest,
    line: IncomingConnection,
    sent: Iterable[Chunk],
    missing: Iterable[Chunk],
) -> None:
    """Send chunks that leave a file incomplete, and then the missing chunks.

    A client may refuse these chunks (A-5-8). A client that takes them must wait for the missing
    ones. Its answer shows whether it takes the file for complete.
    """
    download = begin_download(subject, line)
    taken = all(download.offer_chunk(chunk) for chunk in sent)
    line.wait(_SHORT_S)
    if (
        not taken
        or download.call.answer is not None
        or not all(download.offer_chunk(chunk) for chunk in missing)
    ):
        expect_transfer_failed(subject, download.call, "5.1/13")
        return
    download.received = _LONG
    download.expect_done("5.1/13")
    subject.tolerate("5.1/13", "chunk_order", "any", "the client accepts chunks in any order")


_LONG = content_of(600)
_FIRST, _SECOND, _THIRD = chunks_of(_LONG)


@client_case("5.1/13", name="last-first")
def test_last_chunk_first(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download whose last chunk arrives first is not complete."""
    _not_complete(subject, line, [_THIRD], [_FIRST, _SECOND])


@client_case("5.1/13", name="gap")
def test_gap(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download with a gap is not complete when its last chunk arrives."""
    _not_complete(subject, line, [_FIRST, _THIRD], [_SECOND])


@client_case("5.1/13", name="repeated")
def test_repeated_chunk(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download is not complete because a chunk arrives twice."""
    _not_complete(subject, line, [_FIRST, _SECOND, _SECOND], [_THIRD])


@client_case("5.1/13", name="overlap")
def test_overlap(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download is not complete because chunks overlap."""
    between = Chunk(600, 100, 200, _LONG[100:300])
    _not_complete(subject, line, [_FIRST, between, _SECOND], [_THIRD])


@client_case("5.1/13", name="larger-size")
def test_file_size_grows(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download whose second chunk has a larger fileSize is refused, or reaches that size."""
    download = begin_download(subject, line)
    sizes = (450, 600, 600)
    chunks = (c._replace(file_size=s) for c, s in zip(chunks_of(_LONG), sizes, strict=True))
    if not all(download.offer_chunk(chunk) for chunk in chunks):
        expect_transfer_failed(subject, download.call, "5.1/13")
        return
    download.expect_done("5.1/13")
    subject.tolerate(
        "5.1/13", "A-5-7", "last", "the client accepts a file size that changes during the download"
    )


@client_case("5.1/13", name="smaller-size")
def test_file_size_shrinks(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download whose later chunk has a smaller fileSize is refused, or ends there."""
    download = begin_download(subject, line)
    download.send_chunk(_FIRST)
    taken = download.offer_chunk(Chunk(250, 200, 50, _LONG[200:250]))
    if not taken or not subject.answers_within(download.call, _REPORT_S) or not download.call.ok:
        expect_transfer_failed(subject, download.call, "5.1/13")
        return
    download.expect_done("5.1/13")
    message = "the client uses the file size of the last chunk"
    subject.tolerate("5.1/13", "A-5-7", "last", message)
