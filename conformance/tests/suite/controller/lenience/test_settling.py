"""Robots whose status and commands are not free exactly at the final result (A-4-9)."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import TAG, Frame
from scaraspec.protocol.payloads import Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]

_REFUSED = frozenset(
    command.opcode
    for command in BY_NAME.values()
    if command.two_stage and command.name != "emergency_stop"
)


class RefusesAfterResult(ControllerCore):
    """For a time after each final result, commands are refused as busy; the status is 00.

    Attributes:
        settle_s: The time in seconds.
        after: The commands after whose results it does so.
    """

    settle_s = 0.09
    after = frozenset(BY_NAME)
    _now_s = _until_s = 0.0

    def _finish_tasks(self, now_s: float) -> None:
        self._now_s = now_s
        super()._finish_tasks(now_s)

    def send_result(self, request: Request, outcome: Outcome) -> None:
        super().send_result(request, outcome)
        if request.command.name in self.after:
            self._until_s = max(self._now_s, request.now_s) + self.settle_s

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if now_s < self._until_s and self.robot.task is None and frame.opcode in _REFUSED:
            self.emit(session, Frame(C2A, frame.opcode, b"0|04"))
        else:
            super().handle(session, frame, now_s)


class IsBusyAfterResult(RefusesAfterResult):
    """Like the base class, and the status is 04 for this time."""

    def get_status(self, request: Request) -> str:
        return "04" if request.now_s < self._until_s else super().get_status(request)


def settling(settle_s: float, *commands: str) -> type[ControllerCore]:
    """Return a robot that is busy for a time after these commands."""
    return type("Settles", (IsBusyAfterResult,), {"settle_s": settle_s, "after": set(commands)})


@pytest.mark.parametrize("commands", [("emergency_stop", "reset"), ("reset",)])
@pytest.mark.parametrize("settle_s", [0.3, 1.0])
def test_robot_may_settle(run_cases: RunCases, settle_s: float, commands: tuple[str, ...]) -> None:
    """No case fails, and the run reports the time once."""
    cases = run_cases(settling(settle_s, *commands), "4/7", "4.17/6", "4.18/4")
    assert not cases.problems
    (notice,) = [notice for notice in cases.notices if "(A-4-9)" in notice]
    assert notice.startswith(f"for {settle_s:.1f} s after {commands[0]} ")


def test_robot_that_does_not_settle(run_cases: RunCases) -> None:
    """A robot that is busy for longer after a stop or a reset fails."""
    assert "4.17/4" in run_cases(settling(3.0, "emergency_stop"), "4.17/4").violated
    assert "4/7" in run_cases(settling(3.0, "reset"), "4.18/4").violated


class RefusesAlways(RefusesAfterResult):
    """Every command after the first one is refused as busy until it is requested again."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        super().handle(session, frame, now_s)
        self._until_s = min(self._until_s, now_s) if frame.opcode in _REFUSED else self._until_s

    def send_result(self, request: Request, outcome: Outcome) -> None:
        super().send_result(request, outcome)
        self._until_s = math.inf


@pytest.mark.parametrize("core", [RefusesAfterResult, IsBusyAfterResult])
def test_robot_may_refuse_right_after_a_result(
    run_cases: RunCases, core: type[ControllerCore]
) -> None:
    """No case fails, and the run reports it once."""
    cases = run_cases(core, "4/1", "4.24/8", "4.16/3", "6.5/19")
    assert not cases.problems
    assert len([notice for notice in cases.notices if "(A-4-9)" in notice]) == 1


def test_refusal_at_a_later_time_fails(run_cases: RunCases) -> None:
    """A robot that refuses the next command whenever it comes does not settle."""
    assert run_cases(RefusesAlways, "4/1", "4.24/8").violated


class SendsResultsLate(ControllerCore):
    """Final results are sent in a cyclic task of 0.2 s; the status is 00 before."""

    cycle_s = 0.2

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: list[tuple[Session, bytes]] = []
        self._now_s, self._due_s = 0.0, math.inf

    def _process_due(self, now_s: float) -> None:
        self._now_s = now_s
        if now_s >= self._due_s:
            waiting, self._waiting, self._due_s = self._waiting, [], math.inf
            for session, data in waiting:
                if session.connection in self.sessions:
                    super().transmit(session, data)
        super()._process_due(now_s)

    def transmit(self, session: Session, data: bytes) -> None:
        if data[1] != TAG:
            super().transmit(session, data)
            return
        self._waiting.append((session, data))
        self._due_s = min(self._due_s, (self._now_s // self.cycle_s + 1) * self.cycle_s)

    @property
    def next_event_s(self) -> float | None:
        next_s = min(self._due_s, super().next_event_s or math.inf)
        return None if next_s == math.inf else next_s


class SendsResultsVeryLate(SendsResultsLate):
    """The same with a cycle of two seconds."""

    cycle_s = 2.0


def test_result_may_follow_the_idle_status(run_cases: RunCases) -> None:
    """A final result that comes up to half a second after the idle status fails no case."""
    only = ("4.5/4", "4.8/4", "4.8/6", "4.24/8", "6.5/20")
    assert not run_cases(SendsResultsLate, *only).problems
    assert run_cases(SendsResultsVeryLate, *only).violated
