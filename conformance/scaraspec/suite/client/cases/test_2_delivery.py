"""Clause 2: TCP is a byte stream that may split and join frames (L79; A-2-6)."""

from typing import Final

from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.frames import Frame
from scaraspec.suite.client.harness.auto_responder import REPLIES
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.downloads import send_download
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    answer_request,
    await_request,
    begin_operation,
    expect_completed,
    expect_reply_reported,
    for_each_supported,
)
from scaraspec.suite.client.harness.program_lists import fetches_parts, list_parts, serve_list
from scaraspec.suite.client.harness.two_stage import (
    RUN,
    begin_and_accept,
    expect_finished,
    require_while_executing,
)
from scaraspec.suite.client.harness.uploads import receive_upload
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped

_CUT_S: Final = 0.005  # longer than TCP waits to join a segment with the next
_SLOW_S: Final = 0.95
_FILE: Final = bytes(range(200)) * 2
_FRAMES: Final = 3  # in the list and in each transfer
_FULL_PART: Final = 22  # names of 11 bytes each
_OF_EACH_KIND: Final = ("list_programs", "set_digital_output", "run_program", "emergency_stop")


def _send_cut(line: IncomingConnection, data: bytes, *cuts: int, pause_s: float = _CUT_S) -> None:
    """Send bytes in pieces that end at these positions."""
    begin = 0
    for end in (*cuts, len(data)):
        line.send_bytes(data[begin:end])
        if end < len(data):
            line.wait(pause_s)
        begin = end


def _reply(line: IncomingConnection, name: str) -> bytes:
    return line.frame(name, data=REPLIES[name]).encode()


# ---------------------------------------------------------------------- cut


@client_case("2/5")
def test_reply_cut_anywhere(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply arrives in two segments, split at each byte in turn."""
    data = _reply(line, "get_motor_temperatures")
    for cut in examples(range(1, len(data))):
        call = subject.begin("get_motor_temperatures")
        await_request(line, call.name, call)
        _send_cut(line, data, cut)
        subject.expect_result(call, {"inner_arm": 20, "outer_arm": 38, "wrist": 34, "rotation": 22})


@client_case("2/5", name="result")
def test_result_cut_anywhere(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A final result arrives in two segments, split at each byte in turn."""
    data = line.result_frame("run_program").encode()
    for cut in examples(range(1, len(data))):
        call = begin_operation(subject, "run_program")
        line.serve(call, data=b"1")
        line.wait(_CUT_S)
        _send_cut(line, data, cut)
        expect_completed(subject, call)


@client_case("2/5", name="bytes")
def test_single_bytes(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A long reply arrives byte by byte."""
    call = subject.begin("get_network")
    await_request(line, call.name, call)
    data = _reply(line, "get_network")
    _send_cut(line, data, *range(1, len(data)), pause_s=_CUT_S / 5)
    subject.expect_result(
        call, {"ip": "192.168.1.2", "mask": "255.255.255.0", "gateway": "192.168.1.1"}
    )


@client_case("2/5", name="slow")
def test_slow_pieces(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply pauses for almost 1 s in the middle; a final result pauses twice.

    A client may time out on a whole reply (A-3-15), but not on a final result.
    """
    call = subject.begin("get_status")
    await_request(line, "get_status", call)
    _send_cut(line, _reply(line, "get_status"), 4, pause_s=_SLOW_S)
    subject.expect_result(call, "00")
    call = begin_operation(subject, "run_program")
    line.serve(call, data=b"1")
    _send_cut(line, line.result_frame("run_program").encode(), 2, 5, pause_s=_SLOW_S)
    expect_completed(subject, call)


@client_case("2/5", name="all")
def test_all_in_pieces(subject: ClientUnderTest) -> None:
    """Every frame arrives in pieces: login, list, setting, final results, upload and download."""
    line, call = subject.begin_connect()
    line.fragment_pause_s = _CUT_S
    line.log_in(call)
    subject.expect_done(call)

    def each(name: str) -> None:
        try:
            _served(subject, line, name)
        except CaseFailed as error:  # whole frames have cases of their own
            error.requirement = "2/5"
            raise

    for_each_supported((*_OF_EACH_KIND, "upload", "download"), each)


def _served(subject: ClientUnderTest, line: IncomingConnection, name: str) -> None:
    """Run an operation of this name to its successful end."""
    match name:
        case "upload":
            receive_upload(subject, line, _FILE)
        case "download":
            send_download(subject, line, _FILE)
        case "list_programs":
            names = [f"pro{number:03}.rob" for number in range(3 * _FULL_PART)]
            call = subject.begin(name)
            serve_list(subject, line, call, list_parts(*names, per_part=_FULL_PART))
            subject.expect_result(call, names)
        case _:
            call = begin_operation(subject, name)
            line.serve(call, data=b"1")
            if BY_NAME[name].two_stage:
                line.result(name)
            expect_completed(subject, call)


@client_case("2/5", name="interrupted")
def test_request_within_a_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends another request between the two halves of a reply."""
    subject.require_concurrency(line)
    for name in examples(("get_version", "set_digital_output", "emergency_stop")):
        query = subject.begin("get_joint_angles")
        await_request(line, query.name, query)
        data = _reply(line, query.name)
        line.send_bytes(data[: len(data) // 2])
        other = begin_operation(subject, name)
        line.wait_for_any(subject.answer_timeout_s)  # the request, or an earlier poll
        line.send_bytes(data[len(data) // 2 :])
        request = line.request(name, other)
        expect_reply_reported(subject, query, query.name, REPLIES[query.name])
        answer_request(line, name, request)
        subject.wait_for_answer(other)


# ---------------------------------------------------------------------- joined


@client_case("2/6", attended=True)
def test_result_with_its_reply(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The first reply and the final result of a command arrive in one segment."""
    call = begin_operation(subject, "run_program")
    await_request(line, call.name, call)
    reply = line.frame("run_program", data=b"1").encode()
    line.send_bytes(reply + line.result_frame("run_program").encode())
    expect_completed(subject, call)


@client_case("2/6", name="list")
def test_parts_of_a_list(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """All parts of a program list, each of full size, arrive in one segment."""
    if subject.dialect["list_cont"] == "request" or fetches_parts(subject, line):
        raise CaseSkipped("the client requests each part of a list")
    names = [f"pro{number:03}.rob" for number in range(8 * _FULL_PART)]
    parts = list_parts(*names, per_part=_FULL_PART)
    frames = [line.frame("list_programs", data=part) for part in parts]
    call = subject.begin("list_programs")
    await_request(line, call.name, call)
    line.send_bytes(b"".join(map(Frame.encode, frames)))
    subject.expect_result(call, names)


@client_case("2/6", name="two-replies")
def test_two_replies(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The replies to two requests arrive in one segment."""
    subject.require_concurrency(line)
    names = subject.prefer_unpolled("get_status", "get_version", "get_time")
    calls = [subject.begin(name) for name in names]
    for call in calls:
        await_request(line, call.name, call)
    line.send_bytes(b"".join(_reply(line, call.name) for call in calls))
    for call in calls:
        subject.expect_result(call, REPLIES[call.name].decode())


@client_case("2/6", name="first-replies")
def test_first_reply_after_a_query_reply(
    subject: ClientUnderTest, line: IncomingConnection
) -> None:
    """The first reply of each two-stage command arrives in one segment after a query reply."""
    subject.require_concurrency(line)

    def each(name: str) -> None:
        query = subject.begin("get_version")
        await_request(line, query.name, query)
        call = begin_operation(subject, name)
        await_request(line, name, call)
        line.send_bytes(_reply(line, query.name) + line.frame(name, data=b"1").encode())
        line.result(name)
        subject.expect_result(query, REPLIES[query.name].decode())
        expect_completed(subject, call)

    for_each_supported([each.name for each in COMMANDS if each.two_stage], each)


@client_case("2/6", name="among-others")
def test_result_among_others(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A final result follows each frame of a list, a setting, an upload and a download."""
    ending = line.result_frame(RUN.name).encode()

    def each(name: str) -> None:
        require_while_executing(subject, line, name)
        for place in examples(range(_FRAMES)):
            run = begin_and_accept(subject, line, RUN)
            line.wait(_CUT_S)
            with subject.allow_refusal(), line.append_to_frame(ending, after_frames=place):
                _served(subject, line, name)
            expect_finished(subject, run, requirement="2/6")

    for_each_supported(("list_programs", "set_digital_output", "upload", "download"), each)


@client_case("2/6", name="behind-others")
def test_reply_after_unexpected_results(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Unexpected final results arrive before a reply, in the same segment."""
    for count in examples((1, 2, 9)):
        call = subject.begin("get_version")
        await_request(line, call.name, call)
        late = line.result_frame("reset").encode() * count
        line.send_bytes(late + _reply(line, "get_version"))
        subject.expect_result(call, "1.0.0")
