"""4.17: emergency stop, 0x32 (L356-383)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
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
    R("4.17/1", lines=((358, 361),), register=("A-3-12",),
      sentence="The request 0x32 must carry no data.",
      original="0xAA | 0x32 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.17/2", lines=((363, 366),), register=("A-4.17-1",),
      sentence="When nothing needs stopping, the reply to 0x32 should be '0' alone.",
      original='若不需要急停，则返回结果 / 0xCC | 0x32 | 1 | "0" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("4.17/3", lines=((368, 371),), register=("A-4.17-1",),
      sentence="When something needs stopping, the first reply to 0x32 must be '1'.",
      original='若需要急停，则首先返回“1” / 0xCC | 0x32 | 1 | "1" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.17/4", lines=((373, 376),), register=("A-3-7",),
      sentence="When the stop has succeeded, the tagged result '11' must be sent.",
      original="然后执行“急停”指令，并将结果返回，成功时返回“11” / "
               '0xCC | 0x90 | 0x32 | 2 | "11" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.17/5", lines=((378, 383),), register=("A-3-8",),
      sentence="When the stop fails, the tagged result '00|code' must be sent.",
      original='0xCC | 0x90 | 0x32 | 5 | "00 12" | 0xAA / 数据“00”表示急停失败',
      binds=CONTROLLER, testable=PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4.17/6", lines=(363,), register=("A-4.17-1",),
      sentence="The stop must be accepted during the execution of every two-stage command.",
      original="首先检查是否需要急停条件",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.17/7", lines=(373,), register=("A-4.17-2",),
      sentence="Once the stop has ended with '11', the joint angles must stand still.",
      original="然后执行“急停”指令，并将结果返回，成功时返回“11”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4.17/8", lines=(373,), register=("A-4.17-4",),
      sentence="If the interrupted command sends a final result, it "
               "should have the failure form; for a jog '11' passes too.",
      original="然后执行“急停”指令，并将结果返回",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
    R("4.17/9", lines=(373,), register=("A-4.17-4",),
      sentence="A client must survive the result of the interrupted "
               "command before that of the stop, after it, or not at all.",
      original="然后执行“急停”指令，并将结果返回",
      binds=CLIENT, testable=AK, hazard=MOTION, strength=FIRM, basis=ROBUSTNESS),
    R("4.17/10", register=("A-4-3",),
      sentence="An unanswered request should not keep a client from sending the stop.",
      binds=CLIENT, testable=AK, hazard=MOTION, strength=TOLERANT, basis=ROBUSTNESS),
)
