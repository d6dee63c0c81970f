"""4.18: reset the robot, 0x33 (L385-419)."""

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
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.18/1", lines=((387, 390),), register=("A-3-12",),
      sentence="The request 0x33 must carry no data.",
      original="0xAA | 0x33 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.18/2", lines=((394, 399),), register=("A-4-2",),
      sentence="A robot that executes a program must refuse the reset with '0|01'.",
      original="若不具有复位条件，则将返回如下结果： / "
               '0xCC | 0x33 | 4 | "0 01" | 0xAA / '
               "“01”表示机器人正在执行程序",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.18/3", lines=((401, 404),), register=("A-4.18-2",),
      sentence="An idle robot must accept the reset with '1'.",
      original='若机器人正在空闲状态，则可以进行复位 / 0xCC | 0x33 | 1 | "1" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.18/4", lines=((406, 409),), register=("A-3-7",),
      sentence="When the reset has succeeded, the tagged result '11' must be sent.",
      original='复位成功时，返回如下 / 0xCC | 0x90 | 0x33 | 2 | "11" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.18/5", lines=((411, 419),), register=("A-4.18-1",),
      sentence="When the reset fails, the tagged result '00|code' must "
               "be sent with length 5, although its row prints 4.",
      original='复位失败时返回如下： / 0xCC | 0x90 | 0x33 | 4 | "00 11" | 0xAA / “00”表示复位失败',
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.18/6", lines=(401,), register=("A-4.18-2",),
      sentence="A robot in error should accept the reset too.",
      original="若机器人正在空闲状态，则可以进行复位",
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
)
