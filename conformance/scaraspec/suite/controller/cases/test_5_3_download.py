"""Clause 5.3: a file from the controller (0x54, 0x56; L765-787).

Where no state may be changed, a program that is stored already is fetched, and nothing is known of
its content.
"""

from functools import partial

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.malformed.timeouts import (
    Track,
    downloads_at_once,
    run_tracks,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    CHUNK_S,
    again,
    begin,
    course_of,
    delete,
    download,
    expect_stored,
    gives_up,
    incoming,
    left_behind,
    next_chunk,
    nothing_more,
    send,
    some_file,
    transfer_frames,
    upload,
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
from scaraspec.suite.engine.transfer_timeouts import Silence, limits_of
from scaraspec.suite.program_files.listed import INHERITED
from scaraspec.traffic.transfers import refuses_an_answer
from scaraspec.user_message import UserMessage

_CONTENT = content_of(650)


def _absent(line: OutgoingConnection, name: bytes, message: str) -> None:
    answer = line.ask("download_name", data=name)
    expect(not answer.accepted, message, expected="0", observed=f"{answer}")


def _ask_for(line: OutgoingConnection, name: bytes) -> Chunk:
    """Ask for a file that is there, and take its first chunk, which is not answered yet."""
    answer = line.ask("download_name", data=name)
    expect(
        answer.accepted,
        "a file that is there was refused",
        expected="1",
        observed=f"{answer}",
        requirement="5.3/2",
    )
    chunk = next_chunk(line)
    message = "a download does not begin at the beginning of its file"
    expect_equal(chunk.position, 0, message, requirement="5.1/8")
    return chunk


def _unless_last(chunk: Chunk) -> Chunk:
    """Go on only with a file that has a further chunk.

    Raises:
        CaseSkipped: It has none.
    """
    if chunk.last:
        raise CaseSkipped("the stored program is too short: --allow state sends a longer one")
    return chunk


@case("5.3/2")
def test_file_that_is_there(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file that is there is answered 1, time and again; one that is not, 0."""
    name = some_file(subject, line, _CONTENT)
    for _ in range(3):
        _absent(line, b"absent-" + name, "a file that is not there was promised")
        expect(download(line, name), "a file that is there was refused", expected="1", observed="0")


@case("5.3/3")
def test_file_that_is_not_there(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Names that are nearly those of a file, and no name at all, are answered 0."""
    name = some_file(subject, line, _CONTENT)
    near_ones = [name + b"x", name[:-1], b"x" + name, name[1:], name + b".bak"]
    if subject.files.is_own(name):  # else somebody's other file may be called so
        near_ones.append(name.partition(b".")[0])
    for near in examples((*near_ones, b"*", b"*.rob", INHERITED)):
        _absent(line, near, f"{near.decode(errors='replace')} is not there and was promised")
    line.send("download_name", data=b"")
    came = transfer_frames(line)
    promised = [seen for seen in came if seen.name == "download_name" and seen.value is True]
    expect(not promised, "a file without a name was promised", expected="0", observed="1")


@case("5.3/3", name="deleted", hazards=(Hazard.STATE,))
def test_deleted_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file that was deleted is answered 0, also where it was fetched before.

    One of which the name has the same letters was never there.
    """
    name = subject.new_name("ab")
    upload(line, name, _CONTENT)
    _absent(line, name.replace(b"ab", b"ba"), "a file with another name was promised")
    expect_stored(line, name, _CONTENT)
    delete(line, name)
    _absent(line, name, "a file that was deleted was promised")
    _absent(again(subject, line), name, "a file that was deleted was promised")


@case("5.3/3", name="unfinished", hazards=(Hazard.STATE,))
def test_unfinished_file(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file that is still being uploaded elsewhere is not fetched as if it were whole."""
    subject.require_multiple_connections()
    name = subject.new_name()
    begin(line, name)
    send(line, Chunk(650, 0, 200, _CONTENT[:200]))
    got = left_behind(subject.open(), name)
    if got is None:
        return
    message = "a file that is still being uploaded was fetched with bytes that nobody sent"
    expect(
        got in (b"", _CONTENT[:200]),
        message,
        expected="0, or the 200 bytes sent so far",
        observed=f"{len(got)} bytes",
    )
    message = "what was received so far can be fetched while the upload goes on"
    subject.tolerate("5.3/3", "A-5-12", "visible", message)


@case("5.3/4")
def test_content_follows(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Behind the 1 the content follows by itself, one fileData in each 0x56."""
    name = some_file(subject, line, _CONTENT)
    line.send("download_name", name)
    behind = line.reply("download_name").seen.place.offset_bytes
    early = [seen for seen in line.inbox if seen.place.offset_bytes < behind]
    expect(
        not early,
        "a chunk came before the answer to the name",
        expected="1, then the first chunk",
        observed="; ".join(f"{seen.frame}" for seen in early),
    )
    begun_ns = subject.now_ns
    late_s = 0.0
    for chunk in incoming(line):
        if not chunk.position:
            late_s = (subject.now_ns - begun_ns) / 1e9
    if late_s > subject.reply_s:
        message = UserMessage("the first chunk came {late_s:.1f} s behind the 1", late_s=late_s)
        subject.tolerate("5.3/4", "A-5-23", "later", message)


@case("5.3/4", name="edges", hazards=(Hazard.STATE,))
def test_content_at_the_edges(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Files of one byte, of one full chunk and of one more come in as many chunks as they need."""
    for size in examples((1, 200, 201, 400)):
        name, content = subject.new_name(), content_of(size)
        upload(line, name, content)
        chunks = [chunk_of(frame) for frame in course_of(line, name)]
        got = b"".join(chunk.data for chunk in chunks)
        message = UserMessage("the chunks of a file of {size} bytes do not hold it", size=size)
        expect(got == content, message, expected=f"{size} bytes", observed=f"{len(got)} bytes")


def _fetch_together(
    subject: ControllerUnderTest, line: OutgoingConnection, names: list[bytes]
) -> list[bytes] | None:
    """Fetch files on two connections, chunk by chunk in turns; None where only one can be."""
    lines = (line, subject.open())
    for each, name in zip(lines, names, strict=True):
        if each.ask("download_name", data=name).accepted:
            continue
        expect(each is not line, "a file that is there was refused", requirement="5.3/2")
        subject.tolerate("5.3/4", "A-5-17", "one", "one download at a time, on whatever connection")
        return None
    got = [b"", b""]
    for chunks in zip(*map(incoming, lines), strict=False):
        got = [before + chunk.data for before, chunk in zip(got, chunks, strict=True)]
    return got


@case("5.3/4", name="twice-at-once")
def test_one_file_on_two_connections(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """One file that two connections fetch at the same time comes whole to both."""
    subject.require_multiple_connections()
    got = _fetch_together(subject, line, [some_file(subject, line, _CONTENT)] * 2)
    message = "two connections that fetch one file get different contents"
    expect(got is None or got[0] == got[1], message, expected="the same twice")


@case("5.3/4", name="two-at-once", hazards=(Hazard.STATE,))
def test_two_files_on_two_connections(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """Two files that two connections fetch at the same time come to each its own."""
    subject.require_multiple_connections()
    contents = [content_of(650, number) for number in (0, 1)]
    names = [some_file(subject, line, content) for content in contents]
    got = _fetch_together(subject, line, names)
    message = "two downloads at the same time were mixed"
    expect(got is None or got == contents, message, expected="to each its own file")


@case("5.3/6", slow=True)
def test_one_chunk_at_a_time(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No chunk comes before the one before it was answered, whatever else is asked meanwhile."""
    name = some_file(subject, line, _CONTENT)
    line.ask("download_name", data=name)
    message = "a chunk came before the one before it was answered"
    for chunk in incoming(line):
        line.ask("get_version")
        nothing_more(line, message, "5.3/6")
        if not chunk.position:
            line.wait(SILENCE_S)
            nothing_more(line, message, "5.3/6")


@case("5.3/6", name="never-repeated")
def test_no_chunk_is_repeated(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A chunk that is not answered for some seconds is not sent again."""
    name = some_file(subject, line, _CONTENT)
    _ask_for(line, name)
    line.wait(limits_of(subject).survived_s / 5)
    nothing_more(line, "a chunk that had no answer yet was followed by another", "5.3/6")


@case("5.3/7")
def test_silence_of_the_client(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A download goes on after an answer that took 25 s, twice, and is over after 60 s.

    It is over so behind its first chunk and behind its second.
    """
    name = some_file(subject, line, _CONTENT)
    times = min(2, len(course_of(line, name)) - 1)  # of a stored program there may be less
    line.close()
    limits = limits_of(subject)

    ask, answer = (partial(_begin, name=name, answered=answered) for answered in (0, 1))

    def survived(on: OutgoingConnection, silence: Silence) -> None:
        on.pump()
        early = [seen.frame for seen in on.inbox if seen.name == "download_chunk"]
        message = "something was sent while the answer to a chunk was awaited"
        expect(not early, message, observed=f"{early}", requirement="5.3/6")
        silence.in_time(limits.early_s)
        if not _goes_on(on, CHUNK_S):
            message = UserMessage(
                "an answer to a chunk after {survived_s:g} s was not taken any more",
                survived_s=limits.survived_s,
            )
            raise CaseFailed(message, expected="the next chunk", observed="none")

    def early(on: OutgoingConnection, silence: Silence) -> None:
        passed_s = silence.passed_s
        if not _goes_on(on, subject.reply_s) and passed_s < subject.transfer_s:
            message = UserMessage(
                "a download is given up before {passed_s:g} s of silence", passed_s=passed_s
            )
            subject.tolerate("5.3/7", "xfer_timeout", "less", message)

    def late(on: OutgoingConnection, _: Silence) -> None:
        if _still_goes_on(on):
            message = UserMessage(
                "a download is not given up after {late_s:g} s of silence", late_s=limits.late_s
            )
            subject.tolerate("5.3/7", "xfer_timeout", "more", message)

    def over(on: OutgoingConnection, _: Silence) -> None:
        message = UserMessage(
            "an answer to a chunk was taken after {over_s:g} s", over_s=limits.over_s
        )
        goes_on = _still_goes_on(on)
        expect(not goes_on, message, expected="no further chunk", observed="the next chunk")
        if on.ending is None:
            _ask_for(on, name)

    run_tracks(
        subject,
        [
            Track(
                partial(_ask_again, name=name),
                ((limits.survived_s, survived),) * times,
            ),
            Track(ask, ((limits.early_s, early),)),
            Track(ask, ((limits.late_s, late),)),
            *(Track(begin, ((limits.over_s, over),)) for begin in (ask, answer)[:times]),
        ],
        at_once=downloads_at_once(subject, name),
    )


def _begin(line: OutgoingConnection, name: bytes, answered: int = 0) -> None:
    """Ask for a file, and answer so many of its chunks: another one follows."""
    _unless_last(_ask_for(line, name))
    for _ in range(answered):
        line.answer_chunk(accepted=True)
        _unless_last(next_chunk(line))


def _ask_again(line: OutgoingConnection, name: bytes) -> None:
    """Ask for a file that was just fetched: the time-out of that must not be this one's."""
    download(line, name)
    _begin(line, name)


def _goes_on(line: OutgoingConnection, within_s: float) -> bool:
    """Answer a chunk; whether the next one comes."""
    try:
        line.answer_chunk(accepted=True)
        came = line.reply("download_chunk", within_s=within_s)
    except NoReply:
        return False
    return not refuses_an_answer(came.frame) and not gives_up(came)


def _after_refusal(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, refuse_at: int
) -> None:
    """Refuse one chunk of a download: only the same may come again."""
    chunk = _ask_for(line, name)
    for _ in range(refuse_at):
        _unless_last(chunk)
        line.answer_chunk(accepted=True)
        chunk = next_chunk(line)
    line.answer_chunk(accepted=False)
    sent = transfer_frames(line)
    came = [seen for seen in sent if not gives_up(seen)]
    repeated = [seen for seen in came if seen.value == chunk]
    expect(
        len(came) == len(repeated) <= 1,
        UserMessage(
            "after chunk {refuse_at} of a download was refused, another one came",
            refuse_at=refuse_at + 1,
        ),
        expected="none, or the same once more",
        observed="; ".join(f"{seen.frame}" for seen in came),
    )
    if repeated:
        subject.tolerate("5.3/9", "A-5-14", "repeats", "a chunk that was refused is sent again")
        return
    if sent:
        message = "a chunk of length 0 follows one that was refused"
        subject.tolerate("5.3/9", "A-5-10", "signal", message)
    if line.ending is not None:
        subject.tolerate("5.3/9", "A-5-26", "closed", "a chunk that was refused ends the link")
        return
    line.answer_chunk(accepted=True)
    message = "a download went on after one of its chunks was refused"
    nothing_more(line, message, "5.3/9", stray=True)


@case("5.3/9", name="first")
def test_first_chunk_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After its first chunk was refused, a download does not go on."""
    _after_refusal(subject, line, some_file(subject, line, _CONTENT), 0)


def _still_goes_on(line: OutgoingConnection) -> bool:
    """Answer a chunk; whether the next one comes, where none may."""
    try:
        line.answer_chunk(accepted=True)
    except NoReply:
        return False
    came = transfer_frames(line, stray=True)
    return any(seen.name == "download_chunk" and not gives_up(seen) for seen in came)


@case("5.3/9", name="middle")
def test_middle_chunk_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After a chunk in its middle was refused, a download does not go on."""
    _after_refusal(subject, line, some_file(subject, line, _CONTENT), 2)


@case("5.3/9", name="last", hazards=(Hazard.STATE,))
def test_last_chunk_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After its last chunk was refused, a download does not go on, and can be begun anew."""
    name = some_file(subject, line, _CONTENT)
    _after_refusal(subject, line, name, 3)
    line = again(subject, line)
    expect_stored(line, name, _CONTENT, "5.3/9")


@case("5.3/10")
def test_nothing_after_a_refusal(line: OutgoingConnection) -> None:
    """Behind the 0 to a name no chunk comes."""
    for name in examples((b"absent.rob", b"absent.txt", b"a")):
        _absent(line, name, "a file that is not there was promised")
        nothing_more(line, "a chunk came although the file had been refused", "5.3/10")
    line.wait(MOMENT_S)
    nothing_more(line, "a chunk came although the file had been refused", "5.3/10")


@case("5.3/10", name="answered", hazards=(Hazard.STATE,))
def test_answer_without_a_download(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An answer to a chunk that nobody sent brings no chunk, before or after a transfer."""
    name = some_file(subject, line, _CONTENT)
    for _ in range(2):
        for flag in examples((b"1", b"0")):
            _absent(line, b"absent-" + name, "a file that is not there was promised")
            line.send("download_chunk", data=flag)
            nothing_more(line, "a chunk came that nobody had asked for", "5.3/10", stray=True)
        download(line, name)
