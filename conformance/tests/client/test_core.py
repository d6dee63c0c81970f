"""`ClientCore`: which frame is the reply to which request, and the handling of all others."""

from datetime import datetime
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.client.core import MAX_REMARKS, FrameAccepted, OperationSettled, UnexpectedFrame
from scaraspec.client.errors import (
    ClientError,
    LinkLost,
    LoginFailed,
    ProtocolError,
    Refused,
    ReplyTimeout,
)
from scaraspec.client.pending_operation import MAX_LIST_PARTS
from scaraspec.protocol.commands import (
    COMMANDS,
    JointValues,
    Network,
    PasswordChange,
    Pose,
    RunningProgram,
)
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.fields import PayloadError
from scaraspec.protocol.frames import Frame, Skipped
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.readings import Dialect

TIME = b"20141222143000"
NOON = datetime(2014, 12, 22, 14, 30)  # noqa: DTZ001 - the document names no zone
VALUES: dict[str, Any] = {
    "login": b"password",
    "set_password": (b"old", b"new"),
    "set_network": ("10.0.0.1", "255.0.0.0", "10.0.0.2"),
    "set_time": NOON,
    "delete_program": b"a.rob",
    "set_default_program": b"a.rob",
    "run_program": b"a.rob",
    "simulate_program": b"a.rob",
    "set_gripper_center": (1, 2, 3),
    "set_initial_tool_position": (1, 2, 3, 4, 5, 6),
    "set_tool_coordinates": (60, 1, 2, 3, 4, 5, 6),
    "jog": JogDirection.PLUS_Y,
    "set_digital_output": (8, 1),
    "get_analog_input": 8,
}


def test_a_request_waits_for_the_reply_with_its_opcode(play: Any) -> None:
    """3/33: only the reply to this request settles it."""
    time = play.ask("get_time")
    assert play.sent() == [(0x07, b"")]
    assert play.receive_frame(0x08, b"1.0.0") == [UnexpectedFrame(Frame(C2A, 0x08, b"1.0.0"))]
    assert not time.settled
    reply = Frame(C2A, 0x07, TIME)
    assert play.receive_bytes(reply.encode()) == [
        FrameAccepted(time, reply),
        OperationSettled(time),
    ]
    assert time.outcome() == NOON


def test_a_tagged_frame_is_not_a_reply(play: Any) -> None:
    """4/9, 3/33: neither for a one-stage command nor as the first reply of a two-stage one."""
    time, run = play.ask("get_time"), play.ask("run_program", b"a.rob")
    assert isinstance(play.receive_frame(0x07, TIME, tagged=True)[0], UnexpectedFrame)
    assert isinstance(play.receive_frame(0x30, b"11", tagged=True)[0], UnexpectedFrame)
    assert not time.settled
    assert run.accepted is None


def test_replies_interleave(play: Any) -> None:
    """3/27: several commands may be pending; replies arrive in any order."""
    run = play.ask("run_program", b"a.rob")
    status, version = play.ask("get_status"), play.ask("get_version")
    play.receive_frame(0x08, b"2.10.3-beta")
    play.receive_frame(0x30, b"1")
    play.receive_frame(0x30, b"11", tagged=True)
    play.receive_frame(0x09, b"01")
    assert [e.outcome() for e in (run, status, version)] == [None, "01", "2.10.3-beta"]


def test_at_most_one_request_per_opcode(play: Any) -> None:
    """3/25: the reply frees the slot."""
    play.ask("get_time")
    assert not play.core.is_free("get_time")
    assert play.core.is_free("get_status")
    with pytest.raises(ClientError, match="of the same kind is pending"):
        play.ask("get_time")
    play.receive_frame(0x07, TIME)
    assert play.core.is_free("get_time")
    assert play.sent() == [(0x07, b"")]


@given(st.data())
def test_any_split_of_the_stream_gives_the_same_events(new_play: Any, data: st.DataObject) -> None:
    """2/5, 2/6: byte by byte, all at once, or any other split."""
    stream = b"".join(
        (
            Frame(C2A, 0x0B, b"1|a.rob|b.rob").encode(),
            b"stray \xaa\x07",
            Frame(C2A, 0x30, b"1").encode(),
            Frame(C2A, 0x30, b"00|12", tagged=True).encode(),
            b"\xcc\x07\x0e" + TIME + b"\xbb",  # a wrong end byte
            Frame(C2A, 0x66, b"\xaa\xcc").encode(),
            Frame(C2A, 0x0B, b"0|c.rob").encode(),
            Frame(C2A, 0x07, TIME).encode(),
        )
    )
    cuts = data.draw(st.sets(st.integers(1, len(stream) - 1)))
    printed = []
    for bounds in ([0, len(stream)], [0, *sorted(cuts), len(stream)]):
        play = new_play()
        names = {
            play.ask("list_programs"): "list",
            play.ask("run_program", b"a.rob"): "run",
            play.ask("get_time"): "time",
        }
        events: list[Any] = []
        skipped = b""
        for start, stop in pairwise(bounds):
            for event in play.receive_bytes(stream[start:stop]):
                if isinstance(event, Skipped):
                    skipped += event.data
                elif isinstance(event, UnexpectedFrame):
                    events.append(event)
                else:
                    events.append((type(event), names[event.operation], *event[1:]))
        printed.append((events, skipped, [(e.value, str(e.error)) for e in names]))
    assert printed[0] == printed[1]
    assert [value for value, _ in printed[0][2]] == [(b"a.rob", b"b.rob", b"c.rob"), None, NOON]


BODIES = st.one_of(
    st.binary(max_size=30),
    st.sampled_from([b"1", b"0", b"11", b"00|00", b"0|12", b"1|a", b"1\0", b"0|a|b", b"1|2|3|4"]),
)
FRAMES = st.builds(
    Frame, st.just(C2A), st.sampled_from([c.opcode for c in COMMANDS]), BODIES, st.booleans()
)


@given(st.lists(st.one_of(FRAMES.map(Frame.encode), st.binary(max_size=30), st.floats(0, 40))))
def test_no_received_bytes_raise(new_play: Any, happenings: list[bytes | float]) -> None:
    """Every operation is settled in the end, and the core stays usable."""
    play = new_play()
    exchanges = [play.ask(c.name, VALUES.get(c.name)) for c in COMMANDS if c.clause[0] == "4"]
    exchanges.append(play.begin(play.core.upload(b"a.rob", b"content")))
    for happening in happenings:
        if isinstance(happening, bytes):
            play.receive_bytes(happening)
        else:
            play.wait_for(happening)
        play.sent()
    play.wait_for(1000)
    for operation in exchanges:
        assert operation.settled or operation.command.two_stage
    play.core.connection_lost("the cable is out", play.now_s)
    assert all(operation.settled for operation in exchanges)
    assert play.core.deadline_s is None


def test_data_may_contain_start_and_end_bytes(play: Any) -> None:
    """3/9: only the length ends a frame."""
    listing = play.ask("list_programs")
    play.receive_frame(0x0B, b"0|\xcc\x07\xaa|\xaa\xcc")
    assert listing.outcome() == (b"\xcc\x07\xaa", b"\xaa\xcc")


def test_invalid_bytes_are_skipped_and_recorded(play: Any) -> None:
    """3/19, 3/20, 3/22: stray bytes, a wrong end byte and an undefined opcode lose no reply."""
    time = play.ask("get_time")
    play.receive_bytes(b"\x00\xaa garbage \xcc\x09\x02\x30\x30\x00")
    play.receive_frame(0xEE, b"?")
    play.receive_frame(0x07, TIME)
    assert time.outcome() == NOON
    assert any("not a frame" in remark for remark in play.core.remarks)
    assert any("C2A EE" in remark for remark in play.core.remarks)


def test_remarks_are_bounded(play: Any) -> None:
    """Endless invalid data does not fill the memory."""
    for _ in range(3 * MAX_REMARKS):
        play.receive_frame(0xEE)
    assert len(play.core.remarks) == MAX_REMARKS


def test_a_partial_frame_times_out_after_two_seconds(play: Any) -> None:
    """A-3-11: a false start byte with a large length blocks for 2 s; a pause of 1 s is harmless."""
    time = play.ask("get_time")
    reply = Frame(C2A, 0x07, TIME).encode()
    play.receive_bytes(reply[:5])
    play.wait_for(1.0)
    play.receive_bytes(reply[5:])
    assert time.outcome() == NOON
    time = play.ask("get_time")
    play.receive_bytes(b"\xcc\x08\xff" + reply)
    assert not time.settled
    play.wait_for(2.0)
    assert time.outcome() == NOON


def test_reply_timeout(play: Any) -> None:
    """A-3-15: after 5 s; a later reply is unexpected; the next request works."""
    time = play.ask("get_time")
    play.wait_for(4.9)
    assert not time.settled
    play.wait_for(0.2)
    with pytest.raises(ReplyTimeout, match="get_time got no reply within 5 s"):
        time.outcome()
    assert isinstance(play.receive_frame(0x07, TIME)[0], UnexpectedFrame)
    again = play.ask("get_time")
    play.receive_frame(0x07, TIME)
    assert again.outcome() == NOON


def test_a_late_reply_does_not_answer_the_next_request(play: Any) -> None:
    """The reply to run A.rob comes after its timeout, and run B.rob is refused: B has failed."""
    first = play.ask("run_program", b"A.rob")
    play.wait_for(5.0)
    with pytest.raises(ReplyTimeout):
        first.outcome()
    second = play.ask("run_program", b"B.rob")
    assert isinstance(play.receive_frame(0x30, b"1")[0], UnexpectedFrame)
    assert not second.settled
    play.receive_frame(0x30, b"0|01")
    with pytest.raises(Refused):
        second.outcome()
    assert play.core.remarks[-1] == (
        "a reply to run_program came after the timeout and was ignored"
    )


def test_a_late_reply_without_a_request(play: Any) -> None:
    """It is ignored, and the next request is answered by its own reply."""
    play.ask("get_version")
    play.wait_for(5.0)
    assert isinstance(play.receive_frame(0x08, b"old")[0], UnexpectedFrame)
    again = play.ask("get_version")
    play.receive_frame(0x08, b"new")
    assert again.outcome() == "new"


def test_the_link_ends_if_a_reply_cannot_be_assigned(play: Any) -> None:
    """One reply came for two requests: it may answer either of them."""
    play.ask("get_version")
    play.wait_for(5.0)
    again, other = play.ask("get_version"), play.ask("get_time")
    play.receive_frame(0x08, b"1.0.0")
    play.wait_for(5.0)
    with pytest.raises(ReplyTimeout):
        again.outcome()
    assert play.core.must_close
    with pytest.raises((LinkLost, ReplyTimeout)):
        other.outcome()
    with pytest.raises(LinkLost, match="replies to get_version came late"):
        play.ask("get_status")


def test_every_reply_to_a_stop_counts(play: Any) -> None:
    """Also one that comes after the timeout: it shows that the robot is stopped."""
    play.ask("emergency_stop")
    play.wait_for(5.0)
    again = play.ask("emergency_stop")
    play.receive_frame(0x32, b"1")
    assert again.accepted


def test_received_bytes_do_not_extend_the_timeout(play: Any) -> None:
    """A reply may arrive in pieces (2/5), but a peer that never stops sending is timed out."""
    time = play.ask("get_time")
    frame = Frame(C2A, 0x07, TIME).encode()
    for byte in frame:
        play.wait_for(4 / len(frame))
        play.receive_bytes(bytes((byte,)))
    assert time.outcome() == NOON
    time = play.ask("get_time")
    for _ in range(5):
        assert not time.settled
        play.receive_bytes(b"\xcc")
        play.wait_for(1)
    assert isinstance(time.error, ReplyTimeout)


def test_a_late_frame_is_not_timed_out_by_a_busy_caller(play: Any) -> None:
    """Timeouts expire only in `tick`: bytes that wait in a socket count as on time."""
    time = play.ask("get_time")
    play.now_s += 60
    play.receive_frame(0x07, TIME)
    assert time.outcome() == NOON


def test_nothing_is_sent_before_a_login(new_play: Any) -> None:
    """2/10, 4.1/5: before the first login, and after a failed one."""
    play = new_play(login_required=True)
    with pytest.raises(LoginFailed, match="log in first"):
        play.ask("get_time")
    play.ask("login", b"password")
    with pytest.raises(LoginFailed):
        play.ask("emergency_stop")
    play.receive_frame(0x01, b"1")
    play.ask("get_time")
    assert play.sent() == [(0x01, b"password"), (0x07, b"")]
    wrong = play.ask("login", b"wrong")
    play.receive_frame(0x01, b"0")
    with pytest.raises(LoginFailed, match="refused the password"):
        wrong.outcome()
    with pytest.raises(LoginFailed):
        play.ask("get_status")


@pytest.mark.parametrize("data", [b"", b"2", b"11", b"1|", b"\x01", b"1 ", b'"1"', b"01", b"yes"])
def test_a_login_fails_with_any_other_reply(new_play: Any, data: bytes) -> None:
    """4.1/8: only ``1`` is a success."""
    play = new_play(login_required=True)
    login = play.ask("login", b"password")
    play.receive_frame(0x01, data)
    with pytest.raises(LoginFailed):
        login.outcome()
    assert not play.core.logged_in


def test_a_trailing_nul_is_tolerated(play: Any) -> None:
    """A-T-3: in all replies, including a success; the reading is observed."""
    stop, time, status = play.ask("set_time", NOON), play.ask("get_time"), play.ask("get_status")
    play.receive_frame(0x06, b"1\0")
    play.receive_frame(0x07, TIME + b"\0")
    play.receive_frame(0x09, b"00\0")
    assert [e.outcome() for e in (stop, time, status)] == [None, NOON, "00"]
    assert play.core.observed_readings["trailing_nul"] == {"yes"}


@pytest.mark.parametrize("data", [b"", b"2", b"\x01", b"11", b"1|1"])
def test_only_the_exact_form_is_a_success(play: Any, data: bytes) -> None:
    """This holds for flags and for first replies (T/3)."""
    done, begun = play.ask("set_default_program", b"a"), play.ask("reset")
    play.receive_frame(0x0E, data)
    play.receive_frame(0x33, data)
    for operation in (done, begun):
        with pytest.raises(ProtocolError, match="cannot be decoded"):
            operation.outcome()


def test_a_flag_of_zero_is_a_refusal(play: Any) -> None:
    """The error has no code."""
    deletion = play.ask("delete_program", b"gone.rob")
    play.receive_frame(0x0C, b"0")
    with pytest.raises(Refused, match=r"delete_program was refused: .* no reason") as caught:
        deletion.outcome()
    assert caught.value.code is None


NETWORK = Network("10.0.0.1", "255.0.0.0", "10.0.0.254")
LONGEST = RunningProgram(b"a.rob", 98 * 86400 + 86399)
NUMBERS = JointValues(-0.5, 38, 0, 12.25)
READABLE: list[tuple[str, int, bytes, Any]] = [
    ("get_network", 0x04, b"10.0.0.1|255.0.0.0|10.0.0.254", NETWORK),
    ("get_network", 0x04, b"010.000.000.001|255.0.0.0|10.0.0.254", NETWORK),
    ("get_version", 0x08, "固件 2".encode(), "固件 2"),
    ("get_status", 0x09, b"1a", "1A"),
    ("get_status", 0x09, b"7F", "7F"),
    ("get_running_program", 0x0A, b"1|a.rob|98235959", LONGEST),
    ("get_running_program", 0x0A, b"0", None),
    ("get_running_program", 0x0A, b"0||", None),
    ("get_running_program", 0x0A, b"\x01|a.rob|00000001", RunningProgram(b"a.rob", 1)),
    ("get_running_program", 0x0A, b"\x00", None),
    ("list_programs", 0x0B, b"0|a|b", (b"a", b"b")),
    ("list_programs", 0x0B, b"0a|b", (b"a", b"b")),
    ("list_programs", 0x0B, b"01|0", (b"1", b"0")),
    ("list_programs", 0x0B, b"0|" + b"n" * 200, (b"n" * 200,)),
    ("list_programs", 0x0B, b"0", ()),
    ("list_programs", 0x0B, b"0|", ()),
    ("list_programs", 0x0B, b"", ()),
    ("get_default_program", 0x0D, b"", b""),
    ("get_default_program", 0x0D, b"0", b""),
    ("get_default_program", 0x0D, b"\xb3\xcc.rob", b"\xb3\xcc.rob"),
    ("get_motor_temperatures", 0x0F, b"-0.5|38|0|12.25", NUMBERS),
    ("get_motor_temperatures", 0x0E, b"-0.5|38|0|12.25", NUMBERS),
    ("get_joint_angles", 0x3C, b"-0.50|38.0|-0|12.250|", NUMBERS),
    ("get_tool_coordinates", 0x38, b"1|2.5|-3|04|0|0.0", Pose(1, 2.5, -3, 4, 0, 0)),
    ("get_digital_inputs", 0x42, b"1|10000001", "10000001"),
    ("get_analog_input", 0x44, b"1|0", 0.0),
    ("get_analog_input", 0x44, b"1|-1.005", -1.005),
    ("get_digital_outputs", 0x49, b"1|1001000011110000", "1001000011110000"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "opcode", "data", "value"), READABLE)
def test_every_tolerated_form_is_understood(
    play: Any, name: str, opcode: int, data: bytes, value: Any
) -> None:
    """T/9 and the readings of the register: every form gives the same value."""
    operation = play.ask(name, 8 if name == "get_analog_input" else None)
    play.receive_frame(opcode, data)
    assert operation.outcome() == value


UNREADABLE = [
    ("get_network", 0x04, b"10.0.0.1|255.0.0.0"),
    ("get_network", 0x04, b"10.0.0.256|255.0.0.0|10.0.0.1"),
    ("get_time", 0x07, b"20141332143000"),
    ("get_time", 0x07, b""),
    ("get_status", 0x09, b""),
    ("get_status", 0x09, b"IDLE"),
    ("get_running_program", 0x0A, b"1|a.rob"),
    ("list_programs", 0x0B, b"2|a"),
    ("get_motor_temperatures", 0x0F, b"1|2|3"),
    ("get_joint_angles", 0x3C, b"1,5|2|3|4"),
    ("get_joint_angles", 0x3C, b"1e3|2|3|nan"),
    ("get_digital_inputs", 0x42, b"1|1000000"),
    ("get_digital_inputs", 0x42, b"2"),
    ("get_analog_input", 0x44, b"1|"),
]


@pytest.mark.parametrize(("name", "opcode", "data"), UNREADABLE)
def test_an_undecodable_reply_is_a_protocol_error(
    play: Any, name: str, opcode: int, data: bytes
) -> None:
    """The client stays usable."""
    operation = play.ask(name, 8 if name == "get_analog_input" else None)
    play.receive_frame(opcode, data)
    with pytest.raises(ProtocolError, match=f"reply of {name} cannot be decoded: ."):
        operation.outcome()
    version = play.ask("get_version")
    play.receive_frame(0x08, b"1.0.0")
    assert version.outcome() == "1.0.0"


@pytest.mark.parametrize("name", ["get_digital_inputs", "get_analog_input", "get_digital_outputs"])
def test_an_answer_of_zero_is_an_error(play: Any, name: str) -> None:
    """4.33/4: ``0`` is not ``1|0``."""
    operation = play.ask(name, 8 if name == "get_analog_input" else None)
    play.receive_frame(operation.command.opcode, b"0")
    with pytest.raises(Refused):
        operation.outcome()


def test_readings_are_observed(play: Any) -> None:
    """The frames of a controller show its dialect."""
    play.ask("list_programs")
    play.ask("get_motor_temperatures")
    play.ask("get_running_program")
    play.receive_frame(0x0B, b"0a")
    play.receive_frame(0x0E, b"1|2|3|4")
    play.receive_frame(0x0A, b"0||")
    assert play.core.observed_readings == {
        "list_prefix_sep": {"0a"},
        "op_temp_reply": {"0x0E"},
        "runinfo_none": {"0||"},
    }


def test_temperatures_and_default_program_share_an_opcode(play: Any) -> None:
    """4.14/4: under 0x0E four fields are temperatures and one digit is a set default program."""
    temperatures, default = (
        play.ask("get_motor_temperatures"),
        play.ask("set_default_program", b"a"),
    )
    play.receive_frame(0x0E, b"1")
    assert default.settled
    assert not temperatures.settled
    play.receive_frame(0x0E, b"20|38|34|22")
    assert temperatures.outcome() == JointValues(20, 38, 34, 22)
    late = play.ask("set_default_program", b"a")
    assert isinstance(play.receive_frame(0x0E, b"20|38|34|22")[0], UnexpectedFrame)
    assert not late.settled


def test_the_default_program_is_requested_with_both_opcodes(play: Any) -> None:
    """A-4.12-1: 0x0D, after a timeout 0x13; the client remembers the result."""
    first = play.ask("get_default_program")
    assert isinstance(play.receive_frame(0x13, b"a.rob")[0], UnexpectedFrame)  # not asked for yet
    play.wait_for(5)
    play.receive_frame(0x13, b"a.rob")
    assert first.outcome() == b"a.rob"
    second = play.ask("get_default_program")
    play.wait_for(5)
    assert isinstance(second.error, ReplyTimeout)
    assert play.sent() == [(0x0D, b""), (0x13, b""), (0x13, b"")]
    assert play.core.observed_readings["op_get_default"] == {"0x13"}
    assert play.core.dialect["op_get_default"] == "0x13"


def test_a_late_reply_with_the_first_opcode_counts(play: Any) -> None:
    """Both requests were sent, so both replies are valid."""
    operation = play.ask("get_default_program")
    play.wait_for(6)
    play.receive_frame(0x0D, b"a.rob")
    assert operation.outcome() == b"a.rob"


def test_a_timeout_can_mean_no_default_program(new_play: Any) -> None:
    """In this reading both opcodes stay unanswered without a default program (A-4.12-2 c)."""
    play = new_play(Dialect.of(default_none="silence"))
    operation = play.ask("get_default_program")
    play.wait_for(10)
    assert operation.outcome() == b""


def test_a_pushed_list_is_joined(play: Any) -> None:
    """4.10/10: other replies and pauses between the parts."""
    listing = play.ask("list_programs")
    play.receive_frame(0x0B, b"1|a|b")
    status = play.ask("get_status")
    play.wait_for(4)
    play.receive_frame(0x0B, b"1|c")
    play.receive_frame(0x09, b"00")
    play.wait_for(4)
    play.receive_frame(0x0B, b"0")
    assert listing.outcome() == (b"a", b"b", b"c")
    assert status.settled
    assert play.sent() == [(0x0B, b""), (0x09, b"")]
    assert play.core.observed_readings["list_cont"] == {"push"}


def test_a_list_that_is_not_pushed_is_requested(play: Any) -> None:
    """4.10/10, A-4.10-3 (b): after one timeout, then without waiting."""
    listing = play.ask("list_programs")
    play.receive_frame(0x0B, b"1|a")
    assert play.sent() == [(0x0B, b"")]
    play.wait_for(5)
    assert play.sent() == [(0x0B, b"")]
    play.receive_frame(0x0B, b"0|b")
    assert listing.outcome() == (b"a", b"b")
    again = play.ask("list_programs")
    play.receive_frame(0x0B, b"1|a")
    assert play.sent() == [(0x0B, b""), (0x0B, b"")]
    play.receive_frame(0x0B, b"0|b")
    assert again.outcome() == (b"a", b"b")


def test_an_incomplete_list_is_an_error(play: Any) -> None:
    """The client returns no partial list (T/9)."""
    listing = play.ask("list_programs")
    play.receive_frame(0x0B, b"1|a")
    play.wait_for(10)
    with pytest.raises(ReplyTimeout):
        listing.outcome()


def test_an_endless_list_is_an_error(play: Any) -> None:
    """The memory is limited."""
    listing = play.ask("list_programs")
    for _ in range(MAX_LIST_PARTS):
        play.receive_frame(0x0B, b"1|a")
    with pytest.raises(ProtocolError, match="does not end"):
        listing.outcome()


FORBIDDEN: list[tuple[str, Any]] = [
    ("login", b""),
    ("login", b"x" * 256),
    ("login", b"a|b"),
    ("set_password", PasswordChange(b"a" * 128, b"b" * 127)),
    ("set_password", PasswordChange(b"a", b"b|c")),
    ("set_password", PasswordChange(b"a", b"")),
    ("delete_program", b"a|b.rob"),
    ("delete_program", b"n" * 31),
    ("run_program", b""),
    ("run_program", b"../a"),
    ("set_network", Network("999.1.1.1", "255.0.0.0", "10.0.0.1")),
    ("set_tool_coordinates", (0, 1, 2, 3, 4, 5, 6)),
    ("set_tool_coordinates", (101, 1, 2, 3, 4, 5, 6)),
    ("set_gripper_center", (float("nan"), 0, 0)),
    ("set_gripper_center", (0, float("inf"), 0)),
    ("set_digital_output", (8, 2)),
    ("set_digital_output", (0, 1)),
    ("get_analog_input", 100),
]


@pytest.mark.parametrize(("name", "value"), FORBIDDEN)
def test_invalid_values_are_not_sent(play: Any, name: str, value: Any) -> None:
    """3/28, 4.2/7, T/6, 4.24/2, 4.32/2: the error is one sentence."""
    with pytest.raises(PayloadError):
        play.ask(name, value)
    assert play.sent() == []
    assert play.core.is_free(name)


def test_the_longest_pair_of_passwords_is_sent(play: Any) -> None:
    """4.2/7: 255 bytes with the bar."""
    play.ask("set_password", PasswordChange(b"a" * 127, b"b" * 127))
    assert play.sent() == [(0x03, b"a" * 127 + b"|" + b"b" * 127)]


def test_a_lost_link_ends_all_operations(play: Any) -> None:
    """No operation stays pending, and nothing more is sent."""
    time, run = play.ask("get_time"), play.ask("run_program", b"a")
    play.receive_frame(0x30, b"1")
    play.core.connection_lost("the cable is out", play.now_s)
    assert play.core.connection_lost("again", play.now_s) == []
    for operation in (time, run):
        with pytest.raises(LinkLost, match="was not completed: the cable is out"):
            operation.outcome()
    with pytest.raises(LinkLost, match="is not sent: the cable is out"):
        play.ask("get_time")


def test_a_frame_inside_an_incomplete_one_is_found_at_the_end(play: Any) -> None:
    """3/20: the bytes of the partial frame are searched again."""
    time = play.ask("get_time")
    play.receive_bytes(b"\xcc\x08\xff" + Frame(C2A, 0x07, TIME).encode())
    play.core.connection_lost("it ended", play.now_s)
    assert time.outcome() == NOON


@pytest.mark.parametrize(
    ("name", "value", "opcode"),
    [("shutdown", None, 0x60), ("set_network", Network("10.0.0.1", "255.0.0.0", "10.0.0.2"), 0x05)],
)
def test_the_link_may_end_after_some_commands(
    play: Any, name: str, value: Any, opcode: int
) -> None:
    """4.4/6, 4.35/6: the command succeeds; later commands raise the reason."""
    operation = play.ask(name, value)
    play.receive_frame(opcode, b"1")
    play.core.connection_lost("cut", play.now_s)
    assert operation.outcome() is None
    with pytest.raises(LinkLost, match=f"as it may after {name}"):
        play.ask("get_time")
