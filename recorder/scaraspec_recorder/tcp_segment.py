"""Reads the TCP segment of a captured packet.

Belongs here: headers of single packets, without state. `reassembly` combines packets. Header values
are used only as far as they are plausible.
"""

import struct
from dataclasses import dataclass
from ipaddress import ip_address
from struct import Struct
from typing import Final, NamedTuple

FIN: Final = 0x01
SYN: Final = 0x02
RST: Final = 0x04
ACK: Final = 0x10


class Endpoint(NamedTuple):
    """One end of a TCP connection.

    Attributes:
        address: The IP address in network order, 4 or 16 bytes.
        port: The TCP port.
    """

    address: bytes
    port: int

    def __str__(self) -> str:
        """``192.0.2.1:8877`` or ``[2001:db8::1]:8877``."""
        address = ip_address(self.address)
        return f"[{address}]:{self.port}" if address.version == 6 else f"{address}:{self.port}"  # noqa: PLR2004 - IPv6 is named by its number


class Segment(NamedTuple):
    """One TCP segment as captured.

    Attributes:
        time_ns: Capture time, nanoseconds since the Unix epoch.
        src: The sender.
        dst: The receiver.
        seq: Sequence number, 32 bits.
        ack: Acknowledgment number, 32 bits; valid only if `flags` contains ``ACK``.
        flags: ``FIN``, ``SYN``, ``RST`` and ``ACK``, combined; other bits are ignored.
        payload: The payload bytes that were captured.
        cut_bytes: Number of payload bytes that the capture cut off.
    """

    time_ns: int
    src: Endpoint
    dst: Endpoint
    seq: int
    ack: int
    flags: int
    payload: bytes = b""
    cut_bytes: int = 0


class UnreadablePacket(Exception):  # noqa: N818 - a property of the packet
    """A packet may contain TCP and cannot be read; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class _Link:
    """Layout of a link type: header size and offset of the Ethertype, in bytes."""

    header_bytes: int
    ethertype_at: int | None = None  # None: IP follows, and its first four bits tell the version


_LINKS: Final = {
    0: _Link(4),  # NULL: BSD loopback, address family in the host's byte order
    1: _Link(14, 12),  # Ethernet
    12: _Link(0),  # raw IP, as some systems number it
    14: _Link(0),  # raw IP, as OpenBSD numbers it
    101: _Link(0),  # raw IP
    108: _Link(4),  # LOOP: OpenBSD loopback
    113: _Link(16, 14),  # Linux cooked, version 1
    228: _Link(0),  # raw IPv4
    229: _Link(0),  # raw IPv6
    276: _Link(20, 0),  # Linux cooked, version 2
}
_VLAN_TAGS: Final = {0x8100, 0x88A8, 0x9100}
_IP_ETHERTYPES: Final = {0x0800, 0x86DD}
_TCP: Final = 6
_FRAGMENT_HEADER: Final = 44
_AUTHENTICATION_HEADER: Final = 51
_EXTENSION_HEADERS: Final = {0, 43, _FRAGMENT_HEADER, _AUTHENTICATION_HEADER, 60, 135}

_FRAGMENT: Final = "IP fragments are not put together"
_CONTRADICTION: Final = "headers contradict each other"

_U16: Final = Struct(">H")
_IPV4: Final = Struct(">B x H 2x H x B 2x 4s 4s")
_IPV6: Final = Struct(">4x H B x 16s 16s")
_EXTENSION: Final = Struct(">B B H")
_TCP_HEADER: Final = Struct(">H H I I B B 6x")


class _Ip(NamedTuple):
    """The content of an IP header: sender, receiver, and the begin and end of the payload."""

    src: bytes
    dst: bytes
    start: int
    end: int


def dissect(time_ns: int, link_type: int, packet: bytes, wire_bytes: int) -> Segment | None:
    """Read the TCP segment of one captured packet.

    Args:
        time_ns: The packet's time stamp, nanoseconds since the Unix epoch.
        link_type: The type of the link header, a LINKTYPE number of the pcap registry.
        packet: The captured bytes.
        wire_bytes: The number of bytes of the packet on the wire.

    Returns:
        The segment; None if the packet contains no TCP.

    Raises:
        UnreadablePacket: The link type is unknown, the packet is an IP fragment of TCP, or its
            headers are cut off or contradict each other.
    """
    link = _LINKS.get(link_type)
    if link is None:
        raise UnreadablePacket(f"link type {link_type} is not supported")
    try:
        start = _ip_start(link, packet)
        ip = None if start is None else _ip(packet, start, wire_bytes)
        return None if ip is None else _segment(time_ns, packet, ip)
    except (struct.error, IndexError):
        raise UnreadablePacket("headers are cut off") from None


def _ip_start(link: _Link, packet: bytes) -> int | None:
    """Return the offset of the IP header after the link header and VLAN tags; None if not IP."""
    start = link.header_bytes
    if link.ethertype_at is None:
        return start
    (ethertype,) = _U16.unpack_from(packet, link.ethertype_at)
    while ethertype in _VLAN_TAGS:
        (ethertype,) = _U16.unpack_from(packet, start + 2)
        start += 4
    return start if ethertype in _IP_ETHERTYPES else None


def _ip(packet: bytes, start: int, wire_bytes: int) -> _Ip | None:
    version = packet[start] >> 4
    if version == 4:  # noqa: PLR2004 - IP versions are named by their numbers
        return _ipv4(packet, start, wire_bytes)
    if version == 6:  # noqa: PLR2004 - IP versions are named by their numbers
        return _ipv6(packet, start, wire_bytes)
    return None


def _ipv4(packet: bytes, start: int, wire_bytes: int) -> _Ip | None:
    first, total_bytes, fragment, protocol, src, dst = _IPV4.unpack_from(packet, start)
    if protocol != _TCP:
        return None
    if fragment & 0x3FFF:  # more fragments, or an offset
        raise UnreadablePacket(_FRAGMENT)
    header_bytes = (first & 0x0F) * 4
    if header_bytes < _IPV4.size:
        raise UnreadablePacket(_CONTRADICTION)
    # 0: a packet larger than the field can say, before the network card splits it.
    end = start + total_bytes if total_bytes else wire_bytes
    return _Ip(src, dst, start + header_bytes, end)


def _ipv6(packet: bytes, start: int, wire_bytes: int) -> _Ip | None:
    payload_bytes, header, src, dst = _IPV6.unpack_from(packet, start)
    at = start + _IPV6.size
    end = at + payload_bytes if payload_bytes else wire_bytes
    while header in _EXTENSION_HEADERS:
        following, length, fragment = _EXTENSION.unpack_from(packet, at)
        if header == _FRAGMENT_HEADER:
            if following == _TCP and fragment & 0xFFF9:  # an offset, or more fragments
                raise UnreadablePacket(_FRAGMENT)
            at += 8
        elif header == _AUTHENTICATION_HEADER:
            at += (length + 2) * 4
        else:
            at += (length + 1) * 8
        header = following
    return _Ip(src, dst, at, end) if header == _TCP else None


def _segment(time_ns: int, packet: bytes, ip: _Ip) -> Segment:
    src_port, dst_port, seq, ack, header_words, flags = _TCP_HEADER.unpack_from(packet, ip.start)
    header_bytes = (header_words >> 4) * 4
    start = ip.start + header_bytes
    if header_bytes < _TCP_HEADER.size or start > ip.end:
        raise UnreadablePacket(_CONTRADICTION)
    payload = packet[start : ip.end]
    return Segment(
        time_ns,
        Endpoint(ip.src, src_port),
        Endpoint(ip.dst, dst_port),
        seq,
        ack,
        flags,
        payload,
        ip.end - start - len(payload),
    )
