"""Clause 3: requests sent without waiting: their replies, and the order of their effects.

The order of the replies is a reading; the order of the effects is not (A-3-14).
"""

from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final

from scaraspec.protocol.commands import Point
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import JogDirection
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import require_pipelining
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import shifted_time
from scaraspec.suite.controller.harness.requests.files import (
    expect_begun,
    expect_stored,
    require_any_content,
)
from scaraspec.suite.controller.harness.requests.motion import (
    arm_returned,
    status_after_result,
    stop,
    stop_motion,
)
from scaraspec.suite.controller.harness.requests.queries import (
    Query,
    some_queries,
    supported_queries,
    wait_for_replies,
)
from scaraspec.suite.controller.harness.two_stage.commands import require_command
from scaraspec.suite.controller.harness.two_stage.results import wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import jog_somewhere
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.expectations import CaseInconclusive, expect, expect_equal
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.user_message import UserMessage

_STATE: Final = (Hazard.STATE,)
_MOTION: Final = (Hazard.STATE, Hazard.MOTION)
_CENTERS: Final = tuple(Point(float(n), -n / 2, n + 0.5) for n in range(1, 9))
_CLOCK_TOLERANCE: Final = timedelta(seconds=5)
_HOUR: Final = timedelta(hours=1)
_CHUNKS: Final = 3


@case("3/24")
@given(queries=some_queries)
def test_replies_in_order(subject: ControllerUnderTest, queries: list[Query]) -> None:
    """Every query sent without waiting is answered, and the replies keep the order."""
    require_pipelining(subject)
    line = subject.open()
    queries = supported_queries(subject, queries)
    line.send_bytes(b"".join(query.frame(line).encode() for query in queries))
    _check_order(subject, wait_for_replies(line, queries))
    line.close()


def _check_order(subject: ControllerUnderTest, replies: list[ReceivedFrame]) -> None:
    offsets_bytes = [reply.seen.place.offset_bytes for reply in replies]
    if any(later < earlier for earlier, later in pairwise(offsets_bytes)):
        subject.tolerate("3/24", "pipelining", "any-order", "replies arrived in another order")


@case("3/24", name="same")
def test_same_opcode(subject: ControllerUnderTest) -> None:
    """Twenty status requests get exactly twenty replies."""
    require_pipelining(subject)
    line = subject.open()
    line.send_bytes(line.request("get_status").encode() * 20)
    wait_for_replies(line, [Query("get_status")] * 20)
    for received in line.sync():
        subject.tolerate(
            "3/26",
            "A-3-16",
            "unsolicited frame",
            UserMessage("{frame} arrived without a request", frame=received.frame),
        )


# ---------------------------------------------------------------------- effects


@case("3/30", hazards=_STATE)
def test_last_setting_takes_effect(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The last of eight gripper centers that are set in one segment is kept."""
    require_pipelining(subject)
    require_command(subject, "set_gripper_center", "get_gripper_center")
    before = line.ask("get_gripper_center").value
    try:
        for centers in (_CENTERS, _CENTERS[::-1]):
            _send_together(line, [("set_gripper_center", center) for center in centers])
            for _ in centers:
                accepted = line.reply("set_gripper_center").accepted
                expect(accepted, "a setting was refused", requirement="4.20/2")
            current = line.ask("get_gripper_center").value
            expect_equal(current, centers[-1], "the last setting was not kept")
    finally:
        if before is not None:
            line.ask("set_gripper_center", before)


@case("3/30", name="queries", hazards=_STATE)
def test_queries_between_settings(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Queries between settings in one segment return the values that are set before them."""
    require_pipelining(subject)
    require_command(subject, "set_gripper_center", "get_gripper_center")
    before = line.ask("get_gripper_center").value
    requests: list[tuple[str, object]] = []
    for center in _CENTERS:
        requests += [("set_gripper_center", center), ("get_gripper_center", None)]
    try:
        _send_together(line, requests)
        values = [line.reply("get_gripper_center").value for _ in _CENTERS]
    finally:
        if before is not None:
            line.ask("set_gripper_center", before)
    if values != list(_CENTERS):
        message = "queries did not return the values set before them"
        expect_equal(set(values), set(_CENTERS), message)
        subject.tolerate("3/24", "pipelining", "any-order", "replies arrived in another order")


@case("3/30", name="clock", hazards=_STATE)
def test_last_time_takes_effect(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The last of several times that are set in one segment is kept."""
    require_pipelining(subject)
    require_command(subject, "set_time", "get_time")
    before: datetime | None = line.ask("get_time").value
    if before is None:
        raise CaseInconclusive("the controller does not report its time")
    settings = [("set_time", shifted_time(before, hours * _HOUR)) for hours in (5, 3, 1, 0)]
    begun_ns = subject.now_ns
    _send_together(line, settings)
    for _ in settings:
        line.reply("set_time")
    current: datetime | None = line.ask("get_time").value
    passed = subject.ics.time_scale * timedelta(microseconds=(subject.now_ns - begun_ns) / 1000)
    kept = (
        current is not None and -_CLOCK_TOLERANCE <= current - before <= passed + _CLOCK_TOLERANCE
    )
    if not kept:
        line.ask("set_time", before)
    expect(
        kept,
        "the last time that was set was not kept",
        expected=f"{before}",
        observed=f"{current}",
    )


@case("3/30", name="upload", hazards=_STATE)
def test_upload_in_one_segment(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An upload whose name and chunks are sent in one segment is stored unchanged."""
    require_pipelining(subject)
    require_command(subject, "upload_name", "upload_chunk")
    name, content = subject.new_name(), content_of(200 * _CHUNKS)
    requests: list[tuple[str, object]] = [("upload_name", name)]
    requests += [("upload_chunk", chunk) for chunk in chunks_of(content)]
    _send_together(line, requests)
    answer, within_s = line.reply("upload_name"), line.chunk_timeout_s
    accepted = [line.reply("upload_chunk", within_s=within_s).accepted for _ in range(_CHUNKS)]
    if answer.accepted and not all(accepted):
        require_any_content(line)
    message = "an upload in one segment was refused"
    expect_begun(line, name, answer, message, "3/30")
    expect_equal(accepted, [True] * _CHUNKS, message)
    expect_stored(line, name, content, requirement="3/30")


@case("3/30", "4/6", name="stop", hazards=_MOTION)
def test_stop_after_a_jog(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A jog, a lock and a stop in one segment: the lock is refused, and the arm stops."""
    require_pipelining(subject)
    require_command(subject, "jog", "emergency_stop")
    with arm_returned(subject, line):
        jog_somewhere(subject, line)  # determines the notation (A-4.28-1)
        stop(subject, line)
        refuses_while_busy = subject.dialect["busy_reply"] != "queue"
        try_lock = refuses_while_busy and "lock_joints" not in subject.ics.unsupported
        between = [("lock_joints", None)] if try_lock else []
        for direction in JogDirection:
            _send_together(line, [("jog", direction), *between, ("emergency_stop", None)])
            jog_reply, stop_reply = line.reply("jog"), line.reply("emergency_stop")
            locked = jog_reply.accepted and _locked_between(line, jog_reply, stop_reply)
            if stop_reply.accepted:
                wait_for_result(
                    subject, line, "emergency_stop"
                )  # until then, the arm may decelerate
            status = status_after_result(line).value
            stop_motion(subject, line)
            if jog_reply.accepted:
                break
        else:
            raise CaseInconclusive("the controller refuses to jog in every direction")
        expect(
            stop_reply.accepted and status != "04",
            "an emergency stop sent right after a jog did not stop it",
            expected="1, and a status other than 04",
            observed=UserMessage("{first}, and {second}", first=stop_reply, second=status),
        )
        expect(
            not locked,
            "a lock sent right after a jog was accepted",
            expected="0|04, or silence",
            observed="1",
            requirement="4/6",
        )


def _locked_between(
    line: OutgoingConnection, jog_reply: ReceivedFrame, stop_reply: ReceivedFrame
) -> bool:
    """Whether a lock was accepted between a jog and its stop, before anything ended."""
    between = range(jog_reply.seen.place.offset_bytes, stop_reply.seen.place.offset_bytes)
    for received in line.inbox:
        if received.place.offset_bytes not in between:
            continue
        if received.frame.tagged:
            return False
        if received.name == "lock_joints" and ReceivedFrame(received, received.value).accepted:
            return True
    return False


def _send_together(line: OutgoingConnection, requests: Sequence[tuple[str, object]]) -> None:
    line.send_bytes(b"".join(line.request(*request).encode() for request in requests))
