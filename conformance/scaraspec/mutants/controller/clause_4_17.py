"""Faults of clause 4.17: the emergency stop."""

from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, JogDirection, Outcome
from scaraspec.protocol.transfer import Receiver, Sender
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request, Session

_REFUSED = Acceptance(accepted=False)


@mutant("idle-stop-is-not-answered", "4.17/2")
class IdleStopIsNotAnswered(ControllerCore):
    """A stop where nothing is to be stopped is not answered."""

    def emergency_stop(self, request: Request) -> Any:
        """Say nothing."""
        answer = super().emergency_stop(request)
        return answer if answer.accepted else SILENCE


@mutant("idle-stop-is-answered-two", "4.17/2")
class IdleStopIsAnsweredTwo(ControllerCore):
    """A stop where nothing is to be stopped is answered 2."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 2 for 0."""
        if frame.opcode == 0x32 and frame.data == b"0":
            frame = frame._replace(data=b"2")
        super().emit(session, frame)


@mutant("second-idle-stop-is-lost", "4.17/2", "3/31", subtle=True)
class SecondIdleStopIsLost(ControllerCore):
    """Of stops where nothing is to be stopped every second one is not answered."""

    _idle = 0

    def emergency_stop(self, request: Request) -> Any:
        """Count them."""
        answer = super().emergency_stop(request)
        self._idle += not answer.accepted
        return answer if answer.accepted or self._idle % 2 else SILENCE


class _NotDuring(ControllerCore):
    """A stop is refused while one command executes."""

    during = ""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Find nothing to stop."""
        task = self.robot.task
        if task is not None and task.request.command.name == self.during:
            return _REFUSED
        return super().emergency_stop(request)


@mutant("run-is-not-stopped", "4.17/6", "4.17/3")
class RunIsNotStopped(_NotDuring):
    """The stop is refused while a program runs."""

    during = "run_program"


@mutant("simulation-is-not-stopped", "4.17/6", "4.17/3")
class SimulationIsNotStopped(_NotDuring):
    """The stop is refused while a program is simulated."""

    during = "simulate_program"


@mutant("reset-is-not-stopped", "4.17/6", "4.17/3")
class ResetIsNotStopped(_NotDuring):
    """The stop is refused while the robot resets."""

    during = "reset"


@mutant("move-is-not-stopped", "4.17/6", "4.17/3")
class MoveIsNotStopped(_NotDuring):
    """The stop is refused while the arm moves to a pose."""

    during = "set_tool_coordinates"


@mutant("jog-is-not-stopped", "4.17/6", "4.17/3")
class JogIsNotStopped(_NotDuring):
    """The stop is refused during a jog."""

    during = "jog"


@mutant("stop-comes-too-early", "4.17/6", "4.17/3", subtle=True)
class StopComesTooEarly(ControllerCore):
    """A stop within a millisecond of the start of a program finds nothing to stop."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Look whether it has begun."""
        task = self.robot.task
        if task is not None and task.program and request.now_s - task.request.now_s < 0.001:
            return _REFUSED
        return super().emergency_stop(request)


@mutant("only-the-starter-stops", "4.17/6", subtle=True)
class OnlyTheStarterStops(ControllerCore):
    """A stop is refused on every connection but that which began what executes."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Look at one's own commands alone."""
        task = self.robot.task
        if task is not None and task.request.session is not request.session:
            return _REFUSED
        return super().emergency_stop(request)


@mutant("stop-is-refused-in-uploads", "4.17/6", "4.17/3", subtle=True)
class StopIsRefusedInUploads(ControllerCore):
    """A stop is refused on a connection on which a file is being sent."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Look whether chunks are due."""
        transfer = request.session.transfer
        if transfer is not None and isinstance(transfer.end, Receiver):
            return _REFUSED
        return super().emergency_stop(request)


@mutant("stop-in-downloads-stops-nothing", "4.17/4", subtle=True)
class StopInDownloadsStopsNothing(ControllerCore):
    """A stop on a connection on which a file is being fetched is done, and the program goes on."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Stop nothing."""
        task = self.robot.task
        answer = super().emergency_stop(request)
        transfer = request.session.transfer
        if transfer is not None and isinstance(transfer.end, Sender):
            self.robot.task = task
        return answer


@mutant("stops-ten-times", "4.17/6", "4.17/3", subtle=True)
class StopsTenTimes(ControllerCore):
    """After ten stops every further one is refused."""

    _stops = 0

    def emergency_stop(self, request: Request) -> Acceptance:
        """Count them."""
        if self._stops >= 10:
            return _REFUSED
        answer = super().emergency_stop(request)
        self._stops += answer.accepted
        return answer


@mutant("stop-is-answered-with-code", "4.17/3")
class StopIsAnsweredWithCode(ControllerCore):
    """The first reply to a stop is "1|00"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add the code."""
        if frame.opcode == 0x32 and frame.data == b"1":
            frame = frame._replace(data=b"1|00")
        super().emit(session, frame)


@mutant("stop-has-no-result", "4.17/4")
class StopHasNoResult(ControllerCore):
    """A stop that has succeeded sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "emergency_stop":
            super().send_result(request, outcome)


@mutant("stop-ends-under-the-stopped", "4.17/4")
class StopEndsUnderTheStopped(ControllerCore):
    """The final result of a stop bears the opcode of what it has stopped."""

    _opcode = 0x32

    def emergency_stop(self, request: Request) -> Acceptance:
        """Note what it stops."""
        task = self.robot.task
        self._opcode = task.request.frame.opcode if task else 0x32
        return super().emergency_stop(request)

    def emit(self, session: Session, frame: Frame) -> None:
        """Use the other opcode."""
        if frame.opcode == 0x32 and frame.tagged:
            frame = frame._replace(opcode=self._opcode)
        super().emit(session, frame)


@mutant("stop-fails", "4.17/4")
class StopFails(ControllerCore):
    """A stop that has succeeded is told as a failure."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Blame the arm."""
        if request.command.name == "emergency_stop":
            outcome = Outcome(done=False, code="11")
        super().send_result(request, outcome)


@mutant("second-stop-has-no-result", "4.17/4", subtle=True)
class SecondStopHasNoResult(ControllerCore):
    """A second stop close behind the first is accepted, and has no final result."""

    _stopped_s = -1.0

    def emergency_stop(self, request: Request) -> Acceptance:
        """Accept it as part of the first."""
        answer = super().emergency_stop(request)
        if answer.accepted:
            self._stopped_s = request.now_s
        elif request.now_s - self._stopped_s < 0.01:
            self._stopped_s = -1.0
            return ACCEPTED
        return answer


@mutant("stopped-program-goes-on", "4.17/4", "4.8/3")
class StoppedProgramGoesOn(ControllerCore):
    """A stopped simulation is said to be stopped, and goes on."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Stop nothing of a simulation."""
        task = self.robot.task
        answer = super().emergency_stop(request)
        if task is not None and task.state == "02":
            self.robot.task = task
        return answer


@mutant("arm-coasts-on", "4.17/7")
class ArmCoastsOn(ControllerCore):
    """From the second stopped move on, the arm moves on slowly for a second after the stop."""

    _stopped_moves = 0

    def emergency_stop(self, request: Request) -> Acceptance:
        """Let the arm go on."""
        task = self.robot.task
        answer = super().emergency_stop(request)
        if task is not None and task.request.command.name == "set_tool_coordinates":
            self._stopped_moves += 1
            if self._stopped_moves > 1:
                way = motion.jog(self.plant.joints(request.now_s), JogDirection.PLUS_Y)
                self.plant.start(way, request.now_s)
        return answer


@mutant("jog-goes-on", "4.17/7")
class JogGoesOn(ControllerCore):
    """Behind a stop a jog goes on."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Let the arm go on."""
        task = self.robot.task
        answer = super().emergency_stop(request)
        if task is not None and task.request.command.name == "jog":
            way = motion.jog(self.plant.joints(request.now_s), task.request.value)
            self.plant.start(way, request.now_s)
        return answer


@mutant("stopped-arm-creeps", "4.17/7", subtle=True)
class StoppedArmCreeps(ControllerCore):
    """Behind a stop the inner arm goes on, by no more than half a degree in a second."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Let it creep."""
        answer = super().emergency_stop(request)
        if answer.accepted:
            here = self.plant.joints(request.now_s)
            there = here._replace(inner_arm_deg=here.inner_arm_deg + 0.5)
            creeping = motion.Motion((here, there), (0.0, 1.0), 1.0, smooth=False)
            self.plant.start(creeping, request.now_s)
        return answer


class _EndsAsDone(ControllerCore):
    """Of what was stopped one command is said to be done."""

    stopped = ""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Say so."""
        if request.command.name == self.stopped:
            outcome = DONE
        super().send_result(request, outcome)


@mutant("stopped-run-is-done", "4.17/8")
class StoppedRunIsDone(_EndsAsDone):
    """A run that was stopped is said to be done."""

    stopped = "run_program"


@mutant("stopped-simulation-is-done", "4.17/8")
class StoppedSimulationIsDone(_EndsAsDone):
    """A simulation that was stopped is said to be done."""

    stopped = "simulate_program"


@mutant("stopped-move-is-done", "4.17/8")
class StoppedMoveIsDone(_EndsAsDone):
    """A move that was stopped is said to be done."""

    stopped = "set_tool_coordinates"


@mutant("stopped-reset-is-done", "4.17/8")
class StoppedResetIsDone(_EndsAsDone):
    """A reset that was stopped is said to be done."""

    stopped = "reset"
