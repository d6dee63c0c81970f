"""4.11: delete a program, 0x0C (L253-263)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    DESTRUCTIVE,
    FIRM,
    PC,
    ROBUSTNESS,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.11/1", lines=((255, 258),), register=("A-4.11-1",),
      sentence="The data of 0x0C must be the name of the program to delete.",
      original="应用层向控制层发送“删除用户应用程序”请求 / 0xAA | 0x0C | 8 | “pro1.txt” | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.11/2", lines=((260, 263),), register=("A-4.11-1",),
      sentence="The reply to 0x0C must be '1' for success and '0' for failure.",
      original="控制层反馈删除操作结果，成功返回 1，失败返回 0",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.11/3", lines=(260,), register=("A-4.11-1",),
      sentence="After 0x0C was answered '1', the program must be "
               "gone: neither listed nor downloadable nor runnable.",
      original="控制层反馈删除操作结果，成功返回 1，失败返回 0",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.11/4", lines=(260,), register=("A-4.11-1",),
      sentence="Deleting a name that is not stored must not be answered '1'.",
      original="控制层反馈删除操作结果，成功返回 1，失败返回 0",
      binds=CONTROLLER, testable=AC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.11/5", lines=(260,), register=("A-4.11-1",),
      sentence="The program that is running should not be deleted.",
      original="控制层反馈删除操作结果，成功返回 1，失败返回 0",
      binds=CONTROLLER, testable=PC, hazard=DESTRUCTIVE, strength=TOLERANT, basis=DERIVED),
    R("4.11/6", register=("A-5-20",),
      sentence="Deleting by a name with path elements must touch nothing but the program store.",
      binds=CONTROLLER, testable=AC, hazard=DESTRUCTIVE, strength=FIRM, basis=ROBUSTNESS),
)
