"""Clauses 7 and 8: geometry and the error list (L1000-1046)."""

from scaraspec.judge.requirements.entry import (
    AC,
    AK,
    BOTH,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    MOTION,
    PC,
    READ_ONLY,
    ROBUSTNESS,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    # Clause 7, geometry: the tool point and the gripper centre (L1000-1010).
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
    # Clause 8, the error list: table 8-1 (L1012-1046).
    R("8/1", lines=(1014,), register=("A-8-2",),
      sentence="An error code must be sent as text.",
      original="错误代码为字符串类型。",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("8/2", lines=((1017, 1044),), register=("A-8-2",),
      sentence="Every error code sent must be listed in table 8-1.",
      original="00 | 空闲 / 20 | 程序文件不存在",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("8/3", lines=((1024, 1028),), register=("A-8-3",),
      sentence="The reserved codes 07, 08, 09 and 10 should not be sent.",
      original="07 | 保留 / 08 | 保留 / 09 | 保留 / 10 | 保留",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("8/4", lines=((1029, 1043),), register=("A-8-1",),
      sentence="Codes 11 to 1F must name the faulty joints on both sides: hexadecimal 10 plus 1 "
               "for the inner arm, 2 for the outer arm, 4 for the wrist and 8 for the gripper.",
      original="11 | 大臂关节电机错误 / "
               "12 | 小臂关节电机错误 / "
               "14 | 手腕关节电机错误 / "
               "18 | 夹具关节电机错误 / "
               "1F | 所有关机电机都出错",
      binds=BOTH, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("8/5", lines=(1044,), register=("A-4.15-1",),
      sentence="Code 20 must stand for a missing program file.",
      original="20 | 程序文件不存在",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("8/6", lines=(1038,), register=("A-T-7",),
      sentence="A client should accept the letters of a code in upper and in lower case.",
      original="1A | 夹具关节和小臂关节电机出错",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
)
