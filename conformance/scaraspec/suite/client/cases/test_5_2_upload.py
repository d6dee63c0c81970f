"""Clause 5.2: a file to the controller (0x50, 0x52; L741-763).

A file arrives whole or is told as failed: what the client says is checked as much as what it sends.
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
from scaraspec.suite.client.harness.files import (
    Download,
    Upload,
    begin_download,
    expect_no_transfer_frames,
    expect_served,
    expect_transfer_done,
    expect_transfer_failed,
    is_abort_signal,
    receive_upload,
    request_or_none,
    send_download,
    serve_read_back,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.transfer_silence import (
    expect_given_up,
    expect_given_up_despite_queries,
    expect_survives_silence,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.chunks import chunk_of
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply, expect, expect_equal, expect_in
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.strategies import NAME_CHARACTERS
from scaraspec.suite.engine.transfer_timeouts import limits_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

_WHOLE = content_of(650)
_LAST = len(_WHOLE)  # a number that no chunk exceeds
_SHORT_S = 0.1
_REST_OF_A_LIMIT = 0.25  # of 25 s, behind which those have lasted for more than 30

_ANSWERS = tuple(BY_NAME[name].opcode for name in ("upload_name", "upload_chunk", "download_name"))


def _up_to(subject: ClientUnderTest, line: IncomingConnection, number: int) -> tuple[Upload, Chunk]:
    """An upload up to its chunk of this number, or its last, which is not answered yet."""
    upload = Upload(subject, line, _WHOLE)
    upload.accept_name()
    while True:
        chunk = upload.next_chunk()
        if not number or chunk.last:
            return upload, chunk
        upload.accept_chunk(chunk.length)
        number -= 1


def _take_one_byte(subject: ClientUnderTest, line: IncomingConnection, call: Call) -> None:
    """Take an upload of one byte, whose name has come."""
    line.reply("upload_name")
    chunk_of(line.request("upload_chunk", call))
    line.reply("upload_chunk")
    serve_read_back(subject, line, call, b"!")
    expect_transfer_done(subject, call)


# The name


@client_case("5.2/1", attended=True)
def test_upload(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A file is uploaded, its name first."""
    receive_upload(subject, line, _WHOLE)


@client_case("5.2/1", name="drawn")
@given(name=st.text(f"{NAME_CHARACTERS}.", min_size=1, max_size=30).filter(lambda n: n.strip(".")))
@example(name="file.txt")
@example(name="x")
@example(name="a" * 26 + ".rob")
def test_names(subject: ClientUnderTest, line: IncomingConnection, name: str) -> None:
    """An upload begins with its name, whatever the file is called at home."""
    with subject.allow_refusal():
        receive_upload(subject, line, b"!", name)


@client_case("5.2/1", name="chinese")
def test_chinese_name(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A Chinese name is sent whole in UTF-8 or GB18030, or the client refuses it (A-T-2)."""
    name = "程序一.rob"
    call = subject.begin("upload", local=subject.make_file(b"!"), remote=name)
    asked = request_or_none(subject, line, call, "upload_name")
    if asked is None:
        expect_transfer_failed(subject, call, "5.2/1")
        return
    message = "a Chinese name was sent as"
    expect_in(
        asked.frame.data.removesuffix(b"\0"), (name.encode(), name.encode("gb18030")), message
    )
    _take_one_byte(subject, line, call)


@client_case("5.2/18")
def test_long_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A name of 30 bytes is sent; a longer one is refused by the client, or sent whole."""
    for size in examples((29, 30, 31, 60, 255, 256, 300)):
        name = "n" * (size - 4) + ".rob"
        call = subject.begin("upload", local=subject.make_file(b"!"), remote=name)
        asked = request_or_none(subject, line, call, "upload_name")
        if asked is None:
            message = UserMessage("a name of {size} bytes was refused by the client", size=size)
            expect(size > NAME_MAX_BYTES, message, expected="a request", observed=f"{call}")
            expect_transfer_failed(subject, call, "5.2/18")
            continue
        message = UserMessage("a name of {size} bytes was sent as", size=size)
        expect_equal(asked.frame.data.removesuffix(b"\0"), name.encode(), message)
        _take_one_byte(subject, line, call)
        if size > NAME_MAX_BYTES:
            message = UserMessage("a file name of {size} bytes was sent", size=size)
            subject.tolerate("5.2/18", "name_max", "255", message)


@client_case("5.2/4", attended=True)
def test_existing_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A file that exists on the controller is uploaded in vain: no content is sent."""
    upload = Upload(subject, line, _WHOLE)
    line.reply("upload_name", value=False)
    subject.expect_failure(upload.call, requirement="5.2/19")
    expect_no_transfer_frames(line, "content was sent although the name had been refused", "5.2/4")


@client_case("5.2/4", name="between-others")
def test_existing_file_between_others(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A name that was accepted before and is refused now ends that upload alone."""
    name = "zs-again.rob"
    for _ in range(2):
        receive_upload(subject, line, _WHOLE, name)
        upload = Upload(subject, line, _WHOLE, name)
        line.reply("upload_name", value=False)
        upload.expect_failed()
        message = "content was sent although the name had been refused"
        line = expect_served(subject, line, "a name that was refused")
        expect_no_transfer_frames(line, message, "5.2/4")
    receive_upload(subject, line, _WHOLE, name)


# The content


@client_case("5.2/5")
def test_one_structure_a_frame(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Each chunk frame carries one fileData, also of a file that looks like frames."""
    frame = Frame(C2A, BY_NAME["upload_chunk"].opcode, b"1").encode()
    for content in examples((frame * 100, frame[::-1] * 100, b"\xcc\xaa" * 137)):
        upload = Upload(subject, line, content)
        upload.accept_name()
        for answer in upload.chunk_frames():
            chunk_of(answer)
        upload.expect_done()


@client_case("5.2/7")
def test_one_chunk_at_a_time(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Each chunk is held back until the one before it has been answered."""
    upload = Upload(subject, line, _WHOLE)
    upload.accept_name()
    while upload.received_bytes < len(_WHOLE):
        chunk = upload.next_chunk()
        message = "a chunk was sent before the one before it was answered"
        expect_no_transfer_frames(line, message, "5.2/7", _SHORT_S)
        upload.accept_chunk(chunk.length)
    upload.expect_done()


@client_case("5.2/8")
def test_refused_chunk(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload of which a chunk is refused, whichever it is, stops there and has failed."""
    for number in range(_LAST):
        upload, chunk = _up_to(subject, line, number)
        upload.refuse_chunk(chunk)
        line = expect_served(subject, line, "a refused chunk")
        message = "content was sent although a chunk had been refused"
        expect_no_transfer_frames(line, message, "5.2/8")
        if chunk.last:
            break
    receive_upload(subject, line, _WHOLE)


@client_case("5.2/13")
def test_nothing_after_the_end(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """After the answer to the last chunk nothing more of the upload is sent."""
    for size in examples((1, 199, 200, 201, 400, 600)):
        receive_upload(subject, line, content_of(size))
        line = expect_served(subject, line, "an upload")
        message = UserMessage(
            "something was sent after an upload of {size} bytes was complete", size=size
        )
        expect_no_transfer_frames(line, message, "5.2/13")


@client_case("5.2/17")
def test_empty_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A file of no bytes is refused by the client, or sent as its name, or as an empty chunk."""
    call = subject.begin("upload", local=subject.make_file(b""), remote="zs-empty.rob")
    if request_or_none(subject, line, call, "upload_name") is None:
        expect_transfer_failed(subject, call, "5.2/17")
        return
    line.reply("upload_name")
    option, said = "name-only", "as its name alone"
    frame = request_or_none(subject, line, call, "upload_chunk")
    if frame is not None:
        chunk = chunk_of(frame)
        message = "an empty file was sent as a chunk of"
        expect_equal((chunk.file_size, chunk.position, chunk.length), (0, 0, 0), message)
        line.reply("upload_chunk")
        option, said = "chunk", "as a chunk of length 0"
    if subject.wait_for_answer(call).ok:
        subject.tolerate(
            "5.2/17", "empty_file", option, UserMessage("an empty file is sent {said}", said=said)
        )


@client_case("5.2/19", name="no-file")
def test_no_file(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A file is to be uploaded that does not exist, which the client tells; then one that does."""
    call = subject.begin("upload", local=subject.missing_file(), remote="zs-none.rob")
    sent = request_or_none(subject, line, call, "upload_name") is not None
    if sent:
        line.reply("upload_name")
    subject.expect_failure(call)
    if not sent:
        receive_upload(subject, line, _WHOLE)


@client_case("5.2/17", name="full-chunks")
def test_no_empty_chunk_behind_full_ones(
    subject: ClientUnderTest, line: IncomingConnection
) -> None:
    """A file that fills its last chunk ends with that, not with a chunk of length 0."""
    for size in examples((200, 400, 600)):
        upload = Upload(subject, line, content_of(size))
        upload.accept_name()
        for frame in upload.chunk_frames():
            message = "a chunk of length 0 was sent of a file that has content"
            expect(chunk_of(frame).length, message, expected="1 to 200", observed="0")
        again = request_or_none(subject, line, upload.call, "upload_chunk", _SHORT_S)
        message = UserMessage(
            "a chunk follows on {size} full ones that are the whole file", size=size // BUFFER_BYTES
        )
        expect(again is None, message, expected="nothing", observed=f"{again}")
        upload.expect_done()


# Time


@client_case("5.2/9")
def test_late_and_missing_answers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Answers that come after 25 s are taken, twice; one that does not come ends the upload.

    The limit is one of each silence: a file may take longer than that as a whole, chunks alone.
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
    """The silence of an upload ends it, whatever else is asked meanwhile; another one works.

    The answer to the last chunk never comes, so the next one belongs to the next upload.
    """
    upload, _ = _up_to(subject, line, _LAST)
    expect_given_up_despite_queries(subject, line, upload.call, "5.2/9")
    _another_works(subject, line)


@client_case("5.2/9", name="name")
def test_name_is_not_answered(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload whose name is not answered is given up, and not begun by a late answer."""
    upload = Upload(subject, line, _WHOLE)
    expect_given_up(subject, upload.call, "5.2/9")
    _stays_ended(subject, line, "upload_name")


def _stays_ended(subject: ClientUnderTest, line: IncomingConnection, command: str) -> None:
    """An answer that comes too late does not bring an upload back."""
    if line.ending is None:
        line.reply(command)
    _another_works(subject, line)


def _another_works(subject: ClientUnderTest, line: IncomingConnection) -> None:
    line = expect_served(subject, line, "a silence")
    message = "an upload that was given up goes on"
    expect_no_transfer_frames(line, message, "5.2/9", allowed=is_abort_signal)
    receive_upload(subject, line, _WHOLE)


# Sizes and contents


_FILLINGS = (b"\xaa", b"\xcc", b"\x00", b"\x7c")


def _there_and_back(subject: ClientUnderTest, line: IncomingConnection, content: bytes) -> None:
    receive_upload(subject, line, content)
    send_download(subject, line, content, "5.2/16")


@client_case("5.2/16")
@pytest.mark.parametrize("size", [1, 199, 200, 201, 400], ids=str)
def test_sizes(subject: ClientUnderTest, line: IncomingConnection, size: int) -> None:
    """A file of this size gets there and back, full of one byte or of all of them."""
    for content in examples((*(filling * size for filling in _FILLINGS), content_of(size))):
        _there_and_back(subject, line, content)


@client_case("5.2/16")
@pytest.mark.parametrize(
    ("size", "filling"),
    list(zip((51_200, 65_535, 65_536, 131_100), _FILLINGS, strict=True)),
    ids=["51200", "65535", "65536", "131100"],
)
def test_large_files(
    subject: ClientUnderTest, line: IncomingConnection, size: int, filling: bytes
) -> None:
    """A large file gets there and back: half of it without a pattern, half of one byte."""
    _there_and_back(subject, line, content_of(size // 2) + filling * (size - size // 2))


@client_case("5.2/20")
@given(content=st.binary(min_size=1, max_size=500))
@example(content=bytes(range(256)))
@example(content=b"\r\n".join([b"line"] * 60) + b"\n\n\r\n")
@example(content=b"two\r\nlines\r\n")
@example(content=b"\xef\xbb\xbfwith a mark\x1aand an end\x1a\x04")
@example(content=b"  blanks and zeros \t\n\0\0\0")
@example(content="控制层".encode("gb18030") * 50)
def test_content(subject: ClientUnderTest, line: IncomingConnection, content: bytes) -> None:
    """The chunks of an upload, joined together, are the file."""
    upload = Upload(subject, line, content)
    upload.accept_name()
    sent = b"".join(chunk_of(frame).data for frame in upload.chunk_frames())
    expect_equal(sent, content, "the chunks hold another file")
    upload.expect_done()


# What is said of it


@client_case("5.2/19")
def test_refusals_are_failures(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """An upload whose name, first, middle or last chunk is refused is not told as done."""
    upload = Upload(subject, line, _WHOLE)
    line.reply("upload_name", value=False)
    upload.expect_failed()
    for number in examples((0, 1, _LAST)):
        line = expect_served(subject, line, "a refused upload")
        upload, chunk = _up_to(subject, line, number)
        upload.refuse_chunk(chunk)


@client_case("5.2/19", name="download-refused", attended=True)
def test_refused_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download of a file that the controller has not got is not told as done."""
    download = Download(subject, line)
    line.reply("download_name", value=False)
    subject.expect_failure(download.call)


@client_case("5.2/19", name="download-refused-then-sent")
def test_file_of_a_refused_download(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A download that was refused, or had nowhere to go, keeps no file from being fetched later."""
    line = _fetched_to_nowhere(subject, line)
    download = Download(subject, line, "zs-again.rob")
    line.reply("download_name", value=False)
    download.expect_failed()
    line = expect_served(subject, line, "a refused download")
    download = Download(subject, line, "zs-again.rob")
    download.accept_name()
    for chunk in chunks_of(_WHOLE):
        download.send_chunk(chunk)
    download.expect_done("5.2/19")


def _fetched_to_nowhere(subject: ClientUnderTest, line: IncomingConnection) -> IncomingConnection:
    """Order a file into a folder that cannot be; the connection afterwards."""
    local = Path(subject.make_file(b"no folder")) / "zs-again.rob"
    call = subject.begin("download", remote="zs-again.rob", local=str(local))
    if request_or_none(subject, line, call, "download_name") is not None:
        line.reply("download_name")
        line.send_chunk(Chunk(1, 0, 1, b"!"))
        request_or_none(subject, line, call, "download_chunk", subject.silence_s)
    subject.wait_for_answer(call, within_s=limits_of(subject).over_s)
    message = "a download is told as done, and there is no file"
    expect(not call.ok or local.exists(), message, expected="an error", observed=f"{call}")
    return expect_served(subject, line, "a file that cannot be written")


_ODD = (b"", b"2", b"00", b"0|16", b"\x00", b"10", b"01", b"", b"01", b"10", b"\x01")
"""In turn to the name, the first chunk and the last one; nothing at all is said to two of them."""


@client_case("5.2/19", name="odd-answers")
def test_odd_answers(subject: ClientUnderTest) -> None:
    """An answer that does not say 1 is no yes, to a name, a chunk or the last one."""
    for number, data in examples(zip(itertools.cycle((None, 1, _LAST)), _ODD, strict=False)):
        line = subject.open(judged=False)
        chunk = None
        if number is None:
            upload, command = Upload(subject, line, _WHOLE), "upload_name"
        else:
            (upload, chunk), command = _up_to(subject, line, number), "upload_chunk"
        line.reply(command, data=data)
        message = UserMessage("the answer {data!r} was taken for a yes", data=data)
        expect_no_transfer_frames(
            line, message, "5.2/19", _SHORT_S, allowed=partial(_takes_for_no, chunk)
        )
        line.close()
        upload.expect_failed()


def _takes_for_no(chunk: Chunk | None, seen: FrameSeen) -> bool:
    """Whether this may follow a no: the signal that ends the upload, or the same chunk again."""
    again = chunk and isinstance(seen.value, Chunk) and seen.value.position == chunk.position
    return is_abort_signal(seen) or bool(again)


@client_case("5.2/19", "3/33", name="wrong-opcode")
def test_answers_of_the_wrong_opcode(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A 1 under another opcode, or behind the tag of results, is no answer to a name or a chunk."""
    upload = Upload(subject, line, _WHOLE)
    _offer_wrong(line, "upload_name")
    if _goes_on(upload, line):
        upload.accept_name()
        chunk = upload.next_chunk()
        _offer_wrong(line, "upload_chunk")
        if not line.over:
            upload.accept_chunk(chunk.length)
    if _goes_on(upload, line):
        upload.finish()
    else:
        upload.expect_failed()


def _goes_on(upload: Upload, line: IncomingConnection) -> bool:
    return upload.call.answer is None and not line.over


def _offer_wrong(line: IncomingConnection, command: str) -> None:
    """Answer under every opcode but the right one; a client may hang up at that (A-3-9)."""
    right = BY_NAME[command].opcode
    frames = [Frame(C2A, opcode, b"1") for opcode in _ANSWERS if opcode != right]
    with suppress(NoReply):  # it has hung up already
        for frame in (*frames, Frame(C2A, right, b"1", tagged=True)):
            line.send_frame(frame)
    message = UserMessage(
        "a 1 of another opcode was taken for the answer to {command}", command=command
    )
    expect_no_transfer_frames(line, message, "5.2/19", _SHORT_S)


def _lost(subject: ClientUnderTest, end: Callable[[IncomingConnection], None]) -> None:
    """Let the link end at the name and at every chunk of an upload."""
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
    """An upload whose connection is closed, at its name or any chunk, is not told as done."""
    _lost(subject, IncomingConnection.close)


@client_case("5.2/19", name="reset")
def test_link_reset(subject: ClientUnderTest) -> None:
    """An upload whose connection is cut off, at its name or any chunk, is not told as done."""
    _lost(subject, IncomingConnection.reset)


@client_case("5.2/19", name="download-cut-off")
def test_link_lost_in_a_download(subject: ClientUnderTest) -> None:
    """A download whose connection ends, before or behind any chunk, is not told as done."""
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
