"""Mutants of clause 4.18: the reset."""

from dataclasses import dataclass, replace

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import final_result, first_reply, outcome
from scaraspec.mutants.operators.controller.requests import after, answer, before, refuses
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE, IDLE, RESETTING, RUNNING, Movement
from scaraspec.virtual_controller.session import Request


def _end_run(core: ControllerCore, request: Request) -> None:
    task = core.robot.task
    if task is not None and task.state == RUNNING:
        core.robot.stop(request.now_s)
        core.send_result(task.request, task.outcome_if_stopped)


def _end_run_if_refused(core: ControllerCore, request: Request, reply: Acceptance) -> Acceptance:
    if reply.code == "01":
        core.robot.stop(request.now_s)
    return reply


def _has_no_fault(core: ControllerCore, _request: Request) -> bool:
    return core.plant.fault_code is None and core.robot.task is None


@dataclass(frozen=True)
class _EarlyMovement(Movement):
    """Ends before the motion."""

    ends_s: float

    @property
    def next_event_s(self) -> float:
        return self.ends_s

    def advance(self, now_s: float) -> Outcome | None:
        return DONE if now_s >= self.ends_s else None


def _end_halfway(core: ControllerCore, request: Request, reply: Acceptance) -> Acceptance:
    if reply.accepted and core.robot.task is not None:
        half_s = (request.now_s + core.plant.motion_ends_s) / 2
        core.robot.task = replace(core.robot.task, activity=_EarlyMovement(core.plant, half_s))
    return reply


row(
    "reset-ends-run",
    "4.18/2 4/6",
    "A reset during a run ends the program and is accepted.",
    before("reset", _end_run),
)
row(
    "reset-is-refused-with-idle",
    "4.18/2",
    "A reset during a run is refused with 00.",
    first_reply("reset", {b"0|01": b"0|00"}),
)
row(
    "reset-is-not-answered-during-run",
    "4.18/2",
    "A reset during a run is not answered.",
    answer("reset", lambda reply: SILENCE if reply.code == "01" else reply),
)
row(
    "refused-reset-ends-the-run",
    "4.18/2",
    "A reset during a run is refused but ends the program.",
    after("reset", _end_run_if_refused),
    subtle=True,
)
row(
    "reset-takes-simulation-for-run",
    "4.18/2 4/15",
    "A reset during a simulation is refused with 01.",
    first_reply("reset", {b"0|02": b"0|01"}),
)
row(
    "reset-needs-fault",
    "4.18/3",
    "A reset is refused if there is no fault.",
    refuses("reset", _has_no_fault, "05"),
)


@mutant("reset-is-refused-behind-stop", "4.18/3", subtle=True)
class RefusesResetAfterStop(ControllerCore):
    """The first reset after an emergency stop is refused."""

    _stopped = False

    def emergency_stop(self, request: Request) -> Acceptance:
        reply = super().emergency_stop(request)
        self._stopped = reply.accepted
        return reply

    def reset(self, request: Request) -> Acceptance:
        stopped, self._stopped = self._stopped, False
        return refused("06") if stopped else super().reset(request)


row(
    "reset-is-accepted-with-its-state",
    "4.18/3 4/1",
    "The first reply to a reset is 1|03.",
    first_reply("reset", {b"1": b"1|03"}),
)
row(
    "reset-ends-under-way",
    "4.18/4",
    "The final result of a reset is sent after half of the motion.",
    after("reset", _end_halfway),
    subtle=True,
)
row(
    "reset-has-no-result",
    "4.18/4",
    "A reset sends no final result.",
    outcome("reset", lambda _core, _request, _ended: None),
)
row(
    "reset-ends-in-four-bytes",
    "4.18/4",
    "The final result of a completed reset is 0|11, with the length that L417 prints.",
    final_result("reset", {b"11": b"0|11"}),
)


@mutant("reset-ignores-lasting-faults", "4.18/4")
class IgnoresLastingFaults(ControllerCore):
    """A reset during a lasting fault is reported as done."""

    def reset(self, request: Request) -> Acceptance:
        if self.plant.fault_code is None:
            return super().reset(request)
        self.plant.clear_faults()
        self.send_result(request, DONE)
        return ACCEPTED


@mutant("reset-stays-in-its-state", "4.18/4", "4/7", subtle=True)
class StaysInReset(ControllerCore):
    """After a reset the status is 03 instead of 00 until the next final result."""

    _reset = False

    def send_result(self, request: Request, outcome: Outcome) -> None:
        self._reset = request.command.name == "reset"
        super().send_result(request, outcome)

    def get_status(self, request: Request) -> str:
        status = super().get_status(request)
        return RESETTING if self._reset and status == IDLE else status
