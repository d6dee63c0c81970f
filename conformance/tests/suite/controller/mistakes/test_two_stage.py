"""Faulty controllers: when commands end, and what the controller reports about them.

For each fault, a case of the violated requirement must fail.
"""

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.protocol.commands import Command, RunningProgram
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.program_files import Program
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE, Task
from scaraspec.virtual_controller.session import Action, Request, Session

RunCases = Callable[..., Any]


class StopsWhenAnyClientLeaves(ControllerCore):
    """When any client disconnects, the command of another client is stopped without a result."""

    def close(self, connection: int, now_s: float) -> list[Action]:
        self.robot.stop(now_s)
        return super().close(connection, now_s)


class SkipsLoginWhileBusy(ControllerCore):
    """While a command executes, no login is needed."""

    def _is_permitted(self, session: Session, command: Command) -> bool:
        return self.robot.task is not None or super()._is_permitted(session, command)


class RunsDefaultForMissing(ControllerCore):
    """The default program is run instead of a missing one."""

    def _program(self, name: bytes | None) -> Program | None:
        return super()._program(name) or super()._program(self.store.settings.default_program)


class ReportsRunOnlyToStarter(ControllerCore):
    """The running program is reported only to the client that started it."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        task = self.robot.task
        own = task is not None and task.request.session is request.session
        return super().get_running_program(request) if own else None


class RefusedLockEndsMove(ControllerCore):
    """A lock that is refused during a move ends the move, which is reported as done."""

    def lock_joints(self, request: Request) -> Acceptance:
        if self.robot.task is not None:
            self.plant.stop(request.now_s)
        return super().lock_joints(request)


class RunNeverEndsWithoutClient(ControllerCore):
    """A program whose client has disconnected never ends."""

    def _finish_tasks(self, now_s: float) -> None:
        task = self.robot.task
        if task is None or task.request.session.connection in self.sessions:
            super()._finish_tasks(now_s)


class ClockStopsDuringRun(ControllerCore):
    """While a program runs, the clock stands still."""

    stopped: datetime | None = None

    def get_time(self, request: Request) -> datetime:
        time = super().get_time(request)
        self.stopped = (self.stopped or time) if self.robot.task else None
        return self.stopped or time


class ReportsProgramDuringJog(ControllerCore):
    """While the arm jogs, a running program is reported."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        idle = self.robot.task is None
        return super().get_running_program(request) or (None if idle else RunningProgram(b"a", 1))


class SendsResultOfStoppedRun(ControllerCore):
    """After a stop, the next final result of the same client is sent twice."""

    stopped: Session | None = None

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        if frame.tagged and frame.opcode == 0x32:
            self.stopped = session
        elif frame.tagged and frame.data == b"11" and session is self.stopped:
            self.stopped = None
            super().emit(session, frame)


class RepeatedReleaseNeverEnds(ControllerCore):
    """A release of released joints is accepted and has no final result."""

    released = False

    def emit(self, session: Session, frame: Frame) -> None:
        if frame.tagged and frame.opcode == 0x3A and self.released:
            return
        if frame.tagged and frame.opcode in (0x3A, 0x3B):
            self.released = frame.opcode == 0x3A
        super().emit(session, frame)


class NoAnglesDuringJog(ControllerCore):
    """While the arm jogs, requests for the joint angles are not answered."""

    def emit(self, session: Session, frame: Frame) -> None:
        task = self.robot.task
        if frame.opcode != 0x3C or task is None or not task.ends_with_link:
            super().emit(session, frame)


class HalvesRunTime(ControllerCore):
    """The reported run time is half of the actual one."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        reported = super().get_running_program(request)
        return reported and reported._replace(run_time_s=reported.run_time_s // 2)


class ReportsProgramAsVersion(ControllerCore):
    """While a program runs, its name is reported as the version."""

    def emit(self, session: Session, frame: Frame) -> None:
        task = self.robot.task
        if frame.opcode == 0x08 and task is not None and task.program:
            frame = frame._replace(data=task.program)
        super().emit(session, frame)


class ReportsRunToOtherClients(ControllerCore):
    """Refusals to other clients have the code 01 whatever executes."""

    def emit(self, session: Session, frame: Frame) -> None:
        task = self.robot.task
        if task is not None and task.request.session is not session and frame.data[:2] == b"0|":
            frame = frame._replace(data=b"0|01")
        super().emit(session, frame)


class ReportsLowercaseName(ControllerCore):
    """The name of the running program is reported in lower case."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        reported = super().get_running_program(request)
        return reported and reported._replace(name=reported.name.lower())


class ReportsMoveDuringRun(ControllerCore):
    """While a program moves the arm, the status is that of a move."""

    received_s = 0.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self.received_s = now_s
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        moves = self.plant.motion_ends_s > self.received_s
        if frame.opcode == 0x09 and self.robot.task is not None and moves:
            frame = frame._replace(data=b"04")
        super().emit(session, frame)


class StopKeepsProgramMove(ControllerCore):
    """An emergency stop ends a program but not the move that it started."""

    def emergency_stop(self, request: Request) -> Acceptance:
        task, plant = self.robot.task, self.plant
        motion, began_s = plant._motion, plant._began_s
        reply = super().emergency_stop(request)
        if task is not None and task.program:
            plant._motion, plant._began_s = motion, began_s
        return reply


class StopAppliesToNextRun(ControllerCore):
    """A refused stop stops the next program."""

    stopped = False

    def emergency_stop(self, request: Request) -> Acceptance:
        reply = super().emergency_stop(request)
        self.stopped = not reply.accepted
        return reply

    def run_program(self, request: Request) -> Acceptance | Silence:
        reply = super().run_program(request)
        if reply is ACCEPTED and self.stopped and isinstance(self.robot.task, Task):
            self.stopped = False
            task = self.robot.stop(request.now_s)
            assert task is not None
            self.emit(request.session, Frame(C2A, request.frame.opcode, b"1"))
            self.send_result(task.request, task.outcome_if_stopped)
            return SILENCE
        return reply


class AcceptsLockInSameSegment(ControllerCore):
    """A lock that arrives at the same time as another command is accepted."""

    def lock_joints(self, request: Request) -> Acceptance | Silence:
        task = self.robot.task
        if task is None or task.request.now_s != request.now_s:
            return super().lock_joints(request)
        self.emit(request.session, Frame(C2A, request.frame.opcode, b"1"))
        self.send_result(request, DONE)
        return SILENCE


class ReportsDefaultAsRunning(ControllerCore):
    """The default program, if there is one, is reported as the running program."""

    def emit(self, session: Session, frame: Frame) -> None:
        default = self.store.settings.default_program
        if frame.opcode == 0x0A and default and frame.data.startswith(b"1|"):
            frame = frame._replace(data=b"|".join((b"1", default, frame.data[-8:])))
        super().emit(session, frame)


class JogDoesNotMove(ControllerCore):
    """A jog is accepted and lasts until it is stopped, but the arm does not move."""

    def jog(self, request: Request) -> Acceptance:
        reply = super().jog(request)
        still = replace(motion.hold(self.plant.joints(request.now_s)), duration_s=60.0)
        self.plant.start(still, request.now_s)
        return reply


class SixteenBitTargets(ControllerCore):
    """The x coordinate of a move wraps at 16 bits."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        target = request.value
        if target is not None:
            target = target._replace(x=(target.x + 2**15) % 2**16 - 2**15)
        return super().set_tool_coordinates(replace(request, value=target))


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (RepeatedReleaseNeverEnds, "4.25/3", "4.25/3"),
        (SendsResultOfStoppedRun, "4.17/4", "3/18"),
        (NoAnglesDuringJog, "3/31", "3/31"),
        (ReportsRunToOtherClients, "4/15", "4/15"),
        (StopAppliesToNextRun, "4.15/5", "4.15/5"),
        (ReportsDefaultAsRunning, "4.9/4", "4.9/4"),
        (ReportsRunOnlyToStarter, "4.9/2", "4.9/2"),
        (SixteenBitTargets, "4.24/9", "4.24/9"),
        (ReportsLowercaseName, "4.9/4", "4.9/4"),
        (ReportsProgramAsVersion, "4.7/4", "4.7/4"),
        (HalvesRunTime, "4.9/5", "4.9/5"),
        (ClockStopsDuringRun, "4.6/4", "4.6/4"),
        (ReportsProgramDuringJog, "4.9/6", "4.9/6"),
        # While a program moves the arm, the status is 01; a stop also stops the arm.
        (ReportsMoveDuringRun, "6.5/25", "4.8/4"),
        (StopKeepsProgramMove, "6.5/25", "4.17/7"),
        # A robot is busy as soon as it accepts a request.
        (AcceptsLockInSameSegment, "3/30", "4/6"),
        # A case of another requirement detects that the robot stays busy.
        (RunNeverEndsWithoutClient, "4.15/4", "4/15"),
        # A command ends with a result even if other clients connect and disconnect.
        (StopsWhenAnyClientLeaves, "4.17/6", "4.15/5"),
        (RunsDefaultForMissing, "4.15/7", "4.15/7"),
        # A refused request has no effect.
        (RefusedLockEndsMove, "4.24/8", "4.24/8"),
        # Nothing can be set without a login, also while a program of another client runs.
        (SkipsLoginWhileBusy, "2/11", "2/11"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    assert requirement in run_cases(core, only, examples=1, fail_fast=True).violated


def test_jog_without_motion(run_cases: RunCases) -> None:
    """One direction without motion is skipped: there may be no room. All four together fail."""
    directions = run_cases(JogDoesNotMove, "4.28/3")
    assert directions.pop("4.28/3.moves").verdict is Verdict.FAIL
    assert {case.verdict for case in directions.values()} == {Verdict.NONE}


class SwapsMotorCodes(ControllerCore):
    """The bits of the wrist and of the rotation are swapped in the codes of motors."""

    def get_status(self, request: Request) -> str:
        status: str = super().get_status(request)
        return {"14": "18", "18": "14"}.get(status, status)


def test_swapped_motors_are_detected(run_cases: RunCases) -> None:
    """A hook that makes a motor fail shows that another motor is reported (A-8-1)."""
    hooks = ("motor_fault", "clear_faults")
    assert "8/4" in run_cases(SwapsMotorCodes, "8/2", hooks=hooks).violated
    assert not run_cases(ControllerCore, "8/2", hooks=hooks).not_passed


@pytest.mark.parametrize("fault", ["another-tag", "tag-behind-the-opcode"])
def test_result_without_valid_tag_is_recognized(run_cases: RunCases, fault: str) -> None:
    """A final result is recognized by its content if its tag is wrong or misplaced."""
    assert "3/12" in run_cases(mutants()[fault].wrong, "3/12").violated
