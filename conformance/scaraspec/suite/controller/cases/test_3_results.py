"""Clause 3: final results of two-stage commands: tagged, after the first reply, exactly one.

The effect of a command is judged in its own clause. Here each command is only executed to its end.
"""

from typing import Any, Final

import pytest

from scaraspec.protocol.commands import BY_NAME, MoveTarget
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import TAG
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import FinalResult
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    arm_returned,
    begin_step_somewhere,
    is_responsive,
)
from scaraspec.suite.controller.harness.requests.queries import ask_all
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    MOVE,
    RUN,
    SIMULATE,
    STOP,
    TWO_STAGE,
    expect_accepted,
    harmless_requests,
    require_command,
    start_program,
    try_request,
)
from scaraspec.suite.controller.harness.two_stage.performing import perform
from scaraspec.suite.controller.harness.two_stage.results import wait_for_result
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task, probe_responsiveness
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply, expect
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.user_message import UserMessage

_MOTION: Final = (Hazard.MOTION, Hazard.STATE)
_WAIT_S: Final = 0.4  # wait for a second result
_RUNS: Final = 12
_UNREACHABLE: Final = MoveTarget(1, 9e5, 9e5, 9e5, 0.0, 0.0, 0.0)


# ---------------------------------------------------------------------- one tagged result


@pytest.mark.parametrize("name", TWO_STAGE)
@case("3/12", "3/14", "3/16", "3/18", hazards=_MOTION)
def test_one_tagged_result(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    """A command ends with one final result, which has the tag and follows the first reply."""
    try:
        execution = perform(subject, line, name)
    finally:
        line.finish()  # a different tag changes the length
        _expect_no_untagged_result(subject, name)
    first, result = execution.first, execution.result
    if result is None:
        return
    expect(
        first.seen.place.offset_bytes < result.seen.place.offset_bytes,
        UserMessage("the final result of {name} arrived before its first reply", name=name),
        expected="the first reply first",
        observed="the final result first",
        requirement="3/16",
    )
    line.inbox[:0] = line.sync()
    message = UserMessage("{name} ended a second time", name=name)
    _expect_no_result(line, name, message, "3/18")


@case("3/18", name="twice", hazards=_MOTION)
def test_no_second_result(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No command has a second final result, also after a wait."""
    names = [name for name in TWO_STAGE if name not in subject.ics.unsupported]
    for name in names:
        perform(subject, line, name)
        line.inbox.clear()
    line.wait(_WAIT_S)
    for name in names:
        message = UserMessage("{name} ended a second time", name=name)
        _expect_no_result(line, name, message, "3/18")


def _expect_no_untagged_result(subject: ControllerUnderTest, name: str) -> None:
    """Fail the case if a recent frame or invalid bytes are a final result without its tag."""
    opcode = BY_NAME[name].opcode
    for received in subject.observer.recent:
        if received.place.direction is C2A and _is_untagged_result(received, opcode):
            raise CaseFailed(
                UserMessage("the final result of {name} has no tag", name=name),
                expected=f"{TAG:02X} {opcode:02X}",
                observed=f"{received.frame}"
                if isinstance(received, FrameSeen)
                else show(received.data[:8]),
                requirement="3/12",
            )


def _is_untagged_result(received: FrameSeen | InvalidBytes, opcode: int) -> bool:
    """Whether it is a final result without the tag, with another tag, or with a misplaced one."""
    if isinstance(received, FrameSeen):
        frame = received.frame
        return frame.opcode == opcode and not frame.tagged and _is_final_result(frame.data)
    header, data = received.data[1:3], received.data[4 : 4 + sum(received.data[3:4])]
    has_end_byte = received.data[4 + len(data) : 5 + len(data)] == bytes((C2A.end,))
    return opcode in header and has_end_byte and _is_final_result(data)


def _is_final_result(data: bytes) -> bool:
    return FinalResult().decode(data).value is not None


def _expect_no_result(line: OutgoingConnection, name: str, message: str, requirement: str) -> None:
    for received in line.inbox:
        if _is_result(received, name):
            raise CaseFailed(
                message, expected="no result", observed=f"{received.frame}", requirement=requirement
            )


def _is_result(received: FrameSeen, name: str) -> bool:
    return received.frame.tagged and received.frame.opcode == BY_NAME[name].opcode


@case("3/14")
def test_untagged_queries(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The replies to queries have no tag; a tagged one is undocumented (A-3-6)."""
    try:
        ask_all(subject, line)
    except NoReply:
        tagged = next((received for received in line.inbox if received.frame.tagged), None)
        if tagged is None:
            raise
        raise CaseFailed(
            "a query was answered with the tag of final results",
            expected="no tag",
            observed=f"{tagged.frame}",
        ) from None


@case("3/18", "3/16", name="again", hazards=_MOTION)
def test_repeated_runs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program that runs a dozen times, with queries during the runs, has one result per run."""
    probe_responsiveness(subject, line)
    program = start_program(subject, line, RUN, 0).program
    wait_for_result(subject, line, RUN)
    for _ in range(_RUNS):
        first = line.ask(RUN, program)
        expect(first.accepted, "a program that ran before was refused", requirement="4.15/4")
        if is_responsive(subject, line):
            line.ask("get_status")
        result = wait_for_result(subject, line, RUN)
        expect(
            first.seen.place.offset_bytes < result.seen.place.offset_bytes,
            "a final result arrived before its first reply",
            requirement="3/16",
        )
        line.inbox[:0] = line.sync()
        _expect_no_result(line, RUN, "a run ended a second time", "3/18")


@case("3/18", name="own-connection", hazards=_MOTION)
def test_result_on_own_connection(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """With another client connected, the final result arrives on the connection of its request."""
    subject.require_multiple_connections()
    other = subject.open()
    probe_responsiveness(subject, line)
    with arm_returned(subject, line):
        _, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        if is_responsive(subject, other):
            other.ask("get_status")
        wait_for_result(subject, line, MOVE)
        other.sync()


# ---------------------------------------------------------------------- no result


@case("3/17", hazards=_MOTION, slow=True)
def test_no_result_after_refusal(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Refused commands (missing program, unreachable pose, invalid jog) have no final result."""
    subject.moved = True
    missing = subject.new_name()
    requests: list[tuple[str, Any, bytes | None]] = [
        (RUN, missing, None),
        (SIMULATE, missing, None),
        (MOVE, _UNREACHABLE, None),
        (JOG, None, b"9"),
        (STOP, None, None),
    ]
    refused = []
    for name, value, data in examples(requests):
        if name in subject.ics.unsupported:
            continue
        line = ensure_open(subject, line)
        reply = try_request(line, name, value, data=data)
        if reply is None or reply.accepted is False:
            refused.append(name)
    _expect_no_results(ensure_open(subject, line), refused)


@case("3/17", name="busy", hazards=_MOTION, slow=True)
def test_no_result_after_refusal_while_busy(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """Commands that are refused while a program runs have no final result."""
    if subject.dialect["busy_reply"] == "queue":
        raise CaseSkipped("the ICS claims that requests are queued while the controller is busy")
    require_command(subject, RUN)
    requests = harmless_requests(subject, line)
    with executing_task(subject, line, RUN) as task:
        refused = []
        for name, value in requests.items():
            reply = try_request(line, name, value)
            task.require_executing()
            if name != RUN and (reply is None or reply.accepted is False):
                refused.append(name)
    _expect_no_results(line, refused)


def _expect_no_results(line: OutgoingConnection, names: list[str]) -> None:
    line.wait(_WAIT_S)
    for name in names:
        message = UserMessage("a final result of {name} arrived although it was refused", name=name)
        _expect_no_result(line, name, message, "3/17")
