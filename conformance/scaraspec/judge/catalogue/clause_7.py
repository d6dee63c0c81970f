"""Clause 7, geometry: the tool point and the gripper centre (L1000-1010)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    BOTH,
    CONTROLLER,
    DERIVED,
    INFO,
    PC,
    READ_ONLY,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("7/1", lines=(1004,), register=("A-4.23-1",),
      sentence="Tool coordinates should refer to the centre of the screw's lower end.",
      original="工具坐标是指机器人丝杆的底端中心点",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("7/2", lines=(1006,), register=("A-4.21-3",),
      sentence="Of the six values only x, y, z and thetaX should carry meaning.",
      original="在该系列机器人上，只有(x,y,z,thetaX)有意义",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("7/3", lines=(1006,), register=("A-7-2",),
      sentence="thetaX is expected to be the angle through which the screw is turned.",
      original="thetaX 指机器人丝杠旋转的角度",
      binds=CONTROLLER, testable=PC, hazard=READ_ONLY, strength=INFO, basis=TEXT),
    R("7/4", lines=(1010,), register=("A-4.19-1",),
      sentence="The gripper centre is expected to be where the "
               "user's tool works, measured from the tool point.",
      original="夹具中心点为用户工具的作业端相对工具的位置",
      binds=CONTROLLER, testable=PC, hazard=READ_ONLY, strength=INFO, basis=TEXT),
    R("7/5", lines=(1004, 591), register=("A-4.27-3",),
      sentence="One arm geometry is expected to explain joint angles "
               "(0x3C) and tool coordinates (0x38) that are read together.",
      original="工具坐标是指机器人丝杆的底端中心点 / 包含四个关节的角度",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=INFO, basis=DERIVED),
)
