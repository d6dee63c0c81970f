"""Faults of clause 6.5: moves, and the points that they go to."""

import math
from dataclasses import replace

from scaraspec.mutants.operators.controller.programs import misrun
from scaraspec.protocol.program_files import Node, Point
from scaraspec.virtual_controller.arm import Joints
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.motion import Motion, curve, hold, move


class _StaysAt(Run):
    """Does not go to some of the points of a straight move."""

    def stays(self, place: int, count: int) -> bool:
        """Whether it passes over the point of this place, 0 for the first, of so many."""
        return place == count

    def _motion_to(self, point: Point) -> Motion:
        owner = self._structure.owners[self._index]
        if owner is not None:
            count = self._program.nodes[owner].counts
            if self.stays(self._index - owner - 1, count):
                return hold(self._joints)
        return super()._motion_to(point)


@misrun("straight-to-its-first-point", "6.5/25")
class StraightToItsFirstPoint(_StaysAt):
    """A straight move ends at its first point."""

    def stays(self, place: int, count: int) -> bool:  # noqa: ARG002 - one signature for all
        """All others."""
        return place > 0


@misrun("straight-without-its-last-point", "6.5/25")
class StraightWithoutItsLastPoint(_StaysAt):
    """A straight move of several points ends at the last but one."""

    def stays(self, place: int, count: int) -> bool:
        """The last one."""
        return 0 < place == count - 1


@misrun("straight-to-its-last-point", "6.5/25")
class StraightToItsLastPoint(_StaysAt):
    """A straight move passes over all points but its last."""

    def stays(self, place: int, count: int) -> bool:
        """All others."""
        return place < count - 1


@misrun("straight-past-the-middle", "6.5/25")
class StraightPastTheMiddle(_StaysAt):
    """A straight move of three points or more passes over its second."""

    def stays(self, place: int, count: int) -> bool:
        """That one."""
        return 0 < place < count - 1


@misrun("straight-to-its-sixteenth-point", "6.5/25", subtle=True)
class StraightToItsSixteenthPoint(_StaysAt):
    """A straight move ends at its sixteenth point, for no more are kept."""

    def stays(self, place: int, count: int) -> bool:  # noqa: ARG002 - one signature for all
        """Those behind it."""
        return place > 15


class _Targets(Run):
    """Takes points for others."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """The values that it takes."""
        return point.values

    def _target(self, point: Point, near: Joints) -> Joints:
        return super()._target(Point(self.values(point)), near)


@misrun("points-swap-the-arms", "6.5/27")
class PointsSwapTheArms(_Targets):
    """The first two values of a point are taken for each other."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Swap them."""
        a, b, c, d = point.values
        return b, a, c, d


@misrun("points-of-whole-degrees", "6.5/27")
class PointsOfWholeDegrees(_Targets):
    """The values of a point lose what is behind the decimal point."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Drop it."""
        a, b, c, d = map(math.trunc, point.values)
        return a, b, c, d


@misrun("points-without-rotation", "6.5/27")
class PointsWithoutRotation(_Targets):
    """The last value of a point is left out: the rotation stays what it is."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Keep the rotation."""
        a, b, c, _ = point.values
        return a, b, c, self._joints.rotation_deg


@misrun("points-without-height", "6.5/27")
class PointsWithoutHeight(_Targets):
    """The third value of a point is left out: the wrist stays where it is."""

    def values(self, point: Point) -> tuple[float, float, float, float]:
        """Keep the height."""
        a, b, _, d = point.values
        return a, b, self._joints.wrist_mm, d


@misrun("goes-half-the-way", "6.5/27")
class GoesHalfTheWay(Run):
    """A move ends half the way to its point."""

    def _motion_to(self, point: Point) -> Motion:
        target = self._target(point, self._joints)
        half = Joints(*((p + q) / 2 for p, q in zip(self._joints, target, strict=True)))
        return move(self._joints, half, 50)


@misrun("ends-before-it-arrives", "6.5/27")
class EndsBeforeItArrives(Run):
    """A program goes on, and ends, while the arm is still on its way to a point."""

    def _move(self, motion: Motion, now_s: float) -> float:
        super()._move(motion, now_s)
        return now_s


@misrun("curves-without-their-last-point", "6.5/27")
class CurvesWithoutTheirLastPoint(Run):
    """A curve ends at its last point but one."""

    def _curve(self, node: Node) -> Motion:
        motion = super()._curve(node)
        points = self._program.nodes[self._index - node.counts + 1 : self._index]
        targets = [self._target(p.data, self._joints) for p in points if isinstance(p.data, Point)]
        return curve(self._joints, targets, node.speed_rate) if targets else motion


@misrun("refuses-points", "6.5/27")
class RefusesPoints(Run):
    """Every move to a point fails."""

    def _motion_to(self, point: Point) -> Motion:  # noqa: ARG002 - whatever it is
        raise ZeroDivisionError


@misrun("leaves-out-the-end-of-long-curves", "6.5/27", subtle=True)
class LeavesOutTheEndOfLongCurves(Run):
    """A curve of more than four points ends at the last but one."""

    def _curve(self, node: Node) -> Motion:
        if node.counts <= 4:
            return super()._curve(node)
        motion = super()._curve(replace(node, counts=node.counts - 1))
        self._index += 1
        return motion
