"""4.14: read the motor temperatures, 0x0F (L289-302)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    PC,
    READ_ONLY,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.14/1", lines=((291, 296),), register=("A-3-12",),
      sentence="The request 0x0F must carry no data.",
      original="0xAA | 0x0F | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.14/2", lines=((299, 302),), register=("A-4.14-2",),
      sentence="The reply to 0x0F must be four numbers, the motor temperatures of "
               "inner arm, outer arm, wrist and rotation, with '|' between them.",
      original="以“大臂电机温度|小臂电机温度|手腕电机温度|旋转电机温度”的格式返回",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.14/3", lines=((296, 302),), register=("A-4.14-1",),
      sentence="The reply should carry 0x0F; the 0x0E that the document prints is tolerated.",
      original="0xAA | 0x0F | 0 | 0xCC / 0xCC | 0x0E | 11 | “20 38 34 22” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("4.14/4", lines=((296, 302),), register=("A-4.14-1",),
      sentence="A client should accept the temperatures under 0x0F and "
               "under 0x0E, and not mistake the latter for a reply to 0x0E.",
      original="0xAA | 0x0F | 0 | 0xCC / 0xCC | 0x0E | 11 | “20 38 34 22” | 0xAA",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4.14/5", lines=(299,), register=("A-T-8",),
      sentence="The temperatures are expected to make sense in degrees Celsius, from -20 to 120.",
      original="大臂电机温度|小臂电机温度|手腕电机温度|旋转电机温度",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=INFO, basis=DERIVED),
)
