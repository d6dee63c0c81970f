"""Mutants of clause 4.20: setting the gripper center."""

from collections.abc import Callable
from typing import Any, Final

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import (
    after,
    answer,
    answer_when,
    before,
    busy,
    decoded,
    executes_first,
    on_request,
    reads,
)
from scaraspec.protocol.commands import Point
from scaraspec.protocol.fields import Diagnostics, Number
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller import arm, motion
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_SET: Final = "set_gripper_center"


def _stores(change: Callable[[Point], Point]) -> Core:
    """Another gripper center is stored than the sent one."""
    return after(
        _SET,
        lambda core, request, done: done and core.save(gripper_center=tuple(change(request.value))),
    )


def _coordinates(change: Callable[[float], float]) -> Core:
    return _stores(lambda point: Point(*map(change, point)))


def _fields(change: Callable[[bytes], bytes]) -> Core:
    """Each field of a request is changed before it is decoded."""
    return reads(_SET, lambda data: b"|".join(map(change, data.split(b"|"))))


def _separator(separator: bytes) -> Core:
    return reads(_SET, lambda data: data if b"|" in data else data.replace(separator, b"|"))


def _number(field: bytes) -> float | None:
    return Number("").read(field, Diagnostics())


def _without_third(data: bytes) -> bytes:
    head, bar, last = data.rpartition(b"|")
    has_bad_third = head.count(b"|") == 1 and _number(last) is None
    return head + bar + b"0" if has_bad_third else data


def _clear_after_reset(core: ControllerCore, _request: Request, reply: Acceptance) -> Acceptance:
    if reply.accepted:
        core.save(gripper_center=(0.0, 0.0, 0.0))
    return reply


def _store_x_of_refused(core: ControllerCore, frame: Frame, value: Any) -> Any:
    x = _number(frame.data.partition(b"|")[0]) if value is None else None
    if x is not None and abs(x) < 1000:
        core.save(gripper_center=(x, *core.store.settings.gripper_center[1:]))
    return value


def _move_up(core: ControllerCore, request: Request) -> None:
    joints = core.plant.joints(request.now_s)
    pose = arm.forward(joints)
    up = arm.inverse(pose._replace(z_mm=pose.z_mm + 3.0), near=joints)
    core.plant.start(motion.move(joints, up, 100), request.now_s)


row(
    "gripper-answered-with-itself",
    "4.20/2",
    "A new gripper center is answered with 1 and three numbers.",
    first_reply(_SET, {b"1": b"1|0|0|0"}),
)
row(
    "gripper-answered-with-zero",
    "4.20/2",
    "A new gripper center is set but the answer is 0.",
    answer(_SET, lambda _done: False),
)
row(
    "gripper-is-forgotten",
    "4.20/3",
    "A new gripper center is answered 1 but not set.",
    on_request(_SET, lambda _core, _request: True),
)
row(
    "gripper-loses-its-sign",
    "4.20/3",
    "The height of a gripper center loses its sign.",
    _stores(lambda point: point._replace(z=abs(point.z))),
)
row(
    "gripper-in-whole-millimetres",
    "4.20/3",
    "A gripper center loses its decimals.",
    _coordinates(lambda value: float(int(value))),
)
row(
    "gripper-is-mixed-up",
    "4.20/3",
    "x and y of a gripper center are exchanged.",
    _stores(lambda point: Point(point.y, point.x, point.z)),
)
row(
    "gripper-in-steps",
    "4.20/3",
    "A gripper center is rounded to 0.4 mm.",
    _coordinates(lambda value: round(value / 0.4) * 0.4),
)
row(
    "small-negatives-lose-their-sign",
    "4.20/3",
    "Numbers between -1 and 0 lose their sign.",
    _coordinates(lambda value: abs(value) if -1 < value < 0 else value),
    subtle=True,
)


@mutant("gripper-comes-late", "4.20/3", subtle=True)
class ReportsGripperLate(ControllerCore):
    """A new gripper center is reported after one second; until then the previous one is."""

    _before: tuple[float, Point] | None = None

    def set_gripper_center(self, request: Request) -> bool:
        self._before = request.now_s, Point(*self.store.settings.gripper_center)
        return super().set_gripper_center(request)

    def get_gripper_center(self, request: Request) -> Point:
        if self._before is not None and request.now_s - self._before[0] < 1.0:
            return self._before[1]
        return super().get_gripper_center(request)


@mutant("late-grippers-are-forgotten", "4.20/3", subtle=True)
class ForgetsThirtiethGripper(ControllerCore):
    """From the thirtieth one on, a new gripper center is answered 1 but not set."""

    _count = 0

    def set_gripper_center(self, request: Request) -> bool:
        self._count += 1
        return self._count >= 30 or super().set_gripper_center(request)


@mutant("gripper-of-the-connection", "4.20/3", subtle=True)
class HidesGripperFromOtherConnections(ControllerCore):
    """Only the connection that set the gripper center can read it; others read zeros."""

    _set_by = -1

    def get_gripper_center(self, request: Request) -> Point:
        is_own = request.session.connection == self._set_by
        return super().get_gripper_center(request) if is_own else Point(0, 0, 0)

    def set_gripper_center(self, request: Request) -> bool:
        self._set_by = request.session.connection
        return super().set_gripper_center(request)


row(
    "reset-clears-the-centre",
    "4.20/3",
    "A reset sets the gripper center to zeros.",
    after("reset", _clear_after_reset),
    subtle=True,
)
row(
    "missing-height-is-zero",
    "4.20/4",
    "A gripper center of two numbers gets the height 0.",
    reads(_SET, lambda data: data + b"|0" if data.count(b"|") == 1 else data),
)
row(
    "further-numbers-are-overlooked",
    "4.20/4",
    "Data after the third number are ignored.",
    reads(_SET, lambda data: b"|".join(data.split(b"|")[:3])),
)
row(
    "empty-fields-are-zero",
    "4.20/4",
    "An empty field is read as 0.",
    _fields(lambda field: field or b"0"),
)
row(
    "commas-are-decimal-points",
    "4.20/4",
    "A decimal comma is read as a point.",
    _fields(lambda field: field.replace(b",", b".", 1)),
)
row(
    "words-are-zero",
    "4.20/4",
    "A field that is not a number is read as 0, as atof of C does.",
    _fields(lambda field: b"0" if _number(field) is None else field),
)
row(
    "nan-is-number",
    "4.20/4",
    "The word nan is read as 0.",
    _fields(lambda field: b"0" if field == b"nan" else field),
)
row(
    "infinity-is-number",
    "4.20/4",
    "The word inf is read as 1000.",
    _fields(lambda field: b"1000" if field == b"inf" else field),
)
row(
    "letters-behind-numbers-are-overlooked",
    "4.20/4",
    "Letters after a number are ignored.",
    _fields(lambda field: field.rstrip(b"abcdefghijklmnopqrstuvwxyz")),
)
row(
    "blanks-separate-numbers",
    "4.20/4",
    "Numbers may be separated by blanks.",
    _separator(b" "),
)
row(
    "semicolons-separate-numbers",
    "4.20/4",
    "Numbers may be separated by semicolons.",
    _separator(b";"),
)
row(
    "third-number-is-not-checked",
    "4.20/4",
    "A third field that is not a number is read as 0.",
    reads(_SET, _without_third),
)
row(
    "refused-gripper-is-set-in-part",
    "4.20/3",
    "A gripper center that is refused because of another field sets x.",
    decoded(_SET, _store_x_of_refused),
)
row(
    "gripper-is-forgotten-during-runs",
    "4.20/3",
    "While a program runs, a new gripper center is answered 1 but not set.",
    answer_when(_SET, busy, value=True),
    subtle=True,
)
row(
    "setting-the-gripper-moves-the-arm",
    "4.20/5",
    "A new gripper center moves the arm up by 3 mm.",
    before(_SET, _move_up),
)

row(
    "two-centres-per-connection",
    "4.20/3",
    "Only the first two gripper centers of a connection are stored; later ones are answered 1.",
    executes_first("set_gripper_center", 2),
    subtle=True,
)
