"""Once the emergency stop does not work, nothing is sent that can start a motion."""

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


class Refuses(ControllerCore):
    """Every stop is refused."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Refuse it."""
        del request
        return Acceptance(accepted=False)


class HasNoEffect(ControllerCore):
    """Every stop is said to be done, and what executes goes on."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Say so."""
        if self.robot.task is None:
            return Acceptance(accepted=False)
        self.send_result(request, DONE)
        return Acceptance(accepted=True)


class _Delays(ControllerCore):
    """What a stop does comes three seconds late."""

    _due: "tuple[float, Callable[[], object]] | None" = None

    @property
    def next_event_s(self) -> float | None:
        """The late stop, too."""
        before = super().next_event_s
        if self._due is None:
            return before
        return self._due[0] if before is None else min(before, self._due[0])

    def advance(self, now_s: float) -> Any:
        """Do what is due."""
        if self._due and now_s >= self._due[0]:
            _, act = self._due
            self._due = None
            act()
        return super().advance(now_s)


class StopsLate(_Delays):
    """A stop is answered at once, and takes effect three seconds later."""

    def emergency_stop(self, request: Request) -> Acceptance:
        """Stop later."""
        if self.robot.task is None:
            return Acceptance(accepted=False)
        later_s = request.now_s + 3
        self._due = (later_s, lambda: self.robot.stop(later_s))
        self.send_result(request, DONE)
        return Acceptance(accepted=True)


class AnswersLate(_Delays):
    """A stop takes effect at once, and is answered three seconds later."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer later."""
        if frame.opcode == 0x32 and self.robot.task is not None and self._due is None:
            self._due = (now_s + 3, lambda: ControllerCore.handle(self, session, frame, now_s + 3))
            return
        super().handle(session, frame, now_s)


class SaysNothing(ControllerCore):
    """No stop is answered."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Drop it."""
        if frame.opcode != 0x32:
            super().handle(session, frame, now_s)


MUTANTS = {
    **{core.__name__: core for core in (Refuses, HasNoEffect, StopsLate, AnswersLate)},
    "SaysNothing": SaysNothing,
    **{
        name: mutants()[name].wrong
        for name in (
            *("run-is-not-stopped", "simulation-is-not-stopped", "move-is-not-stopped"),
            *("reset-is-not-stopped", "jog-is-not-stopped", "jog-goes-on", "arm-coasts-on"),
            *("stops-ten-times", "stopped-program-goes-on"),
        )
    },
}


class Tried(NamedTuple):
    """What came of a run: each opcode that was sent, and the robot's status then."""

    results: Results
    before: list[tuple[int, str]]
    after: list[tuple[int, str]]


def _certified(core: type[ControllerCore], monkeypatch: pytest.MonkeyPatch) -> Tried:
    """Certify it with everything allowed; what was sent before and after a stop has failed."""
    heard: list[tuple[int, str]] = []
    failed_at: list[int] = []
    fail = StopMonitor.fail

    def noting(monitor: StopMonitor, *what: str) -> None:
        failed_at.append(len(heard))
        fail(monitor, *what)

    monkeypatch.setattr(StopMonitor, "fail", noting)

    class Watched(core):  # type: ignore[misc, valid-type] # a class that the test names
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            heard.append((frame.opcode, self.robot.status))
            super().handle(session, frame, now_s)

    robot = Robot(Watched, DEFAULT)
    options = Options(ONLY, ALL, undefined=True, examples=2)
    results = certified(robot, Ics(hooks=hooks_of(robot)), options)
    at = failed_at[0] if failed_at else len(heard)
    return Tried(results, heard[:at], heard[at:])


@pytest.mark.parametrize("name", MUTANTS)
def test_nothing_moves_after_a_stop_that_failed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the opcodes after it none starts a motion, and a reset only leaves an error state."""
    results, before, after = _certified(MUTANTS[name], monkeypatch)
    assert results.verdict is Conclusion.NONCONFORMANT
    assert results.notices[0].startswith("THE EMERGENCY STOP DOES NOT WORK")
    assert 0x32 in {opcode for opcode, _ in before}
    assert {opcode for opcode, _ in after} <= BY_OPCODE.keys() - STARTERS
    assert not [status for opcode, status in after if opcode == 0x33 and status < "05"]
    reasons = {c.message for c in results.cases if c.verdict is Verdict.INCONCLUSIVE}
    assert any("the emergency stop does not work" in reason for reason in reasons)


@pytest.mark.parametrize("name", ["Refuses", "HasNoEffect", "StopsLate", "AnswersLate"])
def test_the_first_motion_proves_the_stop(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stop that works for no command is found with one step of the arm."""
    tried = _certified(MUTANTS[name], monkeypatch)
    assert {opcode for opcode, _ in tried.before if opcode in STARTERS} == {0x39}


def test_the_proof_is_the_first_motion_of_every_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is tried first: a step, then the stop, then all else."""
    tried = _certified(ControllerCore, monkeypatch)
    opcodes = [opcode for opcode, _ in tried.before if opcode in {*STARTERS, 0x33, 0x32}]
    assert opcodes[:2] == [0x39, 0x32]
    assert not tried.after
