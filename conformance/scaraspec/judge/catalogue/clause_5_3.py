"""5.3: download, controller to client, 0x54 and 0x56 (L765-787)."""

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
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("5.3/1", lines=((767, 770),), register=("A-5-18",),
      sentence="The data of 0x54 must be the file name under its "
               "real length: 9 for file2.txt, whose row prints 8.",
      original='后面添加文件名称 / 0xAA | 0x54 | 8 | "file2.txt" | 0xCC',
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("5.3/2", lines=((772, 775),), register=("A-5-11",),
      sentence="0x54 must be answered '1' when the file can be sent and '0' when it cannot.",
      original="文件可以发送，返回 1，若文件不可发送，返回 0",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("5.3/3", lines=(772,), register=("A-5-11",),
      sentence="A file that is not stored must be answered '0'.",
      original="若文件不可发送，返回 0",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("5.3/4", lines=((777, 780),), register=("A-5-23",),
      sentence="Behind the '1' to 0x54 the controller must send "
               "the content, one fileData in each 0x56 frame.",
      original="然后，控制层发送文件内容 / 0xCC | 0x56 | Sizeof(fileData) | Struct fileData | 0xAA",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("5.3/5", lines=((782, 785),), register=("A-5-19",),
      sentence="A client must answer each 0x56 once and only once: "
               "'1' when it took the chunk, '0' when it failed.",
      original="应用层发送反馈信号(0x56)，其中 1 表示成功，0 表示失败 / "
               '0xAA | 0x56 | 1 | "1" | 0xCC',
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("5.3/6", lines=(782, 787), register=("A-5-9",),
      sentence="The controller must hold each chunk back until "
               "the client has answered the one before it.",
      original="应用层发送反馈信号(0x56) / 不能收到反馈,则认为发送失败",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("5.3/7", lines=(787,), register=("A-5-13",),
      sentence="A controller must still take an answer after 25 s and, when none comes, have "
               "stopped the transfer after 60 s; within 27 to 35 s this is silent, outside "
               "it is reported, and a limit that the subject claims scales all four.",
      original="若一定时间内(暂定 30 秒)不能收到反馈,则认为发送失败,自动停止该次文件传输",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("5.3/8", lines=(787,), register=("A-5-10",),
      sentence="A client that receives data of length 0 must "
               "count the transfer as failed and stop it.",
      original="若文件接受端接受到长度为 0 的数据时,表明本次传输出现错误,停止传输",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("5.3/9", lines=(782,), register=("A-5-14",),
      sentence="After a 0x56 was answered '0', the controller should send no "
               "further chunk of the transfer; repeating the refused one passes.",
      original="其中 1 表示成功，0 表示失败",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=TOLERANT, basis=DERIVED),
    R("5.3/10", lines=(772,), register=("A-5-11",),
      sentence="After 0x54 was answered '0', no 0x56 must follow.",
      original="若文件不可发送，返回 0",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("5.3/11", lines=(737,), register=("A-5-15",),
      sentence="A client must end the download once position + length equals fileSize, and "
               "write the fileSize bytes it was sent, each at its position, and no others.",
      original="当检查到 $position+length==filesize$ 时，表示文件传输结束",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("5.3/12", lines=(739, 791), register=("A-5-11",),
      sentence="A client must not overwrite a local file that "
               "exists: the transfer fails or never begins.",
      original="若文件已经存在，则传输文件失败。 / 若文件已经存在,则返回错误标志",
      binds=CLIENT, testable=AK, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("5.3/13", lines=(735,), register=("A-5-6",),
      sentence="A client must reject a chunk longer than 200 bytes or reaching beyond fileSize.",
      original="缓冲区最多 200 个字节",
      binds=CLIENT, testable=AK, hazard=STATE, strength=FIRM, basis=DERIVED),
)
