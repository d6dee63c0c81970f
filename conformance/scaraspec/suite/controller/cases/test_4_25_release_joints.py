"""Clause 4.25: release the joints (0x3A, L518-549). The cases lock them again immediately."""

import pytest

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.two_stage.commands import (
    LOCK,
    MOVE,
    RELEASE,
    RUN,
    STATES,
    require_command,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.performing import perform
from scaraspec.suite.controller.harness.two_stage.refusals import expect_first_reply, text_of
from scaraspec.suite.controller.harness.two_stage.results import (
    locked_afterwards,
    release_joints,
    wait_for_result,
)
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.STATE, Hazard.MOTION)


@case("4.25/2", "4.25/3", hazards=_MOTION)
def test_first_reply(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A release is answered "1", and again "1" or "0|code". Each "1" has a final result."""
    require_command(subject, RELEASE, LOCK)
    with locked_afterwards(subject, line):
        reply, result = release_joints(subject, line)
        expect(
            text_of(reply) == b"1",
            "the first reply to a release is not just the flag 1",
            expected="1",
            observed=f"{reply}",
        )
        second = try_request(line, RELEASE)
        if second is not None:
            expect_first_reply(RELEASE, second)
            if second.accepted is False:
                message = "a release of released joints was refused"
                subject.tolerate("4.25/2", "A-4.25-3", "0|code", message)
            elif result is not None:  # it does not wait until the joints are locked (A-4.25-2)
                wait_for_result(subject, line, RELEASE)


@case("4.25/3", hazards=_MOTION)
def test_end_of_a_release(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A release ends with "11", immediately or when the joints are locked again (A-4.25-2)."""
    require_command(subject, RELEASE, LOCK)
    for _ in range(2):
        execution = perform(subject, line, RELEASE)
        result = execution.result
        expect(
            result is not None and text_of(result) == b"11",
            "a release does not end with success",
            expected="11",
            observed=f"{result}",
        )
    perform(subject, line, MOVE)


@pytest.mark.parametrize("name", STATES)
@case("4.25/5", hazards=_MOTION)
def test_not_during_motion(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    """A release during a program or a move is refused, and is not executed later."""
    require_command(subject, RELEASE, LOCK)
    if subject.dialect["busy_reply"] == "queue":
        return
    with locked_afterwards(subject, line), executing_task(subject, line, name) as task:
        reply = try_request(line, RELEASE)
        task.require_executing()
        expect(
            reply is None or not reply.accepted,
            UserMessage("the joints were released while {name} executed", name=name),
            expected=f"0|{task.state}",
            observed=f"{reply}",
        )
        if reply is not None:
            expect_first_reply(RELEASE, reply)
    if name == RUN:
        perform(subject, line, MOVE)
