"""4.7: read the software version, 0x08 (L191-203)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    PC,
    READ_ONLY,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.7/1", lines=((195, 198),), register=("A-3-12",),
      sentence="The request 0x08 must carry no data.",
      original="0xAA | 0x08 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.7/2", lines=((200, 203),), register=("A-4.7-1",),
      sentence="The reply to 0x08 must be a version text of at least one character.",
      original="控制层返回结果： / 0xCC | 0x08 | 5 | “1.0.0” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.7/3", lines=(203,), register=("A-4.7-1",),
      sentence="The version should be three groups of digits joined by dots.",
      original="0xCC | 0x08 | 5 | “1.0.0” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4.7/4", lines=(203,), register=("A-4.7-1",),
      sentence="The version must stay the same throughout a session.",
      original="0xCC | 0x08 | 5 | “1.0.0” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.7/5", lines=(203,), register=("A-4.7-1",),
      sentence="A client must accept versions shorter or "
               "longer than the example's five characters.",
      original="0xCC | 0x08 | 5 | “1.0.0” | 0xAA",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
)
