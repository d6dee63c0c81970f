"""4.2: set a new password, 0x03 (L121-140)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    DESTRUCTIVE,
    FIRM,
    PC,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.2/1", lines=((125, 128),), register=("A-4.2-3",),
      sentence="The data of 0x03 must be the old password, "
               "'|' and the new password, in this order.",
      original="应用层的请求中既要包含旧密码，同时包含新密码，中间以“|”分割 / "
               "0xAA | 0x03 | 23 | “oldpassword newpassword” | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.2/2", lines=(123, 133), register=("A-4.2-1",),
      sentence="When the password was changed, the reply to 0x03 must be '1'.",
      original="控制层反馈设置结果 / 0xCC | 0x03 | 1 | “1” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.2/3", lines=(140,), register=("A-4.2-1",),
      sentence="When the old password was wrong and nothing "
               "changed, the reply to 0x03 must be '0'.",
      original='0xCC | 0x03 | 1 | "0" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.2/4", lines=(123,), register=("A-4.2-1",),
      sentence="Once 0x03 was answered '1', the new password must "
               "open the next login and the old one must not.",
      original="应用层向控制层发送设置新密码请求，控制层反馈设置结果。",
      binds=CONTROLLER, testable=AC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.2/5", lines=(123,), register=("A-4.2-1",),
      sentence="After 0x03 was answered '0', the old password must still log in.",
      original="应用层向控制层发送设置新密码请求，控制层反馈设置结果。",
      binds=CONTROLLER, testable=AC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.2/6", lines=(125,), register=("A-4.2-3",),
      sentence="A 0x03 that lacks the separator or leaves "
               "a field empty should not be answered '1'.",
      original="中间以“|”分割",
      binds=CONTROLLER, testable=AC, hazard=DESTRUCTIVE, strength=TOLERANT, basis=DERIVED),
    R("4.2/7", lines=(89, 125), register=("A-T-6",),
      sentence="A client must refuse to send a pair that exceeds "
               "255 bytes or a password that contains '|'.",
      original="1 字节 | 1 字节 | 1 字节 | N 字节 | 1 字节 / 中间以“|”分割",
      binds=CLIENT, testable=AK, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
)
