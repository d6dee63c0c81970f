"""Mutants of clause 4.16: simulating a program."""

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, outcome, sent_frame
from scaraspec.mutants.operators.controller.requests import completes_refused
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import RUNNING, SIMULATING
from scaraspec.virtual_controller.session import Request

row(
    "accepts-simulation-in-words",
    "4.16/2 4/1",
    "A simulation is accepted with 1|sim.",
    first_reply("simulate_program", {b"1": b"1|sim"}),
)
row(
    "refuses-simulation-in-one-byte",
    "4.16/2 4/1",
    "The refusal of a simulation has no code.",
    first_reply("simulate_program", lambda data: b"0" if data.startswith(b"0|") else data),
)


@mutant("simulates-once", "4.16/2", subtle=True)
class RefusesSimulationAfterRun(ControllerCore):
    """After a run every simulation is refused."""

    _ran = False

    def run_program(self, request: Request) -> Acceptance:
        self._ran = True
        return super().run_program(request)

    def simulate_program(self, request: Request) -> Acceptance:
        is_refused = self._ran and self.robot.task is None
        return refused("05") if is_refused else super().simulate_program(request)


row(
    "simulates-what-is-not-there",
    "8/5",
    "The simulation of a missing program is accepted and reported as done.",
    completes_refused("simulate_program", "20"),
)
row(
    "simulation-misses-with-one",
    "8/5",
    "The simulation of a missing program is refused with 01.",
    first_reply("simulate_program", {b"0|20": b"0|01"}),
)
row(
    "simulation-has-no-result",
    "4.16/3",
    "A completed simulation sends no final result.",
    outcome("simulate_program", lambda _core, _request, ended: None if ended.done else ended),
)
row(
    "simulation-ends-as-run",
    "4.16/3",
    "The final result of a simulation has the opcode of the run.",
    sent_frame(lambda frame: frame.opcode == 0x31 and frame.tagged, opcode=0x30),
)


@mutant("second-simulation-fails", "4.16/3", subtle=True)
class FailsSecondSimulation(ControllerCore):
    """From the second one on, a completed simulation is reported as failed."""

    _simulated = 0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name == "simulate_program" and outcome.done:
            self._simulated += 1
            if self._simulated > 1:
                outcome = Outcome(done=False, code="06")
        super().send_result(request, outcome)


@mutant("simulation-is-run", "4.16/5", "4.8/5")
class RunsSimulation(ControllerCore):
    """A simulation runs the program."""

    def simulate_program(self, request: Request) -> Acceptance:
        return self._start(request, RUNNING)


@mutant("stays-in-the-simulator", "4.8/4", "4.16/3", subtle=True)
class ReportsRunAsSimulation(ControllerCore):
    """After a simulation the status of every run is 02."""

    _simulated = False

    def simulate_program(self, request: Request) -> Acceptance:
        self._simulated = True
        return super().simulate_program(request)

    def get_status(self, request: Request) -> str:
        status = super().get_status(request)
        return SIMULATING if self._simulated and status == RUNNING else status
