"""Clause 3: how a client interprets the frames that it receives (L92-L98, L320-L321)."""

from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Final

from scaraspec.protocol.commands import BY_NAME, BY_OPCODE
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import TAG, Frame
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.downloads import begin_download, send_download
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    answer_request,
    await_request,
    begin_operation,
    expect_completed,
    expect_reply_reported,
    for_each_supported,
    request_operation,
    sent_or_answered,
)
from scaraspec.suite.client.harness.two_stage import (
    RUN,
    begin_and_accept,
    ensure_open,
    expect_finished,
    require_while_executing,
)
from scaraspec.suite.client.harness.uploads import Upload
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, NoReply, expect, expect_equal
from scaraspec.user_message import UserMessage

_TWO_STAGE: Final = tuple(c.name for c in BY_NAME.values() if c.two_stage)
_UNDEFINED: Final = tuple(o for o in range(256) if o not in BY_OPCODE and o != TAG)
_SHORT_S: Final = 0.03
_LATE_S: Final = 0.3
_MARKS: Final = (
    b"\xaa" * 150 + b"\xcc" * 150,
    b"\xcc\x09\x02\x30\x30\xaa" * 50,
    b"\xaa\x09\x00\xcc" * 60,
    bytes(range(256)),
)
"""Contents full of start and end bytes. Some look like frames of either direction."""

_PENDING: Final = (
    "get_status",
    "list_programs",
    "set_digital_output",
    "delete_program",
    "emergency_stop",
)
_SMALL: Final = bytes(range(200)) * 2
"""A file of two chunks."""

_FRAMING: Final = 4  # start, opcode, length, end


# ---------------------------------------------------------------------- data and length


@client_case("3/9")
def test_marks_in_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client downloads a file full of 0xAA and 0xCC and stores it unchanged.

    The last chunk arrives in segments that begin and end with such a byte: data of an incomplete
    frame may look like frames.
    """
    for content in examples(_MARKS):
        local = subject.missing_file()
        call = subject.begin("download", remote="marks.rob", local=local)
        line.request("download_name", call)
        line.reply("download_name")
        *chunks, last = chunks_of(content)
        for chunk in chunks:
            line.send_chunk(chunk)
            line.request("download_chunk")
        data = line.chunk_frame(last).encode()
        marks = [max(data.rfind(mark, 0, -1), 0) for mark in (b"\xaa", b"\xcc")]
        cuts = {0, *marks, *(at + 1 for at in marks), len(data)}
        for begin, end in pairwise(sorted(cuts)):
            line.send_bytes(data[begin:end])
            line.wait(_SHORT_S / 3)
        line.request("download_chunk")
        subject.expect_done(call)
        expect_equal(Path(local).read_bytes(), content, "the downloaded file differs")


@client_case("3/9", name="results-in-files")
def test_results_in_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client downloads a file full of final results while a program runs and continues."""
    require_while_executing(subject, line, "download")
    run = begin_and_accept(subject, line, RUN)
    ending = line.result_frame(RUN.name).encode()
    send_download(subject, line, ending * 50)
    subject.expect_pending(run, "the client took chunk data for a final result", requirement="3/9")
    line.result(RUN.name)
    expect_finished(subject, run)


@client_case("3/9", name="within-strays")
def test_replies_in_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Unexpected frames with a reply in their data arrive before the real reply."""
    within = Frame(C2A, 0x09, b"01").encode()
    for stray in examples((Frame(C2A, 0x08, within), Frame(C2A, 0x30, within, tagged=True))):
        call = subject.begin("get_status")
        await_request(line, "get_status", call)
        why = "the client took the data of another frame for the reply"
        if _ignored(subject, line, call, stray, why=why):
            line.reply("get_status", "00")
            subject.expect_result(call, "00")
        else:
            line = _given_up(subject, line, "3/9")


@client_case("3/9", name="length")
def test_marks_as_lengths(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The length byte of a reply equals the start byte, the end byte or the tag."""
    for size_bytes in examples((0xAA, 0xCC, TAG)):
        names = [f"{number:03}.rob" for number in range((size_bytes - 2) // 8)]
        data = "|".join(["0", *names]).encode()
        names[-1] = "z" * (size_bytes - len(data)) + names[-1]
        call = subject.begin("list_programs")
        line.serve(call, data="|".join(["0", *names]).encode())
        subject.expect_result(call, names)


# ---------------------------------------------------------------------- the tag


@client_case("3/13")
def test_tag(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result of each two-stage command carries the tag; the client accepts it."""

    def each(name: str) -> None:
        call = begin_operation(subject, name)
        await_request(line, name, call)
        line.reply(name, data=b"1")
        line.result(name)
        expect_completed(subject, call)

    for_each_supported(_TWO_STAGE, each)


@client_case("3/13", name="cut")
def test_cut_at_the_tag(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A final result is split after its tag, opcode, length and first data byte."""

    def each(name: str) -> None:
        for cut in examples((1, 2, 3, 4)):
            call = begin_operation(subject, name)
            line.serve(call, data=b"1")
            data = line.result_frame(name).encode()
            line.send_bytes(data[:cut])
            line.wait(_SHORT_S / 3)
            line.send_bytes(data[cut:])
            expect_completed(subject, call)

    for_each_supported(("run_program", "emergency_stop", "jog"), each)


@client_case("3/13", name="next")
def test_frame_after_a_tagged_one(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply follows a tagged frame, in the same segment or in the middle of a split frame."""
    result = line.result_frame("simulate_program").encode()
    reply = line.frame("get_status", data=b"04").encode()
    for cut in examples(range(len(result) + 1)):
        call = subject.begin("get_status")
        await_request(line, "get_status", call)
        line.send_bytes(result[:cut])
        line.wait(_SHORT_S / 3)
        line.send_bytes(result[cut:] + reply)
        subject.expect_result(call, "04")


# ---------------------------------------------------------------------- undefined opcodes


def _ignored(
    subject: ClientUnderTest, line: IncomingConnection, call: Call, *frames: Frame, why: str
) -> bool:
    """Send frames that the client must not take for the reply to a pending operation.

    Returns:
        Whether the operation is still pending: a client may abort it and close the connection.

    Raises:
        CaseFailed: The client takes a frame for the reply.
    """
    with suppress(NoReply):  # the client has closed the connection
        line.send_bytes(b"".join(map(Frame.encode, frames)))
        line.wait(_SHORT_S)
    if line.ended:
        subject.wait_for_answer(call)
    if call.answer is None:
        return True
    expect(not call.ok, why, expected="no answer yet, or an error", observed=f"{call}")
    return False


def _given_up(
    subject: ClientUnderTest, line: IncomingConnection, requirement: str
) -> IncomingConnection:
    """Continue after the client has aborted an operation because of an unexpected frame."""
    subject.tolerate(requirement, "A-3-9", "close", "the client aborted the operation")
    if not line.ended:
        return line
    subject.wait_for_answer(subject.begin("disconnect"))
    return subject.open()


@client_case("3/22")
def test_undefined_opcodes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Frames with every undefined opcode arrive before a reply; the client takes the reply."""
    for data in examples((b"", b"1", b"00", b"0|a.rob")):
        call = subject.begin("get_status")
        await_request(line, "get_status", call)
        frames = [Frame(C2A, opcode, data) for opcode in _UNDEFINED]
        why = "the client took a frame with an undefined opcode for a reply"
        if not _ignored(subject, line, call, *frames, why=why):
            line = _given_up(subject, line, "3/22")
            continue
        line.reply("get_status", "00")
        subject.expect_result(call, "00")


@client_case("3/22", name="idle")
def test_undefined_while_idle(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Frames with undefined opcodes, some with the tag, arrive while no request is pending."""
    for opcode in (0x02, 0x10, 0x3E, 0x46, 0x7F, 0xFF):
        for tagged in examples((False, True)):
            with suppress(NoReply):  # the client has closed the connection
                line.send_frame(Frame(C2A, opcode, b"11", tagged))
    call = subject.begin("get_status")
    if sent_or_answered(subject, line, call) is not None:
        with suppress(NoReply):  # the client may process them only now, and close
            line.reply("get_status", "00")
        subject.wait_for_answer(call)
    if not call.ok:
        line = _given_up(subject, line, "3/22")
        call = subject.begin("get_status")
        line.serve(call, "00")
    subject.expect_result(call, "00")


# ---------------------------------------------------------------------- late, split and reordered


@client_case("3/27")
def test_late_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply arrives late, in two pieces with a pause between them."""
    call = subject.begin("get_version")
    await_request(line, "get_version", call)
    line.wait(_LATE_S)
    data = line.frame("get_version", data=REPLIES["get_version"]).encode()
    line.send_bytes(data[:_FRAMING])
    line.wait(_LATE_S)
    line.send_bytes(data[_FRAMING:])
    subject.expect_result(call, "1.0.0")


@client_case("3/27", name="result-of-nobody")
def test_overtaken_by_an_old_result(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result of an earlier command arrives before each reply."""
    for name in examples(_TWO_STAGE):
        call = subject.begin("get_version")
        await_request(line, "get_version", call)
        line.result(name)
        line.reply("get_version", data=REPLIES["get_version"])
        subject.expect_result(call, "1.0.0")


@client_case("3/27", name="overtaken")
def test_overtaken(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The final result of an executing command arrives before the reply to a later query."""
    require_while_executing(subject, line, "get_time")
    run = begin_operation(subject, "run_program")
    line.serve(run, data=b"1")
    query = subject.begin("get_time")
    await_request(line, "get_time", query)
    line.result("run_program")
    expect_completed(subject, run)
    line.reply("get_time", data=REPLIES["get_time"])
    subject.expect_done(query)


@client_case("3/27", name="meanwhile")
def test_replies_during_execution(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Queries are answered while a command executes; its final result arrives after them."""
    require_while_executing(subject, line, "get_status")
    run = begin_operation(subject, "run_program")
    line.serve(run, data=b"1")
    for status in ("01", "02", "01"):
        query = subject.begin("get_status")
        line.serve(query, status)
        subject.expect_result(query, status)
    subject.expect_pending(run, "the client reports the end of run_program before its final result")
    line.result("run_program")
    expect_completed(subject, run)


@client_case("3/27", name="among-others")
def test_result_among_others(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A final result arrives while another request, an upload or a download is pending."""

    def each(name: str) -> None:
        require_while_executing(subject, line, name)
        run = begin_and_accept(subject, line, RUN)
        line.wait(_SHORT_S)
        match name:
            case "upload":
                upload = Upload(subject, line, _SMALL)
                upload.accept_name()
                chunk = upload.next_chunk()
                _ends(subject, line, run)
                upload.accept_chunk(chunk.length)
                upload.finish()
            case "download":
                first, last = chunks_of(_SMALL)
                download = begin_download(subject, line)
                download.send_chunk(first)
                _ends(subject, line, run)
                download.send_chunk(last)
                download.expect_done()
            case _:
                call, request = request_operation(subject, line, name)
                _ends(subject, line, run)
                answer_request(line, name, request)
                subject.wait_for_answer(call)

    for_each_supported((*_PENDING, "upload", "download"), each)


def _ends(subject: ClientUnderTest, line: IncomingConnection, run: Call) -> None:
    line.result(RUN.name)
    expect_finished(subject, run, requirement="3/27")


# ---------------------------------------------------------------------- matching replies

_OTHERS: Final = (
    Frame(C2A, 0x08, b"00"),
    Frame(C2A, 0x07, b"20141222143000"),
    Frame(C2A, 0x0D, b"00"),
    Frame(C2A, 0x01, b"1"),
    Frame(C2A, 0x49, b"1|1001000011110000"),
    Frame(C2A, 0x09, b"01", tagged=True),
    Frame(C2A, 0x30, b"11", tagged=True),
)
"""Frames that do not answer 0x09: another opcode, or the tag."""


@client_case("3/33")
def test_reply_of_another(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Frames of other commands, and tagged frames, arrive before the reply to get_status."""
    for frame in examples(_OTHERS):
        call = subject.begin("get_status")
        await_request(line, "get_status", call)
        why = UserMessage("the client took {frame} for the reply to get_status (09)", frame=frame)
        if not _ignored(subject, line, call, frame, why=why):
            line = _given_up(subject, line, "3/33")
            continue
        line.reply("get_status", "00")
        subject.expect_result(call, "00")


_OTHERWISE: Final = {
    "get_network": b"10.0.0.2|255.0.0.0|10.0.0.1",
    "get_time": b"20200101000000",
    "get_version": b"9.8.7",
    "get_running_program": b"1|other.txt|00000001",
    "list_programs": b"0|other.rob",
    "get_default_program": b"other.txt",
    "get_motor_temperatures": b"1|2|3|4",
    "get_gripper_center": b"1|2|3",
    "get_initial_tool_position": b"1|2|3|4|0|0",
    "get_tool_coordinates": b"1|2|3|4|0|0",
    "get_joint_angles": b"1|2|3|4",
    "get_digital_inputs": b"1|01010101",
    "get_analog_input": b"1|7",
    "get_digital_outputs": b"1|0101010101010101",
}
"""Other valid replies to these queries."""


@client_case("3/33", name="query")
def test_reply_of_another_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A matching reply arrives under the opcode of every other query before the real reply."""

    def each(name: str) -> None:
        nonlocal line
        call, request = request_operation(subject, line, name)
        others = [BY_NAME[other].opcode for other in _OTHERWISE if other != name]
        frames = [Frame(C2A, opcode, _OTHERWISE[name]) for opcode in others]
        why = UserMessage(
            "the client took the reply to another query for the reply to {command}", command=name
        )
        if not _ignored(subject, line, call, *frames, why=why):
            line = _given_up(subject, line, "3/33")
            return
        answer_request(line, name, request)
        expect_reply_reported(subject, call, name, REPLIES[name])

    for_each_supported(_OTHERWISE, each)


_YES_TO_OTHERS: Final = {
    "set_time": (0x03, 0x0C, 0x35),
    "set_default_program": (0x0F,),  # that reply may carry the opcode of this command (A-4.14-1)
    "run_program": (0x31,),
    "simulate_program": (0x30,),
}
"""Opcodes of other commands: a 1 with such an opcode does not answer this command."""


@client_case("3/33", name="flag")
def test_flag_of_another(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The success of another command arrives before the refusal of this one, or the link closes."""

    def each(name: str) -> None:
        nonlocal line
        for opcode in examples(_YES_TO_OTHERS[name]):
            call = begin_operation(subject, name)
            await_request(line, name, call)
            why = "the client took the reply to another command for the reply to this one"
            if not _ignored(subject, line, call, Frame(C2A, opcode, b"1"), why=why):
                line = _given_up(subject, line, "3/33")
                continue
            line.reply(name, data=b"0")
            subject.expect_failure(call)
        call = begin_operation(subject, name)
        await_request(line, name, call)
        line.close()
        subject.expect_failure(call)
        line = subject.open()

    for_each_supported(_YES_TO_OTHERS, each)


_LATE: Final = {
    "get_version": (b"9.8.7", b"1.0.0"),
    "get_time": (b"20200101000000", b"20141222143000"),
    "get_status": (b"01", b"00"),
    "set_digital_output": (b"1", b"0"),
    "delete_program": (b"1", b"0"),
}
"""For each command, a reply that arrives after the timeout, and the reply to the next request."""


@client_case("3/33", name="late")
def test_reply_after_the_timeout(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply that arrives after the timeout of its request does not answer the next request."""
    query, _ = subject.prefer_unpolled("get_version", "get_time", "get_status")

    def each(name: str) -> None:
        nonlocal line
        line = ensure_open(subject, line)
        late, right = _LATE[name]
        call = begin_operation(subject, name)
        await_request(line, name, call)
        timed_out = subject.answers_within(call, subject.answer_timeout_s) and not line.ended
        with suppress(NoReply):  # the client has closed the connection
            line.reply(name, data=late)
            line.wait(_SHORT_S)
        if not timed_out:
            raise CaseSkipped("the client ends the connection at a missing reply, or waits for it")
        expect(not call.ok, "the client reports success without a reply", observed=f"{call}")
        if line.ended:
            line = _given_up(subject, line, "3/33")
            return
        call = begin_operation(subject, name)
        line.request(name, call)
        line.wait(_SHORT_S)
        subject.expect_pending(call, "the client took a late reply for the reply to this request")
        line.reply(name, data=right)
        if name == query:
            expect_reply_reported(subject, call, name, right)
        else:
            subject.expect_failure(call)

    for_each_supported((query, "set_digital_output", "delete_program"), each)


@client_case("3/33", name="late-again")
def test_late_reply_during_the_next_request(
    subject: ClientUnderTest, line: IncomingConnection
) -> None:
    """The late reply to a request arrives after the next one was sent, which is then refused.

    Between the two, a query of another command is answered.
    """
    name = "set_digital_output"
    call = begin_operation(subject, name)
    await_request(line, name, call)
    if not subject.answers_within(call, subject.answer_timeout_s) or line.ended:
        raise CaseSkipped("the client ends the connection at a missing reply, or waits for it")
    expect(not call.ok, "the client reports success without a reply", observed=f"{call}")
    line.wait(_SHORT_S)  # the timeout is over, also for the judge
    other, _ = subject.prefer_unpolled("get_version", "get_time", "get_status")
    with suppress(CaseSkipped):  # a client need not have this query
        query = subject.begin(other)
        if sent_or_answered(subject, line, query) is not None:
            line.serve(query, data=REPLIES[other])
            expect_reply_reported(subject, query, other, REPLIES[other], requirement="3/27")
    call = begin_operation(subject, name)
    if sent_or_answered(subject, line, call) is None:
        raise CaseSkipped("the client sends no further request after a missing reply")
    with suppress(NoReply):  # the client has closed the connection
        line.reply(name, data=b"1")
        line.wait(_SHORT_S)
        line.reply(name, data=b"0")
    subject.wait_for_answer(call)
    expect(
        not call.ok,
        "the client took the late reply to an earlier request for the reply to this request",
        observed=f"{call}",
    )


@client_case("3/33", name="result-first")
def test_result_ahead_of_its_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A tagged frame with the opcode of the command arrives before the first reply, a refusal."""

    def each(name: str) -> None:
        nonlocal line
        call, request = request_operation(subject, line, name)
        why = "the client took a tagged frame for the first reply"
        if not _ignored(subject, line, call, line.result_frame(name), why=why):
            line = _given_up(subject, line, "3/33")
            return
        answer_request(line, name, request)
        subject.expect_failure(call)

    for_each_supported(_TWO_STAGE, each)
