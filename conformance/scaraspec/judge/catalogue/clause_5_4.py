"""5.4: what a receiver of a file does (L789-795)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    BOTH,
    CONTROLLER,
    DERIVED,
    FIRM,
    PC,
    ROBUSTNESS,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("5.4/1", lines=(791,), register=("A-5-11",),
      sentence="On the name of a file that is not there, the "
               "receiver must create it and answer success.",
      original="若不存在则建立文件,返回成功标志",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.4/2", lines=(791,), register=("A-5-11",),
      sentence="On the name of a file that is there, the receiver must answer with the error.",
      original="若文件已经存在,则返回错误标志",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.4/3", lines=(793,), register=("A-5-6",),
      sentence="A sender must never put more into a chunk than the buffer holds.",
      original="发送端按照流程发送,但不要超过缓冲区大小",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.4/4", lines=(793,), register=("A-5-15",),
      sentence="The receiver must find the end of the transfer by itself.",
      original="接收端自己判断文件传输是否结束",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.4/5", lines=(795,), register=("A-5-13",),
      sentence="A receiver must survive pauses of up to 25 s, also repeated ones, and must have "
               "abandoned the transfer after one of 60 s; within 27 to 35 s this is silent, "
               "outside it is reported, and a limit that the subject claims scales all four.",
      original="等待时间超过 30 秒没有收到下一个报文,表明传送失败,自动停止文件传输。",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.4/6", lines=(795,), register=("A-5-26",),
      sentence="After an abandoned transfer the link must still serve other "
               "commands; serving them only on a new connection is reported.",
      original="表明传送失败,自动停止文件传输",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("5.4/7", lines=(795,), register=("A-5-12",),
      sentence="An abandoned upload should leave no partial file behind that can be run.",
      original="表明传送失败,自动停止文件传输",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
    R("5.4/8", register=("A-5-17",),
      sentence="A transfer under way should not keep other commands from being served.",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=TOLERANT, basis=ROBUSTNESS),
)
