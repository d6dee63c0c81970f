"""Clause 4.17: the emergency stop (0x32, L356-383). It is not a safety function (A-4.17-3)."""

from contextlib import suppress
from typing import Final

import pytest

from scaraspec.judge.tolerances import STANDSTILL, max_deviation
from scaraspec.protocol.commands import MoveTarget
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.controller_under_test import MOMENT_S, ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import (
    require_pipelining,
    serves_one_at_a_time,
)
from scaraspec.suite.controller.harness.malformed.mutation_targets import GET_STATUS
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    receive_chunks,
    reconnect,
    send_chunk,
    try_chunk,
    upload,
)
from scaraspec.suite.controller.harness.requests.motion import (
    SLOWEST_PERCENT,
    arm_returned,
    begin_step_somewhere,
    joints_of,
    move_target,
    pose_of,
    same_place,
    status_after_result,
    stop_motion,
    wait_until_at_rest,
)
from scaraspec.suite.controller.harness.state_lag import TOLERATED_S
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    MOVE,
    RESET,
    RUN,
    SIMULATE,
    STATES,
    STOP,
    expect_accepted,
    require_command,
    start_program,
    upload_wait_program,
)
from scaraspec.suite.controller.harness.two_stage.performing import perform
from scaraspec.suite.controller.harness.two_stage.refusals import text_of
from scaraspec.suite.controller.harness.two_stage.results import (
    expect_success,
    interrupted_result,
    wait_for_result,
)
from scaraspec.suite.controller.harness.two_stage.tasks import Task, executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseSkipped, NoReply, expect
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.user_message import UserMessage

_SHORT_S: Final = 0.02  # a step may take only a fifth of a second
_MOTION = (Hazard.STATE, Hazard.MOTION)
_REPEATS = 15
_FILE_BYTES: Final = 450
_PAUSES_S: Final = (0.05, 0.05, 0.1, 0.8)
"""Between two checks of a stopped arm: slow motion becomes visible only after some time."""


def expect_stopped(
    subject: ControllerUnderTest, line: OutgoingConnection, reply: ReceivedFrame
) -> ReceivedFrame:
    """Fail the case unless the stop was accepted and succeeded; return its final result."""
    expect_accepted(STOP, reply)
    expect(
        text_of(reply) == b"1",
        "the first reply to the stop is not just the flag 1",
        expected="1",
        observed=f"{reply}",
        requirement="4.17/3",
    )
    return expect_success(subject, line, STOP)


@case("4.17/2", hazards=(Hazard.MOTION,))
def test_nothing_to_stop(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An idle robot answers "0", or follows the reading that a stop always succeeds.

    Nothing else changes. A request in the same segment after the stop is served, and a later move
    moves the arm.
    """
    require_command(subject, STOP)
    subject.moved = True
    for _ in range(3):
        reply = line.ask(STOP)
        if reply.accepted:
            subject.tolerate("4.17/2", "A-4.17-1", "always 1", "a stop of an idle robot succeeds")
            wait_for_result(subject, line, STOP)
            stop_motion(subject, line)
            continue
        expect(
            reply.accepted is False and reply.frame.data[:1] == b"0",
            "a stop of an idle robot is neither refused nor accepted",
            expected="0",
            observed=f"{reply}",
        )
    line.no_result(STOP, for_s=0.1)
    status = line.ask("get_status") if reply.accepted else _status_after_stop(subject, line)
    expect(
        status.value not in BUSY,
        "an idle robot executes something after a stop",
        expected="00",
        observed=f"{status}",
    )
    with suppress(CaseSkipped):
        _expect_move(subject, line)


def _expect_move(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Expect that a step that reports success has moved the arm.

    Raises:
        CaseSkipped: There is no room for a step, or no such command.
    """
    before = pose_of(line)
    with arm_returned(subject, line):
        _, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
        line.wait(TOLERATED_S)
        pose = pose_of(line)
        expect(
            not same_place(before, pose),
            "a move after the stop of an idle robot reports success, but the arm has not moved",
            expected=UserMessage("another pose than {pose}", pose=tuple(before)),
            observed=f"{tuple(pose)}",
            requirement="4.24/8",
        )


def _status_after_stop(subject: ControllerUnderTest, line: OutgoingConnection) -> ReceivedFrame:
    """Return the status that is requested in one segment after a stop of an idle robot."""
    if serves_one_at_a_time(subject):
        return line.ask("get_status")
    line.send_bytes(line.request(STOP).encode() + GET_STATUS)
    line.reply(STOP)
    try:
        return line.reply("get_status")
    except NoReply as error:
        error.requirement = "2/6"
        raise


@pytest.mark.parametrize("name", STATES)
@case("4.17/6", "4.17/3", "4.17/4", "4.17/8", "3/18", hazards=_MOTION)
def test_stop(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """A stop interrupts each command: "1", "11", and at most one result of the command itself.

    A reset directly after one that was stopped is not refused as busy.
    """
    with executing_task(subject, line, name, queries=False) as task:
        reply = line.ask(STOP)
        if not reply.accepted and task.finished:
            task.require_executing()
        expect(
            reply.accepted,
            UserMessage("the stop was refused while {name} executed", name=name),
            expected="1",
            observed=f"{reply}",
        )
        _skip_if_over(reply, task)
        expect_stopped(subject, line, reply)
        _expect_interrupted(line, task)
        if name == RESET:
            _expect_reset(subject, line)


def _expect_reset(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Expect that an idle robot does not refuse a reset as busy; a stop may have latched it."""
    answer = line.ask(RESET)
    if answer.accepted:
        expect_success(subject, line, RESET)
    elif answer.code in BUSY:
        expect_accepted(RESET, answer)


def _skip_if_over(reply: ReceivedFrame, task: Task) -> None:
    """Skip the case if a simulation had ended before the stop; the stop may succeed even then.

    The duration of a simulation is open (A-4.16-1, A-4.17-1).

    Raises:
        CaseSkipped: The simulation had ended.
    """
    if task.name == SIMULATE and task.finished_before(reply):
        task.require_executing()


def _expect_interrupted(line: OutgoingConnection, task: Task) -> None:
    result = interrupted_result(line, task.name)
    expect(
        result is None or not result.done or task.name == JOG,
        UserMessage("{task} ended with 11 although a stop interrupted it", task=task.name),
        expected="00|code",
        observed=f"{result}",
        requirement="4.17/8",
    )
    status = status_after_result(line)
    expect(
        status.value not in BUSY,
        UserMessage("{task} continues after the stop", task=task.name),
        expected="00",
        observed=f"{status}",
        requirement="4.17/4",
    )
    line.no_result(task.name, for_s=0)


@pytest.mark.parametrize("name", [RUN, SIMULATE, MOVE])
@case("4.17/6", "4.17/3", "4.17/8", name="at-once", hazards=_MOTION)
def test_stop_right_after_start(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    """A stop that is sent before the reply to the start stops the command that was started."""
    require_pipelining(subject)
    perform(subject, line, name)
    with arm_returned(subject, line):
        value = (
            _step_there_and_back(subject, line)
            if name == MOVE
            else upload_wait_program(subject, line)
        )
        subject.moved = True
        start, stop = line.request(name, value), line.request(STOP)
        line.send_bytes(start.encode() + stop.encode())
        expect_accepted(name, line.reply(name))
        try:
            reply = line.reply(STOP)
        except NoReply:
            message = "a request sent before the reply to the previous one was lost"
            subject.tolerate("4.17/6", "pipelining", "one", message)
            reply = line.ask(STOP)
        task = Task(name, line)
        if not reply.accepted and task.finished:
            task.require_executing()
        _skip_if_over(reply, task)
        expect_stopped(subject, line, reply)
        _expect_interrupted(line, task)


def _step_there_and_back(subject: ControllerUnderTest, line: OutgoingConnection) -> MoveTarget:
    """Return a step that the arm can make, found by making it, and move back."""
    with arm_returned(subject, line):
        pose, reply = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, reply)
        expect_success(subject, line, MOVE)
    return move_target(pose, SLOWEST_PERCENT)


@case("4.17/6", "4.17/3", "4.17/4", name="in-transfers", hazards=_MOTION)
def test_stop_within_a_transfer(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A stop interrupts a program between two chunks of an upload and of a download."""
    name, stopped = subject.new_name(), False
    upload(line, name, content_of(_FILE_BYTES))
    for downloads in examples((False, True)):
        with executing_task(subject, line, RUN) as task:
            opening = "download_name" if downloads else "upload_name"
            if line.ask(opening, data=name if downloads else subject.new_name()).accepted:
                received = receive_chunks(line)
                first, *others = chunks_of(content_of(_FILE_BYTES))
                if downloads:
                    next(received)
                else:
                    send_chunk(line, first)
                reply = line.ask(STOP)
                if not reply.accepted and task.finished:
                    task.require_executing()
                expect(
                    reply.accepted,
                    "the stop of a program was refused between two chunks of a file",
                    expected="1",
                    observed=f"{reply}",
                )
                expect_stopped(subject, line, reply)
                if status_after_result(line).value in BUSY:  # perhaps due to the transfer (A-5-17)
                    with suppress(NoReply):
                        _ = list(received) if downloads else [try_chunk(line, c) for c in others]
                _expect_interrupted(line, task)
                stopped = True
        line = reconnect(subject, line)
    if not stopped:
        raise CaseSkipped("no file can be uploaded or downloaded while a program runs")


@case("4.17/4", "3/18", name="twice", hazards=_MOTION)
def test_stop_twice(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Two stops without a pause get two replies, and one final result for each reply that is "1".

    A later run ends exactly once.
    """
    with executing_task(subject, line, RUN, queries=False):
        line.send(STOP)
        line.send(STOP)
        replies = [line.reply(STOP)]
        try:
            replies.append(line.reply(STOP))
        except NoReply:
            message = "a request sent before the reply to the previous one was lost"
            subject.tolerate("4.17/4", "pipelining", "one", message)
        expect(
            replies[0].accepted,
            "the first of two stops was refused while a program ran",
            expected="1",
            observed=f"{replies[0]}",
            requirement="4.17/6",
        )
        for reply in replies:
            if reply.accepted:
                expect_success(subject, line, STOP)
        line.no_result(STOP, for_s=0.1)
    start_program(subject, line, RUN, seconds=0)
    expect_success(subject, line, RUN)
    line.no_result(RUN, for_s=0.1, requirement="3/18")  # of the run that was stopped


@case("4.17/3", name="again", hazards=_MOTION)
def test_repeated_stops(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program can be stopped each time it is run; each run starts from the beginning.

    Every second stop comes from another client; the result of the program is not only sent to it.
    """
    with executing_task(subject, line, RUN, queries=False):  # it determines the layout
        pass
    program = upload_wait_program(subject, line)
    other = subject.open() if subject.supports_multiple_connections else line
    for number in range(_REPEATS):
        stopping = other if number % 2 else line
        expect_accepted(RUN, line.ask(RUN, program))
        expect_stopped(subject, stopping, stopping.ask(STOP))
        if interrupted_result(line, RUN) is None and stopping is not line:
            other.no_result(RUN, for_s=0, requirement="3/16")
        running = line.ask("get_running_program")
        expect(
            running.value is None,
            "a stopped program is still reported as running",
            expected="0",
            observed=f"{running}",
            requirement="4.9/6",
        )
        stop_motion(subject, line)


@pytest.mark.parametrize("name", [MOVE, JOG])
@case("4.17/7", hazards=_MOTION)
def test_standstill(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """After the "11" of a stop, the joints stay where the stop stopped them."""
    with executing_task(subject, line, name, queries=False) as task:
        line.wait(_SHORT_S)
        reply = line.ask(STOP)
        if not reply.accepted:
            task.require_executing()
        expect_stopped(subject, line, reply)
        line.wait(TOLERATED_S)
        stopped_joints, stopped_pose = joints_of(line), pose_of(line)
        for pause_s in _PAUSES_S:
            line.wait(pause_s)
            joints, pose = joints_of(line), pose_of(line)
            expect(
                max_deviation(stopped_joints, joints) <= STANDSTILL
                and same_place(stopped_pose, pose),
                "the arm continues to move after the emergency stop",
                expected=UserMessage(
                    "{joints} at {pose}", joints=tuple(stopped_joints), pose=tuple(stopped_pose)
                ),
                observed=UserMessage("{joints} at {pose}", joints=tuple(joints), pose=tuple(pose)),
            )


@case("4.17/8", name="results", hazards=_MOTION, slow=True)
def test_interrupted_results(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An interrupted command fails or has no result, and no success arrives later."""
    for name in examples((RUN, RESET, MOVE)):
        with executing_task(subject, line, name, queries=False) as task:
            reply = line.ask(STOP)
            if not reply.accepted:
                continue
            expect_success(subject, line, STOP)
            _expect_interrupted(line, task)
            wait_until_at_rest(subject, line)
            line.no_result(name, for_s=MOMENT_S)
