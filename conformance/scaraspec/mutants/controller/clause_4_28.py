"""Mutants of clause 4.28: jogs."""

import math
from dataclasses import replace
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import final_result, first_reply, outcome
from scaraspec.mutants.operators.controller.requests import (
    after,
    before,
    completes,
    decoded,
    on_request,
    refuses,
)
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, JogDirection, Outcome
from scaraspec.virtual_controller import motion
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import MOVING, Movement, Task
from scaraspec.virtual_controller.session import Request

_PLUS_X, _MINUS_X = JogDirection.PLUS_X, JogDirection.MINUS_X
_PLUS_Y, _MINUS_Y = JogDirection.PLUS_Y, JogDirection.MINUS_Y


def _directions(table: dict[JogDirection, JogDirection]) -> Core:
    """Jogs go in the directions of the table."""
    return decoded("jog", lambda _core, _frame, direction: table.get(direction, direction))


row(
    "jog-swaps-axes",
    "4.28/3",
    "1 and 2 jog along X, 3 and 4 along Y.",
    _directions({_PLUS_Y: _PLUS_X, _MINUS_Y: _MINUS_X, _PLUS_X: _PLUS_Y, _MINUS_X: _MINUS_Y}),
)
row(
    "jog-swaps-signs",
    "4.28/3",
    "1 and 2 jog in the opposite direction.",
    _directions({_PLUS_Y: _MINUS_Y, _MINUS_Y: _PLUS_Y}),
)
row("jog-four-is-three", "4.28/3", "4 jogs like 3.", _directions({_MINUS_X: _PLUS_X}))
row("jog-two-is-one", "4.28/3", "2 jogs like 1.", _directions({_MINUS_Y: _PLUS_Y}))
row(
    "jog-by-binary-two-is-one",
    "4.28/3 4.28/4",
    "2 as a binary byte jogs like 1; 2 as a digit is executed correctly.",
    decoded(
        "jog",
        lambda _core, frame, direction: (
            _PLUS_Y if direction is _MINUS_Y and frame.data < b"0" else direction
        ),
    ),
    subtle=True,
)


def _hold(core: ControllerCore, request: Request, reply: Acceptance) -> Acceptance:
    if reply.accepted:
        joints = core.plant.joints(request.now_s)
        still = motion.Motion((joints,), (0.0,), duration_s=math.inf, smooth=False)
        core.plant.start(still, request.now_s)
    return reply


row(
    "jog-moves-nothing",
    "4.28/3",
    "A jog is accepted and lasts until it is stopped, but the arm does not move.",
    after("jog", _hold),
)
row(
    "jog-is-answered-with-its-direction",
    "4.28/4 4/1",
    "The first reply to a jog has a second field.",
    first_reply("jog", {b"1": b"1|1"}),
)
row(
    "jog-is-refused",
    "4.28/4",
    "An idle robot refuses every jog.",
    on_request("jog", lambda core, _: refused(core.robot.refusal_code() or "05")),
)
row(
    "fourth-jog-is-refused",
    "4.28/4",
    'An idle robot refuses a jog in direction 4, with the reply "05".',
    refuses(
        "jog", lambda core, request: request.value is _MINUS_X and core.robot.task is None, "20"
    ),
    first_reply("jog", {b"0|20": b"05"}),
)


def _at_limit(core: ControllerCore, request: Request) -> bool:
    return core.get_tool_coordinates(replace(request, now_s=core.plant.motion_ends_s)).x > 399


def _omit_at_limit(core: ControllerCore, request: Request, ended: Outcome) -> Outcome | None:
    arrived = core.robot.task is None and core.plant.motion_ends_s > 1
    return None if arrived and _at_limit(core, request) else ended


def _fail_at_limit(core: ControllerCore, request: Request, ended: Outcome) -> Outcome:
    failed = request.value is _PLUS_X and _at_limit(core, request)
    return Outcome(done=False, code="12") if failed else ended


row(
    "jog-has-no-result",
    "4.28/5",
    "A jog that ends at the limit has no final result.",
    outcome("jog", _omit_at_limit),
)
row(
    "stopped-jog-is-told",
    "4.28/5",
    'The final result of a jog is "1".',
    final_result("jog", lambda _: b"1"),
)
row(
    "jog-fails-with-motor",
    "4.28/5",
    "A jog that ends at the limit fails with the code of a motor.",
    outcome("jog", _fail_at_limit),
)


@mutant("jog-of-lost-client-goes-on", "4.28/5", "4.17/6", subtle=True)
class ContinuesJogOfLostClient(ControllerCore):
    """A jog continues after its client disconnected, and no other client can stop it."""

    def close(self, connection: int, now_s: float) -> list[Any]:
        task = self.robot.task
        actions = super().close(connection, now_s)
        if task is not None and task.ends_with_link and self.robot.task is None:
            self.plant.start(motion.jog(self.plant.joints(now_s), task.request.value), now_s)
            movement, stopped = Movement(self.plant), task.outcome_if_stopped
            self.robot.task = Task(task.request, MOVING, movement, outcome_if_stopped=stopped)
        return actions

    def emergency_stop(self, request: Request) -> Acceptance:
        task = self.robot.task
        if task is not None and task.request.session.connection not in self.sessions:
            return Acceptance(accepted=False)
        return super().emergency_stop(request)


def _low_bits(_core: ControllerCore, frame: Frame, direction: Any) -> Any:
    if direction is None and frame.data and 1 <= frame.data[0] & 7 <= 4:
        return JogDirection(frame.data[0] & 7)
    return direction


def _first_byte(_core: ControllerCore, frame: Frame, direction: Any) -> Any:
    first = frame.data[:1]
    if direction is None and len(frame.data) > 1 and first in b"1234":
        return JogDirection(int(first))
    return direction


def _move(core: ControllerCore, request: Request) -> None:
    if request.value is None and core.robot.task is None:
        way = motion.jog(core.plant.joints(request.now_s), _PLUS_Y)
        core.plant.start(way, request.now_s)


row(
    "jog-takes-the-low-bits",
    "4.28/7",
    "Only the lowest three bits of the direction are read.",
    decoded("jog", _low_bits),
)
row(
    "jog-takes-five-for-four",
    "4.28/7",
    "Direction 5 is read as 4.",
    decoded(
        "jog",
        lambda _core, frame, direction: (
            _MINUS_X if direction is None and frame.data in (b"5", b"\5") else direction
        ),
    ),
)
row(
    "jog-takes-the-first-of-two",
    "4.28/7",
    "Only the first of several bytes is read as the direction.",
    decoded("jog", _first_byte),
)
row(
    "jog-takes-zero",
    "4.28/7",
    "Direction 0 is accepted and reported as done, but the arm does not move.",
    completes("jog", lambda core, request: request.frame.data == b"0" and core.robot.task is None),
)
row(
    "jog-moves-what-it-refuses",
    "4.28/7",
    "An invalid direction is refused, but the arm moves.",
    before("jog", _move),
)
