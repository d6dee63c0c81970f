"""Clause 6: program files (L799-998)."""

from scaraspec.judge.requirements.entry import (
    AC,
    BOTH,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    MOTION,
    PC,
    ROBUSTNESS,
    SF,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    # 6.1 and 6.2: the order of a program file, and its header (L799-826).
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
    # 6.3 and 6.4: configuration and user variables of a program file (L828-872).
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
    # 6.5: the nodes of a program file, and what a controller does at each (L874-942).
    R("6.5/1", lines=(880, 902), register=("A-6.5-1",),
      sentence="The alias of a node must fit into 30 bytes.",
      original="表示别名，用户可自定义，最长 30 个字节",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.5/2", lines=((904, 920),), register=("A-6.5-8",),
      sentence="nodeType must be one of 1 to 13.",
      original="目前支持如下 / "
               "1 | 结点坐标 | 真实的刀具坐标信息，point 有效 / "
               "13 | 计算操作 | 计算操作",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.5/3", lines=(922,), register=("A-6.5-3",),
      sentence="speedRate should be a share of the maximum speed, 1 to "
               "100, on move nodes (5, 6) and have no meaning on others.",
      original="Speed: 移动时的速度，该值为最大移动速度的比例，"
               "只有当结点类型是“直线移动”或“曲线移动”时才有意义",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("6.5/4", lines=(924,), register=("A-6.5-4",),
      sentence="counts should be the number of following nodes that belong to "
               "a move (5, 6) or a loop, and have no meaning on other nodes.",
      original="Count: 表示后续结点个数，只有当结点类型是“直线移动”，"
               "“曲线移动”或“循环”时才有意义，分别代表“直线移动”，“曲线移动”或“循环”的结点个数，"
               "后续的 count 个结点都属于该结点。",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=TOLERANT, basis=TEXT),
    R("6.5/5", lines=(924,), register=("A-6.5-4",),
      sentence="As many nodes as counts says must follow in the file.",
      original="后续的 count 个结点都属于该结点",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("6.5/6", lines=(926,), register=("A-6.5-2",),
      sentence="point, four floats, should have a meaning on coordinate nodes (1) only.",
      original="Point: 某个位置时的四个电机的旋转角度，只有路点类型是“结点坐标”时才有意义",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("6.5/7", lines=(928,), register=("A-6.5-9",),
      sentence="waitTimes must be seconds, 0 to 255, with a meaning on wait nodes (3) only.",
      original="Waittimes: 等待时间，只有结点类型是“等待时间”时才有意义，以秒为单位计时",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.5/8", lines=((930, 932),), register=("A-6.5-11",),
      sentence="waitCond must be port, value and condition, the last one "
               "of 1 to 5, with a meaning on wait-input nodes (2) only.",
      original="等待条件，waitcond[0]标示端口号，waitcond[1]标示端口输入值，"
               "waitcond[2]为判断条件，只有当结点类型是“等待输入”时才有意义 / "
               "1: 大于； 2: 小于； 3: 等于； 4: 不大于； 5: 不小于",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.5/9", lines=(932,), register=("A-6.5-11",),
      sentence="The condition numbers must compare input with "
               "value: 1 as >, 2 as <, 3 as ==, 4 as <=, 5 as >=.",
      original="1: 大于； 2: 小于； 3: 等于； 4: 不大于； 5: 不小于",
      binds=BOTH, testable=SF | AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/10", lines=(934,), register=("A-6.5-10",),
      sentence="waitCond[1] should be the real value times 100, as an integer.",
      original="Waitcond[1]的值为整数，为真实值的 100 倍，即小数点后移 2 位。",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("6.5/11", lines=(936,), register=("A-6.5-12",),
      sentence="gpioSet must be type (3 PWM, 4 TTL), port, value and "
               "PWM time base, with a meaning on output nodes (4) only.",
      original="Setgpio: 输出设置，setgpio[0]表示类型，3: PWM 输出，4: TTL 输出；"
               "setgpio[1]标示端口号，setgpio[2]标示端口输出值，setgpio[3]为 PWM 时基，"
               "只有当结点类型是“设置输出”时才有意义",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/12", lines=(938,), register=("A-6.5-13",),
      sentence="waitTimer should be the instant that a timer node (9) "
               "waits for, in seconds since 1970-01-01 and microseconds.",
      original="waitTimer 表示到达某一时刻时执行后续操作，waitTimerSecond 代表秒时间(从 1970 年 "
               "1 月 1 日经过的秒数)，waitTimerUS 代表微秒时间；(为视觉准备的接口)",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=TOLERANT, basis=TEXT),
    R("6.5/13", lines=(940,), register=("A-6.5-14",),
      sentence="operation should be used by IF nodes (10) and calculation nodes (13).",
      original="operation: 代表用户操作，operation 的结构见变量操作一节。",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("6.5/14", lines=(942,), register=("A-6.5-6",),
      sentence="The nodes of a curve move must be coordinate "
               "nodes, three or more, and nothing else.",
      original="注意：“曲线移动”的后续结点中，只能是结点坐标，且不能少于 3 个。",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/15", lines=((913, 914),), register=("A-6.5-4",),
      sentence="Every loop start (7) must have its loop end (8).",
      original="7 | 开始循环 | 开始循环标记 / 8 | 结束循环 | 结束循环标记",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("6.5/16", lines=((917, 919),), register=("A-6.5-15",),
      sentence="Every IF (10) must have its ENDIF (12), and an ELSE "
               "(11) must stand inside an IF, not more than once.",
      original="10 | 判断为真分支 | IF 判断 / "
               "11 | 判断为假分支 | ELSE 判断 / "
               "12 | 判断结束 | ENDIF",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("6.5/17", lines=(839, 936), register=("A-6.3-2",),
      sentence="A port that a node uses should be configured "
               "in ports[] with a type that suits the use.",
      original="uint8_t ports[40]; / setgpio[1]标示端口号",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
    R("6.5/18", lines=(914,), register=("A-6.5-5",),
      sentence="A program is expected to contain no endless loop unless one is intended.",
      original="8 | 结束循环 | 结束循环标记",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=INFO, basis=ROBUSTNESS),
    R("6.5/19", lines=(910, 936), register=("A-6.5-12",),
      sentence="An output node (4) must set its port when the "
               "program gets to it, so that 0x49 shows the value.",
      original="4 | 设置输出 | 设置端口输出后继续运动 / "
               "setgpio[1]标示端口号，setgpio[2]标示端口输出值",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/20", lines=(909, 928), register=("A-6.5-9",),
      sentence="A wait node (3) must hold the program for its seconds: never less, "
               "and at most half a second or a tenth longer, whichever is more.",
      original="3 | 等待时间 | 等待一定时间才可继续运动 / 以秒为单位计时",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/21", lines=(908, (930, 932)), register=("A-6.5-11", "A-6.5-10"),
      sentence="At a wait-input node (2) the program must stand still until the "
               "condition is true and then go on, with each of the five conditions.",
      original="2 | 等待输入 | 输入条件满足时才可继续运动 / "
               "等待条件，waitcond[0]标示端口号，waitcond[1]标示端口输入值，"
               "waitcond[2]为判断条件 / "
               "1: 大于； 2: 小于； 3: 等于； 4: 不大于； 5: 不小于",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/22", lines=(915, 938), register=("A-6.5-13",),
      sentence="A timer node (9) must hold the program until its instant; where the "
               "clock of 0x07 does not agree with UTC, a deviation is tolerated.",
      original="9 | 等待定时器 | 等待具体时间定时器 / waitTimer 表示到达某一时刻时执行后续操作",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/23", lines=((913, 914), 924), register=("A-6.5-5",),
      sentence="The nodes of a loop must be executed at least twice.",
      original="7 | 开始循环 | 开始循环标记 / "
               "8 | 结束循环 | 结束循环标记 / "
               "后续的 count 个结点都属于该结点",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/24", lines=((917, 919),), register=("A-6.5-15",),
      sentence="One branch must be executed and the other not: IF when the comparison holds, "
               "ELSE when it does not; without an ELSE there is then nothing to execute.",
      original="10 | 判断为真分支 | IF 判断 / "
               "11 | 判断为假分支 | ELSE 判断 / "
               "12 | 判断结束 | ENDIF",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/25", lines=(911, 924), register=("A-6.5-6",),
      sentence="A straight move (5) must end at the last coordinate node that "
               "it counts, and every node that it counts must belong to it.",
      original="5 | 直线移动 | 设置直线移动模式 / 后续的 count 个结点都属于该结点",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.5/26", lines=(824,), register=("A-6.2-2",),
      sentence="Every node of a program must be executed, the last one included.",
      original="Points: 表示结点个数",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("6.5/27", lines=(926, 907), register=("A-6.5-2",),
      sentence="After a program that ends at a coordinate node, the node's four "
               "values must appear in their order in 0x3C (joint angles) or 0x38 "
               "(x, y, z, thetaX); which of the two is the reading point_meaning.",
      original="1 | 结点坐标 | 真实的刀具坐标信息，point 有效 / 某个位置时的四个电机的旋转角度",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("6.5/28", lines=(822, 868, 942, 998), register=("A-4.15-2",),
      sentence="A file that clause 6 does not allow (wrong SCARA or ARACS, a size that "
               "fits no layout, a key twice, a curve of too few or of other nodes, "
               "unbalanced markers) must never be reported as run successfully.",
      original='统一定义为"SCARA" / '
               "不可重复 / "
               "注意：“曲线移动”的后续结点中，只能是结点坐标，且不能少于 3 个。 / "
               "统一定义为“ARACS”",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    # 6.6, a number used twice: operations on variables (6.6a, L944-986), footer (6.6b, L988-998).
    R("6.6a/1", lines=((961, 965),), register=("A-6.6a-3",),
      sentence="result_type must be one of 1 to 4.",
      original="1 | 比较 / 2 | 计算 / 3 | 赋值 / 4 | 设置端口",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/2", lines=(962,), register=("A-6.6a-1",),
      sentence="In a comparison (result_type 1) a result of 0 should "
               "stand for true and every other value for false.",
      original="1 | 比较 | Result 表示结果值，0 为真，其余值为假",
      binds=BOTH, testable=SF | AC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("6.6a/3", lines=((963, 964),), register=("A-6.4-2",),
      sentence="In a calculation and an assignment (result_type 2, "
               "3) result must be the key of a defined variable.",
      original="2 | 计算 | Result 表示用户变量的关键字 / 3 | 赋值 | Result 表示用户变量的关键字",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/4", lines=(965,), register=("A-6.6a-2",),
      sentence="When a port is set (result_type 4), result must be the number of an output port.",
      original="4 | 设置端口 | Result 表示输出端口号",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/5", lines=((967, 973),), register=("A-6.6a-3",),
      sentence="valueA_type and valueB_type must be one of 0 to 3.",
      original="valueA_type 和 valueB_type 分别表示 valueA 和 valueB 的类型 / "
               "0 | 无值 / "
               "3 | Value 表示输入端口号",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/6", lines=(972,), register=("A-6.4-2",),
      sentence="A value of type 2 must be the key of a defined variable.",
      original="2 | Value 表示用户变量的关键值",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/7", lines=(973,), register=("A-6.6a-5",),
      sentence="A value of type 3 must be the number of an input port.",
      original="3 | Value 表示输入端口号",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/8", lines=((975, 986),), register=("A-6.6a-2",),
      sentence="opt should be one of 1 to 9 in its listed meaning; 0 "
               "is tolerated where a value is assigned or a port set.",
      original="Opt 表 valueA 和 valueB 的操作 / 1 | 两数相加 / 9 | 判断是否满足 $A <= B$",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=TEXT),
    R("6.6a/9", lines=(962, (982, 986)), register=("A-6.6a-3",),
      sentence="A comparison should use opt 5 to 9 and a calculation opt 1 to 4.",
      original="1 | 比较 / 5 | 判断是否满足 $A > B$ / 9 | 判断是否满足 $A <= B$",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=TOLERANT, basis=DERIVED),
    R("6.6a/10", lines=(981,), register=("A-6.6a-4",),
      sentence="A program is expected not to divide by the constant zero.",
      original="4 | 两数相除",
      binds=CLIENT, testable=SF | PC, hazard=MOTION, strength=INFO, basis=ROBUSTNESS),
    R("6.6a/11", lines=((978, 981),), register=("A-6.6a-2", "A-6.6a-3", "A-6.6a-5"),
      sentence="opt 1 must add B to A, 2 take B from A, 3 multiply "
               "A by B and 4 divide A by B, all in integers.",
      original="1 | 两数相加 / 2 | 两数相减 / 3 | 两数相乘 / 4 | 两数相除",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/12", lines=((982, 986),), register=("A-6.6a-2", "A-6.6a-3", "A-6.6a-5"),
      sentence="opt 5 must hold when A > B, 6 when A < B, 7 "
               "when A == B, 8 when A >= B and 9 when A <= B.",
      original="5 | 判断是否满足 $A > B$ / "
               "6 | 判断是否满足 $A < B$ / "
               "7 | 判断是否满足 $A == B$ / "
               "8 | 判断是否满足 $A >= B$ / "
               "9 | 判断是否满足 $A <= B$",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/13", lines=((963, 965),), register=("A-6.6a-2", "A-6.6a-3", "A-6.6a-5"),
      sentence="A calculation and an assignment must store into the variable whose key "
               "is result, and result_type 4 must set the output port that result names.",
      original="2 | 计算 | Result 表示用户变量的关键字 / "
               "3 | 赋值 | Result 表示用户变量的关键字 / "
               "4 | 设置端口 | Result 表示输出端口号",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6a/14", lines=((967, 973),), register=("A-6.6a-2", "A-6.6a-3", "A-6.6a-5"),
      sentence="A value of type 1 must stand for itself, of type 2 for the variable with "
               "that key, of type 3 for the state of the input port with that number.",
      original="1 | Value 表示整数 / 2 | Value 表示用户变量的关键值 / 3 | Value 表示输入端口号",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("6.6b/1", lines=((994, 998),), register=("A-6.6b-1",),
      sentence="A program file must end with the five bytes ARACS.",
      original="Char tobor[5]; / 统一定义为“ARACS”，作为结尾表示",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("6.6b/2", lines=(998,), register=("A-6.6b-1",),
      sentence="The footer should be the end of the file, without a byte after it.",
      original="统一定义为“ARACS”，作为结尾表示",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
)
