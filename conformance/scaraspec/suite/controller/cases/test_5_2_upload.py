"""Clause 5.2: upload a file to the controller (0x50, 0x52; L741-763)."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import BUFFER_BYTES, FILE_DATA, HEAD_BYTES, Chunk, chunks_of
from scaraspec.suite.controller.harness.controller_under_test import SILENCE_S, ControllerUnderTest
from scaraspec.suite.controller.harness.malformed import payloads as malformed
from scaraspec.suite.controller.harness.malformed.delivery import send_parts
from scaraspec.suite.controller.harness.malformed.payloads import Malformed
from scaraspec.suite.controller.harness.outgoing_connection import (
    SEGMENT_S,
    OutgoingConnection,
    split_bytes,
)
from scaraspec.suite.controller.harness.requests.files import (
    NameRefused,
    begin_upload,
    delete,
    download,
    expect_begun,
    expect_nothing_more,
    expect_round_trip,
    expect_stored,
    leftover_content,
    next_chunk,
    reconnect,
    send_chunk,
    transfer_frames,
    try_chunk,
    upload,
)
from scaraspec.suite.controller.harness.two_stage.commands import try_request
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply, expect
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.strategies import NAME_CHARACTERS
from scaraspec.user_message import UserMessage

_MAX_UINT32 = 2**32 - 1
_LARGEST_BYTES = 70_000
_NEIGHBOUR_CONTENT = content_of(250)
_DESTRUCTIVE: Final = (Hazard.STATE, Hazard.DESTRUCTIVE)
_EDGES: Final = (
    *(1, 2, 127, 128, 199, 200, 201, 211, 212, 213, 243, 255, 256, 257),
    *(399, 400, 401, 512, 600, 1000),
)
_SPECIAL_SEGMENT_SIZES: Final = ((3, 12, 100), (16, 99), (215,))
"""Sizes of segments that split a chunk of AA CC AA CC ... so that later segments begin with AA,
with CC, or consist of the end byte alone."""


def _expect_refused(line: OutgoingConnection, name: bytes, message: str) -> None:
    reply = line.ask("upload_name", data=name)
    expect(not reply.accepted, message, expected="0", observed=f"{reply}")


# The name


@case("5.2/2")
@given(stem=st.text(f"{NAME_CHARACTERS}.", max_size=18).filter(lambda stem: ".." not in f"{stem}."))
@example(stem="-._")
@example(stem=".x.y")
@example(stem="AZaz09")
def test_new_name(subject: ControllerUnderTest, line: OutgoingConnection, stem: str) -> None:
    """A new name of letters, digits, dots, dashes and underscores is answered 1.

    A name with other characters than letters and digits may be refused (A-5-20).
    """
    name = subject.new_name(stem)
    try:
        upload(line, name, b"!")
    except NameRefused as refusal:
        subject.tolerate("5.2/2", "A-5-20", "letters and digits", str(refusal))
        return
    delete(line, name)


@case("5.2/2", name="long")
def test_long_names(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name of up to 30 bytes is accepted; a longer one is refused or stored in full."""
    for size in examples((29, 30, 31, 60, 120, 200)):
        short = subject.new_name()
        name = short[:-4] + b"n" * (size - len(short)) + short[-4:]
        reply = line.ask("upload_name", data=name)
        if size <= 30:
            message = UserMessage("a name of {size} bytes was refused", size=size)
            expect_begun(line, name, reply, message)
        if not reply.accepted:
            message = UserMessage("a name of {size} bytes is refused", size=size)
            subject.tolerate("5.2/2", "name_max", "30", message)
            continue
        send_chunk(line, Chunk(1, 0, 1, b"!"))
        expect_stored(line, name, b"!", "5.2/2")
        truncated = line.ask("download_name", data=name[:30]).accepted if size > 30 else False
        message = UserMessage("a name of {size} bytes was truncated to 30", size=size)
        expect(not truncated, message, expected="0 to its first 30 bytes", observed="1")
        line.ask("delete_program", data=name)  # there may be few places (A-5-21)


@case("5.2/2", name="none")
def test_no_name(line: OutgoingConnection) -> None:
    """An upload without a name is refused."""
    line.send("upload_name", data=b"")
    received = transfer_frames(line)
    accepted = [seen for seen in received if seen.name == "upload_name" and seen.value is True]
    expect(not accepted, "an upload without a name was accepted", expected="0", observed="1")


@case("5.2/2", name="many")
def test_many_names(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each of forty new names in succession is answered 1 once."""
    for _ in range(40):
        name = subject.new_name()
        upload(line, name, b"!")
        delete(line, name)
    expect_nothing_more(line, "a name got two replies", "5.2/2")


@case("5.2/3")
def test_existing_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An existing name is answered 0 each time, and its file is unchanged."""
    name, content = subject.new_name(), content_of(450)
    upload(line, name, content)
    for _ in range(3):
        _expect_refused(line, name, "an existing name was accepted")
        expect_stored(line, name, content, "5.2/3")
    expect_round_trip(subject, line, content, "5.2/3")


@case("5.2/3", name="elsewhere")
def test_name_in_use_on_another_connection(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A name used on an earlier connection is answered 0, too, and its file is unchanged."""
    name, content = subject.new_name(), content_of(450)
    upload(line, name, content)
    line = reconnect(subject, line)
    _expect_refused(line, name, "a name used on another connection was accepted")
    line = reconnect(subject, line)
    expect_stored(line, name, content, "5.2/3")


@case("5.2/15", name="upload", hazards=_DESTRUCTIVE)
def test_path_in_a_new_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A new name with a slash, or with dots that lead to another folder, is refused."""
    plain = subject.new_name()
    for path in examples((b"../%s", b"../../%s", b"a/../%s", b"./%s", b"/%s", b"/tmp/%s", b"a/%s")):
        name = path % plain
        attempt = malformed.send_malformed(subject, line, "upload_name", Malformed("a path", name))
        line = attempt.line
        message = UserMessage("the name {name} was accepted", name=name.decode())
        expect(not attempt.accepted, message, expected="0", observed="1")


@case("5.2/15", name="backslash", hazards=_DESTRUCTIVE)
def test_backslash_in_a_new_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A new name with a backslash is refused, or nothing is stored where the path would lead."""
    for path in examples((b".\\%s", b"a\\..\\%s", b"..\\%s")):
        plain = subject.new_name()
        name = path % plain
        attempt = malformed.send_malformed(subject, line, "upload_name", Malformed("a path", name))
        line = attempt.line
        if attempt.accepted:
            try_chunk(line, Chunk(1, 0, 1, b"!"))
            line = reconnect(subject, line)
            message = UserMessage(
                "the name {name} stored the file {file_name}",
                name=name.decode(),
                file_name=plain.decode(),
            )
            expect(leftover_content(line, plain) is None, message, expected="0", observed="1")


@case("5.2/15", name="same-file", hazards=_DESTRUCTIVE)
def test_path_to_a_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A path that would lead to a stored file does not download it."""
    plain = subject.new_name()
    upload(line, plain, b"!")
    for path in examples(
        (b"./%s", b"a/../%s", b"/%s", b".\\%s", b"a\\..\\%s", b"../programs/../%s")
    ):
        name = path % plain
        attempt = malformed.send_malformed(
            subject, line, "download_name", Malformed("a path", name)
        )
        line = attempt.line
        message = UserMessage(
            "the name {name} downloaded the file {file_name}",
            name=name.decode(),
            file_name=plain.decode(),
        )
        expect(not attempt.accepted, message, expected="0", observed="1")


@case("5.2/15", name="system")
def test_path_to_the_system(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A path that would lead out of the program store downloads nothing."""
    prefixes = (b"../" * 8, b"/", b"..\\" * 8, b"C:\\", b"/proc/self/cwd/../../../../")
    for name in examples(
        [prefix + file for prefix in prefixes for file in (b"etc/passwd", b"windows\\win.ini")]
    ):
        attempt = malformed.send_malformed(
            subject, line, "download_name", Malformed("a path", name)
        )
        line = attempt.line
        message = UserMessage("{name} was downloaded", name=name.decode())
        expect(not attempt.accepted, message, expected="0", observed="1")


# The chunks


@case("5.2/6")
def test_every_chunk_is_answered(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every chunk of an upload is answered with a single 1."""
    for size in examples((1, 200, 1000)):
        begin_upload(line, subject.new_name())
        for chunk in chunks_of(content_of(size)):
            send_chunk(line, chunk)
        expect_nothing_more(line, "a chunk got two replies", "5.2/6")


@case("5.2/6", name="refused")
def test_refused_chunks_are_answered(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """An invalid chunk is answered 0, or closes the link (A-5-6, A-5-26)."""
    for chunk in examples((Chunk(600, 0, 201, bytes(200)), Chunk(100, 0, 101, bytes(200)))):
        begin_upload(line, subject.new_name())
        try:
            reply = line.ask("upload_chunk", chunk)
        except NoReply:
            if line.ending is None:
                raise
            message = "a chunk out of bounds closes the link"
            subject.tolerate("5.2/6", "A-5-26", "closed", message)
        else:
            message = UserMessage(
                "a chunk of length {length} of {file_size} was not refused",
                length=chunk.length,
                file_size=chunk.file_size,
            )
            refused = reply.accepted is False
            expect(refused, message, expected="0", observed=f"{reply}")
            expect_nothing_more(line, "a chunk got two replies", "5.2/6")
        line = reconnect(subject, line)


def _other_order_is_illegal(length: int) -> bool:
    """Whether a length is out of bounds in the other byte order, too."""
    return int.from_bytes(length.to_bytes(4, "little")) > BUFFER_BYTES


_too_long = st.integers(BUFFER_BYTES + 1, _MAX_UINT32).filter(_other_order_is_illegal)


def _expect_chunk_refused(
    subject: ControllerUnderTest, line: OutgoingConnection, header: Chunk, accepted_before: int = 0
) -> None:
    """Send `accepted_before` valid chunks, and then one that must be refused."""
    subject.delete_own_files(line)
    begin_upload(line, subject.new_name())
    for chunk in list(chunks_of(content_of(header.file_size)))[:accepted_before]:
        send_chunk(line, chunk)
    accepted = try_chunk(line, header)
    message = UserMessage(
        "length {length} at {position} of {file_size} bytes was accepted",
        length=header.length,
        position=header.position,
        file_size=header.file_size,
    )
    expect(not accepted, message, expected="0", observed="1", requirement="5.2/10")
    line.close()


@case("5.2/10", name="length")
@given(length=_too_long, before=st.integers(0, 2))
@example(length=201, before=0)
@example(length=201, before=2)
@example(length=212, before=1)
@example(length=255, before=0)
@example(length=256, before=1)
@example(length=0xFFFFFF38, before=1)
@example(length=_MAX_UINT32, before=0)
def test_length_over_the_buffer(subject: ControllerUnderTest, length: int, before: int) -> None:
    """A chunk with a length over 200 is refused, as the first chunk or a later one."""
    header = Chunk(1000, 200 * before, length, bytes(BUFFER_BYTES))
    _expect_chunk_refused(subject, subject.open(), header, before)


@case("5.2/10", name="long-frame")
def test_more_than_the_buffer(subject: ControllerUnderTest) -> None:
    """A chunk that contains more than 200 bytes is refused."""
    for length in examples((201, 220, 243)):
        line = subject.open()
        begin_upload(line, subject.new_name())
        header = FILE_DATA.encode(Chunk(1000, 0, length, b""), subject.dialect)[:HEAD_BYTES]
        accepted = try_chunk(line, data=header + content_of(length))
        message = UserMessage("a chunk of {length} bytes was accepted", length=length)
        expect(not accepted, message, expected="0", observed="1")
        line.close()


@case("5.2/10", name="beyond")
@given(size=st.integers(1, 600), excess=st.integers(1, 199))
@example(size=1, excess=1)
@example(size=200, excess=1)
@example(size=201, excess=1)
@example(size=399, excess=1)
def test_beyond_the_file(subject: ControllerUnderTest, size: int, excess: int) -> None:
    """A last chunk that exceeds fileSize is refused."""
    before, rest = divmod(size, BUFFER_BYTES)
    length = min(rest + excess, BUFFER_BYTES)
    if rest + length <= BUFFER_BYTES or length > rest:
        header = Chunk(size, 200 * before, length, bytes(BUFFER_BYTES))
        _expect_chunk_refused(subject, subject.open(), header, before)


@case("5.2/10", name="position")
def test_position_beyond_the_file(subject: ControllerUnderTest) -> None:
    """A position at or after the end is refused, also if position plus length overflows.

    A position whose lower 16 bits are those of the expected position is refused, too.
    """
    for position in (
        600,
        601,
        65_536,
        65_736,
        100_000,
        2**31 - 1,
        2**32 - 200,
        2**32 - 100,
        _MAX_UINT32,
    ):
        header = Chunk(600, position, BUFFER_BYTES, bytes(BUFFER_BYTES))
        for before in examples((0, 1)):
            _expect_chunk_refused(subject, subject.open(), header, before)


@case("5.2/11")
def test_chunk_without_a_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk before any name, or after the end of an upload, is refused."""
    for content in examples((b"abc", content_of(200))):
        accepted = try_chunk(line, Chunk(len(content), 0, len(content), content))
        expect(not accepted, "a chunk without a name was accepted", expected="0", observed="1")
        upload(line, subject.new_name(), content)


@case("5.2/11", name="after-the-end")
def test_chunk_after_the_end(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk after the last one is refused and does not change the file."""
    name, content = subject.new_name(), content_of(250)
    upload(line, name, content)
    last = Chunk(250, 200, 50, content[200:])
    for more in examples((last, Chunk(450, 250, 200, bytes(200)), Chunk(3, 0, 3, b"new"))):
        message = "a chunk after the last one was accepted"
        expect(not try_chunk(line, more), message, expected="0")
        expect_stored(line, name, content, "5.2/11")


@case("5.2/11", name="after-refusal")
def test_chunk_after_a_refused_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk after a refused name is refused."""
    name, content = subject.new_name(), content_of(250)
    upload(line, name, content)
    _expect_refused(line, name, "an existing name was accepted")
    accepted = try_chunk(line, Chunk(3, 0, 3, b"new"))
    expect(not accepted, "a chunk after a refused name was accepted", expected="0", observed="1")
    expect_stored(line, name, content, "5.2/11")


@case("5.2/11", name="during-a-download")
def test_chunk_during_a_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An upload chunk during a download is refused."""
    name = subject.new_name()
    upload(line, name, content_of(450))
    line.ask("download_name", data=name)
    next_chunk(line)
    accepted = try_chunk(line, Chunk(3, 0, 3, b"new"))
    message = "an upload chunk was accepted during a download"
    expect(not accepted, message, expected="0", observed="1")


@case("5.2/11", name="elsewhere")
def test_chunk_on_another_connection(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A chunk on a connection without an upload is not added to that of another connection."""
    subject.require_multiple_connections()
    name, content = subject.new_name(), content_of(450)
    begin_upload(line, name)
    other = subject.open()
    reply = try_request(other, "upload_chunk", Chunk(450, 0, 200, bytes(200)))
    expect(reply is None or not reply.accepted, "a chunk without a name was accepted")
    for chunk in chunks_of(content):
        send_chunk(line, chunk)
    expect_stored(other, name, content, "5.2/11")


@case("5.2/11", name="reconnected")
def test_chunk_after_the_connection_was_lost(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A chunk on a new connection is refused: the upload ended with the old connection."""
    subject.require_close_detection()
    for end in examples((OutgoingConnection.close, OutgoingConnection.reset)):
        begin_upload(line, subject.new_name())
        send_chunk(line, Chunk(450, 0, 200, bytes(200)))
        end(line)
        line = subject.open()
        accepted = try_chunk(line, Chunk(450, 200, 200, bytes(200)))
        message = "a chunk without a name was accepted on a new connection"
        expect(not accepted, message, expected="0", observed="1")


@case("5.2/13")
def test_nothing_after_the_last_answer(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """After the reply to the last chunk, nothing more is sent, in uploads and downloads."""
    for size in examples((1, 200, 450)):
        name = subject.new_name()
        upload(line, name, content_of(size))
        expect_nothing_more(line, "something followed the last reply of an upload", "5.2/13")
        download(line, name)
        expect_nothing_more(line, "something followed the last reply of a download", "5.2/13")
    line.wait(SILENCE_S)
    expect_nothing_more(line, "something followed the last reply of a transfer", "5.2/13")


# Stored content


@case("5.2/12", name="again")
def test_repeated_downloads(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each download of an uploaded file, also on another connection, returns the same content."""
    name, content = subject.new_name(), content_of(450)
    upload(line, name, content)
    expect_stored(line, name, content)
    expect_stored(line, name, content)
    line.ask("get_status")
    expect_stored(line, name, content)
    expect_stored(reconnect(subject, line), name, content)


@case("5.2/12", name="anew")
def test_replaced_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name used again after deletion stores the new content, regardless of its size."""
    name = subject.new_name()
    for number, size in enumerate((450, 600, 250, 250, 1)):
        content = content_of(size, number)
        upload(line, name, content)
        expect_stored(line, name, content)
        delete(line, name)


@case("5.2/12", name="two-files")
def test_two_files(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Two files with similar names keep their own contents."""
    first = subject.new_name()
    second = first[:-4] + b"b" + first[-4:]
    contents = {first: content_of(450), second: content_of(450, 1)}
    for name, content in contents.items():
        upload(line, name, content)
    for name, content in contents.items():
        expect_stored(line, name, content)


@case("5.2/12", name="two-connections")
def test_two_uploads_at_once(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Two connections upload and then download in turns, and each file has its own content."""
    subject.require_multiple_connections()
    lines = (line, subject.open())
    names = [subject.new_name() for _ in lines]
    contents = [content_of(650, number) for number in (0, 1)]
    for name in names:
        upload(line, name, b"!")  # there is a place for both (A-5-21)
    for name in names:
        delete(line, name)
    begin_upload(lines[0], names[0])
    if not lines[1].ask("upload_name", names[1]).accepted:
        message = "only one upload at a time is possible on all connections"
        subject.tolerate("5.2/12", "A-5-17", "one", message)
        return
    for both in zip(*(list(chunks_of(content)) for content in contents), strict=True):
        for connection, chunk in zip(lines, both, strict=True):
            send_chunk(connection, chunk)
    for connection, name, content in zip(lines, names[::-1], contents[::-1], strict=True):
        expect_stored(connection, name, content)


@case("5.2/12", name="one-name-twice")
def test_one_name_on_two_connections(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """Of two uploads under one name, one is refused, or one complete file is stored."""
    subject.require_multiple_connections()
    lines = (line, subject.open())
    name = subject.new_name()
    contents = [content_of(450, number) for number in (0, 1)]
    begin_upload(lines[0], name)
    lines[1].ask("upload_name", name)
    accepted = [True, True]
    for both in zip(*(list(chunks_of(content)) for content in contents), strict=True):
        for number in (0, 1):
            accepted[number] = bool(try_chunk(lines[number], both[number])) and accepted[number]
    if not any(accepted):
        return
    downloaded = download(lines[0], name)
    whole = [
        content for content, all_accepted in zip(contents, accepted, strict=True) if all_accepted
    ]
    expect(
        downloaded in whole,
        "two uploads under one name were mixed",
        expected="one of the files whose chunks were all accepted",
        observed="another content" if downloaded is not None else "no file",
    )


@case("5.2/14", "2/5", name="bytes")
def test_delimiters_in_the_content(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Files full of AA, CC, 00, 7C and other bytes that software may alter are kept unchanged."""
    frame = b"\xaa\x09\x00\xcc"
    contents = (
        *(bytes([value]) * size for value in b"\xaa\xcc\x00\x7c\x90\xff" for size in (199, 401)),
        bytes(range(256)) * 2,
        frame * 100,
        (bytes(198) + b"\xaa\xcc") * 2,
        (bytes(198) + b"\xcc\xaa") * 2,
        b"\xcc\x52\x01\x31\xaa" * 60,
        b"abc" + bytes(300),
        bytes(300) + b"abc",
        b"\r\n" * 150,
        b"a\nb\rc\x1ad\x04e\x0f" * 30,
        b"\xef\xbb\xbf" + "程序".encode("gb18030") * 60,
        b"1|2|3" * 50,
        b"0",  # a false value in some languages
        b"\\\"'%s%n&amp;" * 20,
    )
    for content in examples(contents):
        expect_round_trip(subject, line, content, "5.2/14")
    for sizes in _SPECIAL_SEGMENT_SIZES:
        _upload_in_segments(subject, line, b"\xaa\xcc" * 100, sizes)


def _upload_in_segments(
    subject: ControllerUnderTest, line: OutgoingConnection, content: bytes, sizes: tuple[int, ...]
) -> None:
    """Send a file of one chunk in segments of these sizes, and the rest in a last segment."""
    name = subject.new_name()
    begin_upload(line, name)
    chunk = line.request("upload_chunk", Chunk(len(content), 0, len(content), content)).encode()
    send_parts(line, split_bytes(chunk, sizes), subject, SEGMENT_S)
    try:
        reply = line.reply("upload_chunk", within_s=line.chunk_timeout_s)
    except NoReply as error:
        error.requirement = "2/5"
        raise
    message = "a chunk that arrived in several segments was refused"
    expect(reply.accepted, message, expected="1", observed=f"{reply}", requirement="2/5")
    expect_stored(line, name, content, "2/5")


@case("5.2/14", name="drawn")
@given(content=st.binary(min_size=1, max_size=700))
def test_any_content(
    subject: ControllerUnderTest, line: OutgoingConnection, content: bytes
) -> None:
    """A file of any bytes is kept unchanged."""
    expect_round_trip(subject, line, content, "5.2/14")


@case("5.2/16", name="edges")
def test_sizes_at_the_edges(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Files around multiples of 200 and of powers of two are stored unchanged."""
    for size in examples(_EDGES):
        expect_round_trip(subject, line, content_of(size), "5.2/16")


@case("5.2/16", name="drawn")
@given(size=st.integers(1, 1200))
def test_any_size(subject: ControllerUnderTest, line: OutgoingConnection, size: int) -> None:
    """Files of any size are stored unchanged."""
    expect_round_trip(subject, line, content_of(size), "5.2/16")


def _check_large_file(subject: ControllerUnderTest, line: OutgoingConnection, size: int) -> None:
    """Upload and download a large file; if there is no room, the first chunk is refused.

    Its place is between two other files, which must not change.
    """
    neighbours, between = [subject.new_name(), subject.new_name()], subject.new_name()
    for neighbour in (neighbours[0], between, neighbours[1]):
        upload(line, neighbour, _NEIGHBOUR_CONTENT)
    delete(line, between)
    name, content = subject.new_name(), content_of(size)
    begin_upload(line, name)
    first, *others = chunks_of(content)
    if not line.ask("upload_chunk", first, within_s=line.chunk_timeout_s).accepted:
        line.require_timely()
        _expect_too_large(subject, reconnect(subject, line), size)
        return
    for chunk in others:
        send_chunk(line, chunk, "5.2/16")
    expect_stored(line, name, content, "5.2/16")
    expect_nothing_more(line, "something followed a large file", "5.2/16")
    for neighbour in neighbours:
        expect_stored(line, neighbour, _NEIGHBOUR_CONTENT)


def _expect_too_large(subject: ControllerUnderTest, line: OutgoingConnection, size: int) -> None:
    """Expect that a controller without room for a file refuses each larger one (A-5-25)."""
    for larger in (size + 1, _LARGEST_BYTES + 1, 2 * size + 1):
        begin_upload(line, subject.new_name())
        accepted = try_chunk(line, Chunk(larger, 0, BUFFER_BYTES, bytes(BUFFER_BYTES)))
        message = UserMessage(
            "a file of {size} bytes is refused, but one of {larger} bytes is accepted",
            size=size,
            larger=larger,
        )
        expect(not accepted, message, expected="0", observed="1", requirement="5.2/16")
        line = reconnect(subject, line)
    subject.tolerate(
        "5.2/16",
        "A-5-25",
        "no room",
        UserMessage("the controller has no room for {size} bytes", size=size),
    )


@case("5.2/16", "5.2/12", name="51200")
def test_size_51200(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file of 256 full chunks is stored unchanged."""
    _check_large_file(subject, line, 51_200)


@case("5.2/16", "5.2/12", name="65535")
def test_size_65535(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The largest file whose size fits 16 bits is stored unchanged."""
    _check_large_file(subject, line, 65_535)


@case("5.2/16", "5.2/12", name="65536")
def test_size_65536(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The smallest file whose size does not fit 16 bits is stored unchanged."""
    _check_large_file(subject, line, 65_536)


@case("5.2/16", "5.2/12", name="70000")
def test_size_70000(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file whose positions do not fit 16 bits is stored unchanged."""
    _check_large_file(subject, line, _LARGEST_BYTES)
