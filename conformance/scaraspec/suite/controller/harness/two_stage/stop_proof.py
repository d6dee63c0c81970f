"""Stop proof: tries the emergency stop on the smallest motion before the first motion of a run.

The smallest motion is a step at the slowest speed. If the robot accepts no step, it is a program
that waits; if the robot runs no program, it is a jog. If the robot accepts none
of them, no case moves it.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Final, NamedTuple

from scaraspec.judge.tolerances import STANDSTILL
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.emergency_stop import EFFECT_S, LATE_S
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    SLOWEST_PERCENT,
    arm_returned,
    begin_step_somewhere,
    joints_of,
    pose_deviation,
    pose_of,
    same_place,
    wait_for_end,
)
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    LOCK,
    MOVE,
    RESET,
    RUN,
    STOP,
    start_program,
)
from scaraspec.suite.controller.harness.two_stage.tasks import jog_somewhere
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.user_message import UserMessage

_UNDER_WAY_S: Final = 0.1
_LOOKS: Final = 3
_LOOK_S: Final = 0.2


def prove_stop(subject: ControllerUnderTest) -> None:
    """Try the emergency stop, unless it is known not to work.

    If the stop does not work, `StopMonitor.failure` states the failure.
    """
    stop = subject.guard.stop
    if STOP in subject.ics.unsupported:
        message = "the ICS states that the controller does not support it"
        stop.fail("4.17/6", message, "an emergency stop", "none")
    for start in (_leave_error, _step, _step_once_locked, _program, _jog):
        if stop.failure:
            return
        with suppress(CaseFailed, CaseInconclusive):
            proved = _stops(subject, start)
            subject.settle()
            if proved:
                return


class _Started(NamedTuple):
    """A command that was started, and the target pose if it is a step."""

    name: str
    target: Pose | None = None


def _stops(subject: ControllerUnderTest, start: "_Start") -> bool:
    """Start a command and stop it; return whether this proved that the stop works."""
    line = subject.open()
    with arm_returned(subject, line):
        subject.moved = True
        started = start(subject, line)
        if started is None:
            return False
        line.wait(_UNDER_WAY_S)
        return _is_stopped(subject, line, started)


def _is_stopped(subject: ControllerUnderTest, line: OutgoingConnection, started: _Started) -> bool:
    """Whether the stop ended the command; False if the command ended before the stop."""
    name = started.name
    stop = subject.guard.stop
    try:
        answer = line.ask(STOP, within_s=max(LATE_S, subject.reply_s))
    except NoReply as error:
        stop.fail(
            "4.17/6",
            UserMessage("the controller did not answer it while {name} executed", name=name),
            "1",
            error.observed,
        )
        return False
    if not answer.accepted:
        if line.ask("get_status").value in BUSY and line.ask("get_status").value in BUSY:
            stop.fail(
                "4.17/6",
                UserMessage("the controller refused it while {name} executed", name=name),
                "1",
                f"{answer}",
            )
        return False
    with suppress(NoReply):
        line.result(STOP, within_s=subject.reply_s)
    line.wait(EFFECT_S)
    places = [_look(line) for _ in range(_LOOKS)]
    if pose_deviation(places[0], places[-1]) > STANDSTILL:
        shown = (f"{tuple(place[:4])}" for place in (places[0], places[-1]))
        stop.fail("4.17/7", "the arm continues to move after it was accepted", *shown)
    arrived = started.target is not None and same_place(places[-1], started.target)
    return stop.failure is None and not arrived


def _look(line: OutgoingConnection) -> Pose:
    """The pose of the tool. The monitor compares the joint angles and the status by itself."""
    joints_of(line)
    line.ask("get_status")
    line.wait(_LOOK_S)
    return pose_of(line)


def _leave_error(subject: ControllerUnderTest, line: OutgoingConnection) -> _Started | None:
    """Reset a robot that is in an error state."""
    if line.ask("get_status").value in (IDLE, *BUSY) or RESET in subject.ics.unsupported:
        return None
    return _Started(RESET) if line.ask(RESET).accepted else None


def _step(subject: ControllerUnderTest, line: OutgoingConnection) -> _Started | None:
    if MOVE in subject.ics.unsupported:
        return None
    there, answer = begin_step_somewhere(subject, line, SLOWEST_PERCENT)
    return _Started(MOVE, there) if answer.accepted else None


def _step_once_locked(subject: ControllerUnderTest, line: OutgoingConnection) -> _Started | None:
    """Start a step after locking the joints, which may have been released (A-4.25-1)."""
    if {LOCK, MOVE} & subject.ics.unsupported or not line.ask(LOCK).accepted:
        return None
    wait_for_end(subject, line, LOCK)
    return _step(subject, line)


def _program(subject: ControllerUnderTest, line: OutgoingConnection) -> _Started | None:
    if RUN in subject.ics.unsupported or Hazard.STATE not in subject.allowed:
        return None
    start_program(subject, line, RUN)
    return _Started(RUN)


def _jog(subject: ControllerUnderTest, line: OutgoingConnection) -> _Started | None:
    if JOG in subject.ics.unsupported:
        return None
    jog_somewhere(subject, line)
    return _Started(JOG)


_Start = Callable[[ControllerUnderTest, OutgoingConnection], _Started | None]
