"""5.1: the structure that carries file content, and the rules of both directions (L710-739)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    BOTH,
    CONTROLLER,
    DERIVED,
    FIRM,
    PC,
    STATE,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("5.1/1", lines=((718, 723),), register=("A-5-1",),
      sentence="Content must travel in a structure of fileSize, position and "
               "length, an unsigned 32-bit number each, and a buffer of 200 bytes.",
      original="Uint32_t fileSize; / Uint32_t position; / Uint32_t length; / Char data[200];",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.1/2", lines=(756, 780), register=("A-5-3",),
      sentence="A chunk should carry sizeof(fileData) = 212 data bytes; a "
               "last chunk cut off behind its valid bytes is tolerated.",
      original="0xAA | 0x52 | Sizeof(fileData) | Struct fileData | 0xCC / "
               "0xCC | 0x56 | Sizeof(fileData) | Struct fileData | 0xAA",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=TOLERANT, basis=TEXT),
    R("5.1/3", lines=(729,), register=("A-5-7",),
      sentence="fileSize must be the size of the whole file in "
               "bytes, the same in every chunk of a transfer.",
      original="FileSize: 文件大小",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("5.1/4", lines=(731, 737), register=("A-5-5",),
      sentence="position must be the place of the chunk's first "
               "byte in the file, counted in bytes from 0.",
      original="Position: 该段内容在文件中的位置 / $position+length==filesize$",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.1/5", lines=((733, 735),), register=("A-5-6",),
      sentence="length must be the number of valid bytes in the buffer, 1 to 200.",
      original="Length: 缓冲区的有效数据长度 / 缓冲区最多 200 个字节",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.1/6", lines=(737,), register=("A-5-6",),
      sentence="No chunk must reach past the end of the "
               "file: position + length is at most fileSize.",
      original="当检查到 $position+length==filesize$ 时，表示文件传输结束",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("5.1/7", lines=(737,), register=("A-5-15",),
      sentence="A transfer must be over once position + length equals fileSize.",
      original="当检查到 $position+length==filesize$ 时，表示文件传输结束",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.1/8", lines=(737, 793), register=("A-5-8",),
      sentence="A sender must send the chunks in ascending order from "
               "position 0 on, leaving no gap and repeating no byte.",
      original="$position+length==filesize$ / 发送端按照流程发送",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("5.1/9", lines=((719, 721),), register=("A-5-2",),
      sentence="Every chunk should use the same byte order, "
               "little-endian unless the peer shows otherwise.",
      original="Uint32_t fileSize; / Uint32_t position; / Uint32_t length;",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
    R("5.1/10", lines=(739,), register=("A-5-11",),
      sentence="A transfer to the controller must fail when the file is already there.",
      original="若文件已经存在，则传输文件失败。",
      binds=CONTROLLER, testable=AC | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.1/11", lines=(712,), register=("A-5-25",),
      sentence="The file name must be sent ahead of all content.",
      original="第一步先发送传输文件的信息，即文件名，然后发送文件内容",
      binds=BOTH, testable=AC | AK | PC, hazard=STATE, strength=FIRM, basis=TEXT),
    R("5.1/12", lines=(733,), register=("A-5-4",),
      sentence="A receiver must store the first `length` bytes of the buffer and ignore the rest.",
      original="Length: 缓冲区的有效数据长度",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("5.1/13", lines=(737, 793), register=("A-5-8",),
      sentence="A receiver should not take a file for "
               "complete while some of its bytes are missing.",
      original="当检查到 $position+length==filesize$ 时，表示文件传输结束 / "
               "接收端自己判断文件传输是否结束",
      binds=BOTH, testable=AC | AK, hazard=STATE, strength=TOLERANT, basis=DERIVED),
)
