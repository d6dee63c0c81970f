"""4.35: shut the robot down, 0x60 (L689-706)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    DESTRUCTIVE,
    FIRM,
    PC,
    ROBUSTNESS,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.35/1", lines=((691, 694),), register=("A-4.35-1",),
      sentence="The request 0x60 must carry no data.",
      original="数据长度为 0 / 0xAA | 0x60 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.35/2", lines=((696, 699),), register=("A-4.35-2",),
      sentence="When the robot can be shut down, the reply to 0x60 must "
               "be '1', and the shutdown must begin after that reply.",
      original='可以关闭机器人时，返回“1”，返回后机器人开始执行关闭 / 0xCC | 0x60 | 1 | "1" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.35/3", lines=((701, 706),), register=("A-4-2",),
      sentence="When the robot cannot be shut down, the reply to "
               "0x60 must be '0|code' and the robot must stay on.",
      original='若此时不满足关闭机器人的条件，则返回失败及原因 / 0xCC | 0x60 | 4 | "0 01" | 0xAA',
      binds=CONTROLLER, testable=PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.35/4", lines=(706,), register=("A-4.35-3",),
      sentence="The shutdown must be refused with '0|01' while a program runs.",
      original="“01”表示正常执行程序",
      binds=CONTROLLER, testable=PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.35/5", lines=(696,), register=("A-4.35-2",),
      sentence="The reply to 0x60 must be the last word: no tagged result follows.",
      original="返回“1”，返回后机器人开始执行关闭",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.35/6", lines=(696,), register=("A-4.35-2",),
      sentence="After 0x60 was answered '1', a client must cope with losing its connection.",
      original="返回后机器人开始执行关闭",
      binds=CLIENT, testable=AK, hazard=DESTRUCTIVE, strength=FIRM, basis=ROBUSTNESS),
)
