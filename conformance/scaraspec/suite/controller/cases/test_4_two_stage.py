"""Clause 4: common rules of two-stage commands (0x30 to 0x33, 0x39 to 0x3B, 0x3D; L304-637)."""

from collections.abc import Sequence

import pytest

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Outcome
from scaraspec.protocol.transfer import BUFFER_BYTES, chunks_of
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    leftover_content,
    receive_chunks,
    send_chunk,
    upload,
)
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    SLOWEST_PERCENT,
    arm_returned,
    begin_step_somewhere,
    move_target,
    neighbours,
    pose_of,
    require_known_responsive,
    same_place,
    status_at_rest,
    stop,
    stop_motion,
)
from scaraspec.suite.controller.harness.requests.queries import (
    QUERIES,
    Query,
    some_queries,
    supported_queries,
    wait_for_replies,
)
from scaraspec.suite.controller.harness.timeouts import ExpectedReply
from scaraspec.suite.controller.harness.two_stage.commands import (
    BRIEFLY_S,
    JOG,
    LOCK,
    MOVE,
    RESET,
    RUN,
    SIMULATE,
    STATES,
    STOP,
    TWO_STAGE,
    begin,
    expect_accepted,
    harmless_requests,
    require_command,
    start_program,
    try_request,
    upload_wait_program,
)
from scaraspec.suite.controller.harness.two_stage.performing import expect_standstill, perform
from scaraspec.suite.controller.harness.two_stage.refusals import (
    expect_busy,
    expect_failure,
    expect_first_reply,
    expect_refusal,
    text_of,
)
from scaraspec.suite.controller.harness.two_stage.results import (
    expect_success,
    interrupted_result,
    wait_for_result,
)
from scaraspec.suite.controller.harness.two_stage.tasks import (
    executing_task,
    initial_position_at_pose,
    probe_responsiveness,
    require_responsive,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseSkipped,
    EndedTooSoon,
    NoReply,
    expect,
    expect_equal,
    expect_in,
)
from scaraspec.suite.engine.file_contents import content_of
from scaraspec.suite.program_files.bench import bench
from scaraspec.suite.program_files.writing import wait
from scaraspec.user_message import UserMessage

_MOTION = (Hazard.STATE, Hazard.MOTION)
_WAIT_S = 0.5
_CHUNKS_BYTES = 450
_LONG_BYTES = 2_000
_END_TIMEOUT_S = 10.0
_POLL_S = 0.1
_POLLS = 10
_SIMULTANEOUS_S = 0.05
_BRIEF_S = 0.01  # every homing motion takes longer
_DELAY_FACTOR = 5  # times the reply time of a query
_NS_PER_S = 1e9


# ---------------------------------------------------------------------- first replies and results


@pytest.mark.parametrize("name", TWO_STAGE)
@case("4/1", "4/2", "3/16", "3/18", hazards=_MOTION)
def test_one_reply_and_one_result(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    """A possible command is answered "1", and ends once, with "11" or a failure."""
    execution = perform(subject, line, name)
    expect_first_reply(name, execution.first)
    if execution.result is not None and execution.result.done is not False:
        expect(
            text_of(execution.result) == b"11",
            UserMessage("the final result of {name} is neither success nor failure", name=name),
            expected="11",
            observed=f"{execution.result}",
            requirement="4/2",
        )
    line.inbox[:0] = line.sync()
    line.no_result(name, for_s=0)


@case("4/2", "3/18", name="in-transfers", hazards=_MOTION, slow=True)
def test_result_in_transfers(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program that ends during an upload or a download has its final result."""
    content = content_of(_LONG_BYTES)
    with bench(subject, line) as robot:
        pause_s = 2 * robot.ours_s(1) / len(content) * BUFFER_BYTES

        def pause() -> None:
            if not any(received.frame.tagged for received in line.inbox):
                line.wait(pause_s)

        name, ended = subject.new_name(), False
        upload(line, name, content)
        for downloads in examples((False, True)):
            robot.start(wait(1))
            require_known_responsive(subject, line)
            opening = "download_name" if downloads else "upload_name"
            if not line.ask(opening, data=name if downloads else subject.new_name()).accepted:
                robot.stop()
                continue
            if downloads:
                for _ in receive_chunks(line):
                    pause()
            else:
                for chunk in chunks_of(content):
                    pause()
                    send_chunk(line, chunk)
            robot.finish()
            ended = True
        if not ended:
            raise CaseSkipped("no file can be uploaded or downloaded while a program runs")


@case("4/1", "3/17", name="refused", hazards=_MOTION)
def test_refusals_have_no_result(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A refusal is "0|code", or "0" for the stop. No final result follows it."""
    subject.moved = True
    refused = []
    for name in examples((RUN, SIMULATE, STOP)):
        reply = line.ask(name, None if name == STOP else subject.new_name())
        expect_first_reply(name, reply)
        if reply.accepted:  # A-4.15-1, A-4.17-1
            wait_for_result(subject, line, name)
        else:
            refused.append(BY_NAME[name].opcode)
    line.wait(MOMENT_S)
    tagged = [
        received
        for received in line.sync()
        if received.frame.tagged and received.frame.opcode in refused
    ]
    expect(
        not tagged,
        "a final result arrived although the command was refused",
        expected="none",
        observed=" ".join(f"{received.frame}" for received in tagged),
        requirement="3/17",
    )


@case("4/3", "4/5", name="stopped", hazards=_MOTION)
def test_stopped_commands_fail(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A command that an emergency stop ends fails with "00|code", or has no result of its own."""
    for name in examples(name for name in STATES if name not in {JOG, *subject.ics.unsupported}):
        with executing_task(subject, line, name, queries=False) as task:
            task.require_executing()
            stop(subject, line)
            result = interrupted_result(line, name)
            if result is not None and result.done is not True:
                expect(
                    isinstance(result.value, Outcome) and len(text_of(result)) == 5,
                    UserMessage("the failure of {name} is not 00|code", name=name),
                    expected="00|code",
                    observed=f"{result}",
                    requirement="4/3",
                )
                expect_failure(subject, result)


@case("4/3", "4/5", name="fault", needs=("motor_fault", "clear_faults"), hazards=_MOTION)
def test_a_fault_fails_the_run(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A run whose motor fails ends with "00|code", and the code names the motor."""
    try:
        with executing_task(subject, line, RUN):
            subject.hook("motor_fault", joints="outer_arm")
            result = wait_for_result(subject, line, RUN)
            expect(
                result.done is False and len(text_of(result)) == 5,
                "a run whose motor failed did not fail",
                expected="00|12",
                observed=f"{result}",
                requirement="4/3",
            )
            expect(
                result.code == "12",
                "the code of the failure does not name the outer arm",
                expected="00|12",
                observed=f"{result}",
                requirement="4/5",
            )
            _clear_faults(subject, line)
    finally:
        subject.hook("clear_faults")


def _clear_faults(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Clear the faults, and reset the robot if it still reports one."""
    subject.hook("clear_faults")
    if line.ask("get_status").value != IDLE and line.ask(RESET).accepted:
        wait_for_result(subject, line, RESET)


def _immediate_result(line: OutgoingConnection, name: str) -> ReceivedFrame | None:
    try:
        return line.result(name, within_s=SILENCE_S)
    except NoReply:
        return None


@pytest.mark.parametrize(
    ("fault", "code"), [("position_fault", "05"), ("angle_fault", "06"), ("motor_fault", "11")]
)
@case(
    "4/4",
    hazards=_MOTION,
    needs=("position_fault", "angle_fault", "motor_fault", "clear_faults"),
    attended=True,
)
def test_faults_refuse(
    subject: ControllerUnderTest, line: OutgoingConnection, fault: str, code: str
) -> None:
    """A robot with a fault refuses motion commands with the code of its fault."""
    values = harmless_requests(subject, line)
    subject.moved = True
    try:
        subject.hook(fault, **({"joints": "inner_arm"} if fault == "motor_fault" else {}))
        for name in (name for name in (RUN, MOVE, JOG) if name in values):
            first = line.ask(name, values[name])
            outcome = _immediate_result(line, name) if first.accepted else first
            without_code = name == MOVE and text_of(first) == b"0"  # err_bare0
            expect(
                without_code or (outcome is not None and not outcome.done and outcome.code == code),
                UserMessage(
                    "a robot with the fault {code} does not refuse {name} with this code",
                    code=code,
                    name=name,
                ),
                expected=f"0|{code}",
                observed=f"{first}",
            )
            if first.accepted:
                message = UserMessage(
                    "{name} was accepted and failed because of an earlier fault", name=name
                )
                subject.tolerate("4/4", "A-4-1", UserMessage("00|{code}", code=code), message)
    finally:
        _clear_faults(subject, line)


@case("4/4", name="missing", hazards=_MOTION)
def test_code_of_a_refusal(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A refusal has a code of table 8-1 that is allowed for refusals."""
    for name in examples((RUN, SIMULATE)):
        reply = line.ask(name, subject.new_name())
        if reply.accepted:
            wait_for_result(subject, line, name)
        else:
            expect_refusal(subject, reply)


# ---------------------------------------------------------------------- a busy robot


@pytest.mark.parametrize("name", STATES)
@case("4/6", "4/15", "4/4", hazards=_MOTION)
def test_busy(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """While one command executes, every other is refused with the status that 0x09 reports.

    This also holds for requests on another connection. If the command ends too soon, the remaining
    ones are tried while it executes again.
    """
    remaining = [*harmless_requests(subject, line).items()]
    second_line = subject.open() if subject.supports_multiple_connections else line
    while remaining:
        count = len(remaining)
        with executing_task(subject, line, name) as task:
            try:
                for other, value in examples(tuple(remaining)):
                    if subject.dialect["busy_reply"] != "queue":
                        expect_busy(subject, line, task, other, value)
                        expect_busy(subject, second_line, task, other, value)
                    task.require_executing()
                    del remaining[0]
            except EndedTooSoon:
                if len(remaining) == count:
                    raise


@case("4/6", "4.24/8", name="afterwards", hazards=_MOTION, slow=True)
def test_refused_commands_are_not_queued(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A command that a busy robot did not accept is not executed later.

    It does not change the target of the arm either.
    """
    require_responsive(subject, line)
    values = harmless_requests(subject, line)
    with arm_returned(subject, line):
        _, move_reply = begin_step_somewhere(subject, line, SLOWEST_PERCENT)
        expect_accepted(MOVE, move_reply)
        refused = {
            BY_NAME[name].opcode
            for name in (RUN, MOVE, LOCK)
            if (reply := try_request(line, name, values.get(name))) is None or not reply.accepted
        }
        expect_success(subject, line, MOVE)
        line.wait(2 * MOMENT_S)
        line.ask("get_tool_coordinates")  # the judge uses the reply (4.24/8)
        delayed = [received for received in line.sync() if received.frame.opcode in refused]
    if subject.dialect["busy_reply"] == "queue":
        return
    expect(
        not delayed,
        "a command sent to a busy robot started when the robot was idle",
        expected="0|01, or no reply at all",
        observed=" ".join(f"{received.frame}" for received in delayed),
    )


@case("4/6", name="after-a-run", hazards=_MOTION, slow=True)
def test_refused_moves_stay_refused(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A move that is refused while a program runs is not made after the program ends."""
    require_responsive(subject, line)
    if subject.dialect["busy_reply"] == "queue":
        raise CaseSkipped("the controller makes the move then (busy_reply)")
    with arm_returned(subject, line) as pose:
        neighbour_poses = [
            candidate for axis in ("y", "x") for candidate in neighbours(subject, pose, axis)
        ]
        if not neighbour_poses:
            raise CaseSkipped("there is no room for a step")
        start_program(subject, line, RUN, BRIEFLY_S)
        reply = try_request(
            line, MOVE, move_target(neighbour_poses[0], subject.ics.motion.speed_percent)
        )
        expect_success(subject, line, RUN)
        if reply is not None and reply.accepted:
            expect_success(subject, line, MOVE)
            raise CaseSkipped("the move was not refused")  # other cases cover this
        message = "a move that was refused while a program ran was made after the program ended"
        expect_standstill(line, message, for_s=_WAIT_S, pose=pose)


@pytest.mark.parametrize("name", TWO_STAGE)
@case("4/7", hazards=_MOTION, slow=True)
def test_idle_afterwards(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """After a final result "11", the status is no longer that of an executing robot."""
    execution = perform(subject, line, name)
    status = execution.status
    expect(
        status.value not in BUSY,
        UserMessage(
            "the status is still {status} although {name} has ended",
            status=status.value,
            name=name,
        ),
        expected="00",
        observed=f"{status}",
    )


@pytest.mark.parametrize("name", STATES)
@case("4/8", "3/31", hazards=_MOTION)
def test_never_idle_while_executing(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    """From the first reply to the final result, no status is 00 and every query is answered."""
    with executing_task(subject, line, name) as task:
        for _ in range(_POLLS):
            status = line.ask("get_status")
            expect(
                status.value != IDLE or task.finished,
                UserMessage("the status is 00 while {name} executes", name=name),
                expected=task.state,
                observed=f"{status}",
            )
            if task.finished:
                break
            line.wait(0.01)
        for query in supported_queries(subject):
            if try_request(line, *query) is None:
                _expect_late_reply(subject, line, query, name)


def _expect_late_reply(
    subject: ControllerUnderTest, line: OutgoingConnection, query: Query, name: str
) -> None:
    """Expect a late reply to a query (3/24), after a stop, so that no jog continues."""
    stop(subject, line)
    try:
        line.reply(query.name)
    except NoReply as error:
        message = UserMessage("{error} while {name} executed", error=error, name=name)
        raise CaseFailed(message, observed=error.observed, requirement="3/31") from None


@case("4/8", "4/7", "3/18", name="to-the-end", hazards=_MOTION, slow=True)
def test_results_between_replies(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A final result between the replies to queries is one valid frame among others."""
    require_responsive(subject, line)
    for name, seconds in examples(((RUN, BRIEFLY_S), (SIMULATE, 0))):
        start_program(subject, line, name, seconds)
        opcode, due = BY_NAME[name].opcode, ExpectedReply(name, result=True)
        deadline = Deadline(subject, subject.timeout_policy.timeout_s(due, subject.longest_s))
        results: list[ReceivedFrame] = []
        while not results:
            sent = supported_queries(subject, [Query("get_status"), Query("get_time")])
            for query in sent:
                line.send(query.name)
            wait_for_replies(line, sent)
            results += [
                ReceivedFrame(received, received.value)
                for received in line.inbox
                if received.frame.tagged and received.frame.opcode == opcode
            ]
            line.wait(0.05)
            expect(
                results or not deadline.expired,
                UserMessage("no final result of {name} arrived between the replies", name=name),
                expected="11",
                observed="none",
                requirement="3/18",
            )
        expect(
            len(results) == 1 and results[0].done,
            UserMessage("{name} did not end with one success among other replies", name=name),
            expected="11",
            observed=" ".join(map(str, results)),
            requirement="3/18",
        )
        line.inbox.clear()
        status = status_at_rest(line)
        expect(
            status.value == IDLE,
            UserMessage(
                "the status is {status} although {name} has ended with success",
                status=status.value,
                name=name,
            ),
            expected=IDLE,
            observed=f"{status}",
            requirement="4/7",
        )


@case("4/8", "3/31", "3/32", "4.7/4", "5.2/12", name="queries", hazards=_MOTION)
def test_queries_while_executing(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Queries in any number and order are answered while a program runs.

    The version is the same before, during and after the run, and so is a file that is downloaded.
    """
    file, content = subject.new_name(), content_of(_CHUNKS_BYTES)
    upload(line, file, content)
    versions = [line.ask("get_version").value]

    def ask_each(queries: Sequence[Query]) -> None:
        for query in supported_queries(subject, list(queries)):
            try:
                line.ask(*query)
            except NoReply as error:
                message = UserMessage("{error} while a program ran", error=error)
                raise CaseFailed(message, observed=error.observed, requirement="3/31") from None
        expect(
            not line.invalid_bytes,
            "bytes that are not a frame arrived between replies",
            requirement="3/32",
        )

    with executing_task(subject, line, RUN):
        ask_each(QUERIES)
        given(some_queries)(ask_each)()
        fetched = leftover_content(line, file)
        versions.append(line.ask("get_version").value)
    versions.append(line.ask("get_version").value)
    message = "the version changes while a program runs, or afterwards"
    expect_equal(versions, versions[:1] * len(versions), message, requirement="4.7/4")
    if fetched is not None:
        message = "a file downloaded while a program runs differs from its content"
        expect(fetched == content, message, requirement="5.2/12")


# ---------------------------------------------------------------------- time and connection


@pytest.mark.parametrize("name", [RUN, SIMULATE, MOVE])
@case("4/14", hazards=_MOTION)
def test_reply_before_execution(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> None:
    """The first reply comes before the execution and does not wait for its end."""
    perform(subject, line, name)
    probe_responsiveness(subject, line)
    program = upload_wait_program(subject, line, 1)
    attempts = range(2)  # a packet may be lost once
    expect(
        not all(_reply_comes_at_the_end(subject, line, name, program) for _ in attempts),
        UserMessage("the first reply to {name} arrived late, with its final result", name=name),
        expected="the first reply before the execution",
        observed="both at the end of the execution",
    )


def _reply_comes_at_the_end(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, program: bytes
) -> bool:
    with arm_returned(subject, line):
        before = line.ask("get_status")
        if name == MOVE:
            _, reply = begin_step_somewhere(subject, line, SLOWEST_PERCENT)
        else:
            reply = line.ask(name, program)
        expect_accepted(name, reply)
        delayed = reply.time_s - before.time_s >= _WAIT_S
        if delayed:  # the reply may be slow for another reason
            delayed = wait_for_result(subject, line, name).time_s - reply.time_s <= _SIMULTANEOUS_S
        stop_motion(subject, line)
    return delayed


@case("4/14", name="reset", hazards=_MOTION, slow=True)
def test_reply_before_a_reset(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The first reply to a reset comes before the motion, not with the final result."""
    require_command(subject, MOVE, RESET)
    with arm_returned(subject, line), initial_position_at_pose(subject, line):
        together = [_reset_reply_comes_at_the_end(subject, line) for _ in range(2)]
        expect(
            not all(together),
            "the first reply to a reset arrived with its final result, after the motion",
            expected="the first reply before the execution",
            observed="both at the end of the motion",
        )


def _reset_reply_comes_at_the_end(subject: ControllerUnderTest, line: OutgoingConnection) -> bool:
    """Whether a reset that moves the arm is answered only after the motion."""
    expect_accepted(MOVE, begin_step_somewhere(subject, line)[1])
    expect_success(subject, line, MOVE)
    pose_before = pose_of(line)
    sent_s = subject.now_ns / _NS_PER_S
    query_s = line.ask("get_status").time_s - sent_s
    sent_s = subject.now_ns / _NS_PER_S
    reply = begin(subject, line, RESET)
    delay_s = reply.time_s - sent_s
    duration_s = wait_for_result(subject, line, RESET).time_s - reply.time_s
    delayed = delay_s > max(_BRIEF_S, _DELAY_FACTOR * query_s)
    return delayed and duration_s < _BRIEF_S and not same_place(pose_of(line), pose_before)


@case("4/15", "4.15/4", name="free-again", hazards=_MOTION)
def test_next_command_after_end(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After a refusal, a stop or a success, an idle robot accepts the next command."""
    line.ask(RUN, subject.new_name())
    stop_motion(subject, line)
    expect_accepted(RUN, start_program(subject, line, RUN).answer)
    stop(subject, line)
    stop_motion(subject, line)
    for name in examples((SIMULATE, RUN)):
        start_program(subject, line, name, seconds=0)
        expect_success(subject, line, name)
    perform(subject, line, MOVE)


@case("4/15", "4/6", "4.17/6", name="second-client", hazards=_MOTION, slow=True)
def test_second_client(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A second client sees the first client's run, is refused, can stop it, and can disconnect."""
    subject.require_multiple_connections()
    other = subject.open()
    program = upload_wait_program(subject, other, 0)
    with executing_task(subject, line, RUN) as task:
        message = "another client does not see the run"
        expect_in(other.ask("get_status").value, ("01",), message)
        if subject.dialect["busy_reply"] != "queue":
            expect_busy(subject, other, task, RUN, program)
            expect_busy(subject, other, task, LOCK)
        reply = other.ask(STOP)
        expect(
            reply.accepted,
            "the stop of another client was refused while a program ran",
            expected="1",
            observed=f"{reply}",
            requirement="4.17/6",
        )
        wait_for_result(subject, other, STOP)
    other.sync()
    start_program(subject, line, RUN, BRIEFLY_S)
    other.close()
    wait_for_result(subject, line, RUN)


@case("4/15", "4.17/6", "4.15/4", name="lost-link", hazards=_MOTION, slow=True)
def test_lost_link(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """After its client disconnects, the next client can stop a program, and the robot is idle.

    The same holds if the program ends while no client is connected.
    """
    subject.require_close_detection()
    require_responsive(subject, line)
    for end in examples((line.close, None)):
        first_client = line if end else subject.open()
        start_program(subject, first_client, RUN)
        (end or first_client.reset)()
        other = subject.open()
        status = other.ask("get_status")
        if status.value in BUSY:
            reply = other.ask(STOP)
            expect(
                reply.accepted,
                "a program whose client disconnected cannot be stopped",
                expected="1",
                observed=f"{reply}",
                requirement="4.17/6",
            )
            wait_for_result(subject, other, STOP)
        stop_motion(subject, other)
        start_program(subject, other, RUN, seconds=0)
        expect_success(subject, other, RUN)
        start_program(subject, other, RUN, BRIEFLY_S)
        other.close()
        _expect_program_ends(subject, subject.open())
        subject.close_lines()


def _expect_program_ends(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Expect that a program that waits for a second ends soon, with or without a client."""
    deadline = Deadline(subject, _END_TIMEOUT_S)
    while (status := line.ask("get_status")).value in BUSY:
        expect(
            not deadline.expired,
            "a program whose client disconnected does not end",
            expected=IDLE,
            observed=f"{status}",
        )
        line.wait(_POLL_S)


@case("4/15", "3/18", "4.15/5", name="many", hazards=_MOTION)
def test_many_runs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Fifty consecutive runs are accepted, and each ends once with success."""
    program = upload_wait_program(subject, line, 0)
    subject.moved = True
    for _ in range(50):
        expect_accepted(RUN, line.ask(RUN, program))
        expect_success(subject, line, RUN)
    line.no_result(RUN, for_s=0)
