"""The geometry of the virtual arm: forward and inverse kinematics, and limits.

The document gives no dimensions (A-7-1): the arm is that of register section 9. Right-handed base
frame, origin on the base plane under joint 1, X along the stretched arm, Y to its left, Z up;
angles in degrees, counter-clockwise positive.
"""

import math
from typing import NamedTuple

from scaraspec.user_message import UserMessage

INNER_ARM_MM = 200.0
OUTER_ARM_MM = 200.0

TOLERANCE = 1e-3
"""Tolerance of the limits in mm or degrees.

A pose is sent with three decimals, so it can be off by half of this. A pose that was reported at a
limit can therefore be commanded again.
"""


class Joints(NamedTuple):
    """Positions of the four joints in the order of 4.14 (L299)."""

    inner_arm_deg: float
    outer_arm_deg: float
    wrist_mm: float
    rotation_deg: float


class Pose(NamedTuple):
    """The tool position in the base frame and its rotation about the vertical (7.1, L1004-1006).

    thetaX is the orientation in the base frame, not an angle of joint 4 (A-7-2); it is not reduced
    modulo 360 degrees, because joint 4 turns more than once.
    """

    x_mm: float
    y_mm: float
    z_mm: float
    theta_x_deg: float


class Offset(NamedTuple):
    """The gripper centre relative to the tool (7.2, L1010), in the tool frame (A-4.19-1)."""

    x_mm: float
    y_mm: float
    z_mm: float


LOWER = Joints(-130.0, -140.0, 150.0, -360.0)
UPPER = Joints(130.0, 140.0, 350.0, 360.0)

HOME = Pose(300.0, 0.0, 250.0, 0.0)
"""The pose at power-on, and the initial tool position until 0x36 sets another."""


class UnreachableError(Exception):
    """The arm cannot reach a pose.

    Attributes:
        code: ``05`` outside the annulus or the travel of Z, ``06`` beyond the limit of a joint
            (table 8-1, A-4.24-5).
    """

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code = code


def _radius_mm(outer_arm_deg: float) -> float:
    """Return the distance of the tool from the axis of joint 1."""
    return math.sqrt(
        INNER_ARM_MM**2
        + OUTER_ARM_MM**2
        + 2 * INNER_ARM_MM * OUTER_ARM_MM * math.cos(math.radians(outer_arm_deg))
    )


INNER_REACH_MM = _radius_mm(UPPER.outer_arm_deg)
OUTER_REACH_MM = INNER_ARM_MM + OUTER_ARM_MM


def within_limits(joints: Joints) -> bool:
    """Whether each joint is within its range; false for values that are not finite."""
    return all(low <= value <= high for low, value, high in zip(LOWER, joints, UPPER, strict=True))


def clamp_to_limits(joints: Joints) -> Joints:
    """Return the joints, moved to a limit if they exceed it by less than `TOLERANCE`.

    Raises:
        UnreachableError: ``05`` for the wrist, ``06`` for another joint.
    """
    for name, low, value, high in zip(Joints._fields, LOWER, joints, UPPER, strict=True):
        if not low - TOLERANCE <= value <= high + TOLERANCE:
            code = "05" if name == "wrist_mm" else "06"
            raise UnreachableError(
                code,
                UserMessage(
                    "{joint} {value:g} is outside {low:g} to {high:g}",
                    joint=name,
                    value=value,
                    low=low,
                    high=high,
                ),
            )
    return Joints(*map(max, LOWER, map(min, joints, UPPER)))


def forward(joints: Joints) -> Pose:
    """Return the position of the lower end centre of the screw (7.1, L1004)."""
    inner = math.radians(joints.inner_arm_deg)
    outer = inner + math.radians(joints.outer_arm_deg)
    return Pose(
        x_mm=INNER_ARM_MM * math.cos(inner) + OUTER_ARM_MM * math.cos(outer),
        y_mm=INNER_ARM_MM * math.sin(inner) + OUTER_ARM_MM * math.sin(outer),
        z_mm=joints.wrist_mm,
        theta_x_deg=joints.inner_arm_deg + joints.outer_arm_deg + joints.rotation_deg,
    )


def inverse(pose: Pose, near: Joints) -> Joints:
    """Return the joints for a pose, with the elbow on the same side as in `near`.

    From a stretched arm, which has no side, the elbow bends counter-clockwise.

    Raises:
        UnreachableError: ``05`` outside the annulus or Z, ``06`` beyond the limit of a joint.
    """
    radius_mm = math.hypot(pose.x_mm, pose.y_mm)
    if not INNER_REACH_MM - TOLERANCE <= radius_mm <= OUTER_REACH_MM + TOLERANCE:
        raise UnreachableError(
            "05",
            UserMessage(
                "distance {radius_mm:g} mm from the base axis is outside {inner_mm:g} to "
                "{outer_mm:g} mm",
                radius_mm=radius_mm,
                inner_mm=INNER_REACH_MM,
                outer_mm=OUTER_REACH_MM,
            ),
        )
    cosine = (radius_mm**2 - INNER_ARM_MM**2 - OUTER_ARM_MM**2) / (2 * INNER_ARM_MM * OUTER_ARM_MM)
    outer = math.acos(min(cosine, 1.0))
    if near.outer_arm_deg < 0:
        outer = -outer
    inner = math.atan2(pose.y_mm, pose.x_mm) - math.atan2(
        OUTER_ARM_MM * math.sin(outer), INNER_ARM_MM + OUTER_ARM_MM * math.cos(outer)
    )
    inner_deg, outer_deg = math.remainder(math.degrees(inner), 360.0), math.degrees(outer)
    rotation_deg = pose.theta_x_deg - inner_deg - outer_deg
    return clamp_to_limits(Joints(inner_deg, outer_deg, pose.z_mm, rotation_deg))


def gripper_point(tool: Pose, centre: Offset) -> Pose:
    """Return the gripper center; its offset turns with thetaX (7.2, A-4.19-1)."""
    theta = math.radians(tool.theta_x_deg)
    return Pose(
        x_mm=tool.x_mm + centre.x_mm * math.cos(theta) - centre.y_mm * math.sin(theta),
        y_mm=tool.y_mm + centre.x_mm * math.sin(theta) + centre.y_mm * math.cos(theta),
        z_mm=tool.z_mm + centre.z_mm,
        theta_x_deg=tool.theta_x_deg,
    )
