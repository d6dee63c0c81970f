"""Exchanges on a connection: requests, replies, gaps, floods."""

import gc
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.readings import Dialect
from scaraspec.traffic.dialogue import Dialogue
from scaraspec.traffic.events import CaptureGap, Ending, Exchange, InvalidBytes
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import Kind, WireEvent

Judged = Callable[..., Any]

ANSWERED, UNANSWERED, UNFINISHED = Ending.ANSWERED, Ending.UNANSWERED, Ending.UNFINISHED
TIME = "20260101000000"


def endings(record: Any) -> list[tuple[str, Ending]]:
    """The exchanges in the order in which they ended."""
    return [(x.name, x.ending) for x in record.exchanges if x.name != "login"]


# Which reply belongs to which request


def test_an_exchange_has_its_frames_and_times(judged: Judged) -> None:
    """Latency is until the first byte of the reply, duration until that of the final result."""
    record = judged("login\n> reset\n+0.5\n< reset 1\n+2\n<90 reset 00|12")
    x = record.exchange("reset")
    assert (x.request_value, x.reply_value) == (None, Acceptance(accepted=True))
    assert x.outcome == Outcome(done=False, code="12")
    assert (x.latency_ns, x.duration_ns) == (501_000_000, 2_001_000_000)
    assert x.frames == (x.request, x.reply, x.result)
    assert x.ending is ANSWERED
    assert x.accepted
    assert x.certain


def test_the_same_request_twice_is_answered_in_order(judged: Judged) -> None:
    """Replies have no number: the first one belongs to the older request."""
    record = judged("login\n> get_status\n> get_status\n< get_status 01\n< get_status 02")
    first, second = (x for x in record.exchanges if x.name == "get_status")
    assert (first.reply_value, second.reply_value) == ("01", "02")
    assert first.request.place.offset_bytes < second.request.place.offset_bytes
    assert (first.same_opcode_pending, second.same_opcode_pending) == (False, True)


def test_mixed_requests_are_matched_by_opcode(judged: Judged) -> None:
    """Replies may come in any order; the overtaken exchange is marked."""
    record = judged(f"login\n> get_status\n> get_time\n< get_time {TIME}\n< get_status 00")
    assert [x.name for x in record.exchanges] == ["login", "get_time", "get_status"]
    assert [x.overtaken for x in record.exchanges] == [False, False, True]


def test_a_late_reply_after_silence(judged: Judged) -> None:
    """A late reply belongs to the request if no later request was answered."""
    x = judged("login\n> get_status\n+8\n< get_status 00").exchange("get_status")
    assert x.ending is ANSWERED
    assert not x.overdue


def test_a_repeated_request_and_two_late_replies(judged: Judged) -> None:
    """A request that is repeated after the timeout gets both replies; none is unsolicited."""
    record = judged(
        "login\n> get_status\n+6\n> get_status\n< get_status 01\n+1\n< get_status 02\n> close"
    )
    assert endings(record) == [("get_status", ANSWERED)] * 2
    assert not record.unsolicited


def test_a_reply_that_was_read_as_data_of_another_frame(judged: Judged) -> None:
    """It answers the request before it, and not the one that was sent after the timeout."""
    record = judged(
        "login\n> get_status\n< =CC 39 90 02 31 31 AA\n< get_status 01\n+6\n> get_status\n"
        "< get_status 02\n> close"
    )
    first, second = (x for x in record.exchanges if x.name == "get_status")
    assert (first.reply_value, second.reply_value) == ("01", "02")
    assert 0 < first.latency_ns < 10**9
    assert not first.requested_again


def test_a_reply_to_an_abandoned_request_is_late(judged: Judged) -> None:
    """A reply to an abandoned request is late, not unsolicited, once for each such request."""
    record = judged(
        "login\n> get_time\n> get_status\n< get_status 00\n+11\n> get_status\n< get_status 00\n"
        f"< get_time {TIME}\n< get_time {TIME}"
    )
    assert ("get_time", UNANSWERED) in endings(record)
    assert [unsolicited.late for unsolicited in record.unsolicited] == [True, False]


def test_the_reply_time_can_be_claimed(judged: Judged) -> None:
    """With a claimed reply time of 20 s a reply after 10 s is not overdue."""
    session = f"login\n> get_time\n> get_status\n< get_status 00\n+9\n< get_time {TIME}"
    assert judged(session).failed == {"3/31"}
    assert not judged(session, Dialect.of(reply_timeout="20")).failed


@pytest.mark.parametrize(
    ("timeout", "pause_s", "failed"), [("8", 7, set()), ("8", 9, {"3/31"}), ("1", 4, set())]
)
def test_the_limit_of_a_chunk(judged: Judged, timeout: str, pause_s: int, failed: set[str]) -> None:
    """The limit is the claimed transfer timeout, but at least the reply time of five seconds."""
    chunk = "> chunk 0/300\n> get_status\n< get_status 00\n"
    session = f"login\n> upload_name a\n< upload_name 1\n{chunk}+{pause_s}\n< upload_chunk 1"
    assert judged(session, Dialect.of(xfer_timeout=timeout)).failed == failed


@pytest.mark.parametrize("opcode", ["0D", "13"])
def test_both_opcodes_of_the_default_program(judged: Judged, opcode: str) -> None:
    """Request and reply may have 0x0D or 0x13: it is one command."""
    for reply in ("0D", "13"):
        x = judged(f"login\n> {opcode}\n< {reply} a.rob").exchange("get_default_program")
        assert x.reply_value == b"a.rob"


def test_silence_to_0x0d_then_0x13(judged: Judged) -> None:
    """The request with the other opcode is answered, the first one is not: a reading, no
    failure."""
    record = judged("login\n> 0D\n+6\n> 13\n< 13 a.rob\n+11\n> get_status\n< get_status 00")
    first, second = (x for x in record.exchanges if x.name == "get_default_program")
    assert (first.request.frame.opcode, second.request.frame.opcode) == (0x13, 0x0D)
    assert (first.ending, second.ending) == (ANSWERED, UNANSWERED)
    assert not record.failed


def test_temperatures_under_0x0e_while_a_default_is_set(judged: Judged) -> None:
    """Four fields are temperatures, one flag is the reply to 0x0E, in either order."""
    asked = "login\n> set_default_program a.rob\n> get_motor_temperatures\n"
    for replies in ("< 0E 20|38|34|22\n< 0E 1", "< 0E 1\n< 0E 20|38|34|22"):
        record = judged(asked + replies)
        assert record.exchange("get_motor_temperatures").reply_value == (20, 38, 34, 22)
        assert record.exchange("set_default_program").reply_value is True


def test_a_reply_with_another_opcode_is_stray(judged: Judged) -> None:
    """The waiting request keeps waiting, and the stray frame is noted in it."""
    record = judged(f"login\n> get_status\n< get_time {TIME}\n< get_status 00")
    (unsolicited,) = record.unsolicited
    assert [x.name for x in unsolicited.waiting] == ["get_status"]
    assert record.exchange("get_status").unmatched_reply is unsolicited.seen


def test_an_undefined_opcode_is_an_exchange_without_a_command(judged: Judged) -> None:
    """The exchange is named by its opcode and answered by the same opcode."""
    record = judged("login\n> 3E 1\n< 3E 0\n> 77")
    answered, unanswered = record.exchange("0x3E"), record.exchange("0x77")
    assert answered.command is None
    assert answered.reply.frame.data == b"0"
    assert unanswered.ending is Ending.CUT_OFF


def test_a_malformed_reply_takes_the_place_of_the_reply(judged: Judged) -> None:
    """The malformed frame answers its request, and the next reply is not mistaken for it."""
    record = judged("login\n> get_status\n< = CC 09 03 30 30 AA\n> get_status\n< get_status 00")
    first, second = (x for x in record.exchanges if x.name == "get_status")
    assert first.malformed is record.undecodable[0]
    assert first.reply is None
    assert second.reply_value == "00"
    assert first.ending is second.ending is ANSWERED


def test_a_malformed_final_result_ends_the_command(judged: Judged) -> None:
    """After it no command executes."""
    record = judged(
        "login\n> reset\n< reset 1\n< = CC 90 33 04 30 30 7C 31 31 AA\n> reset\n< reset 1"
    )
    assert endings(record) == [("reset", ANSWERED), ("reset", Ending.CUT_OFF)]
    assert len(record.robot.executing) == 0


def test_a_malformed_request_explains_its_answer(judged: Judged) -> None:
    """A tolerant controller answers a malformed request; that reply is late, not unsolicited."""
    record = judged("login\n> = AA 09 00 30 CC\n< get_status 00")
    assert [unsolicited.late for unsolicited in record.unsolicited] == [True]


# Program lists


def test_pushed_parts_are_one_exchange(judged: Judged) -> None:
    """The exchange ends with the part that says that no more follow."""
    record = judged("login\n> list_programs\n< list_programs 1|a\n+1\n< list_programs 0|b")
    x = record.exchange("list_programs")
    assert [part.value.names for part in x.parts] == [(b"a",), (b"b",)]
    assert x.reply is x.parts[0]
    assert x.frames == (x.request, *x.parts)


def test_fetched_parts_add_up(judged: Judged) -> None:
    """Each request has its own reply, and the last exchange has the whole list."""
    record = judged(
        "login\n> list_programs\n< list_programs 1|a\n> list_programs\n< list_programs 0|b"
    )
    first, last = (x for x in record.exchanges if x.name == "list_programs")
    assert [part.value.names for part in first.parts] == [(b"a",)]
    assert [part.value.names for part in last.parts] == [(b"a",), (b"b",)]
    assert (first.ending, last.ending) == (ANSWERED, ANSWERED)


def test_a_list_requested_again_may_come_twice(judged: Judged) -> None:
    """The next part may be pushed or fetched: none of the parts is unsolicited."""
    record = judged(
        "login\n> list_programs\n< list_programs 1|a\n> list_programs\n"
        "< list_programs 0|b\n< list_programs 0|a|b"
    )
    assert [unsolicited.late for unsolicited in record.unsolicited] == [True]


def test_a_list_without_its_end_is_cut_off(judged: Judged) -> None:
    """The announced next part is missing."""
    record = judged("login\n> list_programs\n< list_programs 1|a\n> close")
    assert record.exchange("list_programs").ending is Ending.CUT_OFF


# Two-stage commands


def test_a_result_in_the_segment_of_the_first_reply(judged: Judged, script: Callable) -> None:
    """Two frames in one segment are two frames."""
    events = script("login\n> reset\n< reset 1\n<90 reset 11")
    *head, reply, result = events
    joined = WireEvent(
        result.time_ns, "1", C2A, Kind.BYTES, reply.data + result.data, reply.offset_bytes
    )
    x = judged([*head, joined]).exchange("reset")
    assert x.outcome == Outcome(done=True)
    assert x.duration_ns == 0


def test_a_result_before_the_first_reply_is_unsolicited(judged: Judged) -> None:
    """It ends no command; the first reply after it starts the command."""
    record = judged("login\n> reset\n<90 reset 11\n< reset 1")
    assert [u.seen.frame.tagged for u in record.unsolicited] == [True]
    assert record.exchange("reset").ending is Ending.CUT_OFF


def test_a_second_result_is_unsolicited(judged: Judged) -> None:
    """It comes after the exchange that it repeats."""
    record = judged("login\n> reset\n< reset 1\n<90 reset 11\n<90 reset 11")
    (unsolicited,) = record.unsolicited
    assert unsolicited.after is record.exchange("reset")
    assert unsolicited.certain


JOG_AND_STOP = "login\n> jog 1\n< jog 1\n> emergency_stop\n< emergency_stop 1\n"


@pytest.mark.parametrize(
    ("order", "ending", "after_stop"),
    [
        ("<90 jog 11\n<90 emergency_stop 11", ANSWERED, False),
        ("<90 emergency_stop 11\n<90 jog 11", ANSWERED, True),
        ("<90 emergency_stop 11\n> reset\n< reset 1", UNFINISHED, False),
    ],
)
def test_a_stopped_command_ends_in_three_ways(
    judged: Judged, order: str, ending: Ending, *, after_stop: bool
) -> None:
    """Its final result may come first, after that of the stop, or never: none is a failure
    (A-4.17-4)."""
    record = judged(JOG_AND_STOP + order)
    x = record.exchange("jog")
    assert x.interrupted_by.name == "emergency_stop"
    assert (x.ending, x.result_after_stop) == (ending, after_stop)
    assert record.exchange("emergency_stop").ending is ANSWERED
    assert not record.failed
    assert not record.unsolicited


def test_a_stopped_command_may_end_late(judged: Judged) -> None:
    """Its final result is assigned even after the next command was accepted."""
    record = judged(
        JOG_AND_STOP + "<90 emergency_stop 11\n> reset\n< reset 1\n<90 jog 11\n<90 reset 11"
    )
    assert [unsolicited.late for unsolicited in record.unsolicited] == [True]
    assert not record.failed


def test_a_stop_ends_commands_of_other_clients(judged: Judged) -> None:
    """A stop also ends commands of other connections: they share one robot."""
    record = judged(
        "login\n2> login password\n2< login 1\n> jog 1\n< jog 1\n2> emergency_stop\n"
        "2< emergency_stop 1\n2<90 emergency_stop 11\n<90 jog 11"
    )
    assert record.exchange("jog").interrupted_by.name == "emergency_stop"


def test_each_exchange_knows_the_executing_command(judged: Judged) -> None:
    """A command executes from acceptance to final result, for all connections; uncertain if that
    changes during an exchange."""
    record = judged(
        "login\n2> login password\n2< login 1\n> get_version\n> reset\n< get_version 1.0.0\n"
        "< reset 1\n2> get_status\n2< get_status 03\n> get_time\n<90 reset 11\n"
        f"< get_time {TIME}\n> get_network\n< get_network 1.1.1.1|1.1.1.1|1.1.1.1"
    )
    during = {x.name: [y.name for y in x.concurrent] for x in record.exchanges}
    assert during["get_version"] == during["get_time"] == during["get_network"] == []
    assert during["get_status"] == ["reset"]
    unsettled = {x.name for x in record.exchanges if x.concurrent_uncertain}
    assert unsettled == {"get_time"}


def test_overlapping_commands_have_their_own_results(judged: Judged) -> None:
    """Each of two commands that overlap gets its own final result."""
    record = judged(
        "login\n> reset\n< reset 1\n> lock_joints\n< lock_joints 1\n<90 reset 11\n"
        "<90 lock_joints 11"
    )
    assert endings(record) == [("reset", ANSWERED), ("lock_joints", ANSWERED)]
    assert [y.name for y in record.exchange("lock_joints").concurrent] == ["reset"]


# The link


@pytest.mark.parametrize("line", ["> close", "< close", "> rst", "< rst"])
def test_the_end_of_the_link_cuts_off_exchanges(judged: Judged, line: str) -> None:
    """Waiting requests and executing commands are cut off; neither has failed."""
    record = judged(f"login\n> reset\n< reset 1\n> get_status\n{line}")
    assert {ending for _, ending in endings(record)} <= {Ending.CUT_OFF, Ending.HUNG_UP}
    assert not record.failed
    assert not record.robot.executing


def test_the_side_that_disconnects_is_known(judged: Judged) -> None:
    """An exchange is marked if the controller disconnects instead of answering, not if the client
    does."""
    assert endings(judged("login\n> get_status\n< half-close\n> close")) == [
        ("get_status", Ending.HUNG_UP)
    ]
    assert endings(judged("login\n> get_status\n> half-close\n< close")) == [
        ("get_status", Ending.CUT_OFF)
    ]


@pytest.mark.parametrize("line", ["> close", "> rst", ""])
def test_a_connection_opened_again_is_a_new_one(judged: Judged, line: str) -> None:
    """A connection with an old name starts again: no login, nothing open, offsets from 0."""
    record = judged(f"login\n> reset\n< reset 1\n> = AA 09\n{line}\n> open\n> get_status\n")
    x = record.exchange("get_status")
    assert x.logged_in is False
    assert x.request.place.offset_bytes == 0
    assert x.concurrent == ()
    assert record.exchange("reset").ending is Ending.CUT_OFF


def test_a_serial_link_needs_no_login(judged: Judged) -> None:
    """A serial link serves requests from the beginning (L83)."""
    session = "> get_status\n< get_status 00"
    assert judged(session, needs_login=False).exchange("get_status").logged_in is True
    assert judged(session).exchange("get_status").logged_in is False


def test_a_login_lasts_until_it_is_uncertain(judged: Judged) -> None:
    """A refused login after it may have logged the client out (A-4.1-2)."""
    logged_in = [
        x.logged_in
        for x in judged("> login a\n< login 1\n> login b\n< login 0\n> get_status").exchanges
    ]
    assert logged_in == [False, True, None]


def test_a_refused_login_is_kept_while_certain(judged: Judged) -> None:
    """Until a login succeeds, or a gap may hide a successful one."""
    refused = "> login a\n< login 0\n{}> get_status"
    reply = {
        between: judged(refused.format(between)).exchange("get_status").refused_login is not None
        for between in ("", "> login b\n< login 0\n", "> login b\n< login 1\n", "> gap 9\n")
    }
    assert list(reply.values()) == [True, True, False, False]


# Gaps


def test_a_gap_hides_replies_of_its_direction(judged: Judged) -> None:
    """A reply may be in a gap of its own direction, not in one of the other direction."""
    record = judged("login\n> get_status\n< gap 6\n> get_time")
    assert endings(record)[0] == ("get_status", Ending.UNSEEN)
    record = judged("login\n> get_status\n> gap 4\n< get_status 00")
    assert endings(record) == [("get_status", ANSWERED)]
    assert not record.exchange("get_status").certain


def test_a_gap_includes_incomplete_bytes_beside_it(judged: Judged) -> None:
    """Bytes that the gap may have damaged are not invalid, and are not searched for frames."""
    record = judged("login\n> = AA 52 D4 AA 09 00 CC\n> gap 5\n> get_status")
    truncated, lost = (h for h in record.happenings if isinstance(h, InvalidBytes | CaptureGap))
    assert isinstance(truncated, InvalidBytes)
    assert truncated.touches_gap
    assert isinstance(lost, CaptureGap)
    assert not record.failed
    assert [x.name for x in record.exchanges] == ["login", "get_status"]


def test_frames_are_certain_again_after_a_frame_of_the_other_side(judged: Judged) -> None:
    """If no bytes are left over at that moment, the framer is in step again."""
    record = judged(
        "login\n> gap 1\n> =CC\n> get_status\n> get_time\n< get_status 00\n> get_version"
    )
    frames = [x.request for x in record.exchanges]
    assert {f.name: f.certain for f in frames} == {
        "login": True,
        "get_status": False,
        "get_time": False,
        "get_version": True,
    }


def certainties(record: Any, name: str) -> list[bool]:
    """Whether each exchange of a command is certain."""
    return [x.certain for x in record.exchanges if x.name == name]


def test_the_first_answered_request_settles_a_gap(judged: Judged) -> None:
    """Replies come in order: what the gap hid has been answered before."""
    asked = "> get_status\n< get_status 00\n"
    record = judged(f"login\n> gap 9\n{asked}{asked}")
    assert certainties(record, "get_status") == [False, True]


def test_a_pending_request_keeps_a_gap_unsettled(judged: Judged) -> None:
    """Until its own reply, or the reply time of what the gap hid."""
    asked = "> get_status\n< get_status 00\n"
    record = judged(f"login\n> gap 9\n> get_time\n{asked}{asked}+6\n{asked}{asked}")
    assert certainties(record, "get_status") == [False, False, False, True]


def test_the_reply_to_a_hidden_request_opens_a_gap_again(judged: Judged) -> None:
    """A client with two threads had sent two requests in it."""
    asked = "> get_status\n< get_status 00\n"
    hidden = "< get_time 20260101120000\n"
    record = judged(f"login\n> gap 9\n{asked}{hidden}{asked}{asked}")
    assert certainties(record, "get_status") == [False, False, True]
    assert not record.failed


def test_missing_replies_hide_no_request(judged: Judged) -> None:
    """Only what is pending then depends on them."""
    lost = "login\n> set_time 20260101120000\n< set_time 1\n> {0}\n< gap 9\n> get_time\n"
    later = lost + "< get_time 20270101120000\n"
    assert judged(later.format("get_status")).failed >= {"4.5/4"}
    assert judged(later.format("get_time")).failed == set()
    assert judged(later.format("set_time 20270101120000")).failed == set()


def test_a_missing_reply_may_be_the_last(judged: Judged) -> None:
    """A request after the gap may have been answered in it."""
    assert not judged("login\n> get_time\n< gap 9\n> get_status\n+6\n> close").failed


def test_a_missing_query_is_known_by_its_reply(judged: Judged) -> None:
    """Four missing bytes are one request without data; a query changes nothing."""
    lost = "login\n> set_time 20260101120000\n< set_time 1\n> gap 4\n{}\n> get_time\n"
    later = lost + "< get_time 20270101120000\n"
    assert judged(later.format("< get_status 00")).failed >= {"4.5/4"}
    assert judged(later.format("< emergency_stop 1")).failed == set()
    assert judged(later.format("< get_status 00").replace("gap 4", "gap 8")).failed == set()
    uploading = later.replace("> gap", "> upload_name a\n< upload_name 1\n> gap")
    assert judged(uploading.format("< get_status 00")).failed == set()


def test_a_status_right_after_a_gap_may_be_old(judged: Judged) -> None:
    """It does not show that no hidden command executes (A-4.8-3)."""
    lost = "login\n> run_program a.rob\n< gap 5\n> get_time\n< get_time 20260101120000\n"
    later = "> =AA 09 00 CC\n< get_status 00\n{}<90 run_program 11"
    assert not judged(lost + later.format("")).failed


def test_chunks_after_a_gap_follow_each_other(judged: Judged) -> None:
    """The first one may be anywhere, and positions that count chunks are found."""
    start = "login\n> upload_name a\n< upload_name 1\n> gap 216\n< upload_chunk 1\n"
    sent = "> chunk {}/1000\n< upload_chunk 1\n"
    good = start + "".join(map(sent.format, (200, 400, 600)))
    assert not judged(good).failed
    wrong = start + "".join(map(sent.format, (1, 2, 3)))
    assert judged(wrong).failed == {"5.1/4", "5.1/8"}


def test_a_gap_makes_other_connections_uncertain(judged: Judged) -> None:
    """A gap may hide a change of the robot, until it ends and its requests are answered."""
    hidden = "login\n2> login password\n2< login 1\n2> gap 40\n{}> get_status\n< get_status 00\n"
    certain = {
        between: judged(hidden.format(between)).exchange("get_status").certain
        for between in (
            "",
            "+6\n",
            "2> get_time\n",
            "2> get_time\n+6\n",
            "2> close\n",
            "2> close\n+6\n",
        )
    }
    assert certain == {
        "": False,
        "+6\n": False,  # the gap may still go on
        "2> get_time\n": False,
        "2> get_time\n+6\n": True,
        "2> close\n": False,
        "2> close\n+6\n": True,
    }


def test_a_gap_may_hide_a_stop(judged: Judged) -> None:
    """A stop in the gap may have ended the command of another connection: a status proves
    nothing."""
    record = judged(
        "login\n2> login password\n2< login 1\n> jog 1\n< jog 1\n2> gap 4\n2> get_time\n+6\n"
        "> get_status\n< get_status 00\n> get_status\n< get_status 02\n<90 jog 11"
    )
    assert not record.failed


def test_results_of_hidden_commands_may_come_much_later(judged: Judged) -> None:
    """Such a final result may come until the robot is seen idle."""
    asked = "> get_status\n< get_status {}\n"
    busy = asked.format("01")
    late = f"login\n> gap 5\n{busy}+6\n{busy}{busy}{{}}<90 run_program 11"
    assert judged(late.format("")).verdict("3/16") is Verdict.INCONCLUSIVE
    idle = asked.format("00")
    assert judged(late.format(idle)).verdict("3/16") is Verdict.FAIL


def test_a_capture_that_starts_in_the_middle(judged: Judged, script: Callable) -> None:
    """An offset without an opening: login and name of the file may have come before."""
    events = script("login\n> upload_name a\n< upload_name 1\n> chunk 0/300\n< upload_chunk 1")
    record = judged(events[-2:])
    assert record.exchange("upload_chunk").logged_in is None
    assert not record.failed
    assert [x.request.place.offset_bytes for x in record.exchanges] == [events[-2].offset_bytes]


def test_injected_faults_cause_no_failures(judged: Judged) -> None:
    """Data that was dropped or changed on purpose is the fault of neither side."""
    dropped = "login\n> get_time\n{}> get_status\n< get_status 00\n+11\n> get_status"
    assert judged(dropped.format("")).failed == {"3/31"}
    record = judged(dropped.format("> injected\n"))
    assert not record.failed
    assert not record.exchange("get_time").certain


# Bounds


def flood(data: bytes, direction: Direction, times: int) -> Iterator[WireEvent]:
    """Return the same bytes many times."""
    yield WireEvent(0, "1", A2C, Kind.OPENED)
    for i in range(times):
        yield WireEvent(i, "1", direction, Kind.BYTES, data, i * len(data))


FLOODS = {
    "garbage": (A2C, b"\x55" * 8192, 30),
    "start bytes": (C2A, b"\xcc" * 64, 30),
    "unanswered requests": (A2C, Frame(A2C, 0x09).encode() * 64, 3),
    "unanswered unknown requests": (A2C, bytes.fromhex("AA7700CC") * 64, 3),
    "unsolicited frames": (C2A, Frame(C2A, 0x09, b"00").encode() * 64, 3),
    "unasked results": (C2A, Frame(C2A, 0x30, b"11", tagged=True).encode() * 64, 3),
    "nothing": (A2C, b"", 1200),
}


@pytest.mark.parametrize(("direction", "data", "times"), FLOODS.values(), ids=FLOODS)
def test_floods_need_limited_memory(direction: Direction, data: bytes, times: int) -> None:
    """Bytes that one side sends without end are yielded and not kept."""
    held = []
    for share in (1, 2):
        dialogue = Dialogue("1", RobotState())
        tracemalloc.start()
        for event in flood(data, direction, times * share):
            for _ in dialogue.feed(event):
                pass
        gc.collect()
        held.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert held[0] < 2_000_000
    assert held[1] < held[0] * 1.5 + 50_000


def exchanges_without_end(request: bytes, reply: bytes, times: int) -> Iterator[WireEvent]:
    """A controller that accepts commands and never finishes them."""
    yield WireEvent(0, "1", A2C, Kind.OPENED)
    for i in range(times):
        yield WireEvent(2 * i, "1", A2C, Kind.BYTES, request, i * len(request))
        yield WireEvent(2 * i + 1, "1", C2A, Kind.BYTES, reply, i * len(reply))


@pytest.mark.parametrize("opcode", [0x30, 0x32, 0x3D, 0x50])
def test_endless_commands_need_limited_memory(opcode: int) -> None:
    """Programs, stops and jogs without results, and uploads without content."""
    request = Frame(A2C, opcode, b"" if opcode == 0x32 else b"1").encode()
    held = []
    for times in (150, 300):
        dialogue, kept = Dialogue("1", RobotState()), {}
        tracemalloc.start()
        for event in exchanges_without_end(request, Frame(C2A, opcode, b"1").encode(), times):
            for traffic_event in dialogue.feed(event):
                if isinstance(traffic_event, Exchange):
                    kept[traffic_event.name] = traffic_event  # as RobotState does
        gc.collect()
        held.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert held[1] < held[0] * 1.1 + 20_000


PART = "< list_programs 1|a\n"


@pytest.mark.parametrize(
    "parts", ["> list_programs\n" + PART * 300, f"> list_programs\n{PART}" * 300]
)
def test_endless_lists_need_limited_memory(judged: Judged, parts: str) -> None:
    """Pushed or fetched: the last parts are kept, and the whole list is not judged."""
    record = judged("login\n" + parts)
    assert max(len(x.parts) for x in record.exchanges) == 256
    assert not record.exchanges[-1].certain


def test_many_connections_need_limited_memory(judged: Judged) -> None:
    """The connection that was silent longest is forgotten; later bytes of it count as seen from the
    middle."""
    opened = [WireEvent(i, str(i), A2C, Kind.OPENED) for i in range(5000)]
    back = WireEvent(9000, "7", A2C, Kind.BYTES, Frame(A2C, 0x09).encode(), 24)
    record = judged([*opened, back])
    assert len(record.judge._dialogues) == 0
    assert record.exchange("get_status").logged_in is None


# Secrets


@pytest.mark.parametrize(
    "session",
    [
        "> login {}\n< login 1",
        "> login {}|\n< login {}",
        '> login "{}"\n< login 0|{}',
        "> login {}\\x00\n< login",
        "login\n> set_password {}\n< set_password {}",
        "login\n> set_password {} {}\n< set_password 1|{}",
        "login\n> set_password {}|{}|{}\n< set_password 0",
        "> login {}\n< login 0\n> set_password {}|{}\n< set_password 1\n> login {}\n< login 1",
        "> = AA 01 07 {hex} CC\n> get_status",
        "> = AA 01 07 {hex}\n> get_status",
        "> = AA 01 02 {hex} CC\n> get_status",
        "> = AA 01 0B {hex}\n> get_status",
        "> = AB 01 08 {hex} CC\n> get_status",
        "> = {hex}\n> get_status",
    ],
)
def test_no_finding_shows_a_password(judged: Judged, session: str) -> None:
    """Whatever is wrong with a message that has a password, or with its reply."""
    secret = "Tr0ub4d&"
    record = judged(session.replace("{hex}", secret.encode().hex()).replace("{}", secret))
    for finding in record.findings:
        shown = f"{finding.message} {finding.expected} {finding.observed}"
        assert secret not in shown
        assert secret.encode().hex() not in shown.replace(" ", "").lower()
        assert finding.observed != f"{ord(secret[-1]):02X}"


def test_a_late_reply_to_another_connection_is_no_final_result(judged: Judged) -> None:
    """A query has no final result, so that the frame is unsolicited."""
    record = judged("login\n2> login password\n2< login 1\n> get_version\n2< get_version 1.0.0")
    reported = {f.message for f in record.findings if f.requirement == "3/16"}
    assert reported == {"a reply to get_version came on a connection that did not request it"}


def test_a_damaged_time(judged: Judged, script: Callable[[str], list[WireEvent]]) -> None:
    """A time that no clock shows ends no gap."""
    events = script("login\n> get_status\n< get_status 00")
    record = judged(replace(event, time_ns=event.time_ns + (1 << 63)) for event in events)
    assert endings(record) == [("get_status", ANSWERED)]
