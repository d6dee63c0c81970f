"""4.19 and 4.20: read and set the gripper centre, 0x34 and 0x35 (L421-443)."""

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
    STATE,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.19/1", lines=((423, 426),), register=("A-3-12",),
      sentence="The request 0x34 must carry no data.",
      original="0xAA | 0x34 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.19/2", lines=((428, 431),), register=("A-4.19-1",),
      sentence="The reply to 0x34 must be the numbers x, y and z with '|' between them.",
      original="以三维坐标(x,y,z)坐标表示，其中各参数之间以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.20/1", lines=((435, 438),), register=("A-4.19-1",),
      sentence="The data of 0x35 must be the numbers x, y and z with '|' between them.",
      original='工具坐标三维坐标(x,y,z) / 0xAA | 0x35 | 11 | "200 300 456" | 0xCC',
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.20/2", lines=((440, 443),), register=("A-4.20-1",),
      sentence="The reply to 0x35 must be '1' for success and '0' for failure.",
      original="其中，1表示成功，0表示失败",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.20/3", lines=(428, 440), register=("A-4.19-2",),
      sentence="After 0x35 was answered '1', 0x34 must at once return the numbers that "
               "were set, sign included; with one decimal or none they agree exactly.",
      original="控制层向应用层返回夹具中心点 / 1表示成功",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.20/4", lines=(435,), register=("A-T-5",),
      sentence="A 0x35 without exactly three fields, or with a "
               "field that is no number, must not be answered '1'.",
      original="工具坐标三维坐标(x,y,z)",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.20/5", lines=(435,), register=("A-4.19-2",),
      sentence="Setting the gripper centre must move nothing.",
      original="应用层向控制层发送“设置夹具中心点”请求",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
)
