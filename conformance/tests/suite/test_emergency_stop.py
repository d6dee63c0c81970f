"""After the emergency stop has failed, the suite sends nothing that can start a motion."""

from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import Robot, certified, hooks_of
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results
from scaraspec.suite.controller.harness.emergency_stop import StopMonitor
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import DONE
from scaraspec.virtual_controller.session import Request, Session

if TYPE_CHECKING:
    from collections.abc import Callable

STARTERS = {0x30, 0x31, 0x39, 0x3A, 0x3B, 0x3D}
CLAUSES = tuple(f"4.{number}" for number in (15, 16, 17, 18, 24, 25, 26, 28, 32))
ONLY = frozenset(r for r in REQUIREMENTS if r.partition("/")[0] in CLAUSES) | {"3/21"}


class RefusesStop(ControllerCore):
    """Every stop is refused."""

    def emergency_stop(self, request: Request) -> Acceptance:
        del request
        return Acceptance(accepted=False)


class IgnoresStop(ControllerCore):
    """Every stop is answered with success and has no effect."""

    def emergency_stop(self, request: Request) -> Acceptance:
        if self.robot.task is None:
            return Acceptance(accepted=False)
        self.send_result(request, DONE)
        return Acceptance(accepted=True)


class _Delays(ControllerCore):
    """A callback is executed later."""

    _due: "tuple[float, Callable[[], object]] | None" = None

    @property
    def next_event_s(self) -> float | None:
        before = super().next_event_s
        if self._due is None:
            return before
        return self._due[0] if before is None else min(before, self._due[0])

    def advance(self, now_s: float) -> Any:
        if self._due and now_s >= self._due[0]:
            _, callback = self._due
            self._due = None
            callback()
        return super().advance(now_s)


class StopsLate(_Delays):
    """A stop is answered at once and takes effect three seconds later."""

    def emergency_stop(self, request: Request) -> Acceptance:
        if self.robot.task is None:
            return Acceptance(accepted=False)
        later_s = request.now_s + 3
        self._due = (later_s, lambda: self.robot.stop(later_s))
        self.send_result(request, DONE)
        return Acceptance(accepted=True)


class AnswersLate(_Delays):
    """A stop takes effect and is answered three seconds later."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x32 and self.robot.task is not None and self._due is None:
            self._due = (now_s + 3, lambda: ControllerCore.handle(self, session, frame, now_s + 3))
            return
        super().handle(session, frame, now_s)


class DoesNotAnswerStop(ControllerCore):
    """No stop is answered."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode != 0x32:
            super().handle(session, frame, now_s)


CORES = (RefusesStop, IgnoresStop, StopsLate, AnswersLate, DoesNotAnswerStop)
MUTANTS = {
    **{core.__name__: core for core in CORES},
    **{
        name: mutants()[name].wrong
        for name in (
            *("run-is-not-stopped", "simulation-is-not-stopped", "move-is-not-stopped"),
            *("reset-is-not-stopped", "jog-is-not-stopped", "jog-goes-on", "arm-coasts-on"),
            *("stops-ten-times", "stopped-program-goes-on"),
        )
    },
}


class StopRun(NamedTuple):
    """The results of a run, and the opcodes that were sent before and after a stop failed.

    The status of the robot is stored with each opcode.
    """

    results: Results
    before: list[tuple[int, str]]
    after: list[tuple[int, str]]


def _certify(core: type[ControllerCore], monkeypatch: pytest.MonkeyPatch) -> StopRun:
    """Run the cases with all hazards allowed."""
    sent: list[tuple[int, str]] = []
    failed_after: list[int] = []
    fail = StopMonitor.fail

    def record_failure(monitor: StopMonitor, *details: str) -> None:
        failed_after.append(len(sent))
        fail(monitor, *details)

    monkeypatch.setattr(StopMonitor, "fail", record_failure)

    class Watched(core):  # type: ignore[misc, valid-type] # a class that the test names
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            sent.append((frame.opcode, self.robot.status))
            super().handle(session, frame, now_s)

    robot = Robot(Watched, DEFAULT)
    options = Options(ONLY, ALL, undefined=True, examples=2)
    results = certified(robot, Ics(hooks=hooks_of(robot)), options)
    at = failed_after[0] if failed_after else len(sent)
    return StopRun(results, sent[:at], sent[at:])


@pytest.mark.parametrize("name", MUTANTS)
def test_nothing_moves_after_a_failed_stop(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a failed stop, no motion is started, and a reset is sent only in an error state."""
    results, before, after = _certify(MUTANTS[name], monkeypatch)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert results.notices[0].startswith("THE EMERGENCY STOP DOES NOT WORK")
    assert 0x32 in {opcode for opcode, _ in before}
    assert {opcode for opcode, _ in after} <= BY_OPCODE.keys() - STARTERS
    assert not [status for opcode, status in after if opcode == 0x33 and status < "05"]
    reasons = {c.message for c in results.cases if c.verdict is Verdict.INCONCLUSIVE}
    assert any("the emergency stop does not work" in reason for reason in reasons)


@pytest.mark.parametrize("name", [core.__name__ for core in CORES[:-1]])
def test_first_motion_tests_the_stop(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stop that never works is detected with one step of the arm."""
    run = _certify(MUTANTS[name], monkeypatch)
    assert {opcode for opcode, _ in run.before if opcode in STARTERS} == {0x39}


def test_stop_is_tested_by_the_first_motion_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first motion of a run is a step, which is followed by a stop."""
    run = _certify(ControllerCore, monkeypatch)
    opcodes = [opcode for opcode, _ in run.before if opcode in {*STARTERS, 0x33, 0x32}]
    assert opcodes[:2] == [0x39, 0x32]
    assert not run.after
