"""4.12 and 4.13: read and set the default program, 0x0D (or 0x13) and 0x0E (L265-287)."""

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
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.12/1", lines=((265, 270),), register=("A-4.12-1",),
      sentence="A client should ask with 0x0D, as the heading prints, "
               "or 0x13, as the frame prints, and without data.",
      original="4.12 获取默认程序(0x0D) / 0xAA | 0x13 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=TOLERANT, basis=TEXT),
    R("4.12/2", lines=((272, 275),), register=("A-4.12-1",),
      sentence="The reply to 0x0D or 0x13 must carry the opcode that the request used.",
      original="0xCC | 0x13 | 8 | “pro1.txt” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.12/3", lines=(272,), register=("A-4.12-2",),
      sentence="The data of the reply to 0x0D or 0x13 must be the name of the default program.",
      original="控制层向应用层返回当前默认程序名称",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.12/4", lines=(272,), register=("A-4.12-2",),
      sentence="When there is no default program, the reply "
               "to 0x0D or 0x13 should be empty or '0'.",
      original="控制层向应用层返回当前默认程序名称",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4.12/5", lines=((265, 275),), register=("A-4.12-1",),
      sentence="A controller must answer 0x0D or 0x13 or both.",
      original="4.12 获取默认程序(0x0D) / "
               "0xAA | 0x13 | 0 | 0xCC / "
               "0xCC | 0x13 | 8 | “pro1.txt” | 0xAA",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.13/1", lines=((279, 282),), register=("A-4.13-1",),
      sentence="The data of 0x0E must be the name of the program to make the default.",
      original="应用层设置默认用户程序 / 0xAA | 0x0E | 8 | “pro2.txt” | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.13/2", lines=((284, 287),), register=("A-4.13-1",),
      sentence="0x0E must be answered by a single character: success is '1', failure '0'.",
      original="数据长度为 1，其中，1 表示成功，0 表示失败",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.13/3", lines=(279, 272), register=("A-4.13-1",),
      sentence="After 0x0E was answered '1', the default program, "
               "when asked for, must be the one just named.",
      original="应用层设置默认用户程序 / 控制层向应用层返回当前默认程序名称",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.13/4", lines=(284,), register=("A-4.13-1",),
      sentence="Naming a program that is not stored should be answered '0'.",
      original="其中，1 表示成功，0 表示失败",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
    R("4.13/5", lines=(284,), register=("A-4.13-1",),
      sentence="After 0x0E was answered '0', the default program must be the one it was before.",
      original="其中，1 表示成功，0 表示失败",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.13/6", lines=(279,), register=("A-4.12-3",),
      sentence="Naming a default program should set nothing in motion.",
      original="应用层设置默认用户程序",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
)
