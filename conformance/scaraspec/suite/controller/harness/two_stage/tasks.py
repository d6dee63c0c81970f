"""Tasks: two-stage commands, begun on an idle robot, asked about while they last, and ended.

A task that lasts is a program that waits, or the slowest step of the arm. Whatever a case does
with it, afterwards nothing executes and the arm stands where it stood.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    BUSY,
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
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

# ---------------------------------------------------------------------- beginning


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
