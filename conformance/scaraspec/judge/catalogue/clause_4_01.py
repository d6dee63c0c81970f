"""4.1: log in, 0x01 (L102-119)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    PC,
    ROBUSTNESS,
    STATE,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.1/1", lines=(104, 109), register=("A-4.1-3",),
      sentence="A login must be a 0x01 frame whose data is the password.",
      original="应用层向控制层发送登录验证，同时附带登录密码 / 0xAA | 0x01 | 8 | “password” | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.1/2", lines=((111, 114),), register=("A-4.1-1",),
      sentence="The right password must be answered '1'.",
      original="控制层验证通过结果： / 0xCC | 0x01 | 1 | “1” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.1/3", lines=((116, 119),), register=("A-4.1-2",),
      sentence="A wrong password must be answered '0'.",
      original="控制层验证失败结果： / 0xCC | 0x01 | 1 | “0” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.1/4", lines=(104,), register=("A-3-1",),
      sentence="The reply to a login must be its one flag character and no more.",
      original="控制层向其反馈验证结果",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.1/5", lines=(116,), register=("A-4-4",),
      sentence="A client whose login was answered '0' must not go on to other commands.",
      original="控制层验证失败结果：",
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.1/6", lines=(104,), register=("A-4.1-1",),
      sentence="The password that logged in once must log in again on a new connection.",
      original="应用层向控制层发送登录验证，同时附带登录密码",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.1/7", register=("A-4.1-2",),
      sentence="A wrong login is expected not to spoil the right "
               "one after it, on the same connection or a new one.",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=INFO, basis=ROBUSTNESS),
    R("4.1/8", register=("A-4.1-2",),
      sentence="A client must take every reply but '1' for a failed login.",
      binds=CLIENT, testable=AK, hazard=STATE, strength=FIRM, basis=ROBUSTNESS),
)
