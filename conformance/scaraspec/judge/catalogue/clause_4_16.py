"""4.16: simulate a program, 0x31 (L330-354)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    MOTION,
    PC,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.16/1", lines=((332, 335),), register=("A-4.15-3",),
      sentence="The data of 0x31 must be the name of the program to simulate.",
      original='后面添加运行程序名称 / 0xAA | 0x31 | 8 | "pro1.txt" | 0xCC',
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.16/2", lines=((337, 342),), register=("A-4-7",),
      sentence="The first reply to 0x31 must be '1' or '0|code'.",
      original='首先检查是否具有运行条件，并将结果进行返回 / 0xCC | 0x31 | 4 | "0 11" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.16/3", lines=((344, 347),), register=("A-3-7",),
      sentence="When the simulation has ended well, the tagged result '11' must be sent.",
      original='执行结束后将结果返回，成功返回“11” / 0xCC | 0x90 | 0x31 | 2 | "11" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.16/4", lines=((349, 354),), register=("A-3-8",),
      sentence="When the simulation fails, the tagged result '00|code' must be sent.",
      original='失败时返回格式如下： / 0xCC | 0x90 | 0x31 | 5 | "00 12" | 0xAA / “00”表示失败',
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.16/5", lines=(330,), register=("A-4.16-1",),
      sentence="A simulated run is expected to move no joint and switch no output.",
      original="4.16 模拟运行程序(0x31)",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=INFO, basis=DERIVED),
)
