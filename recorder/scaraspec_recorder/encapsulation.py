"""Finds the IP header in a captured packet: link headers, tags and tunnels.

Belongs here: what is outside of an IP header. `tcp_segment` reads IP and TCP.
"""

from dataclasses import dataclass
from struct import Struct
from typing import Final


class UnreadablePacket(Exception):  # noqa: N818 - a property of the packet
    """A packet may contain TCP and cannot be read; the message gives the reason."""


class UndecodedPacket(UnreadablePacket):
    """A packet may contain TCP in an encapsulation that is not decoded; the message names it."""


@dataclass(frozen=True, slots=True)
class _Link:
    """Layout of a link type: header size and offset of the Ethertype, in bytes."""

    header_bytes: int
    ethertype_at: int | None = None  # None: IP follows, and its first four bits are the version


_LINKS: Final = {
    0: _Link(4),  # NULL: BSD loopback, address family in the host's byte order
    1: _Link(14, 12),  # Ethernet
    12: _Link(0),  # raw IP, as some systems number it
    14: _Link(0),  # raw IP, as OpenBSD numbers it
    101: _Link(0),  # raw IP
    104: _Link(4, 2),  # Cisco HDLC
    108: _Link(4),  # LOOP: OpenBSD loopback
    113: _Link(16, 14),  # Linux cooked, version 1
    228: _Link(0),  # raw IPv4
    229: _Link(0),  # raw IPv6
    276: _Link(20, 0),  # Linux cooked, version 2
}
_PPP_LINKS: Final = {9, 50}
_PPPOE_LINK: Final = 51
_LINK_NAMES: Final = {
    6: "Token Ring",
    10: "FDDI",
    105: "IEEE 802.11",
    107: "Frame Relay",
    119: "IEEE 802.11 with a Prism header",
    127: "IEEE 802.11 with a radiotap header",
    163: "IEEE 802.11 with an AVS header",
    187: "Bluetooth HCI",
    189: "USB",
    192: "PPI",
    195: "IEEE 802.15.4",
    197: "ERF",
    201: "Bluetooth HCI",
    220: "USB",
    227: "SocketCAN",
    230: "IEEE 802.15.4",
    239: "NFLOG",
    249: "USBPcap",
    251: "Bluetooth LE",
    252: "exported PDUs",
    253: "Netlink",
}

_VLAN_TAGS: Final = {0x8100, 0x88A8, 0x9100, 0x9200}
_IP_ETHERTYPES: Final = {0x0800, 0x86DD}
_IPV4_ETHERTYPE: Final = b"\x08\x00"
_ETHERNET_BRIDGED: Final = 0x6558
_PPPOE: Final = 0x8864
_MPLS: Final = {0x8847, 0x8848}
_HSR: Final = 0x892F  # PRP has a trailer instead, after the IP packet
_BACKBONE: Final = 0x88E7
_UNDECODED_ETHERTYPES: Final = {
    0x88E5: "MACsec",
    0x88BE: "ERSPAN",
    0x22EB: "ERSPAN",
    0x880B: "PPTP",
    0x894F: "NSH",
}
_MAX_802_3_LENGTH: Final = 1500
_SNAP: Final = b"\xaa\xaa\x03"
_SNAP_OUIS: Final = {b"\x00\x00\x00", b"\x00\x00\xf8"}
_LLC_IP: Final = b"\x06\x06\x03"
_PPP_IP: Final = {0x0021, 0x0057}
_PPP_COMPRESSED_IP: Final = {0x21, 0x57}
_MPLS_BOTTOM: Final = 0x100

_IP_IN_IP: Final = {4, 41}
_UDP: Final = 17
_GRE: Final = 47
_ESP: Final = 50
_UNDECODED_PROTOCOLS: Final = {_ESP: "IPsec ESP", 115: "L2TP"}
_GRE_FIELDS: Final = (0x8000, 0x2000, 0x1000)  # checksum, key, sequence number; four bytes each
_GRE_VERSION: Final = 0x0007
_VXLAN: Final = {4789, 8472}
_VXLAN_VALID: Final = 0x08
_GENEVE: Final = 6081
_UNDECODED_UDP: Final = {1701: "L2TP", 2152: "GTP", 4500: "IPsec ESP in UDP"}
_UDP_BYTES: Final = 8

_U16: Final = Struct(">H")
_U32: Final = Struct(">I")
_PORTS: Final = Struct(">H H")


def ip_start(link_type: int, packet: bytes) -> int | None:
    """Return the offset of the IP header after the link header and its tags.

    Args:
        link_type: The type of the link header, a LINKTYPE number of the pcap registry.
        packet: The captured bytes.

    Returns:
        The offset; None if the packet contains no IP.

    Raises:
        UndecodedPacket: The link type or an encapsulation is not decoded.
        struct.error: A header is cut off.
    """
    if link_type in _PPP_LINKS:
        return _after_ppp(packet, 0)
    if link_type == _PPPOE_LINK:
        return _after_ethertype(packet, _PPPOE, 0)
    link = _LINKS.get(link_type)
    if link is None:
        raise UndecodedPacket(_LINK_NAMES.get(link_type, f"link type {link_type}"))
    if link.ethertype_at is None:
        return link.header_bytes
    (ethertype,) = _U16.unpack_from(packet, link.ethertype_at)
    return _after_ethertype(packet, ethertype, link.header_bytes)


def plain_ipv4_start(link_type: int, packet: bytes) -> int | None:
    """Return the offset of an IPv4 header directly after the link header; None without one.

    Args:
        link_type: The type of the link header, a LINKTYPE number of the pcap registry.
        packet: The captured bytes.
    """
    link = _LINKS.get(link_type)
    if link is None:
        return None
    at = link.ethertype_at
    if at is not None and packet[at : at + 2] != _IPV4_ETHERTYPE:
        return None
    return link.header_bytes


def tunnelled_ip_start(protocol: int, packet: bytes, start: int) -> int | None:
    """Return the offset of an IP header that is carried in another IP packet.

    Args:
        protocol: The protocol number of the outer packet.
        packet: The captured bytes.
        start: Offset of its payload.

    Returns:
        The offset; None if the payload is no tunnel.

    Raises:
        UndecodedPacket: The tunnel is not decoded.
        struct.error: A header is cut off.
    """
    if protocol in _IP_IN_IP:
        return start
    if protocol == _GRE:
        return _after_gre(packet, start)
    if protocol == _UDP:
        return _after_udp(packet, start)
    if name := _UNDECODED_PROTOCOLS.get(protocol):
        raise UndecodedPacket(name)
    return None


def _after_ethernet(packet: bytes, start: int) -> int | None:
    (ethertype,) = _U16.unpack_from(packet, start + 12)
    return _after_ethertype(packet, ethertype, start + 14)


def _after_ethertype(packet: bytes, ethertype: int, start: int) -> int | None:  # noqa: PLR0911, PLR0912, C901 - a row for each tag
    """Return the offset of the IP header after tags, if any; `start` is after the Ethertype."""
    while True:
        if ethertype in _IP_ETHERTYPES:
            return start
        if ethertype in _VLAN_TAGS:
            (ethertype,) = _U16.unpack_from(packet, start + 2)
            start += 4
        elif ethertype == _HSR:
            (ethertype,) = _U16.unpack_from(packet, start + 4)
            start += 6
        elif ethertype <= _MAX_802_3_LENGTH and packet[start : start + 3] == _SNAP:
            if packet[start + 3 : start + 6] not in _SNAP_OUIS:
                return None
            (ethertype,) = _U16.unpack_from(packet, start + 6)
            start += 8
        elif ethertype <= _MAX_802_3_LENGTH:
            return start + 3 if packet[start : start + 3] == _LLC_IP else None
        elif ethertype == _PPPOE:
            return _after_ppp(packet, start + 6)
        elif ethertype in _MPLS:
            while not _U32.unpack_from(packet, start)[0] & _MPLS_BOTTOM:
                start += 4
            return start + 4
        elif ethertype == _BACKBONE:
            return _after_ethernet(packet, start + 4)
        elif ethertype == _ETHERNET_BRIDGED:
            return _after_ethernet(packet, start)
        elif name := _UNDECODED_ETHERTYPES.get(ethertype):
            raise UndecodedPacket(name)
        else:
            return None


def _after_ppp(packet: bytes, start: int) -> int | None:
    if packet[start : start + 2] == b"\xff\x03":  # address and control
        start += 2
    if packet[start] in _PPP_COMPRESSED_IP:
        return start + 1
    (protocol,) = _U16.unpack_from(packet, start)
    return start + 2 if protocol in _PPP_IP else None


def _after_gre(packet: bytes, start: int) -> int | None:
    flags, protocol = _PORTS.unpack_from(packet, start)
    if flags & _GRE_VERSION:
        raise UndecodedPacket("PPTP")
    start += 4 + 4 * sum(bool(flags & field) for field in _GRE_FIELDS)
    return _after_ethertype(packet, protocol, start)


def _after_udp(packet: bytes, start: int) -> int | None:
    ports = _PORTS.unpack_from(packet, start)
    start += _UDP_BYTES
    if not _VXLAN.isdisjoint(ports) and packet[start] & _VXLAN_VALID:
        return _after_ethernet(packet, start + 8)
    if _GENEVE in ports:
        (protocol,) = _U16.unpack_from(packet, start + 2)
        return _after_ethertype(packet, protocol, start + 8 + 4 * (packet[start] & 0x3F))
    for port in ports:
        if name := _UNDECODED_UDP.get(port):
            raise UndecodedPacket(name)
    return None
