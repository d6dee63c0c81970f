"""Faults of clause 4.18: the reset."""

from dataclasses import dataclass, replace

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE, Movement
from scaraspec.virtual_controller.session import Request, Session


@mutant("reset-ends-run", "4.18/2", "4/6")
class ResetEndsRun(ControllerCore):
    """A reset during a run ends the program and is accepted."""

    def reset(self, request: Request) -> Acceptance:
        """Let go of the program first."""
        task = self.robot.task
        if task is not None and task.state == "01":
            self.robot.stop(request.now_s)
            self.send_result(task.request, task.outcome_if_stopped)
        return super().reset(request)


@mutant("reset-is-refused-with-idle", "4.18/2")
class ResetIsRefusedWithIdle(ControllerCore):
    """A reset during a run is refused with 00."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 00 for 01."""
        if frame.opcode == 0x33 and frame.data == b"0|01":
            frame = frame._replace(data=b"0|00")
        super().emit(session, frame)


@mutant("reset-is-not-answered-during-run", "4.18/2")
class ResetIsNotAnsweredDuringRun(ControllerCore):
    """A reset during a run is not answered."""

    def reset(self, request: Request) -> Acceptance | Silence:  # type: ignore[override] # silence is the fault
        """Say nothing."""
        answer = super().reset(request)
        return SILENCE if answer.code == "01" else answer


@mutant("refused-reset-ends-the-run", "4.18/2", subtle=True)
class RefusedResetEndsTheRun(ControllerCore):
    """A reset during a run is refused, and the program ends all the same."""

    def reset(self, request: Request) -> Acceptance:
        """Stop the program behind the refusal."""
        answer = super().reset(request)
        if answer.code == "01":
            self.robot.stop(request.now_s)
        return answer


@mutant("reset-takes-simulation-for-run", "4.18/2", "4/15")
class ResetTakesSimulationForRun(ControllerCore):
    """A reset during a simulation is refused with 01."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 01 for 02."""
        if frame.opcode == 0x33 and frame.data == b"0|02":
            frame = frame._replace(data=b"0|01")
        super().emit(session, frame)


@mutant("reset-needs-fault", "4.18/3")
class ResetNeedsFault(ControllerCore):
    """A robot without a fault refuses the reset: there is nothing to reset."""

    def reset(self, request: Request) -> Acceptance:
        """Refuse where there is no fault."""
        if self.plant.fault_code is None and self.robot.task is None:
            return Acceptance(accepted=False, code="05")
        return super().reset(request)


@mutant("reset-is-refused-behind-stop", "4.18/3", subtle=True)
class ResetIsRefusedBehindStop(ControllerCore):
    """The first reset behind an emergency stop is refused."""

    _stopped = False

    def emergency_stop(self, request: Request) -> Acceptance:
        """Note it."""
        answer = super().emergency_stop(request)
        self._stopped = bool(answer.accepted)
        return answer

    def reset(self, request: Request) -> Acceptance:
        """Refuse once."""
        stopped, self._stopped = self._stopped, False
        return Acceptance(accepted=False, code="06") if stopped else super().reset(request)


@mutant("reset-is-accepted-with-its-state", "4.18/3", "4/1")
class ResetIsAcceptedWithItsState(ControllerCore):
    """The first reply to a reset is "1|03"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add the state."""
        if frame.opcode == 0x33 and frame.data == b"1":
            frame = frame._replace(data=b"1|03")
        super().emit(session, frame)


@dataclass(frozen=True)
class _UnderWay(Movement):
    """Ends ahead of the motion."""

    ends_s: float

    @property
    def next_event_s(self) -> float:
        """At that time."""
        return self.ends_s

    def advance(self, now_s: float) -> Outcome | None:
        """Done then."""
        return DONE if now_s >= self.ends_s else None


@mutant("reset-ends-under-way", "4.18/4", subtle=True)
class ResetEndsUnderWay(ControllerCore):
    """A reset is said to have ended when the arm has gone half of the way."""

    def reset(self, request: Request) -> Acceptance:
        """Cut it."""
        answer = super().reset(request)
        if answer.accepted and self.robot.task is not None:
            half_s = (request.now_s + self.plant.motion_ends_s) / 2
            self.robot.task = replace(self.robot.task, activity=_UnderWay(self.plant, half_s))
        return answer


@mutant("reset-has-no-result", "4.18/4")
class ResetHasNoResult(ControllerCore):
    """A reset that has succeeded sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "reset":
            super().send_result(request, outcome)


@mutant("reset-ends-in-four-bytes", "4.18/4")
class ResetEndsInFourBytes(ControllerCore):
    """The final result of a reset that has succeeded is "0|11", of the length that L417 prints."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write it so."""
        if frame.opcode == 0x33 and frame.tagged and frame.data == b"11":
            frame = frame._replace(data=b"0|11")
        super().emit(session, frame)


@mutant("reset-ignores-lasting-faults", "4.18/4")
class ResetIgnoresLastingFaults(ControllerCore):
    """A reset is said to have succeeded although the fault lasts."""

    def reset(self, request: Request) -> Acceptance:
        """Do not look again."""
        if self.plant.fault_code is None:
            return super().reset(request)
        self.plant.clear_faults()
        self.send_result(request, DONE)
        return ACCEPTED


@mutant("reset-stays-in-its-state", "4.18/4", "4/7", subtle=True)
class ResetStaysInItsState(ControllerCore):
    """Behind a reset that had a way to go the status stays 03 until something else is asked."""

    _reset = False

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Note what ended last."""
        self._reset = request.command.name == "reset"
        super().send_result(request, outcome)

    def get_status(self, request: Request) -> str:
        """Tell of the reset."""
        now = super().get_status(request)
        return "03" if self._reset and now == "00" else now
