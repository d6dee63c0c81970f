"""Clause 5.4: what a receiver does, the end of a transfer and its time-out (L789-795).

An upload that broke off is met here in every way: at each chunk, by the end of the connection, by
a chunk that is refused, by the error signal of L787, by silence.
"""

from collections.abc import Callable
from datetime import timedelta

from hypothesis import strategies as st

from scaraspec.protocol.transfer import Chunk, chunks_of
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import takes_one_at_a_time
from scaraspec.suite.controller.harness.malformed.mutation_targets import GET_STATUS
from scaraspec.suite.controller.harness.malformed.timeouts import Track, run_tracks, uploads_at_once
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import read, shifted
from scaraspec.suite.controller.harness.requests.files import (
    CHUNK_S,
    again,
    begin,
    course_of,
    delete,
    download,
    expect_round_trip,
    expect_stored,
    incoming,
    left_behind,
    next_chunk,
    offer,
    send,
    some_file,
    transfer_frames,
    upload,
)
from scaraspec.suite.controller.harness.state.preserve import kept
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.chunks import chunk_of
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.engine.transfer_timeouts import Limits, Silence, limits_of
from scaraspec.suite.program_files.listed import program_names, store_program
from scaraspec.user_message import UserMessage

_CONTENT = content_of(650)
_CHUNKS = tuple(chunks_of(_CONTENT))
_POLL_S = 0.5
_AHEAD = timedelta(hours=1)


# The name


@case("5.4/1")
def test_name_that_is_not_there(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The name of a file that is not there is answered 1: new, deleted, asked for in vain."""
    name = subject.new_name()
    line.ask("download_name", data=name)
    for _ in range(3):
        answer = line.ask("upload_name", data=name)
        message = "the name of a file that is not there was refused"
        expect(answer.accepted, message, expected="1", observed=f"{answer}")
        send(line, Chunk(1, 0, 1, b"!"))
        expect_stored(line, name, b"!", "5.4/1")
        delete(line, name)


@case("5.4/1", name="elsewhere")
def test_name_on_a_second_connection(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A file is created on any connection, also while another one is open."""
    subject.require_multiple_connections()
    for on in (line, subject.open(), line):
        name = subject.new_name()
        answer = on.ask("upload_name", data=name)
        message = "the name of a file that is not there was refused"
        expect(answer.accepted, message, expected="1", observed=f"{answer}")
        send(on, Chunk(1, 0, 1, b"!"))
        expect_stored(line, name, b"!", "5.4/1")
        line.sync()  # the download is over for the subject, too: there may be one at a time


@case("5.4/2")
def test_name_that_is_there(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The name of a file that is there is answered 0, on any connection, also after a download."""
    name = subject.new_name()
    upload(line, name, _CONTENT)
    for _ in range(2):
        answer = line.ask("upload_name", data=name)
        message = "the name of a file that is there was accepted"
        expect(not answer.accepted, message, expected="0", observed=f"{answer}")
        download(line, name)
        line = again(subject, line)


@case("5.4/2", name="among-many")
def test_each_of_many_names(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Of twelve files, or as many as there is room for, each one's name is answered 0."""
    names: list[bytes] = []
    for _ in range(12):
        name = subject.new_name()
        full = bool(names) and not line.ask("upload_name", data=name).accepted
        if full:
            message = UserMessage(
                "there is room for {names_count} more files", names_count=len(names)
            )
            subject.tolerate("5.4/2", "A-5-21", "full", message)
            delete(line, names.pop())  # then there is room again
        if full or not names:
            begin(line, name)
        send(line, Chunk(len(name), 0, len(name), name))
        names.append(name)
        if full:
            break
    for name in names:
        answer = line.ask("upload_name", data=name)
        taken = "the name of a file that is there was accepted"
        expect(not answer.accepted, taken, expected="0", observed=f"{answer}")


@case("5.4/3")
def test_buffer_is_not_exceeded(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No chunk of a download holds more than 200 bytes."""
    for size in examples((200, 201, 255, 400, 1000)):
        name = subject.new_name()
        upload(line, name, content_of(size))
        for frame in course_of(line, name):
            length = chunk_of(frame).length
            message = "a chunk holds more than the buffer"
            expect(length <= 200, message, expected="at most 200", observed=f"{length}")


# The end


@case("5.4/4")
def test_end_is_found(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """With its last chunk a file is there, whatever its size, for every connection."""
    for size in examples((1, 199, 200, 201, 400)):
        name = subject.new_name()
        upload(line, name, content_of(size))
        line = again(subject, line)
        expect_stored(line, name, content_of(size), "5.4/4")


@case("5.4/4", name="short-chunks")
@given(lengths=st.permutations([1, 7, 64, 128, 200]))
def test_end_behind_short_chunks(
    subject: ControllerUnderTest, line: OutgoingConnection, lengths: list[int]
) -> None:
    """A file in chunks of any lengths ends where position + length is fileSize, and not before."""
    content, name = content_of(400), subject.new_name()
    begin(line, name)
    position = 0
    for length in lengths:
        chunk = Chunk(400, position, length, content[position : position + length])
        send(line, chunk, "5.4/4", "the end of a file was found too early")
        position += length
    expect_stored(line, name, content, "5.4/4")
    subject.clear(line)


# The time-out


@case("5.4/5", "5.4/6", "5.4/7")
def test_silence(subject: ControllerUnderTest) -> None:
    """An upload survives 25 s of silence, twice, is over after 60 s, and leaves the link usable."""
    limits = limits_of(subject)
    run_tracks(
        subject,
        [
            _patient(subject, limits),
            _reported(subject, limits.early_s, limits),
            _reported(subject, limits.late_s, limits),
            _abandoned(subject, limits, sent=2),
            _abandoned(subject, limits, sent=0),
        ],
        at_once=uploads_at_once(subject),
    )


def _sent(
    subject: ControllerUnderTest, count: int
) -> tuple[bytes, Callable[[OutgoingConnection], None]]:
    """A name, and what sends it and the first chunks."""
    name = subject.new_name()

    def start(line: OutgoingConnection) -> None:
        begin(line, name)
        for chunk in _CHUNKS[:count]:
            send(line, chunk)

    return name, start


def _patient(subject: ControllerUnderTest, limits: Limits) -> Track:
    """Pauses of 25 s behind the name and behind a chunk, and then the rest.

    An upload that has come to its end precedes: its time-out must not be this one's.
    """
    name, start = _sent(subject, 0)

    def after_another(line: OutgoingConnection) -> None:
        another = subject.new_name()
        upload(line, another, _CONTENT)
        delete(line, another)
        start(line)

    def survived(line: OutgoingConnection, silence: Silence, chunk: Chunk) -> None:
        taken = offer(line, chunk, within_s=CHUNK_S)
        if not taken:
            silence.in_time(limits.early_s + (CHUNK_S if taken is None else 0))
            _serving(subject, line, "a time-out")
            message = UserMessage(
                "an upload did not survive {survived_s:g} s of silence",
                survived_s=limits.survived_s,
            )
            raise CaseFailed(message, expected="1", observed="0 or silence", requirement="5.4/5")

    def rest(line: OutgoingConnection, silence: Silence) -> None:
        survived(line, silence, _CHUNKS[1])
        for chunk in _CHUNKS[2:]:
            send(line, chunk)
        expect_stored(line, name, _CONTENT, "5.4/5")

    first = (limits.survived_s, lambda line, silence: survived(line, silence, _CHUNKS[0]))
    return Track(after_another, (first, (limits.survived_s, rest)))


def _reported(subject: ControllerUnderTest, silence_s: float, limits: Limits) -> Track:
    """A pause after which an upload should still, or no longer, be alive."""
    _, start = _sent(subject, 1)

    def look(line: OutgoingConnection, silence: Silence) -> None:
        passed_s = silence.passed_s
        alive = offer(line, _CHUNKS[1])
        if alive and silence_s >= limits.late_s:
            message = UserMessage(
                "an upload is not given up after {silence_s:g} s of silence", silence_s=silence_s
            )
            subject.tolerate("5.4/5", "xfer_timeout", "more", message)
        if not alive and passed_s < subject.transfer_s:
            message = UserMessage(
                "an upload is given up before {passed_s:g} s of silence", passed_s=passed_s
            )
            subject.tolerate("5.4/5", "xfer_timeout", "less", message)

    return Track(start, ((silence_s, look),))


def _abandoned(subject: ControllerUnderTest, limits: Limits, sent: int) -> Track:
    """A pause of 60 s, after which the upload must be over."""
    name, start = _sent(subject, sent)

    def over(line: OutgoingConnection, _: Silence) -> None:
        expect(
            not offer(line, _CHUNKS[sent]),
            UserMessage("a chunk was taken after {over_s:g} s of silence", over_s=limits.over_s),
            expected="0",
            observed="1",
            requirement="5.4/5",
        )
        line = _serving(subject, line, "a time-out")
        _transfers(subject, line, "a time-out")
        _nothing_left(subject, line, name, _CONTENT[: 200 * sent]).close()

    return Track(start, ((limits.over_s, over),))


# What a broken transfer leaves


def _serving(
    subject: ControllerUnderTest, line: OutgoingConnection, what: str
) -> OutgoingConnection:
    """The connection, once it has served another command; a new one where only that does."""
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
        message = UserMessage("after {what} only a new connection is served", what=what)
        subject.tolerate("5.4/6", "A-5-26", "closed", message)
    return line


def _transfers(subject: ControllerUnderTest, line: OutgoingConnection, what: str) -> None:
    """Another transfer works after one has broken off."""
    try:
        expect_round_trip(subject, line, b"next")
    except CaseFailed as error:
        raise CaseFailed(
            UserMessage("after {what} no other transfer works: {error}", what=what, error=error),
            expected=error.expected,
            observed=error.observed,
            requirement="5.4/6",
        ) from None


def _nothing_left(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, part: bytes
) -> OutgoingConnection:
    """A broken upload leaves nothing, or of what was sent as much as was written (A-5-12).

    Its name serves again. What is told is what was sent; a robot that gathers what comes, or lets
    its system do so, has written a beginning of it, or nothing into the file that it had created.

    Returns:
        The connection that is open now.

    Raises:
        CaseFailed: Something else is there, or the name is blocked for good.
    """
    got = left_behind(line, name)
    if got is not None:
        line = again(subject, line)
        expect(
            part.startswith(got),
            "a broken upload left a file that is not what was sent of it",
            expected=f"no file, or the {len(part)} bytes that were sent, or their beginning",
            observed=f"{len(got)} bytes",
            requirement="5.4/7",
        )
        message = "what was sent of a broken upload stays"
        subject.tolerate("5.4/7", "partial_keep", "keep", message)
        delete(line, name)
    left_s = limits_of(subject).over_s  # until a lost connection is noticed by its silence
    while not (answer := line.ask("upload_name", data=name)).accepted and left_s > 0:
        if line.ask("delete_program", data=name).accepted:
            message = "an empty file stays of a broken upload"
            subject.tolerate("5.4/7", "partial_keep", "keep", message)
        line.wait(_POLL_S)
        left_s -= _POLL_S
    expect(
        answer.accepted,
        "the name of a broken upload cannot be used again, though no file of it can be deleted",
        expected="1",
        observed=f"{answer}",
        requirement="5.4/1",
    )
    for chunk in _CHUNKS:
        send(line, chunk)
    expect_stored(line, name, _CONTENT, "5.4/7")
    return line


def _broken_off(subject: ControllerUnderTest, end: Callable[[OutgoingConnection], None]) -> None:
    """Let an upload break off at every chunk."""
    for count in examples(range(len(_CHUNKS))):
        name, start = _sent(subject, count)
        line = subject.open()
        start(line)
        end(line)
        line = subject.open() if line.closed else again(subject, line)
        _nothing_left(subject, line, name, _CONTENT[: 200 * count]).close()


@case("5.4/7", "5.4/1", name="closed")
def test_connection_closed(subject: ControllerUnderTest) -> None:
    """An upload whose connection was closed, at any chunk, leaves nothing but what was sent.

    It may last until its time-out, and be in the way of others until then (A-5-17).
    """
    subject.notices_leaving()
    _broken_off(subject, OutgoingConnection.close)
    if subject.transfers_outlive:
        message = "an upload whose connection ended is in the way of others until its time-out"
        subject.tolerate("5.4/7", "A-5-17", "outlives", message)


@case("5.4/7", "5.4/1", name="reset")
def test_connection_reset(subject: ControllerUnderTest) -> None:
    """An upload whose connection was cut off, at any chunk, leaves nothing but what was sent."""
    subject.notices_leaving()
    _broken_off(subject, OutgoingConnection.reset)


@case("5.4/7", "5.4/1", name="refused")
def test_chunk_refused(subject: ControllerUnderTest) -> None:
    """An upload of which a chunk was refused, at any chunk, leaves nothing but what was sent."""
    _broken_off(subject, _offer_bad)


def _offer_bad(line: OutgoingConnection) -> None:
    """A chunk that nobody takes: longer than the buffer, and beyond the end."""
    offer(line, Chunk(650, 500, 201, bytes(200)))


@case("5.4/6", name="refused-chunk")
def test_served_after_a_refused_chunk(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """After a chunk was refused, other commands are served, and another transfer works."""
    for chunk in examples((Chunk(650, 200, 201, bytes(200)), Chunk(650, 600, 200, bytes(200)))):
        start = _sent(subject, 1)[1]
        start(line)
        offer(line, chunk)
        line = _recovered(subject, line, "a refused chunk")


@case("5.4/6", name="error-signal")
def test_served_after_the_error_signal(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """After a chunk of length 0, with or without numbers, other commands are served."""
    for count in (0, 1, 3):
        for data in examples((None, b"")):
            start = _sent(subject, count)[1]
            start(line)
            line.send("upload_chunk", Chunk(650, 200 * count, 0, b""), data=data)
            transfer_frames(line)  # which answer there is, if any, is open
            line = _recovered(subject, line, "a chunk of length 0")


@case("5.4/6", name="empty-file")
def test_served_after_an_empty_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After a file of no bytes, whether it is taken or not, other commands are served."""
    name = subject.new_name()
    begin(line, name)
    line.send("upload_chunk", Chunk(0, 0, 0, b""))
    line.wait(0.2)
    answers = transfer_frames(line)  # which there is, if any, is open (A-5-10)
    taken = any(seen.name == "upload_chunk" and seen.value is True for seen in answers)
    line = _recovered(subject, line, "an empty file")
    if taken:
        expect_equal(left_behind(line, name) or b"", b"", "an empty file is not empty")
        subject.tolerate("5.4/6", "empty_file", "chunk", "an empty file is a chunk of length 0")


def _recovered(
    subject: ControllerUnderTest, line: OutgoingConnection, what: str
) -> OutgoingConnection:
    """A new connection, after the old one has served other commands.

    The upload may be open still (A-5-10, A-5-14): the next transfer begins where none is. Where
    another one may begin on the old connection, nothing of what broke off is in it.
    """
    line = _serving(subject, line, what)
    name = subject.new_name()
    if line.ask("upload_name", data=name).accepted:
        for chunk in _CHUNKS:
            send(line, chunk, "5.4/6")
        expect_stored(line, name, _CONTENT, "5.4/6")
    line = again(subject, line)
    _transfers(subject, line, what)
    return line


# Other commands meanwhile

_OTHERS = ("get_status", "get_time", "get_version", "list_programs", "get_joint_angles")


def _others(subject: ControllerUnderTest, line: OutgoingConnection, status: str) -> None:
    """Ask for other things; the status has to be this one."""
    for name in examples(each for each in _OTHERS if each not in subject.ics.unsupported):
        try:
            answer = line.ask(name)
        except NoReply as error:
            error.requirement = "5.4/8"
            raise
        if name == "get_status":
            message = "the status is another one while a file is transferred"
            expect_equal(answer.value, status, message, requirement="4.8/3")


@case("5.4/8", "4.8/3", name="upload")
def test_commands_during_an_upload(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Between the chunks of an upload other commands are answered, and the file arrives whole.

    The clock may be set ahead meanwhile: that is no silence. Another file may be deleted, and the
    rest is listed as before.
    """
    name, other = subject.new_name(), subject.new_name()
    upload(line, other, _CONTENT)
    store_program(subject, line)
    with kept(subject, line, "clock"):
        _upload_among_others(subject, line, name, other)
    expect_stored(line, name, _CONTENT, "5.4/8")


def _upload_among_others(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, other: bytes
) -> None:
    listed = _listed(subject, line, name, other)
    status = line.ask("get_status").value
    begin(line, name)
    for chunk in _CHUNKS:
        _others(subject, line, status)
        line.ask("delete_program", data=other)
        message = "the list is another one within an upload"
        expect_equal(_listed(subject, line, name, other), listed, message, requirement="5.4/8")
        if {"get_time", "set_time"}.isdisjoint(subject.ics.unsupported):
            line.ask("set_time", shifted(read(subject, line).time, _AHEAD))
        send(line, chunk, "5.4/8", "a chunk was refused after other commands")


def _listed(subject: ControllerUnderTest, line: OutgoingConnection, *but: bytes) -> list[bytes]:
    """The programs besides these, sorted; none where none are listed."""
    lacks = "list_programs" in subject.ics.unsupported
    return [] if lacks else sorted(set(program_names(subject, line)).difference(but))


@case("5.4/8", "2/6", "4.8/3", name="download")
def test_commands_during_a_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Between the chunks of a download other commands are answered, and the file comes whole."""
    name = some_file(subject, line, _CONTENT)
    listed = _listed(subject, line)
    status = line.ask("get_status").value
    line.ask("download_name", data=name)
    content = b""
    try:
        for chunk in incoming(line):
            content += chunk.data
            _others(subject, line, status)
            message = "the list is another one within a download"
            expect_equal(_listed(subject, line), listed, message)
    except CaseFailed as error:
        error.requirement = "5.4/8"
        raise
    message = "a file was not the same with other commands meanwhile"
    expect(content == _CONTENT, message, expected="650 bytes", observed=f"{len(content)} bytes")
    if not takes_one_at_a_time(subject):
        _answered_among_others(line, name)


def _answered_among_others(line: OutgoingConnection, name: bytes) -> None:
    """Each answer to a chunk comes in one segment with a question before it and one behind."""
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
    begin(line, name)
    for chunk in _CHUNKS:
        _others(subject, other, status)
        send(line, chunk)
    expect_stored(other, name, _CONTENT, "5.4/8")


def _second(subject: ControllerUnderTest, line: OutgoingConnection, opcode: str) -> None:
    """Begin a second transfer within an upload: it is refused, or takes its place (A-5-17)."""
    old, first, second = (subject.new_name() for _ in range(3))
    upload(line, old, content_of(250, 1))
    begin(line, first)
    send(line, _CHUNKS[0])
    download_it = opcode == "download_name"
    replaced = line.ask(opcode, old if download_it else second).accepted
    if not replaced:
        message = "an upload did not survive that a second transfer was refused"
        for chunk in _CHUNKS[1:]:
            send(line, chunk, "5.4/8", message)
        expect_stored(line, first, _CONTENT, "5.4/8")
        return
    message = "a second transfer takes the place of the first"
    subject.tolerate("5.4/8", "xfer_concurrency", "replace", message)
    if not download_it:
        for chunk in _CHUNKS:
            send(line, chunk)
        expect_stored(line, second, _CONTENT, "5.4/8")
    else:
        next_chunk(line)
    left = left_behind(again(subject, line), first)
    message = "an upload that was replaced left more than was sent of it"
    expect(
        left in (None, b"", _CONTENT[:200]), message, expected="no file", observed="another file"
    )


@case("5.4/8", name="second-upload")
def test_second_upload(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A second upload within the first is refused and leaves it alone, or takes its place."""
    _second(subject, line, "upload_name")


@case("5.4/8", name="second-download")
def test_second_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download within an upload is refused and leaves it alone, or takes its place."""
    _second(subject, line, "download_name")


@case("5.4/8", name="one-after-another")
def test_mixed_transfers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Uploads and downloads in turns, whole and broken off, do not get in each other's way."""
    name = subject.new_name()
    upload(line, name, _CONTENT)
    for number in range(4):
        expect_stored(line, name, _CONTENT, "5.4/8")
        expect_round_trip(subject, line, content_of(250, number), "5.4/8")
        line.ask("download_name", data=name)
        next_chunk(line)
        line.answer_chunk(accepted=False)
        if transfer_frames(line) or line.ending:  # it may be sent once more (A-5-14, A-5-26)
            line = again(subject, line)
