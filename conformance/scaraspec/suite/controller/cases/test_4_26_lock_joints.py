"""Clause 4.26: lock the joints (0x3B, L551-582)."""

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import joints_of
from scaraspec.suite.controller.harness.two_stage.commands import (
    LOCK,
    MOVE,
    RELEASE,
    begin,
    require_command,
)
from scaraspec.suite.controller.harness.two_stage.performing import perform
from scaraspec.suite.controller.harness.two_stage.refusals import expect_first_reply, text_of
from scaraspec.suite.controller.harness.two_stage.results import (
    expect_success,
    locked_afterwards,
    release_joints,
    wait_for_result,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect

_MOTION = (Hazard.MOTION,)


@case("4.26/2", hazards=_MOTION)
def test_first_reply(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """If joints are released, a lock is answered "1"; if they are locked, "1" or "0|code"."""
    require_command(subject, LOCK, RELEASE)
    subject.moved = True
    second = line.ask(LOCK)
    expect_first_reply(LOCK, second)
    if second.accepted:
        wait_for_result(subject, line, LOCK)
    else:
        subject.tolerate("4.26/2", "A-4.25-3", "0|code", "a lock of locked joints was refused")
    with locked_afterwards(subject, line):
        release_joints(subject, line)
        reply = begin(subject, line, LOCK)
        expect(
            text_of(reply) == b"1",
            "the first reply to a lock is not just the flag 1",
            expected="1",
            observed=f"{reply}",
        )
        expect_success(subject, line, LOCK)


@case("4.26/3", hazards=_MOTION)
def test_end_of_a_lock(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A lock ends with "11", and the arm can be moved after it."""
    require_command(subject, LOCK, RELEASE)
    with locked_afterwards(subject, line):
        for _ in range(2):
            release_joints(subject, line)
            begin(subject, line, LOCK)
            expect_success(subject, line, LOCK)
            perform(subject, line, MOVE)


@case("4.26/5", hazards=_MOTION)
def test_locked_joints_stay(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After a lock that ended with "11", the joint angles do not change."""
    require_command(subject, LOCK, RELEASE)
    with locked_afterwards(subject, line):
        release_joints(subject, line)
        begin(subject, line, LOCK)
        expect_success(subject, line, LOCK)
    first = joints_of(line)
    for pause_s in (0.0, 0.1, 0.3):
        line.wait(pause_s)
        current = joints_of(line)
        expect(
            max_deviation(first, current) <= STANDSTILL,
            "the joint angles changed although the joints are locked",
            expected=f"{first}",
            observed=f"{current}",
        )
