"""4.21 and 4.22: set and read the initial tool position, 0x36 and 0x37 (L445-467)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    BOTH,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    MOTION,
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
    R("4.21/1", lines=((447, 450),), register=("A-4.21-3",),
      sentence="The data of 0x36 must be the numbers x, y, z, "
               "thetaX, thetaY and thetaZ with '|' between them.",
      original="坐标以六维表示(x,y,z, ThetaX, ThetaY, ThetaZ)，中间以“|”分割",
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.21/2", lines=((452, 455),), register=("A-4.21-2",),
      sentence="The reply to 0x36 must be '1' for success and '0' for failure.",
      original="成功返回“1”，失败返回“0”",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.21/3", lines=(452, 464), register=("A-4.21-2",),
      sentence="After 0x36 was answered '1', 0x37 must at once return the x, "
               "y, z and thetaX that were set, exactly where they have one "
               "decimal or none, and 0x34 must return what it did before.",
      original="成功返回“1” / 控制层向应用层返回“初始化工具坐标”",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.21/4", lines=(447,), register=("A-T-5",),
      sentence="A 0x36 without exactly six fields, or with a field "
               "that is no number, must not be answered '1'.",
      original="坐标以六维表示(x,y,z, ThetaX, ThetaY, ThetaZ)",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.21/5", lines=(447,), register=("A-4.21-2",),
      sentence="Setting the initial position should move nothing.",
      original="应用层向控制层发送“设置初始工具坐标”请求",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
    R("4.21/6", lines=(450, 467, 98), register=("A-4.21-1",),
      sentence="The length byte of a pose must count the bytes really "
               "sent: 23 for the documented text, whose rows print 25.",
      original='0xAA | 0x36 | 25 | "200 300 324 34.6 34.5 0" | 0xCC / '
               "0xCC | 0x37 | 25 | “200 300 324 34.6 34.5 0” | 0xAA / "
               "数据内容的长度受限于“数据长度”",
      binds=BOTH, testable=AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.22/1", lines=((459, 462),), register=("A-3-12",),
      sentence="The request 0x37 must carry no data.",
      original="0xAA | 0x37 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.22/2", lines=((464, 467),), register=("A-4.21-3",),
      sentence="The reply to 0x37 must be six numbers with '|' between them.",
      original="坐标以六维表示(x,y,z, ThetaX, ThetaY, ThetaZ)，中间以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
)
