"""Model of the drawn arm: links, joints and simple shapes, as a table, URDF and transforms.

The model is an illustration. The document defines neither geometry (A-7-1) nor a convention of the
joint angles (A-4.27-3): every robot is drawn with the arm of register section 9, 200 + 200 mm, and
joint values in degrees and millimetres. The reported tool position (0x38) needs no model.
Lengths are in mm, angles in degrees, colours 0xRRGGBB.
"""

import math
from collections.abc import Iterator
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from scaraspec.protocol.commands import JointValues, Pose

Vector = tuple[float, float, float]

ROBOT: Final = "uisr4200s_virtual_arm"
BASE: Final = "base"
TOOL: Final = "tool"
MEASURED_TOOL: Final = "measured_tool"
"""Frame of the pose that the controller reports by 0x38, beside the drawn arm."""


class Box(NamedTuple):
    """A box along the axes of its link."""

    centre_mm: Vector
    size_mm: Vector
    colour: int


class Cylinder(NamedTuple):
    """A cylinder along the Z of its link."""

    centre_mm: Vector
    radius_mm: float
    length_mm: float
    colour: int


class Segment(NamedTuple):
    """A joint and the link that it moves.

    Attributes:
        joint: The joint's name in the command table.
        link: The link that it moves.
        parent: The link to which the joint is attached.
        origin_mm: The position of the joint on its parent.
        prismatic: The joint moves along Z instead of about Z.
        limits: The range of the joint, in degrees, or in mm if it is prismatic.
        shapes: The shapes with which the link is drawn.
    """

    joint: str
    link: str
    parent: str
    origin_mm: Vector
    prismatic: bool
    limits: tuple[float, float]
    shapes: tuple[Box | Cylinder, ...]


class Placement(NamedTuple):
    """Position of a link relative to its parent: a translation and a rotation about Z."""

    link: str
    parent: str
    shift_mm: Vector
    turn_deg: float


_ORANGE, _DARK, _STEEL, _GREY = 0xF28C28, 0x37474F, 0xCFD8DC, 0x78909C

BASE_SHAPES: Final[tuple[Box | Cylinder, ...]] = (
    Box((0, 0, 10), (180, 180, 20), _DARK),
    Cylinder((0, 0, 200), 55, 360, _GREY),
)

SEGMENTS: Final = (
    Segment(
        "inner_arm",
        "inner_arm_link",
        BASE,
        (0, 0, 0),
        prismatic=False,
        limits=(-130, 130),
        shapes=(
            Cylinder((0, 0, 402), 52, 44, _ORANGE),
            Box((100, 0, 402), (200, 76, 36), _ORANGE),
            Cylinder((200, 0, 402), 46, 44, _DARK),
        ),
    ),
    Segment(
        "outer_arm",
        "outer_arm_link",
        "inner_arm_link",
        (200, 0, 0),
        prismatic=False,
        limits=(-140, 140),
        shapes=(
            Cylinder((0, 0, 456), 46, 64, _ORANGE),
            Box((100, 0, 448), (200, 66, 40), _ORANGE),
            Cylinder((200, 0, 456), 36, 64, _DARK),
        ),
    ),
    Segment(
        "wrist",
        "wrist_link",
        "outer_arm_link",
        (200, 0, 0),
        prismatic=True,
        limits=(150, 350),
        shapes=(Cylinder((0, 0, 180), 9, 340, _STEEL),),
    ),
    Segment(
        "rotation",
        TOOL,
        "wrist_link",
        (0, 0, 0),
        prismatic=False,
        limits=(-360, 360),
        shapes=(
            Cylinder((0, 0, 6), 24, 12, _DARK),
            Box((30, 0, 6), (28, 8, 8), _ORANGE),  # shows how far the tool is turned
        ),
    ),
)


def place(joints: JointValues) -> Iterator[Placement]:
    """Yield the position of each link at these joint values."""
    for segment, value in zip(SEGMENTS, joints, strict=True):
        x, y, z = segment.origin_mm
        if segment.prismatic:
            yield Placement(segment.link, segment.parent, (x, y, z + value), 0.0)
        else:
            yield Placement(segment.link, segment.parent, (x, y, z), value)


def measured(tool: Pose) -> Placement:
    """Return the reported tool position; thetaX is its rotation in the base frame (A-7-2)."""
    return Placement(MEASURED_TOOL, BASE, (tool.x, tool.y, tool.z), tool.theta_x)


def to_si(joints: JointValues) -> tuple[float, ...]:
    """Convert joint values to radians, and the wrist to metres, the units of ROS (REP 103)."""
    return tuple(
        value / 1000 if segment.prismatic else math.radians(value)
        for segment, value in zip(SEGMENTS, joints, strict=True)
    )


def urdf() -> str:
    """Return the arm as a URDF document, in metres and radians."""
    robot = Element("robot", name=ROBOT)
    _add_link(robot, BASE, BASE_SHAPES)
    for segment in SEGMENTS:
        _add_link(robot, segment.link, segment.shapes)
    for segment in SEGMENTS:
        kind = "prismatic" if segment.prismatic else "revolute"
        joint = SubElement(robot, "joint", name=segment.joint, type=kind)
        SubElement(joint, "parent", link=segment.parent)
        SubElement(joint, "child", link=segment.link)
        SubElement(joint, "origin", xyz=_metres(*segment.origin_mm), rpy="0 0 0")
        SubElement(joint, "axis", xyz="0 0 1")
        lower, upper = (
            (limit / 1000 if segment.prismatic else math.radians(limit)) for limit in segment.limits
        )
        SubElement(
            joint, "limit", lower=f"{lower:.6g}", upper=f"{upper:.6g}", effort="0", velocity="0"
        )
    indent(robot)
    return tostring(robot, encoding="unicode")


def _add_link(robot: Element, name: str, shapes: tuple[Box | Cylinder, ...]) -> None:
    link = SubElement(robot, "link", name=name)
    for number, shape in enumerate(shapes):
        visual = SubElement(link, "visual", name=f"{name}_{number}")
        SubElement(visual, "origin", xyz=_metres(*shape.centre_mm), rpy="0 0 0")
        geometry = SubElement(visual, "geometry")
        if isinstance(shape, Box):
            SubElement(geometry, "box", size=_metres(*shape.size_mm))
        else:
            SubElement(
                geometry,
                "cylinder",
                radius=_metres(shape.radius_mm),
                length=_metres(shape.length_mm),
            )
        material = SubElement(visual, "material", name=f"{shape.colour:06x}")
        red, green, blue = shape.colour.to_bytes(3, "big")
        rgba = " ".join(f"{channel / 255:.3f}" for channel in (red, green, blue, 255))
        SubElement(material, "color", rgba=rgba)


def _metres(*values_mm: float) -> str:
    return " ".join(f"{value / 1000:.6g}" for value in values_mm)
