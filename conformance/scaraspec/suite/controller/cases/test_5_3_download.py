"""Clause 5.3: download a file from the controller (0x54, 0x56; L765-787).

If state changes are not allowed, a program that is already stored is downloaded. Its content is
unknown.
"""

from functools import partial

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.malformed.silences import (
    Track,
    downloads_at_once,
    run_tracks,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    begin_upload,
    delete,
    download,
    download_replies,
    expect_nothing_more,
    expect_stored,
    is_cancelled,
    leftover_content,
    next_chunk,
    receive_chunks,
    reconnect,
    send_chunk,
    transfer_frames,
    upload,
    upload_some_file,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.chunks import chunk_of
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseSkipped,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.transfer_timeouts import Silence, transfer_timeouts_of
from scaraspec.suite.program_files.listed import INHERITED
from scaraspec.traffic.transfers import refuses_reply
from scaraspec.user_message import UserMessage

_CONTENT = content_of(650)


def _expect_refused(line: OutgoingConnection, name: bytes, message: str) -> None:
    reply = line.ask("download_name", data=name)
    expect(not reply.accepted, message, expected="0", observed=f"{reply}")


def _begin_download(line: OutgoingConnection, name: bytes) -> Chunk:
    """Request an existing file, and return its first chunk, which is not answered yet."""
    reply = line.ask("download_name", data=name)
    expect(
        reply.accepted,
        "an existing file was refused",
        expected="1",
        observed=f"{reply}",
        requirement="5.3/2",
    )
    chunk = next_chunk(line)
    message = "a download does not begin at the beginning of its file"
    expect_equal(chunk.position, 0, message, requirement="5.1/8")
    return chunk


def _skip_if_last(chunk: Chunk) -> Chunk:
    """Return the chunk if another one follows it.

    Raises:
        CaseSkipped: It is the last chunk of its file.
    """
    if chunk.last:
        raise CaseSkipped("the stored program is too short: --allow state uploads a longer one")
    return chunk


@case("5.3/2")
def test_existing_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An existing file is answered 1 each time; a missing one is answered 0."""
    name = upload_some_file(subject, line, _CONTENT)
    for _ in range(3):
        _expect_refused(line, b"absent-" + name, "a missing file was accepted for download")
        expect(download(line, name), "an existing file was refused", expected="1", observed="0")


@case("5.3/3")
def test_missing_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A name that is similar to that of a file, and an empty name, are answered 0."""
    name = upload_some_file(subject, line, _CONTENT)
    similar_names = [name + b"x", name[:-1], b"x" + name, name[1:], name + b".bak"]
    if subject.files.is_own(name):  # otherwise another file of the user may have this name
        similar_names.append(name.partition(b".")[0])
    for similar in examples((*similar_names, b"*", b"*.rob", INHERITED)):
        message = UserMessage(
            "{name} does not exist and was accepted for download",
            name=similar.decode(errors="replace"),
        )
        _expect_refused(line, similar, message)
    line.send("download_name", data=b"")
    replies = transfer_frames(line)
    accepted = [
        received
        for received in replies
        if received.name == "download_name" and received.value is True
    ]
    expect(not accepted, "a nameless download was accepted", expected="0", observed="1")


@case("5.3/3", name="deleted", hazards=(Hazard.STATE,))
def test_deleted_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A deleted file is answered 0, also after it was downloaded before.

    A name with the same letters in another order never existed and is answered 0, too.
    """
    name = subject.new_name("ab")
    upload(line, name, _CONTENT)
    message = "a name with the letters in another order was accepted for download"
    _expect_refused(line, name.replace(b"ab", b"ba"), message)
    expect_stored(line, name, _CONTENT)
    delete(line, name)
    _expect_refused(line, name, "a deleted file was accepted for download")
    _expect_refused(reconnect(subject, line), name, "a deleted file was accepted for download")


@case("5.3/3", name="unfinished", hazards=(Hazard.STATE,))
def test_unfinished_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file that another connection still uploads cannot be downloaded as a complete file."""
    subject.require_multiple_connections()
    name = subject.new_name()
    begin_upload(line, name)
    send_chunk(line, Chunk(650, 0, 200, _CONTENT[:200]))
    fetched = leftover_content(subject.open(), name)
    if fetched is None:
        return
    message = "an unfinished upload was downloaded with bytes that were never sent"
    expect(
        fetched in (b"", _CONTENT[:200]),
        message,
        expected="0, or the 200 bytes sent so far",
        observed=UserMessage("{count} bytes", count=len(fetched)),
    )
    message = "the part received so far can be downloaded during the upload"
    subject.tolerate("5.3/3", "A-5-12", "visible", message)


@case("5.3/4")
def test_content_follows(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After the 1, the content follows without a request, one fileData in each 0x56."""
    name = upload_some_file(subject, line, _CONTENT)
    line.send("download_name", name)
    name_offset_bytes = line.reply("download_name").seen.place.offset_bytes
    early_chunks = [
        received for received in line.inbox if received.place.offset_bytes < name_offset_bytes
    ]
    expect(
        not early_chunks,
        "a chunk arrived before the reply to the name",
        expected="1, then the first chunk",
        observed="; ".join(f"{received.frame}" for received in early_chunks),
    )
    start_ns = subject.now_ns
    delay_s = 0.0
    for chunk in receive_chunks(line):
        if not chunk.position:
            delay_s = (subject.now_ns - start_ns) / 1e9
    if delay_s > subject.reply_s:
        message = UserMessage(
            "the first chunk arrived {delay_s:.1f} s after the 1", delay_s=delay_s
        )
        subject.tolerate("5.3/4", "A-5-23", "later", message)


@case("5.3/4", name="edges", hazards=(Hazard.STATE,))
def test_content_at_the_edges(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Files of one byte, one full chunk and one byte more arrive in as many chunks as they need."""
    for size in examples((1, 200, 201, 400)):
        name, content = subject.new_name(), content_of(size)
        upload(line, name, content)
        chunks = [chunk_of(frame) for frame in download_replies(line, name)]
        fetched = b"".join(chunk.data for chunk in chunks)
        message = UserMessage(
            "the chunks of a file of {size} bytes do not contain its content", size=size
        )
        expect(
            fetched == content,
            message,
            expected=UserMessage("{count} bytes", count=size),
            observed=UserMessage("{count} bytes", count=len(fetched)),
        )


def _fetch_together(
    subject: ControllerUnderTest, line: OutgoingConnection, names: list[bytes]
) -> list[bytes] | None:
    """Download on two connections, chunk by chunk in turns; None if only one is possible."""
    lines = (line, subject.open())
    for connection, name in zip(lines, names, strict=True):
        if connection.ask("download_name", data=name).accepted:
            continue
        expect(connection is not line, "an existing file was refused", requirement="5.3/2")
        message = "only one download at a time is possible on all connections"
        subject.tolerate("5.3/4", "A-5-17", "one", message)
        return None
    fetched = [b"", b""]
    for chunks in zip(*map(receive_chunks, lines), strict=False):
        fetched = [before + chunk.data for before, chunk in zip(fetched, chunks, strict=True)]
    return fetched


@case("5.3/4", name="twice-at-once")
def test_one_file_on_two_connections(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """Two connections that download one file at the same time both receive it completely."""
    subject.require_multiple_connections()
    fetched = _fetch_together(subject, line, [upload_some_file(subject, line, _CONTENT)] * 2)
    message = "two connections that download one file receive different contents"
    expect(fetched is None or fetched[0] == fetched[1], message, expected="the same twice")


@case("5.3/4", name="two-at-once", hazards=(Hazard.STATE,))
def test_two_files_on_two_connections(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """Two connections that download two files at the same time each receive their own file."""
    subject.require_multiple_connections()
    contents = [content_of(650, number) for number in (0, 1)]
    names = [upload_some_file(subject, line, content) for content in contents]
    fetched = _fetch_together(subject, line, names)
    message = "two downloads at the same time were mixed"
    expect(fetched is None or fetched == contents, message, expected="each connection its own file")


@case("5.3/6", slow=True)
def test_one_chunk_at_a_time(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No chunk arrives before the previous one is answered, also during other requests."""
    name = upload_some_file(subject, line, _CONTENT)
    line.ask("download_name", data=name)
    message = "a chunk arrived before the previous one was answered"
    for chunk in receive_chunks(line):
        line.ask("get_version")
        expect_nothing_more(line, message, "5.3/6")
        if not chunk.position:
            line.wait(SILENCE_S)
            expect_nothing_more(line, message, "5.3/6")


@case("5.3/6", name="never-repeated")
def test_no_chunk_is_repeated(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk that is not answered for some seconds is not sent again."""
    name = upload_some_file(subject, line, _CONTENT)
    _begin_download(line, name)
    line.wait(transfer_timeouts_of(subject).must_survive_s / 5)
    expect_nothing_more(line, "an unanswered chunk was followed by another one", "5.3/6")


@case("5.3/7")
def test_silence_of_the_client(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download continues after two answers that took 25 s each, and ends after 60 s of silence.

    The 60 s are tried after the first chunk and after the second one.
    """
    name = upload_some_file(subject, line, _CONTENT)
    times = min(2, len(download_replies(line, name)) - 1)  # a stored program may have fewer chunks
    line.close()
    limits = transfer_timeouts_of(subject)

    after_name, after_chunk = (partial(_begin, name=name, answered=answered) for answered in (0, 1))

    def check_survived(connection: OutgoingConnection, silence: Silence) -> None:
        connection.pump()
        chunks = [
            received.frame for received in connection.inbox if received.name == "download_chunk"
        ]
        message = "something was sent while the answer to a chunk was pending"
        expect(not chunks, message, observed=f"{chunks}", requirement="5.3/6")
        silence.require_within(limits.early_s)
        if not _continues(connection, connection.chunk_timeout_s):
            message = UserMessage(
                "an answer to a chunk was not accepted after {survived_s:g} s",
                survived_s=limits.must_survive_s,
            )
            raise CaseFailed(message, expected="the next chunk", observed="none")

    def check_early(connection: OutgoingConnection, silence: Silence) -> None:
        passed_s = silence.elapsed_s
        if not _continues(connection, subject.reply_s) and passed_s < subject.transfer_s:
            message = UserMessage(
                "a download is aborted before {passed_s:g} s of silence", passed_s=passed_s
            )
            subject.tolerate("5.3/7", "xfer_timeout", "less", message)

    def check_late(connection: OutgoingConnection, _: Silence) -> None:
        if _continues_too_late(connection):
            message = UserMessage(
                "a download is not aborted after {silence_s:g} s of silence",
                silence_s=limits.late_s,
            )
            subject.tolerate("5.3/7", "xfer_timeout", "more", message)

    def check_over(connection: OutgoingConnection, _: Silence) -> None:
        message = UserMessage(
            "an answer to a chunk was accepted after {over_s:g} s", over_s=limits.must_end_s
        )
        continued = _continues_too_late(connection)
        expect(not continued, message, expected="no further chunk", observed="the next chunk")
        if connection.ending is None:
            _begin_download(connection, name)

    run_tracks(
        subject,
        [
            Track(
                partial(_begin_after_download, name=name),
                ((limits.must_survive_s, check_survived),) * times,
            ),
            Track(after_name, ((limits.early_s, check_early),)),
            Track(after_name, ((limits.late_s, check_late),)),
            *(
                Track(begin_upload, ((limits.must_end_s, check_over),))
                for begin_upload in (after_name, after_chunk)[:times]
            ),
        ],
        at_once=downloads_at_once(subject, name),
    )


def _begin(line: OutgoingConnection, name: bytes, answered: int = 0) -> None:
    """Request a file and answer `answered` of its chunks; another chunk follows."""
    _skip_if_last(_begin_download(line, name))
    for _ in range(answered):
        line.answer_chunk(accepted=True)
        _skip_if_last(next_chunk(line))


def _begin_after_download(line: OutgoingConnection, name: bytes) -> None:
    """Request a file again after a download, whose timeout must not apply to the new one."""
    download(line, name)
    _begin(line, name)


def _continues(line: OutgoingConnection, within_s: float) -> bool:
    """Answer a chunk, and return whether the next one arrives."""
    try:
        line.answer_chunk(accepted=True)
        next_frame = line.reply("download_chunk", within_s=within_s)
    except NoReply:
        return False
    return not refuses_reply(next_frame.frame) and not is_cancelled(next_frame)


def _refuse_chunk(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, refuse_at: int
) -> None:
    """Refuse one chunk of a download: only the same chunk may be sent again."""
    chunk = _begin_download(line, name)
    for _ in range(refuse_at):
        _skip_if_last(chunk)
        line.answer_chunk(accepted=True)
        chunk = next_chunk(line)
    line.answer_chunk(accepted=False)
    frames = transfer_frames(line)
    replies = [received for received in frames if not is_cancelled(received)]
    repeated = [received for received in replies if received.value == chunk]
    expect(
        len(replies) == len(repeated) <= 1,
        UserMessage(
            "after chunk {chunk_number} of a download was refused, another one arrived",
            chunk_number=refuse_at + 1,
        ),
        expected="none, or the same once more",
        observed="; ".join(f"{received.frame}" for received in replies),
    )
    if repeated:
        message = "a refused chunk is sent again"
        subject.tolerate("5.3/9", "A-5-14", "repeats", message)
        return
    if frames:
        message = "a chunk of length 0 follows a refused one"
        subject.tolerate("5.3/9", "A-5-10", "signal", message)
    if line.ending is not None:
        subject.tolerate("5.3/9", "A-5-26", "closed", "a refused chunk closes the link")
        return
    line.answer_chunk(accepted=True)
    message = "a download continued after one of its chunks was refused"
    expect_nothing_more(line, message, "5.3/9", stray=True)


@case("5.3/9", name="first")
def test_first_chunk_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download does not continue after its first chunk is refused."""
    _refuse_chunk(subject, line, upload_some_file(subject, line, _CONTENT), 0)


def _continues_too_late(line: OutgoingConnection) -> bool:
    """Answer a chunk, and return whether the next one arrives although the download is over."""
    try:
        line.answer_chunk(accepted=True)
    except NoReply:
        return False
    replies = transfer_frames(line, stray=True)
    return any(
        received.name == "download_chunk" and not is_cancelled(received) for received in replies
    )


@case("5.3/9", name="middle")
def test_middle_chunk_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download does not continue after a middle chunk is refused."""
    _refuse_chunk(subject, line, upload_some_file(subject, line, _CONTENT), 2)


@case("5.3/9", name="last", hazards=(Hazard.STATE,))
def test_last_chunk_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download does not continue after its last chunk is refused, and can be started again."""
    name = upload_some_file(subject, line, _CONTENT)
    _refuse_chunk(subject, line, name, 3)
    line = reconnect(subject, line)
    expect_stored(line, name, _CONTENT, "5.3/9")


@case("5.3/10")
def test_nothing_after_a_refusal(line: OutgoingConnection) -> None:
    """No chunk arrives after a name is refused with 0."""
    for name in examples((b"absent.rob", b"absent.txt", b"a")):
        _expect_refused(line, name, "a missing file was accepted for download")
        expect_nothing_more(line, "a chunk arrived although the file was refused", "5.3/10")
    line.wait(MOMENT_S)
    expect_nothing_more(line, "a chunk arrived although the file was refused", "5.3/10")


@case("5.3/10", name="answered", hazards=(Hazard.STATE,))
def test_answer_without_a_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An answer to a chunk that was never sent causes no chunk, before or after a transfer."""
    name = upload_some_file(subject, line, _CONTENT)
    for _ in range(2):
        for flag in examples((b"1", b"0")):
            _expect_refused(line, b"absent-" + name, "a missing file was accepted for download")
            line.send("download_chunk", data=flag)
            expect_nothing_more(
                line, "a chunk arrived that was not requested", "5.3/10", stray=True
            )
        download(line, name)
