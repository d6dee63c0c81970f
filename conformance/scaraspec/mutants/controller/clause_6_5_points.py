"""Mutants of clause 6.5: moves and their points."""

import math
from collections.abc import Callable
from dataclasses import replace

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.protocol.program_files import Node, Point
from scaraspec.virtual_controller.arm import Joints, UnreachableError
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.motion import Motion, curve, hold, move


def _skips(when: Callable[[int, int], bool]) -> Core:
    """A straight move skips points: the condition gets index and number of points."""

    class SkipsPoints(Run):
        def _motion_to(self, point: Point) -> Motion:
            owner = self._structure.owners[self._index]
            if owner is not None:
                count = self._program.nodes[owner].counts
                if when(self._index - owner - 1, count):
                    return hold(self._joints)
            return super()._motion_to(point)

    return with_interpreter(SkipsPoints)


def _values(change: Callable[..., tuple[float, float, float, float]]) -> Core:
    """The values of a point are changed: a function of the current joints and the values."""

    class ChangedValues(Run):
        def _target(self, point: Point, near: Joints) -> Joints:
            return super()._target(Point(change(self._joints, *point.values)), near)

    return with_interpreter(ChangedValues)


row(
    "straight-to-its-first-point",
    "6.5/25",
    "A straight move ends at its first point.",
    _skips(lambda index, _count: index > 0),
)
row(
    "straight-without-its-last-point",
    "6.5/25",
    "A straight move of several points ends at the last but one.",
    _skips(lambda index, count: 0 < index == count - 1),
)
row(
    "straight-to-its-last-point",
    "6.5/25",
    "A straight move skips all points except its last.",
    _skips(lambda index, count: index < count - 1),
)
row(
    "straight-past-the-middle",
    "6.5/25",
    "A straight move of three or more points skips the points between its first and its last.",
    _skips(lambda index, count: 0 < index < count - 1),
)
row(
    "straight-to-its-sixteenth-point",
    "6.5/25",
    "A straight move ends at its sixteenth point.",
    _skips(lambda index, _count: index > 15),
    subtle=True,
)
row(
    "points-swap-the-arms",
    "6.5/27",
    "The first two values of a point are exchanged.",
    _values(lambda _joints, a, b, c, d: (b, a, c, d)),
)
row(
    "points-of-whole-degrees",
    "6.5/27",
    "The values of a point lose their decimals.",
    _values(lambda _joints, *values: tuple(map(math.trunc, values))),
)
row(
    "points-without-rotation",
    "6.5/27",
    "The last value of a point is ignored: the rotation does not change.",
    _values(lambda joints, a, b, c, _d: (a, b, c, joints.rotation_deg)),
)
row(
    "points-without-height",
    "6.5/27",
    "The third value of a point is ignored: the wrist does not move.",
    _values(lambda joints, a, b, _c, d: (a, b, joints.wrist_mm, d)),
)


@mutant("goes-half-the-way", "6.5/27")
class MovesHalfWay(Run):
    """A move ends half way to its point."""

    def _motion_to(self, point: Point) -> Motion:
        target = self._target(point, self._joints)
        half = Joints(*((p + q) / 2 for p, q in zip(self._joints, target, strict=True)))
        return move(self._joints, half, 50)


@mutant("skips-points-out-of-reach", "6.5/27")
class SkipsUnreachablePoints(Run):
    """A point that is out of reach is skipped, and the program reports success."""

    def _motion_to(self, point: Point) -> Motion:
        try:
            return super()._motion_to(point)
        except UnreachableError:
            return hold(self._joints)


@mutant("ends-before-it-arrives", "6.5/27")
class ContinuesDuringMove(Run):
    """A program continues, and ends, while the arm still moves to a point."""

    def _move(self, motion: Motion, now_s: float) -> float:
        super()._move(motion, now_s)
        return now_s


@mutant("curves-without-their-last-point", "6.5/27")
class SkipsEndOfCurves(Run):
    """A curve ends at its last point but one."""

    def _curve(self, node: Node) -> Motion:
        motion = super()._curve(node)
        points = self._program.nodes[self._index - node.counts + 1 : self._index]
        targets = [self._target(p.data, self._joints) for p in points if isinstance(p.data, Point)]
        return curve(self._joints, targets, node.speed_rate) if targets else motion


@mutant("refuses-points", "6.5/27")
class FailsAtPoints(Run):
    """Every move to a point fails."""

    def _motion_to(self, point: Point) -> Motion:  # noqa: ARG002 - overrides
        raise ZeroDivisionError


@mutant("leaves-out-the-end-of-long-curves", "6.5/27", subtle=True)
class SkipsEndOfLongCurves(Run):
    """A curve of more than four points ends at the last but one."""

    def _curve(self, node: Node) -> Motion:
        if node.counts <= 4:
            return super()._curve(node)
        motion = super()._curve(replace(node, counts=node.counts - 1))
        self._index += 1
        return motion
