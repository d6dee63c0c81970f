"""T, conventions of every text payload in clauses 4 and 5: separators, numbers, names."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    BOTH,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    PC,
    READ_ONLY,
    ROBUSTNESS,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("T/1", lines=(125, 150, 226), register=("A-0-1",),
      sentence="Neighbouring fields must be separated by one '|' (0x7C) and nothing more.",
      original="中间以“|”分割 / 其中以“|”分割 / 使用“|”分割",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("T/2", lines=((109, 785),), register=("A-0-3",),
      sentence="The quotation marks of the examples must not go onto the wire.",
      original="0xAA | 0x01 | 8 | “password” | 0xCC",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/3", lines=((109, 785),), register=("A-T-1",),
      sentence="Flags and digits must be ASCII characters, not binary values.",
      original='0xCC | 0x01 | 1 | “1” | 0xAA / 0xAA | 0x06 | 14 | "20141222143000" | 0xCC',
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/4", lines=((109, 785),), register=("A-T-3", "A-T-4"),
      sentence="Text should stop at its last character, with no NUL and no separator behind it.",
      original="0xAA | 0x01 | 8 | “password” | 0xCC",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("T/5", lines=(431, 450), register=("A-T-5",),
      sentence="A number must be decimal text with '.' as its mark, a minus "
               "sign where needed and as many decimals as the sender likes; "
               "a comma, an exponent, nan, inf or an empty field fails.",
      original='0xCC | 0x34 | 11 | "200 300 456" | 0xAA / '
               '0xAA | 0x36 | 25 | "200 300 324 34.6 34.5 0" | 0xCC',
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/6", lines=(125,), register=("A-T-6",),
      sentence="A name or password must not contain '|'.",
      original="中间以“|”分割",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/7", lines=(1014,), register=("A-8-2",),
      sentence="An error code must be one of the two-character texts of table 8-1.",
      original="错误代码为字符串类型。",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("T/8", register=("A-T-2",),
      sentence="Text beyond ASCII is expected to be accepted and passed on byte for byte.",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=INFO, basis=ROBUSTNESS),
    R("T/9", lines=((100, 706),), register=("A-T-5", "A-3-8"),
      sentence="A client must hand on what a reply says, unaltered and in its "
               "documented meaning and order: signs and decimals, each bit at its port, "
               "every name, the days of a run time, codes, the outcome of both stages.",
      original="“DD”代表天数，“HH”代表小时数，“MM”代表分钟数，“SS”代表秒数 / "
               "以三维坐标(x,y,z)坐标表示",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/10", lines=((100, 706),), register=("A-T-5", "A-5-20"),
      sentence="A client must send the values it was given, whole and in the documented "
               "order: no name or password cut short, no decimal or sign lost.",
      original="既要包含旧密码，同时包含新密码 / "
               "坐标以如下格式表示(speed, x,y,z, ThetaX, ThetaY, ThetaZ)",
      binds=CLIENT, testable=AK, hazard=STATE, strength=FIRM, basis=DERIVED),
)
