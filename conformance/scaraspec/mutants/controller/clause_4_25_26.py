"""Faults of clauses 4.25 and 4.26: releasing and locking the joints."""

from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, JogDirection, Outcome
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request, Session


@mutant("release-is-answered-released", "4.25/2", "4/1")
class ReleaseIsAnsweredReleased(ControllerCore):
    """The first reply to a release is "1|4", the number of joints."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add the number."""
        if frame.opcode == 0x3A and frame.data == b"1" and not frame.tagged:
            frame = frame._replace(data=b"1|4")
        super().emit(session, frame)


@mutant("release-is-refused", "4.25/2")
class ReleaseIsRefused(ControllerCore):
    """An idle robot refuses to release its joints."""

    def release_joints(self, request: Request) -> Acceptance:  # noqa: ARG002 - the seam's form
        """Refuse."""
        code = self.robot.refusal_code(moves=False)
        return Acceptance(accepted=False, code=code or "05")


@mutant("second-release-is-answered-two", "4.25/2", "4/1")
class SecondReleaseIsAnsweredTwo(ControllerCore):
    """A release of released joints is answered 2."""

    def _reply(self, session: Session, command: Command, frame: Frame, answer: Any) -> None:
        self._again = command.name == "release_joints" and self._released
        self._released = command.name == "release_joints"
        super()._reply(session, command, frame, answer)

    _again = _released = False

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 2."""
        if self._again and frame.opcode == 0x3A and not frame.tagged:
            frame = frame._replace(data=b"2")
        super().emit(session, frame)


@mutant("release-has-no-result", "4.25/3")
class ReleaseHasNoResult(ControllerCore):
    """A release sends no final result, not even when the joints are locked again."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "release_joints":
            super().send_result(request, outcome)


@mutant("release-ends-as-lock", "4.25/3")
class ReleaseEndsAsLock(ControllerCore):
    """The final result of a release bears the opcode of the lock."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Use the other opcode."""
        if frame.opcode == 0x3A and frame.tagged:
            frame = frame._replace(opcode=0x3B)
        super().emit(session, frame)


@mutant("second-release-fails", "4.25/3", subtle=True)
class SecondReleaseFails(ControllerCore):
    """From the second on every release ends with a failure."""

    _released = 0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Count them."""
        if request.command.name == "release_joints":
            self._released += 1
            if self._released > 1:
                outcome = Outcome(done=False, code="06")
        super().send_result(request, outcome)


class _ReleasesDuring(ControllerCore):
    """Releases the joints while one command executes."""

    during = ""

    def release_joints(self, request: Request) -> Acceptance:
        """Look at the motors alone."""
        task = self.robot.task
        if task is not None and task.request.command.name == self.during:
            self.send_result(request, DONE)
            return ACCEPTED
        return super().release_joints(request)


@mutant("releases-during-run", "4.25/5", "4/6")
class ReleasesDuringRun(_ReleasesDuring):
    """The joints are released while a program runs."""

    during = "run_program"


@mutant("releases-during-simulation", "4.25/5", "4/6")
class ReleasesDuringSimulation(_ReleasesDuring):
    """The joints are released while a program is simulated."""

    during = "simulate_program"


@mutant("releases-during-reset", "4.25/5", "4/6")
class ReleasesDuringReset(_ReleasesDuring):
    """The joints are released while the robot resets."""

    during = "reset"


@mutant("releases-during-move", "4.25/5", "4/6")
class ReleasesDuringMove(_ReleasesDuring):
    """The joints are released while the arm moves to a pose."""

    during = "set_tool_coordinates"


@mutant("releases-during-jog", "4.25/5", "4/6")
class ReleasesDuringJog(_ReleasesDuring):
    """The joints are released during a jog."""

    during = "jog"


@mutant("lock-is-answered-twice", "4.26/2", "4/1")
class LockIsAnsweredTwice(ControllerCore):
    """The first reply to a lock is "11"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 11 for 1."""
        if frame.opcode == 0x3B and frame.data == b"1" and not frame.tagged:
            frame = frame._replace(data=b"11")
        super().emit(session, frame)


@mutant("lock-of-released-is-refused", "4.26/2")
class LockOfReleasedIsRefused(ControllerCore):
    """Released joints cannot be locked."""

    def lock_joints(self, request: Request) -> Acceptance:
        """Find the joints where they should not be."""
        if not self.plant.locked and self.robot.task is None:
            self.plant.locked = True
            return Acceptance(accepted=False, code="06")
        return super().lock_joints(request)


@mutant("lock-has-no-result", "4.26/3")
class LockHasNoResult(ControllerCore):
    """A lock sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "lock_joints":
            super().send_result(request, outcome)


@mutant("lock-fails", "4.26/3")
class LockFails(ControllerCore):
    """A lock of released joints ends with a failure."""

    _released = False

    def lock_joints(self, request: Request) -> Acceptance:
        """Look what it locks."""
        self._released = not self.plant.locked
        return super().lock_joints(request)

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Say so."""
        if request.command.name == "lock_joints" and self._released:
            outcome = Outcome(done=False, code="18")
        super().send_result(request, outcome)


@mutant("lock-leaves-them-loose", "4.26/3", "4.24/5")
class LockLeavesThemLoose(ControllerCore):
    """A lock is said to be done, and the joints stay released."""

    def lock_joints(self, request: Request) -> Acceptance:
        """Lock nothing."""
        released = not self.plant.locked
        answer = super().lock_joints(request)
        self.plant.locked = not released
        return answer


@mutant("arm-sags-behind-lock", "4.26/5")
class ArmSagsBehindLock(ControllerCore):
    """Behind a lock the arm goes on moving for a while."""

    def lock_joints(self, request: Request) -> Acceptance:
        """Let it."""
        answer = super().lock_joints(request)
        if answer.accepted:
            way = motion.jog(self.plant.joints(request.now_s), JogDirection.PLUS_Y)
            self.plant.start(way, request.now_s)
        return answer
