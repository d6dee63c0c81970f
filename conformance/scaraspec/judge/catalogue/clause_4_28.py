"""4.28: jog, 0x3D (L596-637)."""

from scaraspec.judge.catalogue.entry import (
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
    ROBUSTNESS,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.28/1", lines=((600, 608),), register=("A-4.28-1",),
      sentence="The request 0x3D must carry exactly one data byte.",
      original="0xAA | 0x3D | 1 |  | 0xCC / 其中“数据”为一个字节",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.28/2", lines=((605, 608),), register=("A-4.28-1",),
      sentence="The data byte of 0x3D should be one of 1 to "
               "4, as an ASCII digit or as a binary value.",
      original="- 1: 向 Y 轴正方向持续移动 / - 4: 向 X 轴负方向持续移动",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("4.28/3", lines=((605, 608),), register=("A-4.28-2",),
      sentence="In 0x3D both sides must take 1 for +Y, 2 for -Y, 3 for +X and 4 for -X.",
      original="- 1: 向 Y 轴正方向持续移动 / "
               "- 2: 向 Y 轴负方向持续移动 / "
               "- 3: 向 X 轴正方向持续移动 / "
               "- 4: 向 X 轴负方向持续移动",
      binds=BOTH, testable=AC | AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.28/4", lines=((610, 623),), register=("A-4-7",),
      sentence="The first reply to 0x3D must be '1' or '0|code'.",
      original="若不满足，发送失败及原因 / 若满足条件，则发送结果“1”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.28/5", lines=((625, 630),), register=("A-4.28-3",),
      sentence="The end of a jog must be told by the tagged result '11'.",
      original="然后执行移动机器人关节，指令结束后，返回结果 / "
               '0xCC | 0x90 | 0x3D | 2 | "11" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.28/6", lines=((632, 637),), register=("A-4.28-6",),
      sentence="When the jog fails, the tagged result '00|code' must be sent.",
      original='当执行不成功时，返回失败及原因 / 0xCC | 0x90 | 0x3D | 5 | "00 12" | 0xAA',
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.28/7", lines=((605, 608),), register=("A-4.28-5",),
      sentence="A 0x3D with a value outside 1 to 4 must not be answered '1' and must move nothing.",
      original="- 1: 向 Y 轴正方向持续移动 / - 4: 向 X 轴负方向持续移动",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.28/8", register=("A-4.28-3", "A-2-8"),
      sentence="A jog is expected to end on 0x32, at a travel "
               "limit and when the connection is lost.",
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=INFO, basis=ROBUSTNESS),
)
