"""4.10: list the programs, 0x0B (L239-251)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    PC,
    READ_ONLY,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.10/1", lines=((241, 244),), register=("A-3-12",),
      sentence="The request 0x0B must carry no data.",
      original="0xAA | 0x0B | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.10/2", lines=(246, 251), register=("A-4.10-3",),
      sentence="Each part of the program list must begin with '1' when "
               "another part follows and with '0' when none does.",
      original="以“0”或“1”开头 / “1”表示有后续报文，“0”表示没有后续报文",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.10/3", lines=(246,), register=("A-4.10-2",),
      sentence="The names of the program list must be separated by '|'.",
      original="程序名间以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.10/4", lines=(251,), register=("A-4.10-3",),
      sentence="The last part of a program list must begin with '0'.",
      original="“0”表示没有后续报文",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.10/5", lines=(251,), register=("A-4.10-3",),
      sentence="A part of the program list that begins with '1' should be "
               "followed by the next one, either unasked or on the next request.",
      original="“1”表示有后续报文",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("4.10/6", lines=(246,), register=("A-4.10-3",),
      sentence="Each program name must stand whole within one part of the list.",
      original="程序名间以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.10/7", lines=(246,), register=("A-4.10-5",),
      sentence="A program list must contain no empty name and no name twice.",
      original="控制层以列表的形式返回结果",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.10/8", lines=(246,), register=("A-4.10-4",),
      sentence="The program list of an empty store should be the flag '0' without any name.",
      original="控制层以列表的形式返回结果，以“0”或“1”开头",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4.10/9", lines=(249, 98), register=("A-4.10-1",),
      sentence="The length byte of the reply to 0x0B must count flag, separators "
               "and names as sent; the row of the document prints 26 for 28 bytes.",
      original="0xCC | 0x0B | 26 | “0 pro1.rob pro2.rob pro3.rob” | 0xAA / "
               "数据内容的长度受限于“数据长度”",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.10/10", lines=(251,), register=("A-4.10-3",),
      sentence="A client must make one list of the program names of all parts.",
      original="“1”表示有后续报文，“0”表示没有后续报文",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.10/11", lines=(246,), register=("A-4.10-5",),
      sentence="A valid program must be listed from the end of its upload until it is "
               "deleted and no longer, whatever its name (30 bytes included) and however "
               "many there are; files that are no valid programs may be missing.",
      original="控制层以列表的形式返回结果",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.10/12", lines=(246,), register=("A-4.10-4",),
      sentence="Neither an empty program list nor names of "
               "30 bytes and more must trouble a client.",
      original="以“0”或“1”开头，后面接程序名",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
)
