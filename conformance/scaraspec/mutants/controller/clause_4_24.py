"""Mutants of clause 4.24: moves to tool coordinates."""

import math
from collections.abc import Callable
from dataclasses import replace

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import (
    final_result,
    first_reply,
    length_byte,
    outcome,
)
from scaraspec.mutants.operators.controller.requests import completes, reads, refuses
from scaraspec.protocol.commands import MoveTarget, Pose
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_MOVE = "set_tool_coordinates"
_FAR_MM = 10_000


def _is_far(request: Request) -> bool:
    target: MoveTarget | None = request.value
    return target is not None and max(map(abs, target[1:4])) > _FAR_MM


def _moves(change: Callable[[MoveTarget, Pose], MoveTarget]) -> Core:
    """A move goes to another target, which depends on the target and the pose at the start."""

    class Moves(ControllerCore):
        def set_tool_coordinates(self, request: Request) -> Acceptance:
            if request.value is not None and not _is_far(request):
                here = self.get_tool_coordinates(request)
                request = replace(request, value=change(request.value, here))
            return super().set_tool_coordinates(request)

    return Moves


def _refuses(when: Callable[[MoveTarget, Pose], bool], code: str) -> Core:
    """An idle robot refuses moves, if the condition on target and pose holds."""
    return refuses(
        _MOVE,
        lambda core, request: (
            core.robot.task is None
            and request.value is not None
            and when(request.value, core.get_tool_coordinates(request))
        ),
        code,
    )


row(
    "full-speed-overshoots",
    "4.24/8",
    "A move at full speed goes 1.5 mm too far along X.",
    _moves(lambda to, _: to._replace(x=to.x + 1.5) if to.speed >= 100 else to),
    subtle=True,
)
row(
    "impossible-move-is-refused-like-aresult",
    "4.24/3",
    'An impossible move is refused with "00|05".',
    first_reply(_MOVE, {b"0|05": b"00|05"}),
)
row(
    "impossible-move-is-refused-in-words",
    "4.24/3",
    'An impossible move is refused with "0|unreachable".',
    first_reply(_MOVE, {b"0|05": b"0|unreachable"}),
)
row(
    "reads-comma-as-point",
    "4.24/3 4.24/10",
    "A comma in a number is read as a decimal point.",
    reads(_MOVE, lambda data: data.replace(b",", b".")),
)
row(
    "missing-text-is-alittle",
    "4.24/3 4.24/10",
    "A move with text in place of a number goes to a pose near the initial one.",
    reads(_MOVE, lambda data: b"10|301|0|250|0|0|0" if b"abc" in data else data),
)
row(
    "refusal-has-the-printed-length",
    "4.24/4 3/7",
    "The length byte of the refusal of a move is 1, as the document prints it, for four bytes.",
    length_byte(_MOVE, lambda size: 1 if size == 4 else size),
)
row(
    "refusal-counts-its-end",
    "4.24/4 3/7",
    "The length byte of the refusal of a move also counts the end byte.",
    length_byte(_MOVE, lambda size: 5 if size == 4 else size),
)
row(
    "every-speed-below-ten-is-refused",
    "4.24/5",
    "A move at less than 10 percent is refused.",
    _refuses(lambda to, _: to.speed < 10, "05"),
)
row(
    "full-speed-is-refused",
    "4.24/5",
    "A move at 100 percent is refused.",
    _refuses(lambda to, _: to.speed >= 100, "05"),
    subtle=True,
)
row(
    "accepts-move-with-its-state",
    "4.24/5",
    'The first reply to a move is "1|04".',
    first_reply(_MOVE, {b"1": b"1|04"}),
)
row(
    "refuses-to-stand-still",
    "4.24/5",
    "A move to the current position is refused.",
    _refuses(lambda to, here: math.dist(to[1:4], here[:3]) < 0.001, "06"),
)
row(
    "move-has-no-result",
    "4.24/6",
    "A successful move has no final result.",
    outcome(_MOVE, lambda _core, _request, ended: None if ended.done else ended),
)
row(
    "move-ends-as-failure",
    "4.24/6",
    "A successful move is reported as failed.",
    outcome(
        _MOVE,
        lambda _core, _request, ended: Outcome(done=False, code="05") if ended.done else ended,
    ),
)
row(
    "move-ends-with-its-pose",
    "4.24/6",
    "The final result of a move is the pose.",
    final_result(_MOVE, {b"11": b"300|0|250|0|0|0"}),
)
row(
    "swaps-xand-y",
    "4.24/8",
    "A step along X is made along Y, and a step along Y along X.",
    _moves(lambda to, here: to._replace(x=here.x + to.y - here.y, y=here.y + to.x - here.x)),
)
row(
    "turns-the-other-way",
    "4.24/8",
    "ThetaX is used with the opposite sign.",
    _moves(lambda to, _: to._replace(theta_x=-to.theta_x)),
)
row(
    "forgets-z",
    "4.24/8",
    "The Z coordinate of a target is ignored.",
    _moves(lambda to, here: to._replace(z=here.z)),
)
row(
    "takes-tenths-of-inches",
    "4.24/8",
    "The arm moves 2.54 times the requested distance along Y.",
    _moves(lambda to, here: to._replace(y=here.y + (to.y - here.y) * 2.54)),
)
row(
    "goes-by-whole-fives",
    "4.24/8",
    "The Y coordinate of a target is rounded to 5 mm.",
    _moves(lambda to, _: to._replace(y=round(to.y / 5) * 5)),
)
row(
    "ends-half-way",
    "4.24/8",
    "A move stops halfway and is reported as done.",
    _moves(
        lambda to, here: MoveTarget(
            to.speed, *(p + (q - p) / 2 for p, q in zip(here, to[1:], strict=True))
        )
    ),
)


@mutant("drifts-with-every-move", "4.24/8", subtle=True)
class DriftsWithEveryMove(ControllerCore):
    """Every move misses its target by half a millimetre more than the move before, up to 10 mm."""

    _moves = 0

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        if request.value is not None and not _is_far(request):
            self._moves += 1
            x = request.value.x - 0.5 * min(self._moves, 20)
            request = replace(request, value=request.value._replace(x=x))
        return super().set_tool_coordinates(request)


row(
    "goes-anywhere",
    "4.24/9 4.24/3",
    "A target far out of reach is accepted and reported as reached.",
    completes(_MOVE, lambda core, request: _is_far(request) and core.robot.task is None),
)
row(
    "goes-anywhere-downwards",
    "4.24/9",
    "The lower limit of Z is not checked: a target far below it is reported as reached.",
    completes(
        _MOVE,
        lambda core, request: (
            request.value is not None and request.value.z < -_FAR_MM and core.robot.task is None
        ),
    ),
)
row(
    "blames-motor-for-the-reach",
    "4.24/9",
    "A target far out of reach is refused with the code of a motor.",
    first_reply(_MOVE, {b"0|05": b"0|12"}),
)


def _fields(change: Callable[[list[bytes]], list[bytes]]) -> Core:
    """The fields of a move are changed before they are decoded."""
    return reads(_MOVE, lambda data: b"|".join(change(data.split(b"|"))))


row(
    "move-of-five-fields-is-made",
    "4.24/10",
    "Exactly five fields are read as speed, x, y, z and thetaX.",
    _fields(lambda fields: [*fields, b"0", b"0"] if len(fields) == 5 else fields),
)
row(
    "two-fields-too-many-of-a-move-are-overlooked",
    "4.24/10",
    "Exactly two fields after the seventh are ignored.",
    _fields(lambda fields: fields[:7] if len(fields) == 9 else fields),
)
row(
    "move-without-a-number-succeeds",
    "4.24/10",
    "A malformed move is reported as done, but the arm does not move.",
    completes(_MOVE, lambda core, request: request.value is None and core.robot.task is None),
)
