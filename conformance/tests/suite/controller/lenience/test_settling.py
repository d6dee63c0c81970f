"""Robots that settle after an emergency stop or a reset (A-4-9)."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]

_REFUSED = frozenset(
    command.opcode
    for command in BY_NAME.values()
    if command.two_stage and command.name != "emergency_stop"
)


def settling(settle_s: float, *commands: str) -> type[ControllerCore]:
    """Return a robot whose status is 04 for a time after these commands; it refuses others."""

    class Settles(ControllerCore):
        _now_s = _until_s = 0.0

        def _finish_tasks(self, now_s: float) -> None:
            self._now_s = now_s
            super()._finish_tasks(now_s)

        def send_result(self, request: Request, outcome: Outcome) -> None:
            super().send_result(request, outcome)
            if request.command.name in commands:
                self._until_s = max(self._now_s, request.now_s) + settle_s

        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            settles = now_s < self._until_s and self.robot.task is None
            if settles and frame.opcode in _REFUSED:
                self.emit(session, Frame(C2A, frame.opcode, b"0|04"))
            else:
                super().handle(session, frame, now_s)

        def get_status(self, request: Request) -> str:
            return "04" if request.now_s < self._until_s else super().get_status(request)

    return Settles


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
