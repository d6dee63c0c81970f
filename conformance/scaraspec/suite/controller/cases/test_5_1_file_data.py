"""Clause 5.1: the structure fileData, as the controller sends and receives it (L710-739)."""

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, FILE_DATA_BYTES, HEAD_BYTES, Chunk
from scaraspec.suite.controller.harness.controller_under_test import SILENCE_S, ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    begin_upload,
    delete,
    download,
    download_replies,
    expect_begun,
    expect_nothing_more,
    expect_stored,
    reconnect,
    send_chunk,
    try_chunk,
    upload,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.chunks import (
    chunk_of,
    expect_chunk_content,
    expect_chunk_length,
    expect_chunk_position,
    expect_within,
)
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.user_message import UserMessage

_SIZES = (1, 200, 201, 400, 450)
_CONTENT = content_of(450)


def _downloaded_chunks(
    subject: ControllerUnderTest, line: OutgoingConnection, content: bytes = _CONTENT
) -> list[Chunk]:
    """Upload a file, and return the chunks of its download, valid or not."""
    name = subject.new_name()
    upload(line, name, content)
    return [chunk_of(frame) for frame in download_replies(line, name)]


# The controller as sender


@case("5.1/1")
def test_structure(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every chunk of a download is one fileData."""
    for size in examples(_SIZES):
        _downloaded_chunks(subject, line, content_of(size))


@case("5.1/1", name="torn", slow=True)
def test_incomplete_structure(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk with fewer bytes than its length states, or an incomplete header, is refused."""
    whole = FILE_DATA.encode(Chunk(200, 0, BUFFER_BYTES, content_of(200)), subject.dialect)
    for size in examples((HEAD_BYTES + 50, HEAD_BYTES + 199, HEAD_BYTES, HEAD_BYTES - 1, 1)):
        begin_upload(line, subject.new_name())
        timeout_s = SILENCE_S if size <= HEAD_BYTES else None  # may be the error signal of L787
        accepted = try_chunk(line, data=whole[:size], within_s=timeout_s)
        expect(
            not accepted,
            UserMessage("{size} bytes were accepted as a fileData", size=size),
            expected="0",
            observed="1",
        )
        line = reconnect(subject, line)


@case("5.1/2")
def test_size_of_the_structure(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk of a download has 212 data bytes; it may end after its content."""
    for size in examples(_SIZES):
        name = subject.new_name()
        upload(line, name, content_of(size))
        for frame in download_replies(line, name):
            chunk, bytes_sent = frame.value, len(frame.frame.data)
            if bytes_sent == FILE_DATA_BYTES:
                continue
            truncated = isinstance(chunk, Chunk) and bytes_sent == HEAD_BYTES + chunk.length
            expect(
                truncated,
                "the size of a chunk is not that of fileData",
                expected=UserMessage("{count} bytes", count=FILE_DATA_BYTES),
                observed=UserMessage("{count} bytes", count=bytes_sent),
            )
            message = "chunks end after their content"
            subject.tolerate("5.1/2", "chunk_trunc", "truncated", message)


@case("5.1/3")
def test_file_size(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every chunk of a download states the size of the whole file."""
    for size in examples(_SIZES):
        for chunk in _downloaded_chunks(subject, line, content_of(size)):
            expect_equal(chunk.file_size, size, "fileSize is not the size of the file")


@case("5.1/4")
def test_position(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every chunk of a download has the byte offset that it states."""
    for chunk in _downloaded_chunks(subject, line):
        expect_chunk_position(chunk, _CONTENT)


@case("5.1/5")
def test_length(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every chunk of a download states the number of valid bytes in its buffer: 1 to 200."""
    for size in examples(_SIZES):
        for chunk in _downloaded_chunks(subject, line, content_of(size)):
            expect_chunk_length(chunk)
            expect_chunk_content(chunk, content_of(size))


@case("5.1/6")
def test_within_the_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No chunk of a download exceeds its fileSize."""
    for size in examples(_SIZES):
        for chunk in _downloaded_chunks(subject, line, content_of(size)):
            expect_within(chunk, size)


@case("5.1/7", name="download")
def test_end_of_a_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download is over after the answer to its last chunk, and another one may begin."""
    for size in examples(_SIZES):
        name = subject.new_name()
        upload(line, name, content_of(size))
        for _ in range(2):
            last = chunk_of(download_replies(line, name)[-1])
            message = "a download does not end where position + length is fileSize"
            expect_equal(last.position + last.length, size, message)
            expect_nothing_more(line, "something followed the last chunk of a download", "5.1/7")
            reply = line.ask("download_name", data=name)
            message = "no other download can begin after the last chunk of a download"
            expect(reply.accepted, message, expected="1", observed=f"{reply}")
            line = reconnect(subject, line)


@case("5.1/7", name="upload")
def test_end_of_an_upload(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An upload is over after the reply to its last chunk, and another transfer may begin."""
    for size in examples(_SIZES):
        first, second = subject.new_name(), subject.new_name()
        upload(line, first, content_of(size))
        reply = line.ask("upload_name", data=second)
        message = "no other upload can begin after the last chunk of an upload"
        expect_begun(line, second, reply, message, "5.1/7")
        send_chunk(line, Chunk(1, 0, 1, b"!"))
        delete(line, first)
        delete(line, second)


@case("5.1/8")
@given(size=st.integers(1, 1000))
@example(size=1000)
def test_ascending(subject: ControllerUnderTest, line: OutgoingConnection, size: int) -> None:
    """A download of any size comes in ascending order, without gap or overlap."""
    expected_position = 0
    for chunk in _downloaded_chunks(subject, line, content_of(size)):
        expect_equal(chunk.position, expected_position, "a chunk does not follow the previous one")
        expected_position += chunk.length
    expect_equal(expected_position, size, "a download does not reach the end of its file")
    subject.delete_own_files(line)


@case("5.1/9")
def test_one_byte_order(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The chunks of all downloads of a session have one byte order, in which it reads uploads."""
    orders = set()
    for size in examples((1, 450, 70)):
        name = subject.new_name()
        upload(line, name, content_of(size))
        for frame in download_replies(line, name):
            parsed = frame.seen.parsed
            orders |= {v for k, v in parsed.decoded.readings if k == "endian"} if parsed else set()
    expect(len(orders) <= 1, "the byte order changes", expected="one", observed="both")
    for order in orders:
        dialect = subject.dialect.replace(endian=order)
        begin_upload(line, subject.new_name())
        expect(
            try_chunk(line, data=FILE_DATA.encode(Chunk(1, 0, 1, b"!"), dialect)),
            UserMessage("downloads are {order}-endian, but uploads are not", order=order),
            expected="1",
            observed="0",
        )
    if "big" in orders:
        subject.tolerate("5.1/9", "endian", "big", "file data is big-endian")


# The controller as receiver


@case("5.1/10")
def test_existing_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An upload to an existing name is refused, and its chunks are refused, too."""
    name = subject.new_name()
    upload(line, name, _CONTENT)
    reply = line.ask("upload_name", data=name)
    expect(not reply.accepted, "an existing name was accepted", expected="0", observed="1")
    accepted = try_chunk(line, Chunk(3, 0, 3, b"new"))
    message = "content for an existing name was accepted"
    expect(not accepted, message, expected="0", observed="1")
    expect_stored(line, name, _CONTENT, "5.1/10")


@case("5.1/11")
def test_content_without_a_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Content before any name is refused, and the controller sends none without a request."""
    accepted = try_chunk(line, Chunk(3, 0, 3, b"abc"))
    expect(not accepted, "content before any name was accepted", expected="0", observed="1")
    expect_nothing_more(line, "content was sent without a request", "5.1/11")
    upload(line, subject.new_name(), _CONTENT)
    expect_nothing_more(line, "content was sent without a request", "5.1/11")


@case("5.1/12")
@given(lengths=st.lists(st.integers(1, BUFFER_BYTES), min_size=1, max_size=6), filler=st.binary())
@example(lengths=[50], filler=b"\xaa")
@example(lengths=[200, 1], filler=b"\xcc")
@example(lengths=[1, 199, 1], filler=b"!")
def test_rest_of_the_buffer(
    subject: ControllerUnderTest, line: OutgoingConnection, lengths: list[int], filler: bytes
) -> None:
    """Only the valid bytes of each chunk are stored, regardless of the rest of the buffer."""
    content = content_of(sum(lengths))
    name = subject.new_name()
    begin_upload(line, name)
    position = 0
    for length in lengths:
        buffer = content[position : position + length] + filler * BUFFER_BYTES
        send_chunk(line, Chunk(len(content), position, length, buffer[:BUFFER_BYTES]), "5.1/12")
        position += length
    expect_stored(line, name, content, "5.1/12")
    subject.delete_own_files(line)


def _chunks_at(content: bytes, *positions: int) -> list[Chunk]:
    return [
        Chunk(len(content), at, len(piece), piece)
        for at in positions
        for piece in [content[at : at + BUFFER_BYTES]]
    ]


def _expect_incomplete(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    sent_positions: list[int],
    missing_positions: list[int],
) -> None:
    """Send chunks out of order; the file must not be complete before the missing ones arrive.

    A controller may refuse them (A-5-8). One that accepts them must wait for the missing chunks, so
    these are sent to find out.
    """
    content, name = content_of(600), subject.new_name()
    begin_upload(line, name)
    if not all(try_chunk(line, chunk) for chunk in _chunks_at(content, *sent_positions)):
        return
    if all(try_chunk(line, chunk) for chunk in _chunks_at(content, *missing_positions)):
        expect_stored(line, name, content, "5.1/13")
        subject.tolerate("5.1/13", "chunk_order", "any", "chunks are accepted in any order")
        return
    fetched = download(reconnect(subject, line), name)
    if fetched is None:
        return
    message = UserMessage(
        "a file of 600 bytes was complete before the chunks at {missing_positions} arrived",
        missing_positions=missing_positions,
    )
    claims_order = "chunk_order" in subject.ics.claimed
    if claims_order and subject.dialect["chunk_order"] == "any" and 400 in sent_positions:
        subject.tolerate("5.1/13", "chunk_order", "any", message)
        return
    raise CaseFailed(
        message,
        expected="0 to a chunk after a gap, or a wait for the missing chunks",
        observed=UserMessage("1 to each chunk, and a file of {count} bytes", count=len(fetched)),
    )


@case("5.1/13", name="last-first")
def test_last_chunk_first(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file whose last chunk comes first is not complete after it."""
    _expect_incomplete(subject, line, [400], [0, 200])


@case("5.1/13", name="gap")
def test_gap(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file with a gap is not complete after its last chunk."""
    _expect_incomplete(subject, line, [0, 400], [200])


@case("5.1/13", name="repeated")
def test_repeated_chunk(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file is not complete because a chunk is repeated."""
    _expect_incomplete(subject, line, [0, 200, 200], [400])


@case("5.1/13", name="overlap")
def test_overlap(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file is not complete because chunks overlap."""
    _expect_incomplete(subject, line, [0, 100, 200], [400])


@case("5.1/13", name="other-size")
def test_file_size_changed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file whose later chunk states a smaller size is refused, or is complete with that size."""
    content, name = content_of(600), subject.new_name()
    begin_upload(line, name)
    send_chunk(line, Chunk(600, 0, 200, content[:200]))
    if not try_chunk(line, Chunk(250, 200, 50, content[200:250])):
        return
    fetched = download(reconnect(subject, line), name)
    if fetched is None:
        return
    expect(
        fetched == content[:250],
        "a file whose size changed during the upload was accepted with bytes missing",
        expected="0 to the chunk with another size, or a file of the 250 bytes sent",
        observed=UserMessage("a file of {count} bytes", count=len(fetched)),
    )
    message = "the file size of the last chunk is used"
    subject.tolerate("5.1/13", "A-5-7", "last", message)
