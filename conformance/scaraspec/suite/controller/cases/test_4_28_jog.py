"""Clause 4.28: jog the arm until it is stopped (0x3D, L596-637). Every jog here is short."""

from typing import Final, NamedTuple

import pytest

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import Malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    arm_returned,
    begin_step,
    is_responsive,
    joints_of,
    pose_deviation,
    pose_of,
    release_latch,
    status_of,
    stop,
    stop_motion,
    stop_without_reset,
    wait_for_end,
)
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    MOVE,
    STOP,
    expect_accepted,
    require_command,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.jogs import (
    expect_direction,
    moved,
    position_of,
    wait_for_motion,
)
from scaraspec.suite.controller.harness.two_stage.refusals import expect_first_reply, text_of
from scaraspec.suite.controller.harness.two_stage.results import interrupted_result, wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import (
    begin_jog,
    jog_somewhere,
    require_responsive,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, expect
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.MOTION,)
_MIN_MOTION_MM: Final = 1.0
_STANDSTILL_S: Final = 1.0
_TRAVEL_S: Final = 30.0
_POLL_S: Final = 0.05

_DIRECTIONS: Final = {
    "y": (JogDirection.PLUS_Y, JogDirection.MINUS_Y),
    "x": (JogDirection.PLUS_X, JogDirection.MINUS_X),
}

_INVALID_DIRECTIONS: Final = tuple(
    Malformed(kind, data)
    for kind, data in (
        ("zero", b"0"),
        ("binary zero", b"\0"),
        ("five", b"5"),
        ("binary five", b"\5"),
        ("six", b"6"),
        ("nine", b"9"),
        ("colon", b":"),
        ("letter", b"x"),
        ("letter with the low bits of 1", b"q"),
        ("digit 1 with the highest bit", b"\xb1"),
        ("sign", b"-"),
        ("binary sixteen", b"\x10"),
        ("highest bit and one", b"\x81"),
        ("highest byte", b"\xff"),
        ("two directions", b"13"),
        ("two binary directions", b"\1\3"),
        ("no data", b""),
    )
)


@pytest.mark.parametrize("direction", list(JogDirection), ids=str)
@case("4.28/3", "4.28/4", hazards=_MOTION)
def test_direction(
    subject: ControllerUnderTest, line: OutgoingConnection, direction: JogDirection
) -> None:
    """1 is +Y, 2 is -Y, 3 is +X, 4 is -X; a jog of single joints has no direction (A-4.28-2)."""
    with arm_returned(subject, line):
        before = position_of(line)
        reply = begin_jog(subject, line, direction)
        if not reply.accepted:
            expect_first_reply(JOG, reply)
            expect_accepted(JOG, jog_somewhere(subject, line))
            stop(subject, line)
            raise CaseSkipped(
                UserMessage(
                    "the arm has no room to move towards {direction}: {reply}",
                    direction=direction,
                    reply=reply,
                )
            )
        wait_for_motion(subject, line)
        stop_without_reset(subject, line)
        after = position_of(line)
        release_latch(subject, line)
        if max_deviation(after.pose[:3], before.pose[:3]) <= STANDSTILL:
            longest_s = subject.ics.motion.jog_s
            raise CaseSkipped(
                UserMessage(
                    "the arm did not move towards {direction} within {longest_s:g} s: "
                    "it has no room there, or needs a longer [motion] jog_s",
                    direction=direction,
                    longest_s=longest_s,
                )
            )
        expect_direction(subject, direction, before, after)


@case("4.28/3", name="moves", hazards=_MOTION)
def test_moves(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A jog that is accepted and executes moves the arm, if a step along the same axis does."""
    with arm_returned(subject, line):
        for axis, directions in _DIRECTIONS.items():
            jogs = [_jog_briefly(subject, line, direction) for direction in directions]
            if any(jog.moved for jog in jogs):
                return
            if all(jog.executed for jog in jogs) and _step_moves(subject, line, axis):
                raise CaseFailed(
                    UserMessage(
                        "no accepted jog along {axis} moves the arm, but a step does", axis=axis
                    ),
                    expected=UserMessage("a motion along {axis}", axis=axis),
                    observed=UserMessage(
                        "{first}, then {second}", first="04", second=pose_of(line)[:3]
                    ),
                )
        raise CaseSkipped(
            UserMessage(
                "no jog moved the arm within {longest_s:g} s: it has no room, or needs a longer "
                "[motion] jog_s",
                longest_s=subject.ics.motion.jog_s,
            )
        )


class _BriefJog(NamedTuple):
    """A jog that was stopped: whether it executed until then, and whether it moved the arm."""

    executed: bool
    moved: bool


def _jog_briefly(
    subject: ControllerUnderTest, line: OutgoingConnection, direction: JogDirection
) -> _BriefJog:
    before = position_of(line)
    reply = begin_jog(subject, line, direction)
    if not reply.accepted:
        expect_first_reply(JOG, reply)
        return _BriefJog(executed=False, moved=False)
    wait_for_motion(subject, line)
    executed = is_responsive(subject, line, jogs=True) and status_of(subject, line) in BUSY
    stop_without_reset(subject, line)
    after = position_of(line)
    release_latch(subject, line)
    return _BriefJog(executed, moved=moved(before, after))


def _step_moves(subject: ControllerUnderTest, line: OutgoingConnection, axis: str) -> bool:
    """Whether a step along an axis succeeds and changes the pose.

    Raises:
        CaseSkipped: There is no room for a step.
    """
    before = pose_of(line)
    _, reply = begin_step(subject, line, axis)
    result = wait_for_end(subject, line, MOVE) if reply.accepted else None
    moved = pose_deviation(pose_of(line), before) > STANDSTILL
    return result is not None and result.done is True and moved


@case("4.28/4", hazards=_MOTION)
def test_first_reply(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A jog is answered "1". A second jog is refused with "0|04", or replaces the first one."""
    with arm_returned(subject, line):
        reply = jog_somewhere(subject, line)
        expect(
            text_of(reply) == b"1",
            "the first reply to a jog is not just the flag 1",
            expected="1",
            observed=f"{reply}",
        )
        if not is_responsive(subject, line, jogs=True):
            stop(subject, line)
            return
        second = try_request(line, JOG, JogDirection.PLUS_Y)
        if second is None:
            message = "a jog during another one was not answered"
            subject.tolerate("4.28/4", "busy_reply", "silence", message)
        else:
            expect_first_reply(JOG, second)
        if second is not None and second.accepted:
            message = "another jog replaced the running one"
            subject.tolerate("4.28/4", "A-4.28-5", "replace", message)
        stop(subject, line)


@case("4.28/5", "4.17/6", hazards=_MOTION, slow=True)
def test_end_of_a_jog(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A jog continues until it is stopped, and then has at most one final result."""
    with arm_returned(subject, line):
        for _ in range(2):
            jog_somewhere(subject, line)
            wait_for_motion(subject, line)
            reply = line.ask(STOP)
            if not reply.accepted:  # it ended by itself (A-4.28-3)
                expect(
                    wait_for_result(subject, line, JOG).done is not None,
                    "a jog has no final result",
                )
                continue
            wait_for_result(subject, line, STOP)
            result = interrupted_result(line, JOG)
            expect(
                result is None or result.done is not None,
                "the final result of a jog is neither success nor failure",
                expected="11",
                observed=f"{result}",
            )
            if result is None and subject.dialect["estop_interrupted"] != "none":
                message = "the stopped jog had no final result of its own"
                subject.tolerate("4.28/5", "estop_interrupted", "none", message)
            stop_motion(subject, line)
            line.no_result(JOG, for_s=0.1)


@case("4.28/5", "4.17/6", name="limit", hazards=(Hazard.MOTION, Hazard.DESTRUCTIVE))
def test_to_the_limit(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A jog that reaches the limit of the workspace ends there, or is stopped there (A-4.28-3)."""
    if subject.access.wait_limit_s < _TRAVEL_S:
        raise CaseSkipped(
            UserMessage(
                "the case takes up to {duration_s:.0f} s: allow this duration with --patience",
                duration_s=_TRAVEL_S,
            )
        )
    with arm_returned(subject, line):
        reply = begin_jog(subject, line, JogDirection.PLUS_X)
        if not reply.accepted:
            expect_first_reply(JOG, reply)
            return
        if not is_responsive(subject, line, jogs=True):
            stop(subject, line)
            raise CaseSkipped("the robot does not reply while it executes a command (A-4-3)")
        previous, standstill = pose_of(line), Deadline(subject, _STANDSTILL_S)
        deadline = Deadline(subject, subject.longest_s)
        while line.ask("get_status").value in BUSY and not (deadline.expired or standstill.expired):
            line.wait(0.2)
            current = pose_of(line)
            if max_deviation(current, previous) > 0:
                previous, standstill = current, Deadline(subject, _STANDSTILL_S)
        if line.ask("get_status").value in BUSY:
            subject.tolerate("4.28/5", "A-4.28-3", "0x32", "a jog does not end at the limit")
            stop_reply = stop(subject, line)
            expect_accepted(STOP, stop_reply)
            return
        result = wait_for_result(subject, line, JOG)
        expect(
            result.done or result.code in ("05", "06"),
            "a jog that reached a limit ended neither with 11 nor with 00|05",
            expected="11",
            observed=f"{result}",
        )
        if not result.done:
            subject.tolerate("4.28/5", "A-4.28-6", "00|05", "a jog failed at the limit")


@case("4.28/5", "4.17/6", name="lost-link", hazards=_MOTION)
def test_lost_link(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """When its client disconnects, a jog ends, or the next client can stop it (A-2-8)."""
    subject.require_close_detection()
    require_responsive(subject, line)
    other = subject.open() if subject.supports_multiple_connections else None
    with arm_returned(subject, other or line):
        jog_somewhere(subject, line)
        line.close()
        other = other or subject.open()
        deadline = Deadline(subject, subject.ics.motion.jog_s)  # for the loss and to decelerate
        while (moving := status_of(subject, other) in BUSY) and not deadline.expired:
            other.wait(_POLL_S)
        if moving:
            stop_reply = stop(subject, other)
            if stop_reply.accepted:
                message = "a jog continues without its client"
                subject.tolerate("4.28/5", "A-2-8", "goes on", message)
            expect(
                stop_reply.accepted or status_of(subject, other) not in BUSY,
                "a jog whose client disconnected cannot be stopped by another client",
                expected="1",
                observed=f"{stop_reply}",
                requirement="4.17/6",
            )
        stop_motion(subject, other)
        previous = pose_of(other)
        other.wait(0.2)
        current = pose_of(other)
        expect(
            max_deviation(current[:3], previous[:3]) <= STANDSTILL,
            "the arm continues to move although the robot reports that nothing executes",
            expected=f"{previous}",
            observed=f"{current}",
        )


@case("4.28/7", hazards=_MOTION)
def test_no_direction(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A jog whose data is not one byte of 1 to 4 is not answered "1" and moves nothing."""
    require_command(subject, JOG)
    subject.moved = True
    with arm_returned(subject, line):
        before = joints_of(line)
        for wrong in examples(_INVALID_DIRECTIONS):
            line = ensure_open(subject, line)
            reply = try_request(line, JOG, data=wrong.data)
            expect(
                reply is None or not reply.accepted,
                UserMessage("a jog with an invalid direction was accepted: {wrong}", wrong=wrong),
                expected="0|05, or silence",
                observed=f"{reply}",
            )
            if reply is not None:
                expect_first_reply(JOG, reply)
        line = ensure_open(subject, line)
        line.wait(0.1)
        status, after = line.ask("get_status"), joints_of(line)
        expect(
            status.value not in BUSY and max_deviation(before, after) <= STANDSTILL,
            "the arm moves after a jog that was not accepted",
            expected=f"00, {before}",
            observed=f"{status.value}, {after}",
        )
    line.no_result(JOG, for_s=0)


@case("4.28/4", name="both-notations", hazards=_MOTION, slow=True)
def test_notations(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The direction is accepted as an ASCII digit, as a binary byte, or both (A-4.28-1).

    If both are accepted, they have the same meaning.
    """
    with arm_returned(subject, line):
        jog_somewhere(subject, line)
        responsive = is_responsive(subject, line, jogs=True)
        stop(subject, line)
        if not responsive:
            raise CaseSkipped("the robot does not reply while it executes a command (A-4-3)")
        request, dialect = BY_NAME[JOG].request, subject.dialect
        notations_accepted, first_moves = [], dict[JogDirection, tuple[float, float]]()
        for notation in ("ascii", "binary"):
            for direction in examples(JogDirection):
                data = request.encode(direction, dialect.replace(jog_byte=notation))
                before = pose_of(line)
                reply = try_request(line, JOG, data=data)
                if reply is not None and reply.accepted:
                    notations_accepted.append(notation)
                    wait_for_motion(subject, line)
                    stop(subject, line)
                stop_motion(subject, line)
                current = pose_of(line)
                if max_deviation(current[:2], before[:2]) >= _MIN_MOTION_MM:
                    move = current.x - before.x, current.y - before.y
                    _expect_same_direction(direction, first_moves.setdefault(direction, move), move)
        expect(
            notations_accepted,
            "a jog is accepted in neither notation",
            expected="1",
            observed="refusals",
        )
        if "ascii" not in notations_accepted:
            message = "the direction is accepted only as a binary byte"
            subject.tolerate("4.28/4", "jog_byte", "binary", message)


def _expect_same_direction(
    direction: JogDirection, first: tuple[float, float], second: tuple[float, float]
) -> None:
    """Fail the case if the two notations of a direction move the arm differently."""
    expect(
        first[0] * second[0] + first[1] * second[1] > 0,
        UserMessage(
            "a binary byte for {direction} moves the arm differently from the digit",
            direction=direction,
        ),
        expected=UserMessage("along {axis}", axis=first),
        observed=UserMessage("along {axis}", axis=second),
        requirement="4.28/3",
    )
