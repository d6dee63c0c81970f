"""Tasks: two-stage commands, begun on an idle robot, asked about while they last, and ended.

A task that lasts is a program that waits, or the slowest step of the arm. Whatever a case does
with it, afterwards nothing executes and the arm stands where it stood.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import (
    BUSY,
    SLOWEST_PERCENT,
    arm_returned,
    begin_step_somewhere,
    is_responsive,
    pose_of,
    release_latch,
    require_known_responsive,
    responsiveness_known,
    status_of,
    stop,
    stop_motion,
    target,
    wait_for_end,
)
from scaraspec.suite.controller.harness.timeouts import SUCCESS
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, CaseSkipped, NoReply
from scaraspec.suite.program_files.layout import configured, find_layout, layout_in_use
from scaraspec.suite.program_files.writing import wait_program
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

RUN, SIMULATE, STOP, RESET = "run_program", "simulate_program", "emergency_stop", "reset"
MOVE, RELEASE, LOCK, JOG = "set_tool_coordinates", "release_joints", "lock_joints", "jog"

TWO_STAGE: Final = tuple(command.name for command in COMMANDS if command.two_stage)

STATES: Final[Mapping[str, str]] = {RUN: "01", SIMULATE: "02", RESET: "03", MOVE: "04", JOG: "04"}
"""The long-running commands, and the status while they execute (L1018-1021)."""

ACCEPTANCE: Final[Mapping[str, str]] = {
    RUN: "4.15/4",
    SIMULATE: "4.16/2",
    STOP: "4.17/3",
    RESET: "4.18/3",
    MOVE: "4.24/5",
    RELEASE: "4.25/2",
    LOCK: "4.26/2",
    JOG: "4.28/4",
}
"""The requirement for each command that the first reply is "1"."""

LASTS_S: Final = 5
"""The wait of a program that will be interrupted, in seconds of our clock."""
BRIEFLY_S: Final = 0.5
"""As long as one whose end is awaited: a second, unless the robot's are shorter than ours."""
_ASKED: Final = 20
"""How many consecutive requests such a program outlasts."""

_NS: Final = 1e9


# ---------------------------------------------------------------------- beginning


def begin(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, value: Any = None
) -> ReceivedFrame:
    """Begin a two-stage command on an idle robot; a refusal fails the case.

    Returns:
        The first reply.

    Raises:
        CaseFailed: The subject refuses the command.
        CaseSkipped: The subject does not support the command.
    """
    require_command(subject, name)
    subject.moved = True
    return expect_accepted(name, line.ask(name, value))


def require_command(subject: ControllerUnderTest, *names: str) -> None:
    """Continue only if the subject supports these commands.

    Raises:
        CaseSkipped: The ICS states that a command is not supported.
    """
    for name in names:
        if name in subject.ics.unsupported:
            raise CaseSkipped(UserMessage("the subject does not support {name}", name=name))


def expect_accepted(name: str, answer: ReceivedFrame) -> ReceivedFrame:
    """Fail the case unless the first reply accepts the command; return the reply.

    Raises:
        CaseFailed: The reply is a refusal.
    """
    if answer.accepted:
        return answer
    busy = answer.code in BUSY
    raise CaseFailed(
        UserMessage(
            "the idle robot refuses {name}{reason}",
            name=name,
            reason=" as busy" if busy else "",
        ),
        expected="1",
        observed=f"{answer}",
        requirement="4/15" if busy else ACCEPTANCE[name],
    )


def upload_wait_program(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    seconds: float | None = None,
    name: bytes = b"",
) -> bytes:
    """Upload a program that waits for at least so many seconds, by our clock; its name.

    Without a number it outlasts all requests, however slow the replies are;
    without a name it gets a new one.
    """
    if seconds is None:
        asked_s = subject.now_ns / _NS
        reply_s = line.ask("get_status").time_s - asked_s
        seconds = max(LASTS_S, int(_ASKED * reply_s))
    name = name or subject.new_name()
    scaled = math.ceil(seconds * subject.ics.time_scale)
    _upload_wait(subject, line, name, scaled)
    return name


def upload_short_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes
) -> bytes:
    """Upload a program that ends at once under a name of one's own."""
    _upload_wait(subject, line, name, 0)
    return name


def _upload_wait(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, seconds: int
) -> None:
    layout, base = layout_in_use(subject), configured(subject, line)
    upload(line, name, wait_program(subject.dialect, seconds, layout=layout, base=base))


class Started(NamedTuple):
    """A program that was begun: its name, and the first reply."""

    program: bytes
    answer: ReceivedFrame


def start_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, seconds: float | None = None
) -> Started:
    """Run or simulate a program that waits (see `upload_wait_program`).

    The layout of program files is determined first (A-6.1-2).

    Args:
        subject: The controller under test.
        line: The connection that starts the program.
        name: The command: `run_program` or `simulate_program`.
        seconds: How long the program waits; None for long enough to be interrupted.

    Raises:
        CaseFailed: It is refused.
    """
    require_command(subject, name)
    subject.moved = True
    if RUN not in subject.ics.unsupported:
        with suppress(CaseFailed, CaseInconclusive):  # it is for the cases about layouts to say so
            find_layout(subject, line)
    release_latch(subject, line)
    program = upload_wait_program(subject, line, seconds)
    return Started(program, expect_accepted(name, line.ask(name, program)))


def begin_jog(
    subject: ControllerUnderTest, line: OutgoingConnection, direction: JogDirection
) -> ReceivedFrame:
    """Ask for a jog, in the other notation too where the first is not understood (A-4.28-1).

    The first reply: to the notation that is understood, where one is.

    Raises:
        NoReply: Neither is answered.
    """
    require_command(subject, JOG)
    probe_responsiveness(subject, line)
    request, spoken = BY_NAME[JOG].request, subject.dialect["jog_byte"]
    first: ReceivedFrame | None = None
    for notation in (spoken, "ascii" if spoken == "binary" else "binary"):
        data = request.encode(direction, subject.dialect.replace(jog_byte=notation))
        subject.moved = True
        try:
            answer = line.ask(JOG, data=data)
        except NoReply:
            continue
        if answer.accepted or answer.code in BUSY:
            if notation != spoken:
                subject.set_reading("jog_byte", notation)
            return answer
        first = first or answer
    if first is None:
        raise NoReply("jog was not answered", expected="1 or 0|code", observed="silence")
    return first


def jog_somewhere(subject: ControllerUnderTest, line: OutgoingConnection) -> ReceivedFrame:
    """Begin a jog, in the first direction in which there is room.

    Raises:
        CaseFailed: Every direction is refused.
    """
    for direction in JogDirection:
        answer = begin_jog(subject, line, direction)
        if answer.accepted or answer.code in BUSY:
            break
    return expect_accepted(JOG, answer)


def try_request(
    line: OutgoingConnection, name: str, value: Any = None, *, data: bytes | None = None
) -> ReceivedFrame | None:
    """Ask for what may be refused or not answered (A-4-2, A-3-9); None where silence follows.

    So it is where the connection ends. Everything else that comes before the reply to a query
    stays to be taken. What was granted may execute, and a robot that does may answer no query
    (A-4-3).
    """
    line.send(name, value, data=data)
    try:
        line.inbox[:0] = line.sync()
    except NoReply:
        replies = [s for s in line.inbox if s.name == name and not s.frame.tagged]
        granted = name in TWO_STAGE and any(ReceivedFrame(s, s.value).accepted for s in replies)
        if line.ending is None and not granted:
            raise
    with suppress(NoReply):
        return line.reply(name, within_s=0.0)
    return None


def harmless_requests(subject: ControllerUnderTest, line: OutgoingConnection) -> Mapping[str, Any]:
    """For every two-stage command but the stop, a request that does next to nothing."""
    program = upload_wait_program(subject, line, 0)
    values: dict[str, Any] = {
        RUN: program,
        SIMULATE: program,
        MOVE: target(pose_of(line), SLOWEST_PERCENT),
        JOG: JogDirection.PLUS_X,
    }
    return {
        name: values.get(name)
        for name in TWO_STAGE
        if name != STOP and name not in subject.ics.unsupported
    }


# ---------------------------------------------------------------------- lasting


@dataclass
class Task:
    """A two-stage command that executes.

    Attributes:
        name: The command.
        state: The status during it.
        program: The program that it runs, if it runs one.
    """

    name: str
    line: OutgoingConnection
    program: bytes = b""

    @property
    def state(self) -> str:
        """The status during it."""
        return STATES[self.name]

    @property
    def finished(self) -> bool:
        """Whether its final result is there."""
        self.line.pump()
        return any(self._ends(seen) for seen in self.line.inbox)

    def _ends(self, seen: FrameSeen) -> bool:
        return seen.frame.tagged and seen.frame.opcode == BY_NAME[self.name].opcode

    def finished_before(self, answer: ReceivedFrame) -> bool:
        """Whether its final result came before an answer, or on another connection about then."""
        where = answer.seen.place
        if answer.accepted and where.connection != self.line.name:
            self.line.wait(MOMENT_S)
        return any(
            self._ends(seen)
            and (
                seen.place.connection != where.connection
                or seen.place.offset_bytes < where.offset_bytes
            )
            for seen in self.line.inbox
        )

    def require_executing(self) -> None:
        """Go on only while it executes.

        Raises:
            CaseSkipped: It is over: it was too short to find anything out.
        """
        if self.finished:
            raise CaseSkipped(
                UserMessage("{command} ended before the case could send a query", command=self.name)
            )


@contextmanager
def executing_task(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, *, queries: bool = True
) -> Iterator[Task]:
    """Begin a task that goes on for a while, and end it afterwards, if it has not ended.

    Args:
        subject: The subject.
        line: The connection that asks for it.
        name: The command.
        queries: Whether the caller sends queries during it.

    Raises:
        CaseFailed: The idle robot refuses it.
        CaseSkipped: The robot answers nothing while it executes (A-4-3), or cannot do it here.
    """
    if not queries:  # what ends it asks all the same
        probe_responsiveness(subject, line)
    with arm_returned(subject, line):
        task = Task(name, line)
        with _BEGIN[name](subject, line, task):
            if queries and not is_responsive(subject, line, jogs=name == JOG):
                stop(subject, line)
                stop_motion(subject, line)
                raise CaseSkipped("the robot does not answer queries while it executes (A-4-3)")
            yield task
            stop_motion(subject, line)


def require_responsive(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Go on only where a robot that executes answers queries.

    Raises:
        CaseSkipped: It does not (A-4-3).
    """
    if responsiveness_known(subject):
        require_known_responsive(subject, line)
        return
    with executing_task(subject, line, RUN):
        pass


def probe_responsiveness(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Ask once while a program waits, so that no jog goes on while an answer is waited for."""
    if not responsiveness_known(subject):
        with suppress(CaseFailed, CaseSkipped):
            require_responsive(subject, line)


@contextmanager
def _program(subject: ControllerUnderTest, line: OutgoingConnection, task: Task) -> Iterator[None]:
    task.program = start_program(subject, line, task.name).program
    yield


@contextmanager
def _step(subject: ControllerUnderTest, line: OutgoingConnection, task: Task) -> Iterator[None]:
    require_command(subject, task.name)
    _, answer = begin_step_somewhere(subject, line, SLOWEST_PERCENT)
    expect_accepted(task.name, answer)
    yield


@contextmanager
def _jog(subject: ControllerUnderTest, line: OutgoingConnection, _: Task) -> Iterator[None]:
    jog_somewhere(subject, line)
    yield


@contextmanager
def _way_home(subject: ControllerUnderTest, line: OutgoingConnection, task: Task) -> Iterator[None]:
    """A reset that has a step to go, where it goes to the initial tool position (A-4.18-3)."""
    require_command(subject, task.name)
    with initial_position_at_pose(subject, line):
        _, answer = begin_step_somewhere(subject, line)
        expect_accepted(MOVE, answer)
        expect_success(subject, line, MOVE)
        begin(subject, line, RESET)
        yield


@contextmanager
def initial_position_at_pose(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> Iterator[None]:
    """Make where the arm stands the initial tool position, for a while.

    So that a reset goes no farther than back to it (A-4.18-3).

    Raises:
        CaseSkipped: The subject does not take it, so that the travel of a reset is unknown.
    """
    before = line.ask("get_initial_tool_position").value
    if not line.ask("set_initial_tool_position", pose_of(line)).accepted:
        raise CaseSkipped("the subject refuses the current pose as its initial tool position")
    try:
        yield
    finally:
        with suppress(CaseFailed, CaseSkipped):
            stop_motion(subject, line)
            if before is not None:
                line.ask("set_initial_tool_position", before)


_Begin = Callable[[ControllerUnderTest, OutgoingConnection, Task], Any]
_BEGIN: Final[Mapping[str, _Begin]] = {
    RUN: _program,
    SIMULATE: _program,
    MOVE: _step,
    JOG: _jog,
    RESET: _way_home,
}


# ---------------------------------------------------------------------- ending


def stop_while_idle(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Stop a robot that is idle: that is refused, or done at once (A-4.17-1), and stops nothing.

    What begins afterwards goes on.
    """
    subject.moved = True
    if STOP not in subject.ics.unsupported and line.ask(STOP).accepted:
        wait_for_result(subject, line, STOP)
        stop_motion(subject, line)


def wait_for_result(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    name: str,
    *,
    within_s: float | None = None,
) -> ReceivedFrame:
    """Wait for a final result; see `wait_for_end`.

    Raises:
        NoReply: It does not come.
    """
    answer = wait_for_end(subject, line, name, within_s=within_s)
    if answer is None:
        longest = "motion.longest_s of the ICS at most"
        message = UserMessage(
            "no final result of {name} came while the robot was busy ({longest}) or after it",
            name=name,
            longest=longest,
        )
        error = line.no_reply_error(message)
        error.expected = f"{C2A.start:02X} 90 {BY_NAME[name].opcode:02X} …"
        error.requirement = SUCCESS[name]
        raise error
    return answer


def expect_success(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str
) -> ReceivedFrame:
    """Wait for the successful end of a task.

    Raises:
        CaseFailed: It has another end, or none.
    """
    answer = wait_for_result(subject, line, name)
    if answer.frame.data.rstrip(b"\0") != b"11":
        raise CaseFailed(
            UserMessage("{name} does not end with success", name=name),
            expected="11",
            observed=f"{answer}",
            requirement=SUCCESS[name],
        )
    return answer


def release_joints(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> tuple[ReceivedFrame, ReceivedFrame | None]:
    """Release the joints: the first reply, and the final result.

    That is None where it only comes when the joints are locked again (A-4.25-2).

    Raises:
        CaseFailed: The idle robot refuses it.
    """
    first = begin(subject, line, RELEASE)
    left_s = subject.reply_s
    while True:
        with suppress(NoReply):
            return first, line.result(RELEASE, within_s=SILENCE_S)
        left_s -= SILENCE_S
        if left_s <= 0 or status_of(subject, line) not in (*BUSY, None):
            return first, None


@contextmanager
def locked_afterwards(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[None]:
    """Lock the joints afterwards, whatever has happened."""
    try:
        yield
    finally:
        with suppress(CaseFailed):
            if line.ask(LOCK).accepted:
                wait_for_result(subject, line, LOCK)


def interrupted_result(line: OutgoingConnection, name: str) -> ReceivedFrame | None:
    """The final result of what a stop has ended, where it has one (A-4.17-4)."""
    try:
        return line.result(name, within_s=SILENCE_S)
    except NoReply:
        return None
