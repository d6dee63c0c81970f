"""Clause 5.4: the receiver, the end of a transfer and its timeout (L789-795).

Uploads are interrupted in every way: at each chunk, by the end of the connection, by a refused
chunk, by the error signal of L787, and by silence.
"""

from collections.abc import Callable
from datetime import timedelta
from functools import partial

from hypothesis import strategies as st

from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.transfer import Chunk, chunks_of
from scaraspec.suite.controller.harness.controller_under_test import SILENCE_S, ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import serves_one_at_a_time
from scaraspec.suite.controller.harness.malformed.mutation_targets import GET_STATUS
from scaraspec.suite.controller.harness.malformed.silences import Track, run_tracks, uploads_at_once
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import read_clock, shifted_time
from scaraspec.suite.controller.harness.requests.files import (
    begin_upload,
    delete,
    download,
    download_replies,
    expect_begun,
    expect_round_trip,
    expect_stored,
    leftover_content,
    next_chunk,
    receive_chunks,
    reconnect,
    send_chunk,
    transfer_frames,
    try_chunk,
    upload,
    upload_some_file,
)
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.chunks import chunk_of
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.transfer_timeouts import Silence, TransferTimeouts, transfer_timeouts_of
from scaraspec.suite.program_files.listed import program_names, store_program
from scaraspec.user_message import UserMessage

_CONTENT = content_of(650)
_CHUNKS = tuple(chunks_of(_CONTENT))
_NEXT = bytes(byte ^ 0xFF for byte in content_of(430))
"""Content that differs from `_CONTENT` at every position, and in its length."""
_NEXT_CHUNKS = tuple(
    Chunk(len(_NEXT), at, len(piece), piece)
    for at in range(0, len(_NEXT), 97)
    for piece in [_NEXT[at : at + 97]]
)
_POLL_S = 0.5
_CLOCK_SHIFT = timedelta(hours=1)


# The name


@case("5.4/1")
def test_missing_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An upload name is answered 1 if the file is missing, also after its deletion."""
    name = subject.new_name()
    line.ask("download_name", data=name)
    for _ in range(3):
        reply = line.ask("upload_name", data=name)
        expect_begun(line, name, reply, "the name of a missing file was refused", "5.4/1")
        send_chunk(line, Chunk(1, 0, 1, b"!"))
        expect_stored(line, name, b"!", "5.4/1")
        delete(line, name)


@case("5.4/1", name="elsewhere")
def test_name_on_a_second_connection(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A file can be uploaded on any connection, also while another one is open."""
    subject.require_multiple_connections()
    for connection in (line, subject.open(), line):
        name = subject.new_name()
        reply = connection.ask("upload_name", data=name)
        expect_begun(connection, name, reply, "the name of a missing file was refused", "5.4/1")
        send_chunk(connection, Chunk(1, 0, 1, b"!"))
        expect_stored(line, name, b"!", "5.4/1")
        line.sync()  # the controller may allow one transfer at a time: it must see the end


@case("5.4/2")
def test_existing_name(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The name of an existing file is answered 0 on any connection, also after a download."""
    name = subject.new_name()
    upload(line, name, _CONTENT)
    for _ in range(2):
        reply = line.ask("upload_name", data=name)
        message = "the name of an existing file was accepted"
        expect(not reply.accepted, message, expected="0", observed=f"{reply}")
        download(line, name)
        line = reconnect(subject, line)


@case("5.4/2", name="among-many")
def test_each_of_many_names(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The name of each of twelve files, or of as many as fit, is answered 0."""
    names: list[bytes] = []
    for _ in range(12):
        name = subject.new_name()
        full = bool(names) and not line.ask("upload_name", data=name).accepted
        if full:
            full_message = UserMessage(
                "the controller has room for only {file_count} more files", file_count=len(names)
            )
            subject.tolerate("5.4/2", "A-5-21", "full", full_message)
            delete(line, names.pop())  # to make room again
        if full or not names:
            begin_upload(line, name)
        send_chunk(line, Chunk(len(name), 0, len(name), name))
        names.append(name)
        if full:
            break
    for name in names:
        reply = line.ask("upload_name", data=name)
        message = "the name of an existing file was accepted"
        expect(not reply.accepted, message, expected="0", observed=f"{reply}")


@case("5.4/3")
def test_buffer_is_not_exceeded(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No chunk of a download contains more than 200 bytes."""
    for size in examples((200, 201, 255, 400, 1000)):
        name = subject.new_name()
        upload(line, name, content_of(size))
        for frame in download_replies(line, name):
            length = chunk_of(frame).length
            message = "a chunk contains more than the buffer"
            expect(length <= 200, message, expected="at most 200", observed=f"{length}")


# The end


@case("5.4/4")
def test_end_is_found(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After its last chunk, a file of any size can be downloaded on every connection."""
    for size in examples((1, 199, 200, 201, 400)):
        name = subject.new_name()
        upload(line, name, content_of(size))
        line = reconnect(subject, line)
        expect_stored(line, name, content_of(size), "5.4/4")


@case("5.4/4", name="short-chunks")
@given(lengths=st.permutations([1, 7, 64, 128, 200]))
def test_end_after_short_chunks(
    subject: ControllerUnderTest, line: OutgoingConnection, lengths: list[int]
) -> None:
    """A file in chunks of any lengths ends where position + length is fileSize, not earlier."""
    content, name = content_of(400), subject.new_name()
    begin_upload(line, name)
    position = 0
    for length in lengths:
        chunk = Chunk(400, position, length, content[position : position + length])
        send_chunk(line, chunk, "5.4/4", "the end of a file was detected too early")
        position += length
    expect_stored(line, name, content, "5.4/4")
    subject.delete_own_files(line)


# The timeout


@case("5.4/5", "5.4/6", "5.4/7")
def test_silence(subject: ControllerUnderTest) -> None:
    """An upload continues after two pauses of 25 s and ends after 60 s of silence."""
    limits = transfer_timeouts_of(subject)
    run_tracks(
        subject,
        [
            _track_of_pauses(subject, limits),
            _track_to_observe(subject, limits.early_s, limits),
            _track_to_observe(subject, limits.late_s, limits),
            _track_of_timeout(subject, limits, sent_chunks=2),
            _track_of_timeout(subject, limits, sent_chunks=0),
        ],
        at_once=uploads_at_once(subject),
    )


def _upload_start(
    subject: ControllerUnderTest, count: int
) -> tuple[bytes, Callable[[OutgoingConnection], None]]:
    """Return a new name, and a function that starts its upload and sends `count` chunks."""
    name = subject.new_name()

    def start(line: OutgoingConnection) -> None:
        begin_upload(line, name)
        for chunk in _CHUNKS[:count]:
            send_chunk(line, chunk)

    return name, start


def _track_of_pauses(subject: ControllerUnderTest, limits: TransferTimeouts) -> Track:
    """Return a track with pauses of 25 s after the name and after a chunk, and then the rest.

    A complete upload precedes it, whose timeout must not apply to this one.
    """
    name, start = _upload_start(subject, 0)

    def start_after_another(line: OutgoingConnection) -> None:
        another = subject.new_name()
        upload(line, another, _CONTENT)
        delete(line, another)
        start(line)

    def check_survived(line: OutgoingConnection, silence: Silence, chunk: Chunk) -> None:
        answer_s = line.chunk_timeout_s
        accepted = try_chunk(line, chunk, within_s=answer_s)
        if not accepted:
            silence.require_within(limits.early_s + (answer_s if accepted is None else 0))
            _expect_served(subject, line, "a timeout")
            message = UserMessage(
                "an upload was aborted after {survived_s:g} s of silence",
                survived_s=limits.must_survive_s,
            )
            raise CaseFailed(message, expected="1", observed="0 or silence", requirement="5.4/5")

    def check_rest(line: OutgoingConnection, silence: Silence) -> None:
        check_survived(line, silence, _CHUNKS[1])
        for chunk in _CHUNKS[2:]:
            send_chunk(line, chunk)
        expect_stored(line, name, _CONTENT, "5.4/5")

    first = (limits.must_survive_s, lambda line, silence: check_survived(line, silence, _CHUNKS[0]))
    return Track(start_after_another, (first, (limits.must_survive_s, check_rest)))


def _track_to_observe(
    subject: ControllerUnderTest, silence_s: float, limits: TransferTimeouts
) -> Track:
    """Return a track that checks after a pause whether an upload is still open."""
    _, start = _upload_start(subject, 1)

    def check_state(line: OutgoingConnection, silence: Silence) -> None:
        passed_s = silence.elapsed_s
        still_open = try_chunk(line, _CHUNKS[1])
        if still_open and silence_s >= limits.late_s:
            message = UserMessage(
                "an upload is not aborted after {silence_s:g} s of silence", silence_s=silence_s
            )
            subject.tolerate("5.4/5", "xfer_timeout", "more", message)
        if not still_open and passed_s < subject.transfer_s:
            message = UserMessage(
                "an upload is aborted before {passed_s:g} s of silence", passed_s=passed_s
            )
            subject.tolerate("5.4/5", "xfer_timeout", "less", message)

    return Track(start, ((silence_s, check_state),))


def _track_of_timeout(
    subject: ControllerUnderTest, limits: TransferTimeouts, sent_chunks: int
) -> Track:
    """Return a track with a pause of 60 s, after which the upload must be over."""
    name, start = _upload_start(subject, sent_chunks)

    def check_over(line: OutgoingConnection, _: Silence) -> None:
        expect(
            not try_chunk(line, _CHUNKS[sent_chunks]),
            UserMessage(
                "a chunk was accepted after {over_s:g} s of silence", over_s=limits.must_end_s
            ),
            expected="0",
            observed="1",
            requirement="5.4/5",
        )
        line = _expect_served(subject, line, "a timeout")
        _expect_transfer(subject, line, "a timeout")
        _expect_no_leftover(subject, line, name, _CONTENT[: 200 * sent_chunks]).close()

    return Track(start, ((limits.must_end_s, check_over),))


# The state after an interrupted transfer


def _expect_served(
    subject: ControllerUnderTest, line: OutgoingConnection, event: str
) -> OutgoingConnection:
    """Expect that another command is served, and return the connection that was used.

    It is a new connection if only a new one is served.
    """
    try:
        line.ask("get_status")
    except NoReply as error:
        line.close()
        try:
            line = subject.open()
            line.ask("get_status")
        except CaseFailed:
            error.requirement = "5.4/6"
            raise error from None
        message = UserMessage("after {event}, only a new connection is served", event=event)
        subject.tolerate("5.4/6", "A-5-26", "closed", message)
    return line


def _expect_transfer(subject: ControllerUnderTest, line: OutgoingConnection, event: str) -> None:
    """Expect that another transfer works after an interrupted one."""
    try:
        expect_round_trip(subject, line, b"next")
    except CaseFailed as error:
        raise CaseFailed(
            UserMessage(
                "after {event}, no other transfer works: {error}", event=event, error=error
            ),
            expected=error.expected,
            observed=error.observed,
            requirement="5.4/6",
        ) from None


def _expect_no_leftover(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, sent_part: bytes
) -> OutgoingConnection:
    """Expect that an interrupted upload leaves no file, or only its beginning (A-5-12).

    Its name can be used again, for another content. The file may contain everything that was sent.
    A robot that buffers its writes may have stored only a beginning of it, or an empty file. The
    name may be listed only if there is a file.

    Returns:
        The connection that is open now.

    Raises:
        CaseFailed: The file has other content, or the name cannot be used again.
    """
    listed = name in _other_programs(subject, line)
    remaining = leftover_content(line, name)
    if remaining is None and listed:
        expect(
            line.ask("delete_program", data=name).accepted,
            "an interrupted upload is listed, but it can be neither downloaded nor deleted",
            expected="a list without it",
            observed="0 to the download, 0 to the deletion",
            requirement="4.10/11",
        )
        message = "an empty file of an interrupted upload is kept"
        subject.tolerate("5.4/7", "partial_keep", "keep", message)
    if remaining is not None:
        line = reconnect(subject, line)
        expect(
            sent_part.startswith(remaining),
            "an interrupted upload left a file with another content",
            expected=UserMessage(
                "no file, or the {count} bytes that were sent, or their beginning",
                count=len(sent_part),
            ),
            observed=UserMessage("{count} bytes", count=len(remaining)),
            requirement="5.4/7",
        )
        message = "the part that was sent of an interrupted upload is kept"
        subject.tolerate("5.4/7", "partial_keep", "keep", message)
        delete(line, name)
    # a lost connection may be detected by its silence
    deadline = Deadline(subject, transfer_timeouts_of(subject).must_end_s)
    while not (reply := line.ask("upload_name", data=name)).accepted and not deadline.expired:
        if line.ask("delete_program", data=name).accepted:
            message = "an empty file of an interrupted upload is kept"
            subject.tolerate("5.4/7", "partial_keep", "keep", message)
        line.wait(_POLL_S)
    expect(
        reply.accepted,
        "the name of an interrupted upload cannot be used again, and no file of it can be deleted",
        expected="1",
        observed=f"{reply}",
        requirement="5.4/1",
    )
    for chunk in _NEXT_CHUNKS:
        send_chunk(line, chunk)
    expect_stored(line, name, _NEXT, "5.4/7")
    return line


def _interrupt_uploads(
    subject: ControllerUnderTest, end: Callable[[OutgoingConnection], None]
) -> None:
    """Interrupt an upload at every chunk with `end`."""
    for count in examples(range(len(_CHUNKS))):
        name, start = _upload_start(subject, count)
        line = subject.open()
        start(line)
        end(line)
        line = subject.open() if line.closed else reconnect(subject, line)
        _expect_no_leftover(subject, line, name, _CONTENT[: 200 * count]).close()


@case("5.4/7", "5.4/1", "4.10/11", name="closed")
def test_connection_closed(subject: ControllerUnderTest) -> None:
    """If its connection is closed at any chunk, an upload leaves at most the sent part.

    The upload may stay open until its timeout. Until then, it may block other transfers (A-5-17).
    """
    subject.require_close_detection()
    _interrupt_uploads(subject, OutgoingConnection.close)
    if subject.transfers_outlive:
        message = "an upload whose connection ended blocks others until its timeout"
        subject.tolerate("5.4/7", "A-5-17", "outlives", message)


@case("5.4/7", "5.4/1", "4.10/11", name="reset")
def test_connection_reset(subject: ControllerUnderTest) -> None:
    """If its connection is reset at any chunk, an upload leaves at most the sent part."""
    subject.require_close_detection()
    _interrupt_uploads(subject, OutgoingConnection.reset)


@case("5.4/7", "5.4/1", "4.10/11", name="refused")
def test_chunk_refused(subject: ControllerUnderTest) -> None:
    """If one of its chunks is refused, an upload leaves at most the sent part."""
    _interrupt_uploads(subject, _offer_invalid_chunk)


def _offer_invalid_chunk(line: OutgoingConnection) -> None:
    """Send an invalid chunk: longer than the buffer, and beyond the end."""
    try_chunk(line, Chunk(650, 500, 201, bytes(200)))


@case("5.4/7", "5.4/1", "4.10/11", name="signal")
def test_error_signal(subject: ControllerUnderTest) -> None:
    """After an error signal, with a header or without, an upload leaves at most the sent part."""
    for data in (None, b""):
        _interrupt_uploads(subject, partial(_signal_error, data=data))


def _signal_error(line: OutgoingConnection, data: bytes | None) -> None:
    """Send a chunk of length 0 (L787)."""
    line.send("upload_chunk", Chunk(len(_CONTENT), 0, 0, b""), data=data)
    transfer_frames(line)  # the reply, if any, is open


@case("5.4/6", name="refused-chunk")
def test_served_after_a_refused_chunk(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """After a refused chunk, other commands are served and another transfer works."""
    for chunk in examples((Chunk(650, 200, 201, bytes(200)), Chunk(650, 600, 200, bytes(200)))):
        start = _upload_start(subject, 1)[1]
        start(line)
        try_chunk(line, chunk)
        line = _expect_recovery(subject, line, "a refused chunk")


@case("5.4/6", name="error-signal")
def test_served_after_the_error_signal(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """After a chunk of length 0, with or without its header, other commands are served."""
    for count in (0, 1, 3):
        for data in examples((None, b"")):
            start = _upload_start(subject, count)[1]
            start(line)
            line.send("upload_chunk", Chunk(650, 200 * count, 0, b""), data=data)
            transfer_frames(line)  # the reply, if any, is open
            if count == 1 and try_chunk(line, _CHUNKS[1], within_s=SILENCE_S):
                message = "an upload continues after a chunk of length 0"
                subject.tolerate("5.4/6", "A-5-10", "continues", message)
            line = _expect_recovery(subject, line, "a chunk of length 0")


@case("5.4/6", name="empty-file")
def test_served_after_an_empty_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After a file of no bytes, accepted or not, other commands are served."""
    name = subject.new_name()
    begin_upload(line, name)
    line.send("upload_chunk", Chunk(0, 0, 0, b""))
    line.wait(0.2)
    replies = transfer_frames(line)  # the reply, if any, is open (A-5-10)
    accepted = any(
        received.name == "upload_chunk" and received.value is True for received in replies
    )
    line = _expect_recovery(subject, line, "an empty file")
    if accepted:
        expect_equal(leftover_content(line, name) or b"", b"", "an empty file has content")
        message = "an empty file is a chunk of length 0"
        subject.tolerate("5.4/6", "empty_file", "chunk", message)


def _expect_recovery(
    subject: ControllerUnderTest, line: OutgoingConnection, event: str
) -> OutgoingConnection:
    """Return a new connection, after the old one has served other commands.

    The upload may still be open (A-5-10, A-5-14), so the next transfer uses a new connection. If
    another upload is accepted on the old connection, it contains nothing of the interrupted one.
    """
    line = _expect_served(subject, line, event)
    transfer_frames(line)  # a late reply to the interrupted upload
    name = subject.new_name()
    if line.ask("upload_name", data=name).accepted:
        for chunk in _NEXT_CHUNKS:
            send_chunk(line, chunk, "5.4/6")
        expect_stored(line, name, _NEXT, "5.4/6")
    line = reconnect(subject, line)
    _expect_transfer(subject, line, event)
    return line


# Other commands during a transfer

_OTHER_COMMANDS = ("get_status", "get_time", "get_version", "list_programs", "get_joint_angles")


def _expect_other_commands(
    subject: ControllerUnderTest, line: OutgoingConnection, status: str
) -> None:
    """Send other commands, and expect this status."""
    for name in examples(
        command for command in _OTHER_COMMANDS if command not in subject.ics.unsupported
    ):
        try:
            reply = line.ask(name)
        except NoReply as error:
            error.requirement = "5.4/8"
            raise
        if name == "get_status":
            message = "the status changes during a file transfer"
            if reply.value in BUSY:
                subject.tolerate("5.4/8", "A-5-17", reply.value, message)
            else:
                expect_equal(reply.value, status, message, requirement="4.8/3")


def _expect_status(line: OutgoingConnection, status: str) -> None:
    """Expect the status from before a file transfer."""
    message = "the status has changed although the file transfer is over"
    expect_equal(line.ask("get_status").value, status, message, requirement="4.8/3")


@case("5.4/8", "4.8/3", name="upload")
def test_commands_during_an_upload(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Other commands are answered between the chunks of an upload, and the file is complete.

    If the clock is set ahead, the upload does not time out. Another file may be deleted, and the
    remaining list is unchanged.
    """
    name, other = subject.new_name(), subject.new_name()
    status = line.ask("get_status").value
    upload(line, other, _CONTENT)
    store_program(subject, line)
    with settings_preserved(subject, line, "clock"):
        _upload_between_other_commands(subject, line, name, other, status)
    _expect_status(line, status)
    expect_stored(line, name, _CONTENT, "5.4/8")


def _upload_between_other_commands(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, other: bytes, status: str
) -> None:
    listed = _other_programs(subject, line, name, other)
    begin_upload(line, name)
    for chunk in _CHUNKS:
        _expect_other_commands(subject, line, status)
        line.ask("delete_program", data=other)
        message = "the program list changed during an upload"
        expect_equal(
            _other_programs(subject, line, name, other), listed, message, requirement="5.4/8"
        )
        if {"get_time", "set_time"}.isdisjoint(subject.ics.unsupported):
            line.ask("set_time", shifted_time(read_clock(subject, line).time, _CLOCK_SHIFT))
        send_chunk(line, chunk, "5.4/8", "a chunk was refused after other commands")


def _other_programs(
    subject: ControllerUnderTest, line: OutgoingConnection, *excluded: bytes
) -> list[bytes]:
    """Return the listed programs without these, sorted; empty if the list is not supported."""
    unsupported = "list_programs" in subject.ics.unsupported
    return [] if unsupported else sorted(set(program_names(subject, line)).difference(excluded))


@case("5.4/8", "2/6", "4.8/3", name="download")
def test_commands_during_a_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Other commands are answered between the chunks of a download, and the file is complete."""
    status = line.ask("get_status").value
    name = upload_some_file(subject, line, _CONTENT)
    listed = _other_programs(subject, line)
    line.ask("download_name", data=name)
    content = b""
    try:
        for chunk in receive_chunks(line):
            content += chunk.data
            _expect_other_commands(subject, line, status)
            message = "the program list changed during a download"
            expect_equal(_other_programs(subject, line), listed, message)
    except CaseFailed as error:
        error.requirement = "5.4/8"
        raise
    _expect_status(line, status)
    message = "the content of a file changed with other commands during the download"
    expect(
        content == _CONTENT,
        message,
        expected="650 bytes",
        observed=UserMessage("{count} bytes", count=len(content)),
    )
    if not serves_one_at_a_time(subject):
        _answer_chunks_between_queries(line, name)


def _answer_chunks_between_queries(line: OutgoingConnection, name: bytes) -> None:
    """Send each answer to a chunk in one segment with a query before it and one after it."""
    line.ask("download_name", data=name)
    last = False
    while not last:
        try:
            last = next_chunk(line).last
            line.send_bytes(GET_STATUS + line.chunk_answer(accepted=True).encode() + GET_STATUS)
            line.reply("get_status")
            line.reply("get_status")
        except NoReply as error:
            error.requirement = "2/6"
            raise


@case("5.4/8", "4.8/3", name="elsewhere")
def test_commands_on_another_connection(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """While one connection uploads, another one is served."""
    subject.require_multiple_connections()
    other = subject.open()
    name = subject.new_name()
    status = other.ask("get_status").value
    begin_upload(line, name)
    for chunk in _CHUNKS:
        _expect_other_commands(subject, other, status)
        send_chunk(line, chunk)
    _expect_status(other, status)
    expect_stored(other, name, _CONTENT, "5.4/8")


def _begin_second_transfer(
    subject: ControllerUnderTest, line: OutgoingConnection, opcode: str
) -> None:
    """Begin a second transfer during an upload: it is refused, or replaces the upload (A-5-17)."""
    old, first, second = (subject.new_name() for _ in range(3))
    upload(line, old, content_of(250, 1))
    begin_upload(line, first)
    send_chunk(line, _CHUNKS[0])
    is_download = opcode == "download_name"
    replaced = line.ask(opcode, old if is_download else second).accepted
    if not replaced:
        message = "an upload was interrupted although a second transfer was refused"
        for chunk in _CHUNKS[1:]:
            send_chunk(line, chunk, "5.4/8", message)
        expect_stored(line, first, _CONTENT, "5.4/8")
        return
    message = "a second transfer replaces the first"
    subject.tolerate("5.4/8", "xfer_concurrency", "replace", message)
    if not is_download:
        for chunk in _NEXT_CHUNKS:
            send_chunk(line, chunk)
        expect_stored(line, second, _NEXT, "5.4/8")
    else:
        next_chunk(line)
    remaining = leftover_content(reconnect(subject, line), first)
    message = "a replaced upload left more than the part that was sent"
    expect(
        remaining in (None, b"", _CONTENT[:200]),
        message,
        expected="no file",
        observed="another file",
    )


@case("5.4/8", name="second-upload")
def test_second_upload(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A second upload during the first is refused without effect, or replaces it."""
    _begin_second_transfer(subject, line, "upload_name")


@case("5.4/8", name="second-download")
def test_second_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download during an upload is refused without effect, or replaces it."""
    _begin_second_transfer(subject, line, "download_name")


@case("5.4/8", name="one-after-another")
def test_mixed_transfers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Complete and interrupted uploads and downloads in turns do not affect each other."""
    name = subject.new_name()
    upload(line, name, _CONTENT)
    for number in range(4):
        expect_stored(line, name, _CONTENT, "5.4/8")
        expect_round_trip(subject, line, content_of(250, number), "5.4/8")
        line.ask("download_name", data=name)
        next_chunk(line)
        line.answer_chunk(accepted=False)
        if transfer_frames(line) or line.ending:  # it may be repeated once (A-5-14, A-5-26)
            line = reconnect(subject, line)
