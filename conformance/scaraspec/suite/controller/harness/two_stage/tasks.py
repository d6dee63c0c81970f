"""Tasks: two-stage commands that execute long enough for a case to send other requests.

A task is a program that waits, or the slowest step of the arm. After the case, nothing executes
and the arm is back at its start pose.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    SLOWEST_PERCENT,
    arm_returned,
    begin_step_somewhere,
    is_responsive,
    pose_of,
    require_known_responsive,
    responsiveness_known,
    stop,
    stop_motion,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    MOVE,
    RESET,
    RUN,
    SIMULATE,
    STATES,
    begin,
    expect_accepted,
    require_command,
    start_program,
)
from scaraspec.suite.controller.harness.two_stage.results import expect_success
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, EndedTooSoon, NoReply
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

# ---------------------------------------------------------------------- beginning


def begin_jog(
    subject: ControllerUnderTest, line: OutgoingConnection, direction: JogDirection
) -> ReceivedFrame:
    """Start a jog. If the first notation is not understood, try the other one (A-4.28-1).

    Only the first jog that is accepted tries two notations.

    Returns:
        The first reply to the notation that is understood, or else to the first notation.

    Raises:
        NoReply: Neither notation is answered.
    """
    require_command(subject, JOG)
    probe_responsiveness(subject, line)
    request, current = BY_NAME[JOG].request, subject.dialect["jog_byte"]
    first: ReceivedFrame | None = None
    known, other = subject.traits.jog_notation, "ascii" if current == "binary" else "binary"
    for notation in (current, other) if known is None else (known,):
        data = request.encode(direction, subject.dialect.replace(jog_byte=notation))
        subject.moved = True
        try:
            answer = line.ask(JOG, data=data)
        except NoReply:
            continue
        if answer.accepted or answer.code in BUSY:
            if notation != current:
                subject.set_reading("jog_byte", notation)
            if answer.accepted:
                subject.traits.jog_notation = notation
            return answer
        first = first or answer
    if first is None:
        raise NoReply("jog was not answered", expected="1 or 0|code", observed="silence")
    return first


def jog_somewhere(subject: ControllerUnderTest, line: OutgoingConnection) -> ReceivedFrame:
    """Start a jog in the first direction that the controller accepts.

    Raises:
        CaseFailed: Every direction is refused.
    """
    for direction in JogDirection:
        answer = begin_jog(subject, line, direction)
        if answer.accepted or answer.code in BUSY:
            break
    return expect_accepted(JOG, answer)


# ---------------------------------------------------------------------- lasting


@dataclass
class Task:
    """A two-stage command that executes.

    Attributes:
        name: The command.
        line: The connection that started it.
        program: The program that it runs, if it runs one.
    """

    name: str
    line: OutgoingConnection
    program: bytes = b""

    @property
    def state(self) -> str:
        """The status while it executes."""
        return STATES[self.name]

    @property
    def finished(self) -> bool:
        """Whether its final result has arrived."""
        self.line.pump()
        return any(self._is_result(seen) for seen in self.line.inbox)

    def _is_result(self, seen: FrameSeen) -> bool:
        return seen.frame.tagged and seen.frame.opcode == BY_NAME[self.name].opcode

    def finished_before(self, answer: ReceivedFrame) -> bool:
        """Whether its final result came before a reply, or at about that time on another line."""
        where = answer.seen.place
        if answer.accepted and where.connection != self.line.name:
            self.line.wait(MOMENT_S)
        return any(
            self._is_result(seen)
            and (
                seen.place.connection != where.connection
                or seen.place.offset_bytes < where.offset_bytes
            )
            for seen in self.line.inbox
        )

    def require_executing(self) -> None:
        """Require that it still executes.

        Raises:
            EndedTooSoon: It has ended: it was too short for the case.
        """
        if self.finished:
            raise EndedTooSoon(
                UserMessage("{command} ended before the case could send a query", command=self.name)
            )


@contextmanager
def executing_task(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, *, queries: bool = True
) -> Iterator[Task]:
    """Start a task, and stop it when the context ends if it has not ended.

    Args:
        subject: The controller under test.
        line: The connection that starts the task.
        name: The command.
        queries: Whether the caller sends queries during the task.

    Raises:
        CaseFailed: The idle robot refuses the command.
        CaseSkipped: The robot answers no query while it executes (A-4-3), or has no room to move.
    """
    if not queries:  # stopping it needs queries, too
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
    """Require that the robot answers queries while it executes.

    Raises:
        CaseSkipped: It does not (A-4-3).
    """
    if responsiveness_known(subject):
        require_known_responsive(subject, line)
        return
    with executing_task(subject, line, RUN):
        pass


def probe_responsiveness(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Determine once whether the robot answers queries, with a program that waits.

    Without this, a jog could continue while the suite waits for a reply.
    """
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
def _reset(subject: ControllerUnderTest, line: OutgoingConnection, task: Task) -> Iterator[None]:
    """Start a reset that moves the arm by a step to the initial tool position (A-4.18-3)."""
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
    """Make the current pose the initial tool position until the context ends.

    A reset then moves the arm no farther than back to this pose (A-4.18-3).

    Raises:
        CaseSkipped: The subject refuses the pose, so the travel of a reset is unknown.
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
    RESET: _reset,
}


# ---------------------------------------------------------------------- ending
