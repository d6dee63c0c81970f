"""Clause 4.24: "setting" the tool coordinates moves the arm (0x39, L481-516; A-4.24-1)."""

from typing import Final

import pytest
from hypothesis import strategies as st

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import MOMENT_S, ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    AXES,
    REACHED,
    SLOWEST_PERCENT,
    arm_returned,
    ask_move,
    begin_step,
    begin_step_somewhere,
    joints_of,
    move_target,
    pose_between,
    pose_deviation,
    pose_of,
    same_place,
    stop_motion,
)
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.controller.harness.two_stage.commands import (
    MOVE,
    expect_accepted,
    require_command,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.performing import perform
from scaraspec.suite.controller.harness.two_stage.refusals import expect_first_reply, text_of
from scaraspec.suite.controller.harness.two_stage.results import expect_success, wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import probe_responsiveness
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.MOTION,)
_UNREACHABLE_MM: Final = 1_000_000.0
_WRAPPED_MM: Final = 2.0**16
_UNREACHABLE_CODES: Final = ("05", "06")


def _unreachable_poses(pose: Pose) -> list[Pose]:
    """Return unreachable poses in each direction (4.24/9); one is reachable modulo 16 bits."""
    far_poses = [
        pose._replace(**{axis: value})
        for axis in ("x", "y", "z")
        for value in (_UNREACHABLE_MM, -_UNREACHABLE_MM)
    ]
    return [*far_poses, pose._replace(x=pose.x + _WRAPPED_MM)]


def _outcome(
    subject: ControllerUnderTest, line: OutgoingConnection, reply: ReceivedFrame
) -> ReceivedFrame:
    """Return the outcome of a move: its refusal or its final result."""
    return wait_for_result(subject, line, MOVE) if reply.accepted else reply


@case("4.24/3", "4.24/4", hazards=_MOTION)
def test_impossible_moves(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An impossible move is refused with "0|code", four bytes in a frame of that length."""
    require_command(subject, MOVE)
    with arm_returned(subject, line) as pose:
        for target_pose in examples(_unreachable_poses(pose)):
            reply = ask_move(subject, line, target_pose, SLOWEST_PERCENT)
            expect(
                not line.invalid_bytes,
                "the refusal of a move is not a frame of its stated length",
                expected="CC 39 04 30 7C 30 35 AA",
                observed=" ".join(invalid.data.hex(" ") for invalid in line.invalid_bytes),
                requirement="4.24/4",
            )
            if reply.accepted:  # A-4.24-5: it may be detected later
                result = wait_for_result(subject, line, MOVE)
                message = "an impossible move was accepted and failed later"
                subject.tolerate(
                    "4.24/3", "A-4.24-5", UserMessage("{code}", code=result.code), message
                )
                continue
            expect_first_reply(MOVE, reply)
            without_code = text_of(reply) == b"0"
            expect(
                without_code or (reply.code is not None and len(text_of(reply)) == 4),
                "the refusal of a move is not 0|code",
                expected="0|05",
                observed=f"{reply}",
            )
            if without_code:
                subject.tolerate("4.24/3", "err_bare0", "0", "the refusal of a move has no code")


@case("4.24/9", hazards=_MOTION)
def test_unreachable_targets(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A target a kilometer away is refused or fails with 05 or 06, and the arm does not move."""
    require_command(subject, MOVE)
    with arm_returned(subject, line) as pose:
        for target_pose in examples(_unreachable_poses(pose)):
            reply = _outcome(subject, line, ask_move(subject, line, target_pose, SLOWEST_PERCENT))
            without_code = reply.accepted is False and text_of(reply) == b"0"  # err_bare0
            expect(
                without_code or (not reply.done and reply.code in _UNREACHABLE_CODES),
                "an unreachable target is not refused with 05 or 06",
                expected="0|05 or 0|06",
                observed=f"{reply}",
            )
        current = pose_of(line)
        expect(
            max_deviation(current[:3], pose[:3]) < _UNREACHABLE_MM / 2,
            "the arm reports an impossible position",
            expected=f"{pose}",
            observed=f"{current}",
        )


@case("4.24/5", "4.24/6", "4.24/8", hazards=_MOTION)
def test_every_speed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A move to the current pose succeeds at every speed from 1 to 100 %, and ends there."""
    require_command(subject, MOVE)
    gripper = line.ask("get_gripper_center").value
    with arm_returned(subject, line) as pose:

        def move_and_check(speed_percent: int) -> None:
            reply = expect_accepted(MOVE, ask_move(subject, line, pose, speed_percent))
            expect(
                text_of(reply) == b"1",
                "the first reply to a move is not just the flag 1",
                expected="1",
                observed=f"{reply}",
            )
            expect_success(subject, line, MOVE)
            _expect_reached(subject, line, pose, gripper)

        for speed_percent in examples((1, 2, 9, 10, 99, 100)):
            move_and_check(speed_percent)
        given(st.integers(1, 100))(move_and_check)()


@pytest.mark.parametrize("axis", AXES)
@case("4.24/8", "4.24/5", "4.24/6", "4.27/6", hazards=_MOTION)
def test_there_and_back(subject: ControllerUnderTest, line: OutgoingConnection, axis: str) -> None:
    """A step along one axis, and the step back, end at the commanded pose."""
    require_command(subject, MOVE)
    probe_responsiveness(subject, line)
    gripper = line.ask("get_gripper_center").value
    with arm_returned(subject, line) as pose:
        before = joints_of(line)
        target_pose, reply = begin_step(subject, line, axis)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
        _expect_reached(subject, line, target_pose, gripper)
        after = joints_of(line)
        expect(
            max_deviation(before, after) > 0 or pose_deviation(pose_of(line), pose) <= STANDSTILL,
            "the tool moved but no joint did",
            expected="other joint angles",
            observed=f"{after}",
            requirement="4.27/6",
        )
        expect_accepted(MOVE, ask_move(subject, line, pose))
        expect_success(subject, line, MOVE)
        _expect_reached(subject, line, pose, gripper)


def _expect_reached(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    target_pose: Pose,
    gripper: tuple[float, ...] | None,
) -> None:
    current = pose_of(line)
    deviation = pose_deviation(current, target_pose)
    if deviation > REACHED and (gripper is None or any(gripper)):
        message = "the reached pose is not the commanded one"
        subject.tolerate("4.24/8", "A-4.23-1", "another point", message)
        return
    expect(
        deviation <= REACHED,
        "the reached pose is not the commanded one",
        expected=f"{target_pose}",
        observed=f"{current}",
        requirement="4.24/8",
    )


@case("4.24/8", name="in-between", hazards=_MOTION, slow=True)
def test_fractions(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Targets with decimals are reached one after another."""
    require_command(subject, MOVE)
    probe_responsiveness(subject, line)
    gripper = line.ask("get_gripper_center").value
    with arm_returned(subject, line) as pose:
        target_pose, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
        for fraction in examples((0.25, 0.5, 0.875, 1.0)):
            between = pose_between(pose, target_pose, fraction)
            expect_accepted(MOVE, ask_move(subject, line, between))
            expect_success(subject, line, MOVE)
            _expect_reached(subject, line, between, gripper)


@case("4.24/3", "4.24/10", name="malformed", hazards=_MOTION)
def test_malformed_requests(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A request that is not seven numbers is refused or not answered, and moves nothing."""
    require_command(subject, MOVE)
    subject.moved = True
    with arm_returned(subject, line) as pose:
        rounded_pose = pose._replace(**{axis: round(getattr(pose, axis), 1) for axis in AXES})
        malformed_requests = [
            request
            for request in malformed(
                MOVE, move_target(rounded_pose, SLOWEST_PERCENT), subject.dialect
            )
            if request.firm
        ]
        for wrong in examples(malformed_requests):
            line = ensure_open(subject, line)
            reply = try_request(line, MOVE, data=wrong.data)
            if reply is None:
                continue
            if not reply.accepted:
                expect_first_reply(MOVE, reply)
                continue
            stop_motion(subject, line)  # a missing coordinate may be read as 0, far away
            message = UserMessage("a malformed request ({wrong}) moved the arm", wrong=wrong)
            _expect_unmoved(line, pose, rounded_pose, message)
            raise CaseFailed(
                UserMessage("a request that is {wrong} was accepted", wrong=wrong),
                expected="0|05, or silence",
                observed=f"{reply}",
                requirement="4.24/10",
            )
        line = ensure_open(subject, line)
        line.wait(MOMENT_S)  # a move may begin late and without a reply
        stop_motion(subject, line)
        status = line.ask("get_status")
        expect(
            status.value not in BUSY,
            "the robot executes something after malformed requests",
            expected="00",
            observed=f"{status}",
        )
        _expect_unmoved(line, pose, rounded_pose, "malformed requests moved the arm")
    perform(subject, ensure_open(subject, line), MOVE)


def _expect_unmoved(line: OutgoingConnection, pose: Pose, rounded_pose: Pose, message: str) -> None:
    current = pose_of(line)
    expect(
        same_place(current, pose) or pose_deviation(current, rounded_pose) <= STANDSTILL,
        message,
        expected=f"{pose}",
        observed=f"{current}",
    )
