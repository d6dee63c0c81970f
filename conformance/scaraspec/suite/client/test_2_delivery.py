"""Clause 2: TCP is a stream, which cuts and joins as it likes (L79; A-2-6)."""

from typing import Final

from scaraspec.protocol.frames import Frame
from scaraspec.suite.as_controller.line import Line
from scaraspec.suite.as_controller.lists import fetches_parts, list_of
from scaraspec.suite.as_controller.orders import accomplished, awaited, order
from scaraspec.suite.as_controller.polls import REPLIES
from scaraspec.suite.as_controller.subject import Subject
from scaraspec.suite.case import client_case
from scaraspec.suite.expect import NotRun

_CUT_S: Final = 0.005  # longer than a segment waits to be joined with the next
_SLOW_S: Final = 0.95
_FULL_PART: Final = 22  # names of 11 bytes each


def _send_cut(line: Line, data: bytes, *cuts: int, pause_s: float = _CUT_S) -> None:
    """Send bytes in pieces that end before these positions."""
    begin = 0
    for end in (*cuts, len(data)):
        line.send_bytes(data[begin:end])
        if end < len(data):
            line.wait(pause_s)
        begin = end


def _reply(line: Line, name: str) -> bytes:
    return line.frame(name, data=REPLIES[name]).encode()


# ---------------------------------------------------------------------- cut


@client_case("2/5")
def test_reply_cut_anywhere(subject: Subject, line: Line) -> None:
    """A reply comes in two segments, cut at every byte in turn."""
    data = _reply(line, "get_motor_temperatures")
    for cut in range(1, len(data)):
        call = subject.begin("get_motor_temperatures")
        awaited(line, call.name, call)
        _send_cut(line, data, cut)
        subject.gives(call, {"inner_arm": 20, "outer_arm": 38, "wrist": 34, "rotation": 22})


@client_case("2/5", name="result")
def test_result_cut_anywhere(subject: Subject, line: Line) -> None:
    """A final result comes in two segments, cut at every byte in turn."""
    data = line.result_frame("run_program").encode()
    for cut in range(1, len(data)):
        call = order(subject, "run_program")
        line.serve(call, data=b"1")
        line.wait(_CUT_S)
        _send_cut(line, data, cut)
        accomplished(subject, call)


@client_case("2/5", name="bytes")
def test_single_bytes(subject: Subject, line: Line) -> None:
    """A long reply comes byte by byte."""
    call = subject.begin("get_network")
    awaited(line, call.name, call)
    data = _reply(line, "get_network")
    _send_cut(line, data, *range(1, len(data)), pause_s=_CUT_S / 5)
    subject.gives(call, {"ip": "192.168.1.2", "mask": "255.255.255.0", "gateway": "192.168.1.1"})


@client_case("2/5", name="slow")
def test_slow_pieces(subject: Subject, line: Line) -> None:
    """Almost a second passes within a reply, and twice within a final result.

    A client may lose patience with a reply as a whole (A-3-15), and not with a final result.
    """
    call = subject.begin("get_status")
    awaited(line, "get_status", call)
    _send_cut(line, _reply(line, "get_status"), 4, pause_s=_SLOW_S)
    subject.gives(call, "00")
    call = order(subject, "run_program")
    line.serve(call, data=b"1")
    _send_cut(line, line.result_frame("run_program").encode(), 2, 5, pause_s=_SLOW_S)
    accomplished(subject, call)


# ---------------------------------------------------------------------- joined


@client_case("2/6", attended=True)
def test_result_with_its_reply(subject: Subject, line: Line) -> None:
    """The first reply and the final result of a command come in one segment."""
    call = order(subject, "run_program")
    awaited(line, call.name, call)
    reply = line.frame("run_program", data=b"1").encode()
    line.send_bytes(reply + line.result_frame("run_program").encode())
    accomplished(subject, call)


@client_case("2/6", name="list")
def test_parts_of_a_list(subject: Subject, line: Line) -> None:
    """The parts of a program list, as full as they can be, come in one segment."""
    if subject.dialect["list_cont"] == "request" or fetches_parts(subject, line):
        raise NotRun("the client fetches each part of a list")
    names = [f"pro{number:03}.rob" for number in range(8 * _FULL_PART)]
    parts = list_of(*names, per_part=_FULL_PART)
    frames = [line.frame("list_programs", data=part) for part in parts]
    call = subject.begin("list_programs")
    awaited(line, call.name, call)
    line.send_bytes(b"".join(map(Frame.encode, frames)))
    subject.gives(call, names)


@client_case("2/6", name="two-replies")
def test_two_replies(subject: Subject, line: Line) -> None:
    """The replies to two requests come in one segment, and so do their requests perhaps."""
    subject.concurrent(line)
    names = subject.unpolled("get_status", "get_version", "get_time")
    calls = [subject.begin(name) for name in names]
    for call in calls:
        awaited(line, call.name, call)
    line.send_bytes(b"".join(_reply(line, call.name) for call in calls))
    for call in calls:
        subject.gives(call, REPLIES[call.name].decode())


@client_case("2/6", name="behind-others")
def test_reply_behind_others(subject: Subject, line: Line) -> None:
    """Frames that nobody waits for come ahead of a reply, in one segment with it."""
    for count in (1, 2, 9):
        call = subject.begin("get_version")
        awaited(line, call.name, call)
        late = line.result_frame("reset").encode() * count
        line.send_bytes(late + _reply(line, "get_version"))
        subject.gives(call, "1.0.0")
