"""6.1 and 6.2: the order of a program file, and its header (L799-826)."""

from scaraspec.judge.catalogue.entry import (
    CLIENT,
    DERIVED,
    FIRM,
    PC,
    SF,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("6.1/1", lines=(803,), register=("A-6.1-1",),
      sentence="The parts of a program file must come in this order: "
               "header, configuration, user variables, nodes, footer.",
      original="文件头 | 配置信息 | 用户变量 | 结点 | 文件尾",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.1/2", lines=(806,), register=("A-6.1-1",),
      sentence="A program file must have one header, one configuration and one footer.",
      original="一个文件头,一个配置信息,若干结点信息,最后是文件尾。",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.1/3", lines=((813, 897),), register=("A-6.1-2", "A-6.3-1", "A-6.6a-7"),
      sentence="Under one layout throughout, the file size must equal "
               "header size + 76 + 28 x varNub + node size x points + 5.",
      original="Uint32_t points; / Uint32_t varNub; / uint8_t ports[40]; / }NodePoint",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("6.1/4", lines=((813, 897),), register=("A-6.1-2",),
      sentence="One layout and one byte order should hold "
               "from the first record of a file to the last.",
      original="Uint32_t points; / uint32_t waitCond[3];",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
    R("6.2/1", lines=(814, 822), register=("A-6.2-1",),
      sentence="A program file must begin with the five bytes SCARA.",
      original='Char robot[5]; / 统一定义为"SCARA"',
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.2/2", lines=(824,), register=("A-6.2-2",),
      sentence="The header's points must count the node records.",
      original="Points: 表示结点个数",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.2/3", lines=(826,), register=("A-6.1-1",),
      sentence="The header's varNub must count the records of user variables.",
      original="varNub: 表示用户自定义变量个数",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
)
