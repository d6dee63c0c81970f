"""Clause 5.2: uploading a file to the controller (0x50, 0x52; L741-763).

A file arrives completely, or the client reports a failure. The cases check the reports of the
client as well as its requests.
"""

import itertools
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest
from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.fields import NAME_MAX_BYTES
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import BUFFER_BYTES, Chunk, chunks_of
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.downloads import Download, begin_download, send_download
from scaraspec.suite.client.harness.files import (
    expect_no_transfer_frames,
    expect_served,
    expect_transfer_done,
    expect_transfer_failed,
    is_abort_signal,
    request_or_none,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.transfer_silence import (
    expect_given_up,
    expect_given_up_despite_queries,
    expect_survives_silence,
)
from scaraspec.suite.client.harness.uploads import Upload, receive_upload, serve_read_back
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.chunks import chunk_of
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply, expect, expect_equal, expect_in
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.strategies import NAME_CHARACTERS
from scaraspec.suite.engine.transfer_timeouts import transfer_timeouts_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

_WHOLE = content_of(650)
_LAST = len(_WHOLE)  # larger than any chunk number
_SHORT_S = 0.1
_REST_OF_A_LIMIT = 0.25  # of 25 s: the silences together then exceed 30 s

_ANSWERS = tuple(BY_NAME[name].opcode for name in ("upload_name", "upload_chunk", "download_name"))


def _up_to(subject: ClientUnderTest, line: IncomingConnection, number: int) -> tuple[Upload, Chunk]:
    """Return an upload and its pending chunk of this number, or its last chunk."""
    upload = Upload(subject, line, _WHOLE)
    upload.accept_name()
    while True:
        chunk = upload.next_chunk()
        if not number or chunk.last:
            return upload, chunk
        upload.accept_chunk(chunk.length)
        number -= 1


def _take_one_byte(subject: ClientUnderTest, line: IncomingConnection, call: Call) -> None:
    """Receive an upload of one byte whose name was received."""
    line.reply("upload_name")
    chunk_of(line.request("upload_chunk", call))
    line.reply("upload_chunk")
    serve_read_back(subject, line, call, b"!")
    expect_transfer_done(subject, call)


# The name


@client_case("5.2/1", attended=True)
def test_upload(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client uploads a file and sends its name first."""
    receive_upload(subject, line, _WHOLE)


@client_case("5.2/1", name="drawn")
@given(name=st.text(f"{NAME_CHARACTERS}.", min_size=1, max_size=30).filter(lambda n: n.strip(".")))
@example(name="file.txt")
@example(name="x")
@example(name="a" * 26 + ".rob")
def test_names(subject: ClientUnderTest, line: IncomingConnection, name: str) -> None:
    """An upload begins with the remote name, for any name of the local file."""
    with subject.allow_refusal():
        receive_upload(subject, line, b"!", name)


@client_case("5.2/1", name="chinese")
def test_chinese_name(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends a Chinese name in UTF-8 or GB18030, or refuses it (A-T-2)."""
    name = "程序一.rob"
    call = subject.begin("upload", local=subject.make_file(b"!"), remote=name)
    request = request_or_none(subject, line, call, "upload_name")
    if request is None:
        expect_transfer_failed(subject, call, "5.2/1")
        return
    message = "the client altered a Chinese name"
    expect_in(
        request.frame.data.removesuffix(b"\0"), (name.encode(), name.encode("gb18030")), message
    )
    _take_one_byte(subject, line, call)


@client_case("5.2/18")
def test_long_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends a name of 30 bytes, and refuses a longer one or sends it completely."""
    for size in examples((29, 30, 31, 60, 255, 256, 300)):
        name = "n" * (size - 4) + ".rob"
        call = subject.begin("upload", local=subject.make_file(b"!"), remote=name)
        request = request_or_none(subject, line, call, "upload_name")
        if request is None:
            message = UserMessage(
                "the client refused a name of {size_bytes} bytes", size_bytes=size
            )
            expect(size > NAME_MAX_BYTES, message, expected="a request", observed=f"{call}")
            expect_transfer_failed(subject, call, "5.2/18")
            continue
        message = UserMessage("the client altered a name of {size_bytes} bytes", size_bytes=size)
        expect_equal(request.frame.data.removesuffix(b"\0"), name.encode(), message)
        _take_one_byte(subject, line, call)
        if size > NAME_MAX_BYTES:
            message = UserMessage(
                "the client sent a file name of {size_bytes} bytes", size_bytes=size
            )
            subject.tolerate("5.2/18", "name_max", "255", message)


@client_case("5.2/4", attended=True)
def test_existing_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The file exists on the controller; the client sends no content and reports a failure."""
    upload = Upload(subject, line, _WHOLE)
    line.reply("upload_name", value=False)
    subject.expect_failure(upload.call, requirement="5.2/19")
    expect_no_transfer_frames(line, "the client sent content after the name was refused", "5.2/4")


@client_case("5.2/4", name="between-others")
def test_existing_file_between_others(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A name that was accepted before is refused; only that upload fails."""
    name = "zs-again.rob"
    for _ in range(2):
        receive_upload(subject, line, _WHOLE, name)
        upload = Upload(subject, line, _WHOLE, name)
        line.reply("upload_name", value=False)
        upload.expect_failed()
        message = "the client sent content after the name was refused"
        line = expect_served(subject, line, "a refused name")
        expect_no_transfer_frames(line, message, "5.2/4")
    receive_upload(subject, line, _WHOLE, name)


# The content


@client_case("5.2/5")
def test_one_structure_a_frame(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Each chunk frame carries one fileData, also for a file that looks like frames."""
    frame = Frame(C2A, BY_NAME["upload_chunk"].opcode, b"1").encode()
    for content in examples((frame * 100, frame[::-1] * 100, b"\xcc\xaa" * 137)):
        upload = Upload(subject, line, content)
        upload.accept_name()
        for answer in upload.chunk_frames():
            chunk_of(answer)
        upload.expect_done()


@client_case("5.2/7")
def test_one_chunk_at_a_time(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends each chunk only after the previous one is answered."""
    upload = Upload(subject, line, _WHOLE)
    upload.accept_name()
    while upload.received_bytes < len(_WHOLE):
        chunk = upload.next_chunk()
        message = "the client sent a chunk before the previous one was answered"
        expect_no_transfer_frames(line, message, "5.2/7", _SHORT_S)
        upload.accept_chunk(chunk.length)
    upload.expect_done()


@client_case("5.2/8")
def test_refused_chunk(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload stops and fails at any refused chunk."""
    for number in range(_LAST):
        upload, chunk = _up_to(subject, line, number)
        upload.refuse_chunk(chunk)
        line = expect_served(subject, line, "a refused chunk")
        message = "the client sent content after a chunk was refused"
        expect_no_transfer_frames(line, message, "5.2/8")
        if chunk.last:
            break
    receive_upload(subject, line, _WHOLE)


@client_case("5.2/13")
def test_nothing_after_the_end(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends nothing more of the upload after its last chunk is answered."""
    for size in examples((1, 199, 200, 201, 400, 600)):
        receive_upload(subject, line, content_of(size))
        line = expect_served(subject, line, "an upload")
        message = UserMessage(
            "the client sent something after a complete upload of {size_bytes} bytes",
            size_bytes=size,
        )
        expect_no_transfer_frames(line, message, "5.2/13")


@client_case("5.2/17")
def test_empty_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses an empty file, or sends only its name or an empty chunk."""
    call = subject.begin("upload", local=subject.make_file(b""), remote="zs-empty.rob")
    if request_or_none(subject, line, call, "upload_name") is None:
        expect_transfer_failed(subject, call, "5.2/17")
        return
    line.reply("upload_name")
    option, form = "name-only", "its name alone"
    frame = request_or_none(subject, line, call, "upload_chunk")
    if frame is not None:
        chunk = chunk_of(frame)
        message = "the client sent an empty file as a wrong chunk"
        expect_equal((chunk.file_size, chunk.position, chunk.length), (0, 0, 0), message)
        line.reply("upload_chunk")
        option, form = "chunk", "a chunk of length 0"
    if subject.wait_for_answer(call).ok:
        subject.tolerate(
            "5.2/17",
            "empty_file",
            option,
            UserMessage("the client sends an empty file as {form}", form=form),
        )


@client_case("5.2/19", name="no-file")
def test_no_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Uploading a missing file fails; a following upload of an existing file succeeds."""
    call = subject.begin("upload", local=subject.missing_file(), remote="zs-none.rob")
    sent = request_or_none(subject, line, call, "upload_name") is not None
    if sent:
        line.reply("upload_name")
    subject.expect_failure(call)
    if not sent:
        receive_upload(subject, line, _WHOLE)


@client_case("5.2/17", name="full-chunks")
def test_no_empty_chunk_after_full_ones(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A file that fills its last chunk ends with it, without a chunk of length 0."""
    for size in examples((200, 400, 600)):
        upload = Upload(subject, line, content_of(size))
        upload.accept_name()
        for frame in upload.chunk_frames():
            message = "the client sent a chunk of length 0 of a file with content"
            expect(chunk_of(frame).length, message, expected="1 to 200", observed="0")
        again = request_or_none(subject, line, upload.call, "upload_chunk", _SHORT_S)
        message = UserMessage(
            "the client sent a chunk after {count} full chunks, which are the whole file",
            count=size // BUFFER_BYTES,
        )
        expect(again is None, message, expected="nothing", observed=f"{again}")
        upload.expect_done()


# Time


@client_case("5.2/9")
def test_late_and_missing_answers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload survives two answers after 25 s each and fails when an answer is missing.

    The timeout applies to each silence. A whole file, and all chunks together, may take longer.
    """
    upload = Upload(subject, line, _WHOLE)

    def answer_name() -> None:
        upload.accept_name()
        upload.received_bytes += upload.next_chunk().length

    def answer_chunk() -> None:
        line.reply("upload_chunk")
        upload.received_bytes += upload.next_chunk().length

    expect_survives_silence(subject, upload.call, "5.2/9", answer_name)
    expect_survives_silence(subject, upload.call, "5.2/9", answer_chunk)
    expect_survives_silence(subject, upload.call, "5.2/9", answer_chunk, _REST_OF_A_LIMIT)
    expect_given_up(subject, upload.call, "5.2/9")
    _stays_ended(subject, line, "upload_chunk")


@client_case("5.2/9", name="meanwhile")
def test_answer_is_missing_amid_others(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A missing answer ends an upload while other requests are answered; the next upload works.

    The answer to the last chunk never arrives, so the next answer belongs to the next upload.
    """
    upload, _ = _up_to(subject, line, _LAST)
    expect_given_up_despite_queries(subject, line, upload.call, "5.2/9")
    _another_works(subject, line)


@client_case("5.2/9", name="name")
def test_name_is_not_answered(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload whose name gets no answer times out; a late answer does not start it."""
    upload = Upload(subject, line, _WHOLE)
    expect_given_up(subject, upload.call, "5.2/9")
    _stays_ended(subject, line, "upload_name")


def _stays_ended(subject: ClientUnderTest, line: IncomingConnection, command: str) -> None:
    """Require that a late answer does not resume an upload."""
    if line.ending is None:
        line.reply(command)
    _another_works(subject, line)


def _another_works(subject: ClientUnderTest, line: IncomingConnection) -> None:
    line = expect_served(subject, line, "a silence")
    message = "the client continues an aborted upload"
    expect_no_transfer_frames(line, message, "5.2/9", allowed=is_abort_signal)
    receive_upload(subject, line, _WHOLE)


# Sizes and contents


_FILLINGS = (b"\xaa", b"\xcc", b"\x00", b"\x7c")


def _upload_and_download(
    subject: ClientUnderTest, line: IncomingConnection, content: bytes
) -> None:
    receive_upload(subject, line, content)
    send_download(subject, line, content, "5.2/16")


@client_case("5.2/16")
@pytest.mark.parametrize("size", [1, 199, 200, 201, 400], ids=str)
def test_sizes(subject: ClientUnderTest, line: IncomingConnection, size: int) -> None:
    """The client uploads and downloads files of this size with several contents unchanged."""
    for content in examples((*(filling * size for filling in _FILLINGS), content_of(size))):
        _upload_and_download(subject, line, content)


@client_case("5.2/16")
@pytest.mark.parametrize(
    ("size", "filling"),
    list(zip((51_200, 65_535, 65_536, 131_100), _FILLINGS, strict=True)),
    ids=["51200", "65535", "65536", "131100"],
)
def test_large_files(
    subject: ClientUnderTest, line: IncomingConnection, size: int, filling: bytes
) -> None:
    """The client uploads and downloads a large file unchanged."""
    _upload_and_download(subject, line, content_of(size // 2) + filling * (size - size // 2))


@client_case("5.2/20")
@given(content=st.binary(min_size=1, max_size=500))
@example(content=bytes(range(256)))
@example(content=b"\r\n".join([b"line"] * 60) + b"\n\n\r\n")
@example(content=b"two\r\nlines\r\n")
@example(content=b"\xef\xbb\xbfwith a mark\x1aand an end\x1a\x04")
@example(content=b"  blanks and zeros \t\n\0\0\0")
@example(content="控制层".encode("gb18030") * 50)
def test_content(subject: ClientUnderTest, line: IncomingConnection, content: bytes) -> None:
    """The joined chunks of an upload equal the file."""
    upload = Upload(subject, line, content)
    upload.accept_name()
    sent = b"".join(chunk_of(frame).data for frame in upload.chunk_frames())
    expect_equal(sent, content, "the chunks differ from the file")
    upload.expect_done()


# The reported outcome


@client_case("5.2/19")
def test_refusals_are_failures(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports a failure when the name or any chunk of an upload is refused."""
    upload = Upload(subject, line, _WHOLE)
    line.reply("upload_name", value=False)
    upload.expect_failed()
    for number in examples((0, 1, _LAST)):
        line = expect_served(subject, line, "a refused upload")
        upload, chunk = _up_to(subject, line, number)
        upload.refuse_chunk(chunk)


@client_case("5.2/19", name="download-refused", attended=True)
def test_refused_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports a failure when the controller does not have the file."""
    download = Download(subject, line)
    line.reply("download_name", value=False)
    subject.expect_failure(download.call)


@client_case("5.2/19", name="download-refused-then-sent")
def test_file_of_a_refused_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download that was refused, or could not be written, succeeds later."""
    line = _download_to_an_invalid_folder(subject, line)
    download = Download(subject, line, "zs-again.rob")
    line.reply("download_name", value=False)
    download.expect_failed()
    line = expect_served(subject, line, "a refused download")
    download = Download(subject, line, "zs-again.rob")
    download.accept_name()
    for chunk in chunks_of(_WHOLE):
        download.send_chunk(chunk)
    download.expect_done("5.2/19")


def _download_to_an_invalid_folder(
    subject: ClientUnderTest, line: IncomingConnection
) -> IncomingConnection:
    """Download a file into a folder that cannot exist; return the connection to continue with."""
    local = Path(subject.make_file(b"no folder")) / "zs-again.rob"
    call = subject.begin("download", remote="zs-again.rob", local=str(local))
    if request_or_none(subject, line, call, "download_name") is not None:
        line.reply("download_name")
        line.send_chunk(Chunk(1, 0, 1, b"!"))
        request_or_none(subject, line, call, "download_chunk", subject.silence_s)
    subject.wait_for_answer(call, within_s=transfer_timeouts_of(subject).must_end_s)
    message = "the client reports a successful download without a file"
    expect(not call.ok or local.exists(), message, expected="an error", observed=f"{call}")
    return expect_served(subject, line, "a download that cannot be written")


_ODD = (b"", b"2", b"00", b"0|16", b"\x00", b"10", b"01", b"", b"01", b"10", b"\x01")
"""Answers for the name, the first chunk and the last chunk in turn. Two are empty."""


@client_case("5.2/19", name="odd-answers")
def test_odd_answers(subject: ClientUnderTest) -> None:
    """An answer other than 1 is not an acceptance of a name or a chunk."""
    for number, data in examples(zip(itertools.cycle((None, 1, _LAST)), _ODD, strict=False)):
        line = subject.open(judged=False)
        chunk = None
        if number is None:
            upload, command = Upload(subject, line, _WHOLE), "upload_name"
        else:
            (upload, chunk), command = _up_to(subject, line, number), "upload_chunk"
        line.reply(command, data=data)
        message = UserMessage(
            "the client took the answer {answer!r} for an acceptance", answer=data
        )
        expect_no_transfer_frames(
            line, message, "5.2/19", _SHORT_S, allowed=partial(_may_follow_a_refusal, chunk)
        )
        line.close()
        upload.expect_failed()


def _may_follow_a_refusal(chunk: Chunk | None, seen: FrameSeen) -> bool:
    """Whether a frame may follow a refusal: the abort signal, or the same chunk again."""
    again = chunk and isinstance(seen.value, Chunk) and seen.value.position == chunk.position
    return is_abort_signal(seen) or bool(again)


@client_case("5.2/19", "3/33", name="wrong-opcode")
def test_answers_of_the_wrong_opcode(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A 1 with another opcode or with the tag does not answer a name or a chunk."""
    upload = Upload(subject, line, _WHOLE)
    _offer_wrong(line, "upload_name")
    if _goes_on(upload, line):
        upload.accept_name()
        chunk = upload.next_chunk()
        _offer_wrong(line, "upload_chunk")
        if not line.ended:
            upload.accept_chunk(chunk.length)
    if _goes_on(upload, line):
        upload.finish()
    else:
        upload.expect_failed()


def _goes_on(upload: Upload, line: IncomingConnection) -> bool:
    return upload.call.answer is None and not line.ended


def _offer_wrong(line: IncomingConnection, command: str) -> None:
    """Send 1 with every opcode except the right one. A client may close the link then (A-3-9)."""
    right = BY_NAME[command].opcode
    frames = [Frame(C2A, opcode, b"1") for opcode in _ANSWERS if opcode != right]
    with suppress(NoReply):  # the client has closed the connection
        for frame in (*frames, Frame(C2A, right, b"1", tagged=True)):
            line.send_frame(frame)
    message = UserMessage(
        "the client took a 1 with another opcode for the answer to {command}", command=command
    )
    expect_no_transfer_frames(line, message, "5.2/19", _SHORT_S)


def _end_link_during_uploads(
    subject: ClientUnderTest, end: Callable[[IncomingConnection], None]
) -> None:
    """End the link at the name and at several chunks of an upload."""
    for number in examples((None, 0, 1, 2, _LAST)):
        line = subject.open()
        if number is None:
            upload = Upload(subject, line, _WHOLE)
        else:
            upload, _ = _up_to(subject, line, number)
        end(line)
        upload.expect_failed()


@client_case("5.2/19", name="closed")
def test_link_closed(subject: ClientUnderTest) -> None:
    """The client reports a failure when the link closes at the name or a chunk of an upload."""
    _end_link_during_uploads(subject, IncomingConnection.close)


@client_case("5.2/19", name="reset")
def test_link_reset(subject: ClientUnderTest) -> None:
    """The client reports a failure when the link is reset at the name or a chunk of an upload."""
    _end_link_during_uploads(subject, IncomingConnection.reset)


@client_case("5.2/19", name="download-cut-off")
def test_link_lost_in_a_download(subject: ClientUnderTest) -> None:
    """The client reports a failure when the link ends before or after any chunk of a download."""
    for end in examples((IncomingConnection.close, IncomingConnection.reset)):
        line = subject.open()
        download = Download(subject, line)
        end(line)
        download.expect_failed()
        chunks = tuple(chunks_of(_WHOLE))
        for count in examples(range(len(chunks))):
            line = subject.open()
            download = begin_download(subject, line)
            for chunk in chunks[:count]:
                download.send_chunk(chunk)
            end(line)
            download.expect_failed()
