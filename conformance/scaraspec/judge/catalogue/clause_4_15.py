"""4.15: run a program, 0x30 (L304-328)."""

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
    ROBUSTNESS,
    TEXT,
    UNTESTABLE,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.15/1", lines=((306, 309),), register=("A-4.15-3",),
      sentence="The data of 0x30 must be the name of the program to run.",
      original="后面添加运行程序名称 / 0xAA | 0x30 | 8 | “pro1.txt” | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.15/2", lines=((311, 316),), register=("A-4-1",),
      sentence="The controller must check the conditions of a run before it replies to 0x30.",
      original="首先检查是否具有运行条件，并将结果进行返回",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.15/3", lines=(314,), register=("A-0-2",),
      sentence="When the conditions of a run are not met, the "
               "first reply to 0x30 must be '0|code', four bytes.",
      original="0xCC | 0x30 | 4 | “0 11” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.15/4", lines=(316,), register=("A-4-7",),
      sentence="When the conditions of a run are met, the first reply to 0x30 must be '1'.",
      original="数字“1”表示具有运行条件",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.15/5", lines=((318, 321),), register=("A-3-7",),
      sentence="A run that comes to the program's end must end with the tagged result '11'.",
      original="执行结束后将结果返回，成功返回“11” / 0xCC | 0x90 | 0x30 | 2 | “11” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.15/6", lines=((323, 328),), register=("A-3-8",),
      sentence="A run that fails must end with the tagged result '00|code'.",
      original="失败返回格式如下： / 0xCC | 0x90 | 0x30 | 5 | “00 12” | 0xAA / “00”表示执行失败",
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.15/7", lines=(1044,), register=("A-4.15-1",),
      sentence="Running a program that is not stored must never end as done: the "
               "first reply is '0|20', or, tolerated, the final result '00|20'.",
      original="20 | 程序文件不存在",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.15/8", lines=(1018,), register=("A-4-2",),
      sentence="During a run a second 0x30 must not be answered '1'.",
      original="01 | 正在正常执行程序",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.15/9", register=("A-4.15-2",),
      sentence="A damaged program file is expected to set nothing in motion.",
      binds=CONTROLLER, testable=UNTESTABLE, hazard=MOTION, strength=INFO, basis=ROBUSTNESS),
)
