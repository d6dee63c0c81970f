"""4.3 and 4.4: read and set the network, 0x04 and 0x05 (L143-165)."""

from scaraspec.judge.catalogue.entry import (
    AC,
    AK,
    CLIENT,
    CONTROLLER,
    DERIVED,
    DESTRUCTIVE,
    FIRM,
    PC,
    READ_ONLY,
    ROBUSTNESS,
    TEXT,
    TOLERANT,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("4.3/1", lines=((145, 148),), register=("A-3-12",),
      sentence="The request 0x04 must carry no data.",
      original="0xAA | 0x04 | 0 | 0xCC",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.3/2", lines=((150, 153),), register=("A-4.3-2",),
      sentence="The reply to 0x04 must be IP address, subnet mask "
               "and gateway, in this order, with '|' between them.",
      original="控制层向其返回 IP 地址，子网掩码和网管地址，其中以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("4.3/3", lines=(150,), register=("A-4.3-2",),
      sentence="Each field of the reply to 0x04 must be an IPv4 value "
               "in dotted decimals, every part within 0 to 255.",
      original="IP 地址，子网掩码和网管地址",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.3/4", lines=(153, 98), register=("A-4.3-1",),
      sentence="The length byte of the reply to 0x04 must count the bytes "
               "really sent: 37 for the documented text, whose row prints 36.",
      original='0xCC | 0x04 | 36 | "192.168.1.2 255.255.255.0 192.168.1.1" | 0xAA / '
               "数据内容的长度受限于“数据长度”",
      binds=CONTROLLER, testable=AC | PC, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.3/5", lines=(150,), register=("A-4.3-1",),
      sentence="A client must read the three fields of the "
               "network reply whatever their legal lengths.",
      original="IP 地址，子网掩码和网管地址",
      binds=CLIENT, testable=AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("4.4/1", lines=((157, 160),), register=("A-4.3-2",),
      sentence="The data of 0x05 must be IP address, subnet mask "
               "and gateway, in this order, with '|' between them.",
      original="请求中包含 IP 地址，子网掩码和网关地址，三个之间以“|”分割",
      binds=CLIENT, testable=AK | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.4/2", lines=(162,), register=("A-4.4-1",),
      sentence="The reply to 0x05 must be '1' for success and '0' for failure.",
      original="控制层向应用层返回设置网络结果，1：表示成功；0：表示失败",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=TEXT),
    R("4.4/3", lines=(162,), register=("A-4.4-1",),
      sentence="The reply to 0x05 should leave before the new "
               "address cuts the connection it travels on.",
      original="控制层向应用层返回设置网络结果",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=TOLERANT, basis=DERIVED),
    R("4.4/4", lines=(157,), register=("A-4.4-1",),
      sentence="After 0x05 was answered '1', the next 0x04 must show the new address, mask and "
               "gateway, in this order; only a subject that claims so may wait for a restart.",
      original="请求中包含 IP 地址，子网掩码和网关地址，三个之间以“|”分割",
      binds=CONTROLLER, testable=AC | PC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.4/5", lines=(157,), register=("A-4.4-2",),
      sentence="An address that cannot exist, such as 999.1.1.1, must not be answered '1' to 0x05.",
      original="请求中包含 IP 地址，子网掩码和网关地址",
      binds=CONTROLLER, testable=AC, hazard=DESTRUCTIVE, strength=FIRM, basis=DERIVED),
    R("4.4/6", lines=(162,), register=("A-4.4-1",),
      sentence="After 0x05 was answered '1', a client should cope with losing its connection.",
      original="控制层向应用层返回设置网络结果",
      binds=CLIENT, testable=AK, hazard=DESTRUCTIVE, strength=TOLERANT, basis=ROBUSTNESS),
)
