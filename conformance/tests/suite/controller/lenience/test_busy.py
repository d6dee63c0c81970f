"""Controllers that serve others in ways of their own, which are open, while they execute."""

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

Try = Callable[..., Any]

_STATE = (Hazard.READ_ONLY, Hazard.STATE)


class EndsJustThen(ControllerCore):
    """A reset ends when another client asks for a release, and its result goes to the first."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        task = self.robot.task
        if frame.opcode == 0x3A and task and task.state == "03" and task.request.session != session:
            self.robot.stop(now_s)
            self.send_result(task.request, DONE)
            self._send_deferred()
        super().handle(session, frame, now_s)


def test_who_is_free_again_may_accept_what_another_client_asks(tried: Try) -> None:
    """Which of two connections was served first is not seen where both are within a moment."""
    cases = tried(EndsJustThen, "4/6")
    assert cases["4/6.reset"].verdict is Verdict.NONE
    assert all(cases[f"4/6.{name}"].verdict is Verdict.PASS for name in ("jog", "run_program"))


class FindsOutLate(ControllerCore):
    """That a program is missing is found out late (A-4.15-1), and meanwhile nothing else is
    answered that would execute (A-4-2)."""

    due_s = math.inf

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Look for it later."""
        return self._later_missing(request, super().run_program(request))

    def simulate_program(self, request: Request) -> Acceptance | Silence:
        """Look for it later."""
        return self._later_missing(request, super().simulate_program(request))

    def _later_missing(self, request: Request, answer: Acceptance | Silence) -> Any:
        if self.due_s < math.inf:
            return SILENCE
        if isinstance(answer, Acceptance) and answer.code == "20":
            self.due_s, self._asked = request.now_s + 0.05, request
            return ACCEPTED
        return answer

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        if self.due_s <= now_s:
            self.due_s = math.inf
            self.send_result(self._asked, Outcome(done=False, code="20"))
            self._send_deferred()

    @property
    def next_event_s(self) -> float | None:
        """When it is found out."""
        due_s = min(self.due_s, super().next_event_s or math.inf)
        return None if due_s == math.inf else due_s


@pytest.mark.parametrize("only", ["8/2", "T/1", "T/7"])
def test_who_finds_out_late_what_is_missing_may_be_silent_till_then(tried: Try, only: str) -> None:
    """What was accepted is waited for before the next is asked."""
    assert not tried(FindsOutLate, only).alarms


class FailsLate(ControllerCore):
    """A motor fails, and the final result takes a while (A-3-15)."""

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
        """When the result is due."""
        return super().next_event_s if self._due_s is None else self._due_s


def test_a_fault_may_show_before_the_result(tried: Try) -> None:
    """A status that tells of a fault does not say that nothing executes (A-4.8-2)."""
    cases = tried(FailsLate, "4/3", handled=("motor_fault", "clear_faults"))
    assert cases["4/3.fault"].verdict is Verdict.PASS
    assert not cases.wrong


class SimulatesAtOnce(ControllerCore):
    """A simulation takes no time."""

    def simulate_program(self, request: Request) -> Acceptance:
        """End it."""
        answer = super().simulate_program(request)
        if answer.accepted:
            self.robot.stop(request.now_s)
            self.send_result(request, DONE)
        return answer


class ServesNothingMeanwhile(ControllerCore):
    """While a command executes only the emergency stop is served; the rest waits (A-4-3)."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: list[tuple[Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Let it wait."""
        if self.robot.task is not None and frame.opcode != 0x32:
            self._waiting.append((session, frame))
        else:
            super().handle(session, frame, now_s)

    def _finish_tasks(self, now_s: float) -> None:
        super()._finish_tasks(now_s)
        while self.robot.task is None and self._waiting:
            self.handle(*self._waiting.pop(0), now_s)


@pytest.mark.parametrize("core", [SimulatesAtOnce, ServesNothingMeanwhile])
def test_who_cannot_be_asked_while_executing_is_not_failed(
    tried: Try, core: type[ControllerCore]
) -> None:
    """What cannot be seen so is not tried (A-4-3)."""
    cases = tried(core, "4.8/4", "4.8/5", "4.9/2", "4.9/3", "4.9/4")
    assert Verdict.FAIL not in {case.verdict for case in cases.values()}


class LooksItUp(ControllerCore):
    """What is in a file takes a look, and what is asked meanwhile is answered first (A-3-14)."""

    _LOOKS_S = 0.02

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._looking: list[tuple[float, Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Begin to look."""
        if frame.opcode in (0x0D, 0x0F, 0x13):
            self._looking.append((now_s + self._LOOKS_S, session, frame))
        else:
            super().handle(session, frame, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        while self._looking and self._looking[0][0] <= now_s:
            _, session, frame = self._looking.pop(0)
            super().handle(session, frame, now_s)

    @property
    def next_event_s(self) -> float | None:
        """When it has found it."""
        looked_s = self._looking[0][0] if self._looking else math.inf
        return min(looked_s, super().next_event_s or math.inf)


def test_what_is_answered_behind_a_later_request_is_answered(tried: Try) -> None:
    """Replies may come in any order."""
    cases = tried(LooksItUp, "4.12/2", "4.12/5", "4.13/3", "4.14/3")
    assert not cases.wrong
    assert "op_get_default" in cases.readings


class EndsTheFirstLinkInAMove(ControllerCore):
    """The first client that asks for the status during a move is sent away."""

    of = "set_tool_coordinates"
    _ended = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        task = self.robot.task
        moves = task and task.request.command.name == self.of
        if moves and frame.opcode == 0x09 and not self._ended:
            self._ended = True
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class EndsTheFirstLinkInAJog(EndsTheFirstLinkInAMove):
    """The first client that does during a jog."""

    of = "jog"


@pytest.mark.parametrize("core", [EndsTheFirstLinkInAMove, EndsTheFirstLinkInAJog])
def test_who_ends_a_connection_is_not_taken_for_deaf(
    tried: Try, core: type[ControllerCore]
) -> None:
    """What is tried while it executes goes on to be tried (A-4-3)."""
    cases = tried(core, "4.8/7", "4.25/5")
    assert cases["4.25/5.jog"].verdict is Verdict.PASS
    assert Verdict.NONE not in {case.verdict for case in cases.values()}


class TakesNoSettingsMeanwhile(ControllerCore):
    """While it executes it refuses every setting."""

    def set_default_program(self, request: Request) -> bool:
        """Refuse it."""
        return self.robot.task is None and super().set_default_program(request)

    def set_time(self, request: Request) -> bool:
        """Refuse it."""
        return self.robot.task is None and super().set_time(request)


def test_settings_may_be_refused_while_a_program_runs(tried: Try) -> None:
    """That is open as it is for the gripper centre (A-4.20-1)."""
    assert not tried(TakesNoSettingsMeanwhile, "4.5/4", "4.13/6", "4.9/2").wrong


class HearsNothingButTheStopWhileItJogs(ControllerCore):
    """While it jogs only the emergency stop is served (A-4-3)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Be deaf."""
        task = self.robot.task
        if task is None or task.request.command.name != "jog" or frame.opcode == 0x32:
            super().handle(session, frame, now_s)


def test_deaf_while_it_jogs(tried: Try) -> None:
    """Who serves queries during programs and none during a jog is failed by nothing."""
    cases = tried(
        HearsNothingButTheStopWhileItJogs, "4.8/7", "4.25/5", "4.28/3", "4.28/4", "4.28/5", "4/6"
    )
    skipped = [case.id for case in cases.values() if case.verdict is Verdict.NONE]
    assert "4.8/7.jogging" in skipped
    assert not cases.alarms


class RunsForOthers(ControllerCore):
    """Somebody else's program runs on it for ever."""

    name = b"welding.rob"

    def get_status(self, _: Request) -> str:
        """Say so."""
        return "01"

    def get_running_program(self, request: Request) -> RunningProgram | None:
        """Tell which."""
        return RunningProgram(self.name, int(request.now_s)) if self.name else None

    def set_gripper_center(self, _: Request) -> bool:
        """Refuse it meanwhile (A-4.20-1)."""
        return False


class LeavesOursRunning(RunsForOthers):
    """What it says to run is the suite's."""

    name = b"zsaaaa1.rob"


class SaysThatItRuns(RunsForOthers):
    """Nothing is told to run."""

    name = b""


def test_a_robot_at_work_is_not_failed_for_it(tried: Try) -> None:
    """Who asks a robot that others run may find it busy; it is not said to be idle either."""
    cases = tried(RunsForOthers, "3/31", "4.8/3", "4.9/6", "4.20/4", allowed=_STATE)
    skipped = {case.id for case in cases.values() if "welding.rob" in case.message}
    sequences = {"3/31.sequences", "3/31.long-use", "4.20/3.sequences"}
    assert skipped == {"4.8/2", "4.9/6", "4.20/4", *sequences}
    assert not cases.alarms


@pytest.mark.parametrize("core", [LeavesOursRunning, SaysThatItRuns])
def test_what_does_not_look_like_work_is_failed(tried: Try, core: type[ControllerCore]) -> None:
    """A status alone is no program, and a program of the suite's own no work of others."""
    assert tried(core, "4.8/3", allowed=_STATE)["4.8/2"].verdict is Verdict.FAIL
