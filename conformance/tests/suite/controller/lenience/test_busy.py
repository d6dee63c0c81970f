"""Conforming controllers whose behaviour while a command executes is a reading of its own."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]

_STATE = (Hazard.READ_ONLY, Hazard.STATE)


class ResetEndsAtRelease(ControllerCore):
    """A reset ends at the moment at which another client requests a release."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        task = self.robot.task
        if frame.opcode == 0x3A and task and task.state == "03" and task.request.session != session:
            self.robot.stop(now_s)
            self.send_result(task.request, DONE)
            self._send_deferred()
        super().handle(session, frame, now_s)


def test_robot_that_is_idle_again_may_accept_a_command(run_cases: RunCases) -> None:
    """A command may be accepted if the previous one may have just ended on another connection."""
    cases = run_cases(ResetEndsAtRelease, "4/6")
    assert cases["4/6.reset"].verdict is Verdict.NONE
    assert all(cases[f"4/6.{name}"].verdict is Verdict.PASS for name in ("jog", "run_program"))


class DetectsMissingProgramLate(ControllerCore):
    """A missing program is detected late (A-4.15-1).

    Until then, commands that execute are not answered (A-4-2).
    """

    due_s = math.inf

    def run_program(self, request: Request) -> Acceptance | Silence:
        return self._accept_missing(request, super().run_program(request))

    def simulate_program(self, request: Request) -> Acceptance | Silence:
        return self._accept_missing(request, super().simulate_program(request))

    def _accept_missing(self, request: Request, reply: Acceptance | Silence) -> Any:
        if self.due_s < math.inf:
            return SILENCE
        if isinstance(reply, Acceptance) and reply.code == "20":
            self.due_s, self._request = request.now_s + 0.05, request
            return ACCEPTED
        return reply

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        if self.due_s <= now_s:
            self.due_s = math.inf
            self.send_result(self._request, Outcome(done=False, code="20"))
            self._send_deferred()

    @property
    def next_event_s(self) -> float | None:
        due_s = min(self.due_s, super().next_event_s or math.inf)
        return None if due_s == math.inf else due_s


@pytest.mark.parametrize("only", ["8/2", "T/1", "T/7"])
def test_missing_program_may_be_detected_late(run_cases: RunCases, only: str) -> None:
    """The suite waits for the result of an accepted command before it sends the next one."""
    assert not run_cases(DetectsMissingProgramLate, only).problems


class FailsLate(ControllerCore):
    """A motor fails, and the final result is sent a second later (A-3-15)."""

    _due_s: float | None = None

    def _finish_tasks(self, now_s: float) -> None:
        if self.robot.task is None or self.plant.fault_code is None:
            super()._finish_tasks(now_s)
            return
        self._due_s = now_s + 1 if self._due_s is None else self._due_s
        if now_s >= self._due_s:
            self._due_s = None
            super()._finish_tasks(now_s)

    @property
    def next_event_s(self) -> float | None:
        return super().next_event_s if self._due_s is None else self._due_s


def test_status_may_show_a_fault_before_the_result(run_cases: RunCases) -> None:
    """A status with a fault does not mean that nothing executes (A-4.8-2)."""
    cases = run_cases(FailsLate, "4/3", hooks=("motor_fault", "clear_faults"))
    assert cases["4/3.fault"].verdict is Verdict.PASS
    assert not cases.not_passed


class SimulatesAtOnce(ControllerCore):
    """A simulation takes no time."""

    def simulate_program(self, request: Request) -> Acceptance:
        reply = super().simulate_program(request)
        if reply.accepted:
            self.robot.stop(request.now_s)
            self.send_result(request, DONE)
        return reply


class QueuesRequestsWhileBusy(ControllerCore):
    """While a command executes, only the emergency stop is served; other requests wait (A-4-3)."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: list[tuple[Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if self.robot.task is not None and frame.opcode != 0x32:
            self._waiting.append((session, frame))
        else:
            super().handle(session, frame, now_s)

    def _finish_tasks(self, now_s: float) -> None:
        super()._finish_tasks(now_s)
        while self.robot.task is None and self._waiting:
            self.handle(*self._waiting.pop(0), now_s)


@pytest.mark.parametrize("core", [SimulatesAtOnce, QueuesRequestsWhileBusy])
def test_queries_may_be_impossible_while_executing(
    run_cases: RunCases, core: type[ControllerCore]
) -> None:
    """Cases that need replies while a command executes are skipped (A-4-3)."""
    cases = run_cases(core, "4.8/4", "4.8/5", "4.9/2", "4.9/3", "4.9/4")
    assert Verdict.FAIL not in {case.verdict for case in cases.values()}


class AnswersSomeQueriesLate(ControllerCore):
    """Some queries take time, and later requests are answered before them (A-3-14)."""

    _DELAY_S = 0.02

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._delayed: list[tuple[float, Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode in (0x0D, 0x0F, 0x13):
            self._delayed.append((now_s + self._DELAY_S, session, frame))
        else:
            super().handle(session, frame, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        while self._delayed and self._delayed[0][0] <= now_s:
            _, session, frame = self._delayed.pop(0)
            super().handle(session, frame, now_s)

    @property
    def next_event_s(self) -> float | None:
        next_s = self._delayed[0][0] if self._delayed else math.inf
        return min(next_s, super().next_event_s or math.inf)


def test_replies_may_come_in_any_order(run_cases: RunCases) -> None:
    """Replies may come in any order."""
    cases = run_cases(AnswersSomeQueriesLate, "4.12/2", "4.12/5", "4.13/3", "4.14/3")
    assert not cases.not_passed
    assert "op_get_default" in cases.readings


class ClosesFirstConnectionDuringMove(ControllerCore):
    """The first connection that requests the status during a move is closed."""

    command = "set_tool_coordinates"
    _ended = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        task = self.robot.task
        moves = task and task.request.command.name == self.command
        if moves and frame.opcode == 0x09 and not self._ended:
            self._ended = True
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class ClosesFirstConnectionDuringJog(ClosesFirstConnectionDuringMove):
    """The first connection that requests the status during a jog is closed."""

    command = "jog"


@pytest.mark.parametrize("core", [ClosesFirstConnectionDuringMove, ClosesFirstConnectionDuringJog])
def test_closed_connection_does_not_mean_unresponsive(
    run_cases: RunCases, core: type[ControllerCore]
) -> None:
    """A closed connection does not mean that the busy robot is unresponsive (A-4-3)."""
    cases = run_cases(core, "4.8/7", "4.25/5")
    assert cases["4.25/5.jog"].verdict is Verdict.PASS
    assert Verdict.NONE not in {case.verdict for case in cases.values()}


class RefusesSettingsWhileBusy(ControllerCore):
    """While a command executes, every setting is refused."""

    def set_default_program(self, request: Request) -> bool:
        return self.robot.task is None and super().set_default_program(request)

    def set_time(self, request: Request) -> bool:
        return self.robot.task is None and super().set_time(request)


def test_settings_may_be_refused_while_a_program_runs(run_cases: RunCases) -> None:
    """Settings may be refused during a program, like the gripper center (A-4.20-1)."""
    assert not run_cases(RefusesSettingsWhileBusy, "4.5/4", "4.13/6", "4.9/2").not_passed


class UnresponsiveWhileJogging(ControllerCore):
    """While the arm jogs, only the emergency stop is served (A-4-3)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        task = self.robot.task
        if task is None or task.request.command.name != "jog" or frame.opcode == 0x32:
            super().handle(session, frame, now_s)


def test_unresponsive_only_while_jogging(run_cases: RunCases) -> None:
    """A robot may answer queries during programs and not during a jog."""
    cases = run_cases(
        UnresponsiveWhileJogging, "4.8/7", "4.25/5", "4.28/3", "4.28/4", "4.28/5", "4/6"
    )
    skipped = [case.id for case in cases.values() if case.verdict is Verdict.NONE]
    assert "4.8/7.jogging" in skipped
    assert not cases.problems


class RunsProgramOfOthers(ControllerCore):
    """A program of another user runs forever."""

    name = b"welding.rob"

    def get_status(self, _: Request) -> str:
        return "01"

    def get_running_program(self, request: Request) -> RunningProgram | None:
        return RunningProgram(self.name, int(request.now_s)) if self.name else None

    def set_gripper_center(self, _: Request) -> bool:
        return False


class RunsProgramOfSuite(RunsProgramOfOthers):
    """The reported program belongs to the suite."""

    name = b"zsaaaa1.rob"


class ReportsRunWithoutProgram(RunsProgramOfOthers):
    """The status is that of a run, but no running program is reported."""

    name = b""


def test_robot_in_use_is_skipped(run_cases: RunCases) -> None:
    """Cases that need an idle robot are skipped if a program of another user runs."""
    cases = run_cases(RunsProgramOfOthers, "3/31", "4.8/3", "4.9/6", "4.20/4", allowed=_STATE)
    skipped = {case.id for case in cases.values() if "welding.rob" in case.message}
    sequences = {"3/31.sequences", "3/31.long-use", "4.20/3.sequences"}
    assert skipped == {"4.8/2", "4.9/6", "4.20/4", *sequences}
    assert not cases.problems


@pytest.mark.parametrize("core", [RunsProgramOfSuite, ReportsRunWithoutProgram])
def test_wrong_status_is_not_a_program_of_others(
    run_cases: RunCases, core: type[ControllerCore]
) -> None:
    """A status without a program, or with a program of the suite, is a failure."""
    assert run_cases(core, "4.8/3", allowed=_STATE)["4.8/2"].verdict is Verdict.FAIL
