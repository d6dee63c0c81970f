"""4.23: read the tool coordinates, 0x38 (L469-479)."""

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
    R("4.23/1", lines=((471, 474),), register=("A-3-12",),
      sentence="The request 0x38 must carry no data.",
      original="0xAA | 0x38 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.23/2", lines=((476, 479),), register=("A-4.21-3",),
      sentence="The reply to 0x38 must be the numbers x, y, z, "
               "thetaX, thetaY and thetaZ with '|' between them.",
      original="坐标以六维表示(x,y,z, ThetaX, ThetaY, ThetaZ)，中间以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.23/3", lines=((1004, 1006),), register=("A-4.23-1",),
      sentence="The coordinates should be those of the centre of the "
               "screw's lower end, and thetaX the screw's rotation.",
      original="工具坐标是指机器人丝杆的底端中心点 / thetaX 指机器人丝杠旋转的角度",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("4.23/4", lines=(1006,), register=("A-4.21-3",),
      sentence="A client should make no use of thetaY and "
               "thetaZ, which mean nothing on this series.",
      original="在该系列机器人上，只有(x,y,z,thetaX)有意义",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4.23/5", lines=(476,), register=("A-4.23-1",),
      sentence="While the robot is idle and locked, the coordinates must not change.",
      original="控制层向应用层返回“夹具坐标”",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
)
