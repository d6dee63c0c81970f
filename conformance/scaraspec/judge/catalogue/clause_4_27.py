"""4.27: read the joint angles, 0x3C (L584-594)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    MOTION,
    PC,
    READ_ONLY,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.27/1", lines=((586, 589),), register=("A-3-12",),
      sentence="The request 0x3C must carry no data.",
      original="0xAA | 0x3C | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.27/2", lines=((591, 594),), register=("A-4.27-2",),
      sentence="The reply to 0x3C must be four numbers with '|' between them.",
      original="包含四个关节的角度，以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.27/3", lines=(594, 98), register=("A-4.27-1",),
      sentence="The length byte of the reply to 0x3C must count the bytes "
               "really sent: 16 for the documented text, whose row prints 17.",
      original='0xCC | 0x3C | 17 | "20.4 30.5 38.0 0" | 0xAA / 数据内容的长度受限于“数据长度”',
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.27/4", lines=(591,), register=("A-4.27-3",),
      sentence="While the robot is idle and locked, the joint angles must not change.",
      original="包含四个关节的角度",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.27/5", lines=(591, 299), register=("A-4.27-2",),
      sentence="The order of the joint angles should be inner arm, outer arm, wrist, rotation.",
      original="包含四个关节的角度 / 大臂电机温度|小臂电机温度|手腕电机温度|旋转电机温度",
      binds=CONTROLLER, testable=PC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4.27/6", lines=(591, 1004), register=("A-4.27-3",),
      sentence="A motion that changed the tool coordinates must show in the joint angles too.",
      original="包含四个关节的角度 / 工具坐标是指机器人丝杆的底端中心点",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
)
