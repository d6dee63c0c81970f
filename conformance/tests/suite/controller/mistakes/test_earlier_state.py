"""Faulty controllers: state of an earlier operation or of another connection has an effect."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.protocol.commands import Command, RunningProgram
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.program_files import Node, ValueType, WaitInput, WaitSeconds, WaitTimer
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.robot import RESETTING, SIMULATING
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]


class SendsResultToStopper(ControllerCore):
    """The result of a stopped command goes to the connection that has stopped it."""

    def emergency_stop(self, request: Request) -> Acceptance:
        if self.robot.task:
            stopped = replace(self.robot.task.request, session=request.session)
            self.robot.task = replace(self.robot.task, request=stopped)
        return super().emergency_stop(request)


class LoginMovesToNext(ControllerCore):
    """The login of a closed connection moves to the one that was opened after it."""

    def _remove_session(self, session: Session, now_s: float) -> None:
        order = [*self.sessions.values()]
        at = order.index(session) + 1
        super()._remove_session(session, now_s)
        for after in order[at : at + 1]:
            after.logged_in |= session.logged_in


class RunTimeOfCalendar(ControllerCore):
    """The run time is the difference of two times of the calendar clock."""

    began = None

    def _start(self, request: Request, state: Any) -> Acceptance:
        self.began = self.plant.clock.time(request.now_s)
        return super()._start(request, state)

    def get_running_program(self, request: Request) -> RunningProgram | None:
        running = super().get_running_program(request)
        if running is None or self.began is None:
            return running
        elapsed = self.plant.clock.time(request.now_s) - self.began
        return running._replace(run_time_s=int(elapsed.total_seconds()) % 86_400)


class StaysResetting(ControllerCore):
    """After the stop of a reset, resets are refused as busy until a move."""

    resetting = False

    def emergency_stop(self, request: Request) -> Acceptance:
        self.resetting |= bool(self.robot.task and self.robot.task.state == RESETTING)
        return super().emergency_stop(request)

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        self.resetting = False
        return super().set_tool_coordinates(request)

    def reset(self, request: Request) -> Acceptance:
        return refused(RESETTING) if self.resetting else super().reset(request)


class StaysStopped(ControllerCore):
    """After the stop of an idle robot, the next move ends at once."""

    stopped = False

    def emergency_stop(self, request: Request) -> Acceptance:
        reply = super().emergency_stop(request)
        self.stopped = not reply.accepted
        return reply

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        reply = super().set_tool_coordinates(request)
        if self.stopped and reply.accepted:
            self.stopped = False
            self.plant.stop(request.now_s)
        return reply


class StaysSimulating(ControllerCore):
    """After the stop of a simulation, the next program is simulated."""

    simulating = False

    def emergency_stop(self, request: Request) -> Acceptance:
        self.simulating |= bool(self.robot.task and self.robot.task.state == SIMULATING)
        return super().emergency_stop(request)

    def _start(self, request: Request, state: Any) -> Acceptance:
        reply = super()._start(request, state)
        if reply.accepted and self.simulating:
            self.simulating = False
            self.robot.task.activity._simulated = True
        return reply


class NamesRefusedCommand(ControllerCore):
    """The result of a command has the opcode of the last one that was refused."""

    def _reply(self, session: Session, command: Command, frame: Frame, answer: Any) -> None:
        if self.robot.task and command.two_stage and answer == refused(self.robot.task.state):
            request = replace(self.robot.task.request, command=command, frame=frame)
            self.robot.task = replace(self.robot.task, request=request)
        super()._reply(session, command, frame, answer)


class AnswersRefusedCommands(ControllerCore):
    """Runs and simulations that were refused have a final result, too."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.refused: list[Request] = []

    def _start(self, request: Request, state: Any) -> Acceptance:
        reply = super()._start(request, state)
        if not reply.accepted and self.robot.task:
            self.refused.append(request)
        return reply

    def send_result(self, request: Request, outcome: Outcome) -> None:
        super().send_result(request, outcome)
        while self.refused:
            super().send_result(self.refused.pop(), outcome)


class StopsProgramsOnly(ControllerCore):
    """The stop of a program does not stop its current move."""

    def emergency_stop(self, request: Request) -> Acceptance:
        is_program = self.robot.task and isinstance(self.robot.task.activity, Run)
        motion = self.plant._motion, self.plant._began_s
        reply = super().emergency_stop(request)
        if is_program:
            self.plant._motion, self.plant._began_s = motion
        return reply


class WaitsOnce(Run):
    """A wait node in a loop waits in the first iteration only."""

    waited: frozenset[int] = frozenset()

    def _begin(self, node: Node, now_s: float) -> float:
        if isinstance(node.data, WaitSeconds) and self._index in self.waited:
            return now_s
        self.waited |= {self._index}
        return super()._begin(node, now_s)


class WaitsForOneInput(Run):
    """After the first input condition that is met, all are taken as met."""

    is_met = False

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        if self.is_met and isinstance(wait, WaitInput):
            return now_s
        ends_s = super()._wait_ends_s(wait, now_s)
        self.is_met |= isinstance(wait, WaitInput) and ends_s <= now_s
        return ends_s


class ReadsOutputs(Run):
    """An input operand has the state of the output with this number."""

    def _value(self, value_type: ValueType, value: int) -> int:
        if value_type == ValueType.INPUT_PORT:
            return int(self._plant.digital_outputs[value])
        return super()._value(value_type, value)


class PassesTimersOfOtherDays(Run):
    """A timer compares only the time of day."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        ends_s = super()._wait_ends_s(wait, now_s)
        if not isinstance(wait, WaitTimer):
            return ends_s
        remaining_s = (ends_s - now_s) % 86_400
        return now_s if remaining_s > 43_200 else now_s + remaining_s


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (SendsResultToStopper, "4.17/3", "3/16"),
        (LoginMovesToNext, "2/11", "2/11"),
        (RunTimeOfCalendar, "4.9/5", "4.9/5"),
        (StaysResetting, "4.17/6", "4/15"),
        (StaysStopped, "4.17/2", "4.24/8"),
        (NamesRefusedCommand, "4/6", "3/17"),
        (AnswersRefusedCommands, "4/6", "3/17"),
        (StopsProgramsOnly, "6.5/25", "4.17/7"),
        (with_interpreter(WaitsOnce), "6.5/23", "6.5/20"),
        (with_interpreter(WaitsForOneInput), "6.5/21", "6.5/9"),
        (with_interpreter(ReadsOutputs), "6.6a/14", "6.6a/14"),
        (with_interpreter(PassesTimersOfOtherDays), "6.5/22", "6.5/22"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    assert requirement in run_cases(core, only).violated


def test_sequences_detect_a_simulation_that_does_not_end(run_cases: RunCases) -> None:
    """A stopped simulation is followed by a run that sets outputs."""
    ran = run_cases(StaysSimulating, "4.32/6", examples=20)
    assert ran["4/15.sequences"].verdict is Verdict.FAIL
