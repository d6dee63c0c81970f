"""4.9: read which program runs, 0x0A (L219-237)."""

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
    R("4.9/1", lines=((221, 224),), register=("A-3-12",),
      sentence="The request 0x0A must carry no data.",
      original="0xAA | 0x0A | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.9/2", lines=((226, 232),), register=("A-4.9-1",),
      sentence="While a program runs, the reply to 0x0A must be '1', the "
               "program's name and its run time, with '|' between them.",
      original="控制层返回信息包含结果，运行程序名称和运行时间 / "
               "数据中的“结果”、“程序名”和“运行时间”使用“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.9/3", lines=(226,), register=("A-4.9-3",),
      sentence="The run time must be eight digits DDHHMMSS, with "
               "hours up to 23 and minutes and seconds up to 59.",
      original="其中运行时间固定 8 个字节，以“DDHHMMSS”格式存放",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.9/4", lines=(226,), register=("A-4.9-4",),
      sentence="The name must be the one that the 0x30 or 0x31 in progress was given.",
      original="控制层返回信息包含结果，运行程序名称和运行时间",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.9/5", lines=(226,), register=("A-4.9-3",),
      sentence="While the program runs, its run time must grow as real time passes.",
      original="其中运行时间固定 8 个字节，以“DDHHMMSS”格式存放",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.9/6", lines=(226, 237), register=("A-4.9-2",),
      sentence="While no program runs, the reply to 0x0A must "
               "begin with '0' and give neither name nor time.",
      original="结果为 0 时表示当前机器人没有运行程序，程序名和运行时间为空 / "
               "0xCC | 0x0A | 1 | 0 | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.9/7", lines=(237,), register=("A-4.9-2",),
      sentence="While no program runs, the reply to 0x0A should be '0' alone.",
      original="0xCC | 0x0A | 1 | 0 | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("4.9/8", lines=(226,), register=("A-4.9-5",),
      sentence="The program's name should not exceed 30 bytes.",
      original="程序名一般不超过 30 个字节",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("4.9/9", lines=(232, 98), register=("A-4.9-1",),
      sentence="The length byte of the reply to 0x0A must count "
               "the bytes really sent, separators included.",
      original="0xCC | 0x0A | 22 | 1 | “myprogr m1.txt” | 00011230 | 0xAA / "
               "数据内容的长度受限于“数据长度”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.9/10", lines=(226, 214), register=("A-4.9-4",),
      sentence="The flag of 0x0A should be '1' exactly while the status "
               "is '01', or '02' where a simulation counts as a run.",
      original="结果为 1 时表示正常 / 控制层返回信息包含 IDLE，RUNNING，ERROR 三种状态",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
)
