"""4, what all two-stage commands share: 0x30 to 0x33, 0x39 to 0x3B and 0x3D (L304-637)."""

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
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4/1", lines=((311, 316), (337, 344), (363, 371), (392, 404), (490, 502), (525, 536),
                    (558, 568), (610, 622)),
      register=("A-4-7",),
      sentence="A two-stage request must be answered first with "
               "'1' or '0|code'; for 0x32 it is '1' or '0'.",
      original="首先检查是否具有运行条件，并将结果进行返回 / "
               "0xCC | 0x30 | 4 | “0 11” | 0xAA / "
               '0xCC | 0x32 | 1 | "0" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4/2", lines=((318, 321), (344, 347), (373, 376), (406, 409), (506, 509), (539, 542),
                    (572, 575), (627, 630)),
      register=("A-3-8",),
      sentence="A final result that tells of success must be '11' and nothing else.",
      original="成功返回“11” / 0xCC | 0x90 | 0x30 | 2 | “11” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4/3", lines=((323, 328), (349, 354), (378, 383), (411, 419), (511, 516), (544, 549),
                    (577, 582), (632, 637)),
      register=("A-3-8",),
      sentence="A final result that tells of failure must be '00|code', five bytes.",
      original="0xCC | 0x90 | 0x30 | 5 | “00 12” | 0xAA / “00”表示执行失败",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4/4", lines=(316, 342, 399, 497, 530, 563, 615), register=("A-0-7",),
      sentence="The code behind '0|' should be one of table "
               "8-1, and neither a reserved one nor '00'.",
      original="后面的数字表示错误类型 / 后面跟不能复位机器人的原因",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
    R("4/5", lines=(328, 354, 383, 419, 516, 549, 582, 637), register=("A-8-5",),
      sentence="The code behind '00|' should be one of table 8-1 and not a reserved one.",
      original="“12”表示小臂电机异常，详见错误列表",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
    R("4/6", lines=(399,), register=("A-4-2",),
      sentence="While a two-stage command is being executed, another one except 0x32 must "
               "not be answered '1'; the refusal is '0|code', and silence is tolerated.",
      original="其中 0 表示不具有复位条件，后面跟不能复位机器人的原因，"
               "如“01”表示机器人正在执行程序",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/7", lines=(318,), register=("A-4-5",),
      sentence="Once a final result has said '11', the status must be '00' again.",
      original="执行结束后将结果返回，成功返回“11”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/8", lines=(318,), register=("A-4-5", "A-4-3"),
      sentence="From first reply to final result, every status "
               "that is answered must be other than '00'.",
      original="然后控制层执行程序，执行结束后将结果返回",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/9", lines=((316, 328),), register=("A-3-8",),
      sentence="A client must tell the final result from the "
               "first reply by its tag and not by its data.",
      original="数字“1”表示具有运行条件 / "
               "开始字符 | 标志符 | 命令字 | 数据长度 | 数据 | 结束字符 / "
               "0xCC | 0x90 | 0x30 | 2 | “11” | 0xAA",
      binds=CLIENT, testable=AK, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/10", lines=(318,), register=("A-3-7",),
      sentence="A client must accept a final result right behind "
               "the first reply, even in the same segment.",
      original="然后控制层执行程序，执行结束后将结果返回",
      binds=CLIENT, testable=AK, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/11", lines=(318,), register=("A-3-15",),
      sentence="A client must still take a final result 10 s after the first "
               "reply, and later than that as long as the status says running.",
      original="执行结束后将结果返回",
      binds=CLIENT, testable=AK, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/12", lines=((316, 328),), register=("A-8-1",),
      sentence="A client should show, for every code of table 8-1, which fault it means.",
      original="后面的数字表示错误类型，如“11”表示大臂关节电机出错 / "
               "“12”表示小臂电机异常，详见错误列表",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("4/13", lines=(316,), register=("A-3-7",),
      sentence="After a refusal a client must not suppose that anything has begun to move.",
      original="其中数据“0”表示不具有运行条件",
      binds=CLIENT, testable=AK, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/14", lines=(311, 363, 392, 490), register=("A-3-7",),
      sentence="The first reply must come ahead of the execution, not when it is over.",
      original="首先检查是否具有运行条件，并将结果进行返回 / "
               "首先检查是否需要急停条件 / "
               "首先检查是否具有复位条件，并将结果进行返回 / "
               "首先判断是否可以设置工具坐标",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("4/15", lines=(399, (1017, 1021)), register=("A-4-2", "A-4-5"),
      sentence="A refusal for being busy must give the state that 0x09 "
               "reports at that moment (01 program, 02 simulation, 03 reset, "
               "04 move), and a robot in state '00' must not refuse as busy.",
      original="如“01”表示机器人正在执行程序 / "
               "01 | 正在正常执行程序 / "
               "02 | 正在模拟运行程序 / "
               "03 | 正在复位 / "
               "04 | 正在移动",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("4/16", lines=(318,), register=("A-3-14", "A-4-2"),
      sentence="As long as the final result of a two-stage request is outstanding, "
               "a client must not repeat that request of its own accord.",
      original="执行结束后将结果返回",
      binds=CLIENT, testable=AK | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
)
