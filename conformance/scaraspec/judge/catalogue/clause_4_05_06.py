"""4.5 and 4.6: set and read the clock, 0x06 and 0x07 (L167-189)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    PC,
    READ_ONLY,
    STATE,
    TEXT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.5/1", lines=((169, 172),), register=("A-4.5-2",),
      sentence="The data of 0x06 must be 14 ASCII digits in the form YYYYMMDDHHMMSS.",
      original='时间格式为“YYYYMMDDHHMMSS” / 0xAA | 0x06 | 14 | "20141222143000" | 0xCC',
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.5/2", lines=(169,), register=("A-4.5-2",),
      sentence="A client must not send a 0x06 whose date or time no calendar has.",
      original="时间格式为“YYYYMMDDHHMMSS”",
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.5/3", lines=((174, 177),), register=("A-4.5-2",),
      sentence="The reply to 0x06 must be '1' for success and '0' for failure.",
      original="控制层向应用层返回结果，0：表示失败，1：表示成功",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("4.5/4", lines=(169, 186), register=("A-4.5-1",),
      sentence="After 0x06 was answered '1', 0x07 must show the time "
               "that was set plus the time since then, within 2 s.",
      original="应用层向控制层发送“设置时间”请求 / 控制层向应用层返回当前时间",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.5/5", lines=(174,), register=("A-4.5-2",),
      sentence="On a malformed or impossible time the reply must "
               "not be '1', and the clock must go on as before.",
      original="0：表示失败，1：表示成功",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.5/6", lines=(169,), register=("A-4.5-2",),
      sentence="Every moment that exists in the years 2000 to 2099, 29 February "
               "of leap years included, must be answered '1', and the clock "
               "must roll over minutes, hours, midnight, months and years.",
      original="应用层向控制层发送“设置时间”请求，时间格式为“YYYYMMDDHHMMSS”",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("4.6/1", lines=((181, 184),), register=("A-3-12",),
      sentence="The request 0x07 must carry no data.",
      original="0xAA | 0x07 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.6/2", lines=((186, 189),), register=("A-4.5-1",),
      sentence="The reply to 0x07 must be 14 ASCII digits in the form YYYYMMDDHHMMSS, and no more.",
      original="控制层向应用层返回当前时间，以“YYYYMMDDHHMMSS”表示 / "
               "0xCC | 0x07 | 14 | “20141222143000” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.6/3", lines=(186,), register=("A-4.5-1",),
      sentence="The time in the reply to 0x07 must exist in the calendar.",
      original="控制层向应用层返回当前时间，以“YYYYMMDDHHMMSS”表示",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.6/4", lines=(186,), register=("A-4.5-1",),
      sentence="While nobody sets the clock, its readings must never "
               "step back and must gain one second per second.",
      original="控制层向应用层返回当前时间",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
)
