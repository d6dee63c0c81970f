"""6.3 and 6.4: configuration and user variables of a program file (L828-872)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    MOTION,
    PC,
    ROBUSTNESS,
    SF,
    STATE,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("6.3/1", lines=(835, 846), register=("A-6.3-3",),
      sentence="The initial tool position, toolPos, must be six "
               "floats: x, y, z, then thetaX, thetaY, thetaZ.",
      original="float toolPos[6]; / 以 (x,y,z,ThetaX, ThetaY, ThetaZ) 六维坐标表示",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.3/2", lines=(837, 848), register=("A-6.3-3",),
      sentence="The tool centre, tcpPos, must be three floats: x, y, z.",
      original="float tcpPos[3]; / 以(x,y,z)三维坐标表示",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.3/3", lines=(839, (850, 856)), register=("A-6.3-2",),
      sentence="ports must hold 40 bytes, each a port type from 0 to 4.",
      original="uint8_t ports[40]; / 40 表示最多 40 个 IO 端口 / - 0: 默认, 无配置 / - 4: 数字输出",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.3/4", register=("A-6.1-4",),
      sentence="Every float must be a finite number.",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=ROBUSTNESS),
    R("6.4/1", lines=((862, 864),), register=("A-6.4-1",),
      sentence="A variable record must be an int key, a name of "
               "20 bytes and an int value, 28 bytes together.",
      original="int key; / char variable[20]; / int value;",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.4/2", lines=(868,), register=("A-6.4-2",),
      sentence="No two variables of a file must have the same key.",
      original="key: 表示关键字, 不可重复",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.4/3", lines=(868,), register=("A-6.4-2",),
      sentence="Nodes must refer to variables by key, and each "
               "key they use must be defined in the file.",
      original="在结点中以关键字代替用户变量",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.4/4", lines=(863, 870), register=("A-6.4-1",),
      sentence="The name of a variable must fit into 20 bytes.",
      original="char variable[20]; / 表示用户识别码",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.4/5", lines=(872,), register=("A-6.4-3",),
      sentence="A program must start with each variable at the value that the file gives it.",
      original="Value: 表示当前该变量的值",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=DERIVED),
)
