"""Mutants of clause 4.21: setting the initial tool position."""

from collections.abc import Callable
from typing import Any, Final

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    after,
    answer,
    answer_when,
    busy,
    decoded,
    executes_first,
    on_request,
    reads,
)
from scaraspec.protocol.commands import Pose
from scaraspec.protocol.fields import Diagnostics, Number
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_SET: Final = "set_initial_tool_position"
_FIELDS: Final = 6


def _stores(change: Callable[[Pose], Pose]) -> Core:
    """Another position is stored than the sent one."""
    return after(
        _SET,
        lambda core, request, done: (
            done and core.save(initial_tool_position=tuple(change(request.value)))
        ),
    )


def _fields(change: Callable[[list[bytes]], list[bytes]]) -> Core:
    """The fields of a request are changed before they are decoded."""
    return reads(_SET, lambda data: b"|".join(change(data.split(b"|"))))


def _number(field: bytes) -> float | None:
    return Number("").read(field, Diagnostics())


def _number_at_start(field: bytes) -> bytes:
    """The longest number at the start of a field, or the field."""
    starts = (field[:end] for end in range(len(field), 0, -1))
    return next((start for start in starts if _number(start) is not None), field)


def _filled_up(fields: list[bytes]) -> list[bytes]:
    return fields + [b"0"] * (_FIELDS - len(fields)) if len(fields) > 1 else fields


def _store_part_of_refused(core: ControllerCore, frame: Frame, value: Any) -> Any:
    if value is None:
        numbers = [_number(field) for field in frame.data.split(b"|")[:-1]]
        if len(numbers) == _FIELDS - 1 and None not in numbers:
            core.save(initial_tool_position=(*numbers, 0.0))
    return value


row(
    "position-answered-in-words",
    "4.21/2",
    "A new initial position is answered OK.",
    first_reply(_SET, {b"1": b"OK"}),
)
row(
    "position-answered-with-zero",
    "4.21/2",
    "A new initial position is set but the answer is 0.",
    answer(_SET, lambda _done: False),
)
row(
    "every-position-is-refused",
    "4.21/2",
    "Every initial position is answered 0 and not set.",
    on_request(_SET, lambda _core, _request: False),
)
row(
    "position-is-forgotten",
    "4.21/3",
    "A new initial position is answered 1 but not set.",
    on_request(_SET, lambda _core, _request: True),
)
row(
    "rotation-of-the-position-is-forgotten",
    "4.21/3",
    "thetaX of an initial position is stored as 0.",
    _stores(lambda pose: pose._replace(theta_x=0.0)),
)
row(
    "position-in-whole-numbers",
    "4.21/3",
    "An initial position is rounded to whole numbers.",
    _stores(lambda pose: Pose(*(float(round(value)) for value in pose))),
)
row(
    "position-is-mixed-up",
    "4.21/3",
    "y and z of an initial position are exchanged.",
    _stores(lambda pose: pose._replace(y=pose.z, z=pose.y)),
)
row(
    "angles-of-the-position-are-mixed-up",
    "4.21/3",
    "thetaX and thetaZ of an initial position are exchanged.",
    _stores(lambda pose: pose._replace(theta_x=pose.theta_z, theta_z=pose.theta_x)),
)
row(
    "position-moves-the-gripper-center",
    "4.21/3",
    "A new initial position also sets the gripper center.",
    after(
        _SET,
        lambda core, request, done: done and core.save(gripper_center=tuple(request.value[:3])),
    ),
)


@mutant("position-of-the-connection", "4.21/3", subtle=True)
class HidesPositionFromOtherConnections(ControllerCore):
    """Only the connection that set the initial position reads it; others read the previous one."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._before = Pose(*self.store.settings.initial_tool_position)
        self._set_by = -1

    def set_initial_tool_position(self, request: Request) -> bool:
        if request.session.connection != self._set_by:
            self._before = Pose(*self.store.settings.initial_tool_position)
            self._set_by = request.session.connection
        return super().set_initial_tool_position(request)

    def get_initial_tool_position(self, request: Request) -> Pose:
        is_own = request.session.connection == self._set_by
        return super().get_initial_tool_position(request) if is_own else self._before


row(
    "four-numbers-are-enough",
    "4.21/4",
    "Missing numbers after the first two are read as 0.",
    _fields(_filled_up),
)
row(
    "seventh-number-is-overlooked",
    "4.21/4",
    "Data after the sixth number are ignored.",
    _fields(lambda fields: fields[:_FIELDS]),
)
row(
    "four-fields-are-a-position",
    "4.21/4",
    "Exactly four fields are read as x, y, z and thetaX.",
    _fields(lambda fields: [*fields, b"0", b"0"] if len(fields) == 4 else fields),
)
row(
    "two-fields-too-many-are-overlooked",
    "4.21/4",
    "Exactly two fields after the sixth are ignored.",
    _fields(lambda fields: fields[:_FIELDS] if len(fields) == _FIELDS + 2 else fields),
)
row(
    "last-angles-are-not-read",
    "4.21/4",
    "thetaY and thetaZ may be anything and are read as 0.",
    _fields(lambda fields: [*fields[:4], b"0", b"0"] if len(fields) == _FIELDS else fields),
)
row(
    "commas-in-positions-are-points",
    "4.21/4",
    "A decimal comma in a position is read as a point.",
    reads(_SET, lambda data: data.replace(b",", b".") if data.count(b"|") == _FIELDS - 1 else data),
)
row(
    "numbers-end-where-they-end",
    "4.21/4",
    "Characters after the number at the start of a field are ignored, as strtod of C does.",
    _fields(lambda fields: list(map(_number_at_start, fields))),
)
row(
    "position-is-forgotten-during-runs",
    "4.21/3",
    "While a program runs, a new position is answered 1 but not set.",
    answer_when(_SET, busy, value=True),
    subtle=True,
)
row(
    "refused-position-is-set-in-part",
    "4.21/3",
    "An initial position that is refused because of its last field sets the other numbers.",
    decoded(_SET, _store_part_of_refused),
)


@mutant("second-reset-turns-home", "4.21/3", subtle=True)
class TurnsPositionAtReset(ControllerCore):
    """From the second one on, each reset turns the initial position by half a degree."""

    _count = 0

    def reset(self, request: Request) -> Acceptance:
        reply = super().reset(request)
        self._count += reply.accepted
        if reply.accepted and self._count > 1:
            x, y, z, theta_x, *rest = self.store.settings.initial_tool_position
            self.save(initial_tool_position=(x, y, z, theta_x + 0.5, *rest))
        return reply


row(
    "two-positions-per-connection",
    "4.21/3",
    "Only the first two initial positions of a connection are stored; later ones are answered 1.",
    executes_first("set_initial_tool_position", 2),
    subtle=True,
)
