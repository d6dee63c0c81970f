"""Mistakes of other hands in what executes: when it ends, and what is told of it.

Each is found by a case of a requirement that it violates.
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

Try = Callable[..., Any]


class StopsForAnyone(ControllerCore):
    """Whoever leaves takes along what another client has begun, and nobody is told."""

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Stop it."""
        self.robot.stop(now_s)
        return super().close(connection, now_s)


class OpenDoor(ControllerCore):
    """While something executes everybody is served."""

    def _is_permitted(self, session: Session, command: Command) -> bool:
        """Let them in."""
        return self.robot.task is not None or super()._is_permitted(session, command)


class RunsTheDefault(ControllerCore):
    """In place of a missing program the default one is run."""

    def _program(self, name: bytes | None) -> Program | None:
        return super()._program(name) or super()._program(self.store.settings.default_program)


class TellsItsStarter(ControllerCore):
    """What runs is told to nobody but the client that began it."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Tell it."""
        task = self.robot.task
        own = task is not None and task.request.session is request.session
        return super().get_running_program(request) if own else None


class LocksOnItsWay(ControllerCore):
    """A lock that is refused while the arm moves ends the move, which is then done."""

    def lock_joints(self, request: Request) -> Acceptance:
        """Stand still."""
        if self.robot.task is not None:
            self.plant.stop(request.now_s)
        return super().lock_joints(request)


class DiesWithItsClient(ControllerCore):
    """A program whose result nobody is there to hear is never over."""

    def _finish_tasks(self, now_s: float) -> None:
        task = self.robot.task
        if task is None or task.request.session.connection in self.sessions:
            super()._finish_tasks(now_s)


class StopsItsClock(ControllerCore):
    """While a program runs the clock stands still."""

    stopped: datetime | None = None

    def get_time(self, request: Request) -> datetime:
        """Tell when it began."""
        time = super().get_time(request)
        self.stopped = (self.stopped or time) if self.robot.task else None
        return self.stopped or time


class NeverForgets(ControllerCore):
    """While the arm jogs the last program is told to run."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Mistake every task for a run."""
        idle = self.robot.task is None
        return super().get_running_program(request) or (None if idle else RunningProgram(b"a", 1))


class EndsForTheStopped(ControllerCore):
    """A program that was stopped ends with the next one of its client."""

    stopped: Session | None = None

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell the end of both."""
        super().emit(session, frame)
        if frame.tagged and frame.opcode == 0x32:
            self.stopped = session
        elif frame.tagged and frame.data == b"11" and session is self.stopped:
            self.stopped = None
            super().emit(session, frame)


class NothingToRelease(ControllerCore):
    """A release of joints that are released is accepted, and never ends."""

    released = False

    def emit(self, session: Session, frame: Frame) -> None:
        """Forget the second end."""
        if frame.tagged and frame.opcode == 0x3A and self.released:
            return
        if frame.tagged and frame.opcode in (0x3A, 0x3B):
            self.released = frame.opcode == 0x3A
        super().emit(session, frame)


class NoAnglesOnTheWay(ControllerCore):
    """While the arm jogs its angles are not told."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave them out."""
        task = self.robot.task
        if frame.opcode != 0x3C or task is None or not task.ends_with_link:
            super().emit(session, frame)


class HalfAsLong(ControllerCore):
    """Programs are told to have run for half as long as they have."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Halve it."""
        told = super().get_running_program(request)
        return told and told._replace(run_time_s=told.run_time_s // 2)


class VersionOfARun(ControllerCore):
    """The text of the version is made where the name of a program was put."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Show the one for the other."""
        task = self.robot.task
        if frame.opcode == 0x08 and task is not None and task.program:
            frame = frame._replace(data=task.program)
        super().emit(session, frame)


class OthersRun(ControllerCore):
    """Whoever is refused because another client has begun something is told that it is a run."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell another state."""
        task = self.robot.task
        if task is not None and task.request.session is not session and frame.data[:2] == b"0|":
            frame = frame._replace(data=b"0|01")
        super().emit(session, frame)


class SmallLetters(ControllerCore):
    """The program that runs is told in small letters."""

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Change them."""
        told = super().get_running_program(request)
        return told and told._replace(name=told.name.lower())


class MovesOnARun(ControllerCore):
    """While a program moves the arm its status is that of a move."""

    heard_s = 0.0

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Note when."""
        self.heard_s = now_s
        super().handle(session, frame, now_s)

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell it."""
        moves = self.plant.motion_ends_s > self.heard_s
        if frame.opcode == 0x09 and self.robot.task is not None and moves:
            frame = frame._replace(data=b"04")
        super().emit(session, frame)


class EndsItsMove(ControllerCore):
    """An emergency stop ends a program, and not the move that it has begun."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Let the arm go on."""
        task, plant = self.robot.task, self.plant
        motion, began_s = plant._motion, plant._began_s
        answer = super().emergency_stop(request)
        if task is not None and task.program:
            plant._motion, plant._began_s = motion, began_s
        return answer


class StopsLater(ControllerCore):
    """A stop that is not needed stops what begins next."""

    stopped = False

    def emergency_stop(self, request: Request) -> Acceptance:
        """Keep it."""
        answer = super().emergency_stop(request)
        self.stopped = not answer.accepted
        return answer

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Obey it."""
        answer = super().run_program(request)
        if answer is ACCEPTED and self.stopped and isinstance(self.robot.task, Task):
            self.stopped = False
            task = self.robot.stop(request.now_s)
            assert task is not None
            self.emit(request.session, Frame(C2A, request.frame.opcode, b"1"))
            self.send_result(task.request, task.outcome_if_stopped)
            return SILENCE
        return answer


class BusyLater(ControllerCore):
    """Only at the next instant it knows that a command executes."""

    def lock_joints(self, request: Request) -> Acceptance | Silence:
        """Lock the joints all the same."""
        task = self.robot.task
        if task is None or task.request.now_s != request.now_s:
            return super().lock_joints(request)
        self.emit(request.session, Frame(C2A, request.frame.opcode, b"1"))
        self.send_result(request, DONE)
        return SILENCE


class TellsItsDefault(ControllerCore):
    """The program that runs is told to be the default one, where there is one."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Tell that name."""
        default = self.store.settings.default_program
        if frame.opcode == 0x0A and default and frame.data.startswith(b"1|"):
            frame = frame._replace(data=b"|".join((b"1", default, frame.data[-8:])))
        super().emit(session, frame)


class JogsNowhere(ControllerCore):
    """A jog is accepted, and lasts until it is stopped, and the arm stays where it is."""

    def jog(self, request: Request) -> Acceptance:
        """Hold the arm."""
        answer = super().jog(request)
        still = replace(motion.hold(self.plant.joints(request.now_s)), duration_s=60.0)
        self.plant.start(still, request.now_s)
        return answer


class SixteenBits(ControllerCore):
    """Where a move goes is kept in whole millimetres of 16 bits."""

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        """Cut it off."""
        target = request.value
        if target is not None:
            target = target._replace(x=(target.x + 2**15) % 2**16 - 2**15)
        return super().set_tool_coordinates(replace(request, value=target))


@pytest.mark.parametrize(
    ("core", "tries", "requirement"),
    [
        (NothingToRelease, "4.25/3", "4.25/3"),
        (EndsForTheStopped, "4.17/4", "3/18"),
        (NoAnglesOnTheWay, "3/31", "3/31"),
        (OthersRun, "4/15", "4/15"),
        (StopsLater, "4.15/5", "4.15/5"),
        (TellsItsDefault, "4.9/4", "4.9/4"),
        (TellsItsStarter, "4.9/2", "4.9/2"),
        (SixteenBits, "4.24/9", "4.24/9"),
        (SmallLetters, "4.9/4", "4.9/4"),
        (VersionOfARun, "4.7/4", "4.7/4"),
        (HalfAsLong, "4.9/5", "4.9/5"),
        (StopsItsClock, "4.6/4", "4.6/4"),
        (NeverForgets, "4.9/6", "4.9/6"),
        # While a program moves the arm a program runs, and behind a stop the arm stands then, too.
        (MovesOnARun, "6.5/25", "4.8/4"),
        (EndsItsMove, "6.5/25", "4.17/7"),
        # A robot is busy from the request on, not from its next look at what it does.
        (BusyLater, "3/30", "4/6"),
        # Whether a robot is free again is seen by a case that accepts runs, too.
        (DiesWithItsClient, "4.15/4", "4/15"),
        # What one client has begun ends with a result, whoever else comes and goes.
        (StopsForAnyone, "4.17/6", "4.15/5"),
        (RunsTheDefault, "4.15/7", "4.15/7"),
        # What is refused has no effect.
        (LocksOnItsWay, "4.24/8", "4.24/8"),
        # Without a login nothing is set, whatever another client's program is doing.
        (OpenDoor, "2/11", "2/11"),
    ],
)
def test_it_is_found(tried: Try, core: type[ControllerCore], tries: str, requirement: str) -> None:
    """A case of what it tries fails, for what is violated."""
    assert requirement in tried(core, tries, examples=1).failed


def test_a_jog_that_moves_nothing_is_not_called_right(tried: Try) -> None:
    """Nor is it a mistake: towards an end of its travel the arm may stay."""
    directions = tried(JogsNowhere, "4.28/3")
    assert {case.verdict for case in directions.values()} == {Verdict.NONE}


class ExchangesJoints(ControllerCore):
    """The bits of the wrist and of the gripper are exchanged in the codes of motors."""

    def get_status(self, request: Request) -> str:
        """Exchange them."""
        told: str = super().get_status(request)
        return {"14": "18", "18": "14"}.get(told, told)


def test_motors_that_are_told_for_others_are_found(tried: Try) -> None:
    """Who makes a motor fail knows which (A-8-1)."""
    hooks = ("motor_fault", "clear_faults")
    assert "8/4" in tried(ExchangesJoints, "8/2", handled=hooks).failed
    assert not tried(ControllerCore, "8/2", handled=hooks).wrong


@pytest.mark.parametrize("fault", ["another-tag", "tag-behind-the-opcode"])
def test_a_result_is_known_by_what_it_says(tried: Try, fault: str) -> None:
    """Where its tag is another, or stands elsewhere, its length is another, too."""
    assert "3/12" in tried(mutants()[fault].wrong, "3/12").failed
