"""4.24: set the tool coordinates, which is a move, 0x39 (L481-516)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    MOTION,
    PC,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.24/1", lines=((483, 486),), register=("A-4.24-2",),
      sentence="The data of 0x39 must be the numbers speed, x, y, "
               "z, thetaX, thetaY and thetaZ with '|' between them.",
      original="坐标以如下格式表示(speed, x,y,z, ThetaX, ThetaY, ThetaZ)，中间以“|”分割",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.24/2", lines=(488,), register=("A-4.24-4",),
      sentence="The speed in 0x39 must be a whole percentage from 1 to 100.",
      original="speed 表示速度比，以整数表示，单位%",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.24/3", lines=((490, 497),), register=("A-4.24-3",),
      sentence="An impossible move must be refused with '0|code' as the first reply to 0x39.",
      original="首先判断是否可以设置工具坐标，若不可以，则返回“失败”结果 / "
               "0xCC | 0x39 | 1 | “0 12” | 0xAA / "
               "“0”表示失败",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.24/4", lines=(495, 98), register=("A-4.24-3",),
      sentence="The length byte of a refused 0x39 must count "
               "its data: 4, although the row prints 1.",
      original="0xCC | 0x39 | 1 | “0 12” | 0xAA / 数据内容的长度受限于“数据长度”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.24/5", lines=((499, 502),), register=("A-4-7",),
      sentence="A possible move must be accepted with '1' as the first reply to 0x39.",
      original="若条件满足，可以设置工具坐标，则返回结果“1” / 0xCC | 0x39 | 1 | “1” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.24/6", lines=((504, 509),), register=("A-3-7", "A-4.24-1"),
      sentence="When the move has been made, the tagged result '11' must be sent.",
      original="执行完成后，返回执行结果 / "
               "执行成功后，返回“11” / "
               "0xCC | 0x90 | 0x39 | 2 | “11” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.24/7", lines=((511, 516),), register=("A-3-8",),
      sentence="When the move fails, the tagged result '00|code' must be sent.",
      original="执行不成功，返回结果及原因 / 0xCC | 0x90 | 0x39 | 5 | “00 12” | 0xAA",
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.24/8", lines=(504, 476), register=("A-4.24-5",),
      sentence="After 0x39 ended with '11', 0x38 must return the commanded "
               "x, y and z within 1 mm and thetaX within 1 degree; where "
               "the gripper centre is not 0|0|0, a difference is tolerated.",
      original="然后，执行“设置工具坐标”指令，执行完成后，返回执行结果 / "
               "控制层向应用层返回“夹具坐标”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.24/9", lines=((1022, 1023),), register=("A-4.24-5",),
      sentence="A target beyond all reach (1,000,000 mm) must be refused "
               "or fail, with 05 or 06, and never count as reached.",
      original="05 | 坐标异常 / 06 | 角度异常",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
)
