"""6.6, a number used twice: operations on variables (6.6a, L944-986), footer (6.6b, L988-998)."""

from scaraspec.judge.catalogue.entry import (
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
      sentence="The footer should be the end of the file, without a byte behind it.",
      original="统一定义为“ARACS”，作为结尾表示",
      binds=CLIENT, testable=SF | PC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
)
