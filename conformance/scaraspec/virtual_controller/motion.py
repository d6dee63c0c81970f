"""Motion as a function of time: the joint positions at a time after the start.

A motion is planned completely before it starts. After that it cannot fail, so its position can be
computed for any time and it can be stopped at any time. The document gives no speeds; this module
defines those of the virtual arm.
"""

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from scaraspec.protocol.payloads import JogDirection
from scaraspec.virtual_controller.arm import (
    OUTER_REACH_MM,
    TOLERANCE,
    Joints,
    Pose,
    UnreachableError,
    clamp_to_limits,
    forward,
    inverse,
)

JOINT_SPEEDS = Joints(150.0, 200.0, 150.0, 300.0)
"""Maximum speed of each joint, in degrees or mm per second."""
TOOL_SPEED_MM_S = 400.0
"""Maximum speed of the tool on a straight or curved path."""
JOG_SPEED_MM_S = 20.0
"""Speed of a continuous jog; 4.28 gives none (A-4.28-4)."""
RAMP_S = 0.25
"""Seconds from rest to full speed at maximum acceleration."""

_STEP_MM = 10.0  # between path points; the path deviates by at most about 0.1 mm between them
_FINEST_MM = 1e-4  # precision with which a jog finds the limit
# Peak speed and peak acceleration of the minimum-jerk profile over one second and one unit.
_PEAK_SPEED = 15 / 8
_PEAK_ACCELERATION = 10 / math.sqrt(3)


@dataclass(frozen=True, slots=True)
class Motion:
    """A path through joint space with a duration.

    Attributes:
        waypoints: Positions on the path, each within the limits. Between two of them every joint
            moves linearly, so that the whole path is within the limits.
        stations_s: For each waypoint, the time when it is passed at full speed; 0 for the first.
        duration_s: Time from start to end in seconds.
        smooth: Whether the speed starts and ends at zero (minimum jerk), or is constant.
    """

    waypoints: tuple[Joints, ...]
    stations_s: tuple[float, ...]
    duration_s: float
    smooth: bool

    def joints_at(self, t_s: float) -> Joints:
        """Return the joints `t_s` seconds after the start; at rest before the start and after."""
        if t_s >= self.duration_s:
            return self.waypoints[-1]
        progress = max(t_s, 0.0) / self.duration_s if self.duration_s else 0.0
        if self.smooth:
            progress = progress**3 * (10 - 15 * progress + 6 * progress**2)
        station_s = progress * self.stations_s[-1]
        after = bisect_right(self.stations_s, station_s)
        if after == len(self.stations_s):
            return self.waypoints[-1]
        start_s, end_s = self.stations_s[after - 1 : after + 1]
        fraction = (station_s - start_s) / (end_s - start_s)
        a, b = self.waypoints[after - 1 : after + 1]
        return Joints(*(p + (q - p) * fraction for p, q in zip(a, b, strict=True)))


def hold(joints: Joints) -> Motion:
    """Return a motion of zero length: the arm stays at `joints`."""
    return Motion((joints,), (0.0,), 0.0, smooth=True)


def move(start: Joints, target: Joints, speed_percent: float) -> Motion:
    """Plan a joint-interpolated move; all joints start and arrive together (4.24, L504).

    Raises:
        UnreachableError: The target is beyond a limit.
    """
    return _smooth((start, clamp_to_limits(target)), speed_percent, tool_speed_mm_s=math.inf)


def straight_line(start: Joints, target: Joints, speed_percent: float) -> Motion:
    """Plan a straight line of the tool (node type 5, L911); thetaX changes linearly along it.

    Raises:
        UnreachableError: The target or a point of the line is out of reach, or the elbow would
            have to change sides.
    """
    return curve(start, (target,), speed_percent)


def curve(start: Joints, targets: Sequence[Joints], speed_percent: float) -> Motion:
    """Plan a smooth path of the tool through all targets in order (node type 6, L912).

    The path is a Catmull-Rom spline; with one target it is a straight line.

    Raises:
        UnreachableError: A target or a point of the path is out of reach, or the elbow would
            have to change sides.
    """
    knots = [start, *map(clamp_to_limits, targets)]
    elbow = _elbow(knots)
    poses = [forward(knot) for knot in knots]
    waypoints = [start]
    for index, target in enumerate(knots[1:]):
        waypoints += (inverse(pose, near=elbow) for pose in _spline(poses, index))
        waypoints.append(target)
    return _smooth(waypoints, speed_percent, TOOL_SPEED_MM_S)


def jog(start: Joints, direction: JogDirection) -> Motion:
    """Plan a straight line along a base axis at a slow, constant speed, up to a limit (4.28).

    The duration is close to zero if the arm is already at the limit.
    """
    origin = forward(start)
    dx, dy = {
        JogDirection.PLUS_Y: (0, 1),
        JogDirection.MINUS_Y: (0, -1),
        JogDirection.PLUS_X: (1, 0),
        JogDirection.MINUS_X: (-1, 0),
    }[direction]
    waypoints, travel_mm, step_mm = [start], 0.0, _STEP_MM
    while step_mm > _FINEST_MM and travel_mm < 2 * OUTER_REACH_MM:
        pose = origin._replace(
            x_mm=origin.x_mm + dx * (travel_mm + step_mm),
            y_mm=origin.y_mm + dy * (travel_mm + step_mm),
        )
        try:
            waypoints.append(inverse(pose, near=start))
        except UnreachableError:
            step_mm /= 2
        else:
            travel_mm += step_mm
    stations_s = _stations(waypoints, JOG_SPEED_MM_S)
    return Motion(tuple(waypoints), stations_s, stations_s[-1], smooth=False)


def _smooth(waypoints: Sequence[Joints], speed_percent: float, tool_speed_mm_s: float) -> Motion:
    if not 1 <= speed_percent <= 100:  # noqa: PLR2004 - percent (A-4.24-4)
        raise ValueError(f"speed must be 1 to 100 percent, not {speed_percent!r}")
    stations_s = _stations(waypoints, tool_speed_mm_s)
    fastest_s = stations_s[-1]
    duration_s = max(
        _PEAK_SPEED * fastest_s * 100 / speed_percent,
        math.sqrt(_PEAK_ACCELERATION * fastest_s * RAMP_S),
    )
    return Motion(tuple(waypoints), stations_s, duration_s, smooth=True)


def _stations(waypoints: Sequence[Joints], tool_speed_mm_s: float) -> tuple[float, ...]:
    """Return when each waypoint is passed if always one joint or the tool is at full speed."""
    return tuple(
        accumulate(
            (
                max(
                    _distance_mm(forward(a), forward(b)) / tool_speed_mm_s,
                    *(abs(q - p) / speed for p, q, speed in zip(a, b, JOINT_SPEEDS, strict=True)),
                )
                for a, b in pairwise(waypoints)
            ),
            initial=0.0,
        )
    )


def _elbow(knots: Sequence[Joints]) -> Joints:
    """Return the most bent position; it defines the side of the elbow for the whole path."""
    angles = [knot.outer_arm_deg for knot in knots]
    if min(angles) < -TOLERANCE and max(angles) > TOLERANCE:
        raise UnreachableError("06", "the elbow cannot change sides on a straight or curved path")
    return max(knots, key=lambda knot: abs(knot.outer_arm_deg))


def _spline(poses: Sequence[Pose], index: int) -> Iterator[Pose]:
    """Yield the points between pose `index` and the next on a Catmull-Rom spline."""
    start, end = poses[index], poses[index + 1]
    before = poses[max(index - 1, 0)]
    after = poses[min(index + 2, len(poses) - 1)]
    steps = max(8, math.ceil(_distance_mm(start, end) / _STEP_MM))
    for step in range(1, steps):
        u = step / steps
        yield Pose(
            *(
                p + u * (q - o + u * (2 * o - 5 * p + 4 * q - r + u * (3 * (p - q) + r - o))) / 2
                for o, p, q, r in zip(before, start, end, after, strict=True)
            )
        )


def _distance_mm(a: Pose, b: Pose) -> float:
    return math.dist(a[:3], b[:3])
