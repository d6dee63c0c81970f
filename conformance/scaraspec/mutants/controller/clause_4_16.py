"""Faults of clause 4.16: simulating a program."""

from scaraspec.mutants.controller import mutant
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour.base import ACCEPTED
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import RUNNING, Task
from scaraspec.virtual_controller.session import Request, Session


@mutant("accepts-simulation-in-words", "4.16/2", "4/1")
class AcceptsSimulationInWords(ControllerCore):
    """A simulation is accepted with "1|sim"."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Add a word."""
        if frame.opcode == 0x31 and frame.data == b"1" and not frame.tagged:
            frame = frame._replace(data=b"1|sim")
        super().emit(session, frame)


@mutant("refuses-simulation-in-one-byte", "4.16/2", "4/1")
class RefusesSimulationInOneByte(ControllerCore):
    """The refusal of a simulation has no code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send the flag alone."""
        if frame.opcode == 0x31 and frame.data.startswith(b"0|"):
            frame = frame._replace(data=b"0")
        super().emit(session, frame)


@mutant("simulates-once", "4.16/2", subtle=True)
class SimulatesOnce(ControllerCore):
    """Behind a run no program can be simulated any more."""

    _ran = False

    def run_program(self, request: Request) -> Acceptance:
        """Leave the simulator for good."""
        self._ran = True
        return super().run_program(request)

    def simulate_program(self, request: Request) -> Acceptance:
        """Refuse once a program has run."""
        if self._ran and self.robot.task is None:
            return Acceptance(accepted=False, code="05")
        return super().simulate_program(request)


@mutant("simulates-what-is-not-there", "8/5")
class SimulatesWhatIsNotThere(ControllerCore):
    """The simulation of a missing program is accepted and done."""

    def simulate_program(self, request: Request) -> Acceptance:
        """Simulate an empty program."""
        answer = super().simulate_program(request)
        if answer.code != "20":
            return answer
        self.send_result(request, Outcome(done=True))
        return ACCEPTED


@mutant("simulation-misses-with-one", "8/5")
class SimulationMissesWithOne(ControllerCore):
    """The simulation of a missing program is refused with 01."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Write 01 for 20."""
        if frame.opcode == 0x31 and frame.data == b"0|20":
            frame = frame._replace(data=b"0|01")
        super().emit(session, frame)


@mutant("simulation-has-no-result", "4.16/3")
class SimulationHasNoResult(ControllerCore):
    """A simulation that comes to its end sends no final result."""

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave it out."""
        if request.command.name != "simulate_program" or not outcome.done:
            super().send_result(request, outcome)


@mutant("simulation-ends-as-run", "4.16/3")
class SimulationEndsAsRun(ControllerCore):
    """The final result of a simulation bears the opcode of the run."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Use the other opcode."""
        if frame.opcode == 0x31 and frame.tagged:
            frame = frame._replace(opcode=0x30)
        super().emit(session, frame)


@mutant("second-simulation-fails", "4.16/3", subtle=True)
class SecondSimulationFails(ControllerCore):
    """From the second on every simulation ends with a failure."""

    _simulated = 0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Leave something behind the first time."""
        if request.command.name == "simulate_program" and outcome.done:
            self._simulated += 1
            if self._simulated > 1:
                outcome = Outcome(done=False, code="06")
        super().send_result(request, outcome)


@mutant("simulation-is-run", "4.16/5", "4.8/5")
class SimulationIsRun(ControllerCore):
    """A simulation runs the program in earnest."""

    def simulate_program(self, request: Request) -> Acceptance:
        """Run it."""
        return self._start(request, RUNNING)


@mutant("stays-in-the-simulator", "4.8/4", "4.16/3", subtle=True)
class StaysInTheSimulator(ControllerCore):
    """A run behind a simulation is reported as a simulation."""

    _simulated = False

    def simulate_program(self, request: Request) -> Acceptance:
        """Enter the simulator."""
        self._simulated = True
        return super().simulate_program(request)

    def get_status(self, request: Request) -> str:
        """Forget to leave it."""
        now = super().get_status(request)
        task: Task | None = self.robot.task
        return "02" if task is not None and now == RUNNING and self._simulated else now
