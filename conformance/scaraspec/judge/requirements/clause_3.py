"""Clause 3: the frame (L85-98), and the conventions of text payloads (T)."""

from scaraspec.judge.requirements.entry import (
    AC,
    AK,
    BOTH,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    MOTION,
    PC,
    READ_ONLY,
    ROBUSTNESS,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    # Clause 3, the frame: layout, delimiters, length, the tag 0x90, order of replies (L85-98).
    R("3/1", lines=((89, 90),), register=("A-3-1",),
      sentence="A frame without tag must consist of start byte, opcode, length "
               "byte, the data that the length announces, and end byte.",
      original="1 字节 | 1 字节 | 1 字节 | N 字节 | 1 字节 / "
               "开始字符 | 命令字 | 数据长度 | 数据 | 结束字符",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/2", lines=(92,), register=("A-3-3",),
      sentence="Every frame that a client sends must begin with 0xAA.",
      original="应用层发送数据时的开始字符为 0xAA",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/3", lines=(92,), register=("A-3-3",),
      sentence="Every frame that a client sends must end with 0xCC.",
      original="应用层发送数据时的开始字符为 0xAA，结束字符为 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/4", lines=(94,), register=("A-3-3",),
      sentence="Every frame that a controller sends must begin with 0xCC.",
      original="控制层发送数据时的开始字符为 0xCC",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/5", lines=(94,), register=("A-3-3",),
      sentence="Every frame that a controller sends must end with 0xAA.",
      original="控制层发送数据时的开始字符为 0xCC，结束字符为 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/6", lines=(89, 98), register=("A-3-1", "A-0-4"),
      sentence="The length must be a single unsigned byte, 0 to 255.",
      original="1 字节 | 1 字节 | 1 字节 | N 字节 | 1 字节 / 数据内容的长度受限于“数据长度”",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/7", lines=(98,), register=("A-3-2",),
      sentence="The length byte must count the data bytes and "
               "nothing else: not start, tag, opcode, length or end.",
      original="数据内容的长度受限于“数据长度”",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/8", lines=(98,), register=("A-3-12",),
      sentence="After a length of 0x00 the end byte must follow at once.",
      original="当数据长度为“0x00”时，没有数据",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/9", lines=((89, 94),), register=("A-3-3",),
      sentence="A receiver must find the end of a frame by counting, "
               "so that 0xAA and 0xCC may stand inside the data.",
      original="开始字符 | 命令字 | 数据长度 | 数据 | 结束字符 / 开始字符为 0xAA，结束字符为 0xCC",
      binds=BOTH, testable=AC | AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/10", lines=(96,), register=("A-0-6", "A-0-5"),
      sentence="A frame must carry an opcode that clauses 4 and 5 define for its direction.",
      original="命令字解析具体的通信协议，详见下一章",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("3/11", lines=((100, 706),), register=("A-3-14",),
      sentence="A first reply must repeat the opcode of its request; "
               "the doubtful opcodes of 4.12 and 4.14 are judged there.",
      original="0xAA | 0x01 | 8 | “password” | 0xCC / 0xCC | 0x01 | 1 | “1” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/12", lines=((320, 321),), register=("A-3-5",),
      sentence="Behind its 0xCC a final result must carry the tag "
               "0x90, then opcode, length and data, and end with 0xAA.",
      original="开始字符 | 标志符 | 命令字 | 数据长度 | 数据 | 结束字符 / "
               "0xCC | 0x90 | 0x30 | 2 | “11” | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("3/13", lines=((320, 321),), register=("A-3-5",),
      sentence="A client must read 0x90 after 0xCC as a tag, "
               "and the next two bytes for opcode and length.",
      original="开始字符 | 标志符 | 命令字 | 数据长度 | 数据 | 结束字符 / "
               "0xCC | 0x90 | 0x30 | 2 | “11” | 0xAA",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/14", lines=((320, 635),), register=("A-3-6",),
      sentence="The tag 0x90 must stand in front of these opcodes and no "
               "others: 0x30, 0x31, 0x32, 0x33, 0x39, 0x3A, 0x3B, 0x3D.",
      original="开始字符 | 标志符 | 命令字 | 数据长度 | 数据 | 结束字符 / "
               '0xCC | 0x90 | 0x3D | 5 | "00 12" | 0xAA',
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/15", register=("A-3-6",),
      sentence="A client must never put the tag into a frame of its own.",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=ROBUSTNESS),
    R("3/16", lines=(318,), register=("A-3-7",),
      sentence="A final result must come after the first reply "
               "'1' to the same command, never ahead of it.",
      original="然后控制层执行程序，执行结束后将结果返回",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=TEXT),
    R("3/17", lines=(316,), register=("A-3-7",),
      sentence="A command whose first reply begins with '0' must get no final result.",
      original="其中数据“0”表示不具有运行条件",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("3/18", lines=(318,), register=("A-3-7",),
      sentence="To each first reply '1' of a two-stage command there must be one final result and "
               "no second, unless the link is lost or an emergency stop or a shutdown cuts in.",
      original="执行结束后将结果返回",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("3/19", register=("A-3-10",),
      sentence="Stray bytes ahead of a start byte should be "
               "skipped and the next valid frame served.",
      binds=BOTH, testable=AC | AK, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
    R("3/20", register=("A-3-10",),
      sentence="After a frame with a wrong end byte the receiver should serve "
               "the next valid frame, on the same connection or a new one.",
      binds=BOTH, testable=AC | AK, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
    R("3/21", register=("A-3-9",),
      sentence="An undefined opcode must provoke neither "
               "an action nor a reply with another opcode.",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=ROBUSTNESS),
    R("3/22", register=("A-3-9",),
      sentence="A client must outlive a reply whose opcode is undefined.",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=ROBUSTNESS),
    R("3/23", register=("A-3-13",),
      sentence="A frame that a client sends in the controller's "
               "form (0xCC to 0xAA) should not be executed.",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
    R("3/24", register=("A-3-14",),
      sentence="Requests sent without waiting should get their "
               "first replies in the order of the requests.",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
    R("3/25", register=("A-3-14",),
      sentence="A client should leave no more than one request per opcode unanswered.",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
    R("3/26", register=("A-3-16",),
      sentence="What a controller sends should be a reply, a final result, a "
               "further part of the 0x0B list or a 0x56 chunk, and nothing else.",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=TOLERANT, basis=ROBUSTNESS),
    R("3/27", register=("A-3-14",),
      sentence="A reply that is late, comes in pieces or is overtaken by "
               "another command's final result must not stall a client.",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=ROBUSTNESS),
    R("3/28", lines=(89,), register=("A-3-17",),
      sentence="A client must not try to send more than 255 data bytes in one frame.",
      original="1 字节 | 1 字节 | 1 字节 | N 字节 | 1 字节",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/29", register=("A-3-11",),
      sentence="A frame that stops half-way, followed by silence, must "
               "not keep the peer from serving later connections.",
      binds=BOTH, testable=AC | AK, hazard=READ_ONLY, strength=FIRM, basis=ROBUSTNESS),
    R("3/30", lines=(79,), register=("A-3-14",),
      sentence="The requests of one connection must take effect in the "
               "order sent, even when one segment brings them all.",
      original="两者之间以 tcp 方式建立连接",
      binds=CONTROLLER, testable=AC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("3/31", lines=((100, 706),), register=("A-3-15",),
      sentence="Every valid request must be answered within 5 s, or the time that the "
               "subject claims: leaving one unanswered while a later one is served (here or "
               "on a new connection), or answering no more because of it, is a violation.",
      original="控制层向其反馈验证结果 / 控制层反馈删除操作结果",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/32", lines=((89, 94),), register=("A-3-1",),
      sentence="Between its frames a sender must send nothing.",
      original="1 字节 | 1 字节 | 1 字节 | N 字节 | 1 字节 / "
               "开始字符 | 命令字 | 数据长度 | 数据 | 结束字符",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("3/33", lines=((100, 706),), register=("A-3-14",),
      sentence="A client must accept as a reply only an untagged frame with the opcode "
               "of its request, the doubtful opcodes of 4.12 and 4.14 excepted.",
      original="0xAA | 0x01 | 8 | “password” | 0xCC / 0xCC | 0x01 | 1 | “1” | 0xAA",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    # T, conventions of every text payload in clauses 4 and 5: separators, numbers, names.
    R("T/1", lines=(125, 150, 226), register=("A-0-1",),
      sentence="Neighbouring fields must be separated by one '|' (0x7C) and nothing more.",
      original="中间以“|”分割 / 其中以“|”分割 / 使用“|”分割",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("T/2", lines=((109, 785),), register=("A-0-3",),
      sentence="The quotation marks of the examples must not go onto the wire.",
      original="0xAA | 0x01 | 8 | “password” | 0xCC",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/3", lines=((109, 785),), register=("A-T-1",),
      sentence="Flags and digits must be ASCII characters, not binary values.",
      original='0xCC | 0x01 | 1 | “1” | 0xAA / 0xAA | 0x06 | 14 | "20141222143000" | 0xCC',
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/4", lines=((109, 785),), register=("A-T-3", "A-T-4"),
      sentence="Text should stop at its last character, without a NUL or a separator after it.",
      original="0xAA | 0x01 | 8 | “password” | 0xCC",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("T/5", lines=(431, 450), register=("A-T-5",),
      sentence="A number must be decimal text with '.' as its mark, a minus "
               "sign where needed and as many decimals as the sender likes; "
               "a comma, an exponent, nan, inf or an empty field fails.",
      original='0xCC | 0x34 | 11 | "200 300 456" | 0xAA / '
               '0xAA | 0x36 | 25 | "200 300 324 34.6 34.5 0" | 0xCC',
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/6", lines=(125,), register=("A-T-6",),
      sentence="A name or password must not contain '|'.",
      original="中间以“|”分割",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/7", lines=(1014,), register=("A-8-2",),
      sentence="An error code must be one of the two-character texts of table 8-1.",
      original="错误代码为字符串类型。",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("T/8", register=("A-T-2",),
      sentence="Text beyond ASCII is expected to be accepted and passed on byte for byte.",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=INFO, basis=ROBUSTNESS),
    R("T/9", lines=((100, 706),), register=("A-T-5", "A-3-8"),
      sentence="A client must hand on what a reply says, unaltered and in its "
               "documented meaning and order: signs and decimals, each bit at its port, "
               "every name, the days of a run time, codes, the outcome of both stages.",
      original="“DD”代表天数，“HH”代表小时数，“MM”代表分钟数，“SS”代表秒数 / "
               "以三维坐标(x,y,z)坐标表示",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("T/10", lines=((100, 706),), register=("A-T-5", "A-5-20"),
      sentence="A client must send the values it was given, whole and in the documented "
               "order: no name or password cut short, no decimal or sign lost.",
      original="既要包含旧密码，同时包含新密码 / "
               "坐标以如下格式表示(speed, x,y,z, ThetaX, ThetaY, ThetaZ)",
      binds=CLIENT, testable=AK, hazard=STATE, strength=FIRM, basis=DERIVED),
)
