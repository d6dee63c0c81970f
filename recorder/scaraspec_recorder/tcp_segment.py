"""Reads the TCP segment of a captured packet.

Belongs here: IP and TCP headers of single packets, without state. `encapsulation` finds the IP
header, `reassembly` combines packets. Header values are used only as far as they are plausible.
"""

import struct
from ipaddress import ip_address
from struct import Struct
from typing import Final, NamedTuple

from scaraspec_recorder.encapsulation import (
    UnreadablePacket,
    ip_start,
    plain_ipv4_start,
    tunnelled_ip_start,
)
from scaraspec_recorder.ip_fragments import FragmentBuffer, FragmentPosition

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
        packet: Number of the packet in the capture, from 1; 0 if unknown.
        corrupt: Whether the checksum is wrong. It is not if the packet was captured before the
            network card computed it: the field is 0 or the sum of the addresses then.
    """

    time_ns: int
    src: Endpoint
    dst: Endpoint
    seq: int
    ack: int
    flags: int
    payload: bytes = b""
    cut_bytes: int = 0
    packet: int = 0
    corrupt: bool = False


_TCP: Final = 6
_FRAGMENT_HEADER: Final = 44
_NO_NEXT_HEADER: Final = 59
_AUTHENTICATION_HEADER: Final = 51
_EXTENSION_HEADERS: Final = {0, 43, _FRAGMENT_HEADER, _AUTHENTICATION_HEADER, 60, 135}

_CONTRADICTION: Final = "headers contradict each other"

_IPV4: Final = Struct(">B x H H H x B 2x 4s 4s")
_IPV6: Final = Struct(">4x H B x 16s 16s")
_EXTENSION: Final = Struct(">B B H")
_FRAGMENT_NUMBER: Final = Struct(">4x I")
_TCP_HEADER: Final = Struct(">H H I I B B 6x")
_ORDINARY: Final = Struct(">B x H 2x H x B 2x 4s 4s H H I I B B 6x")  # IPv4 and TCP
_IPV4_WITHOUT_OPTIONS: Final = 0x45
_CHECKSUM: Final = Struct(">H")
_CHECKSUM_MODULUS: Final = 0xFFFF


class _Ip(NamedTuple):
    """An IP header: protocol number, sender, receiver, begin and end of the payload, fragment."""

    protocol: int
    src: bytes
    dst: bytes
    start: int
    end: int
    fragment: FragmentPosition | None = None


def dissect(  # noqa: PLR0913 - the fields of a record
    time_ns: int,
    link_type: int,
    packet: bytes,
    wire_bytes: int,
    fragments: FragmentBuffer,
    *,
    number: int = 0,
) -> Segment | None:
    """Read the TCP segment of one captured packet.

    Args:
        time_ns: The packet's time stamp, nanoseconds since the Unix epoch.
        link_type: The type of the link header, a LINKTYPE number of the pcap registry.
        packet: The captured bytes.
        wire_bytes: The number of bytes of the packet on the wire.
        fragments: Receives IP fragments of TCP.
        number: The number of the packet in the capture, from 1; 0 if unknown.

    Returns:
        The segment; None if the packet contains no TCP, or a fragment of an incomplete packet.

    Raises:
        UnreadablePacket: The link type or a tunnel is not decoded, or the headers are cut off or
            contradict each other.
    """
    segment = _ordinary(time_ns, link_type, packet, number)
    if segment is not None:
        return segment
    try:
        start = ip_start(link_type, packet)
        while start is not None and (ip := _ip(packet, start, wire_bytes)):
            if ip.protocol == _TCP:
                if ip.fragment is None:
                    return _segment(time_ns, packet, ip, number)
                whole = fragments.add(ip.fragment, packet[ip.start : ip.end])
                if whole is None:
                    return None
                return _segment(time_ns, whole, ip._replace(start=0, end=len(whole)), number)
            start = tunnelled_ip_start(ip.protocol, packet, ip.start)
        return None  # noqa: TRY300 - the end of the loop
    except (struct.error, IndexError):
        raise UnreadablePacket("headers are cut off") from None


def _ordinary(time_ns: int, link_type: int, packet: bytes, number: int) -> Segment | None:
    """Read a whole TCP segment in IPv4 without options, directly after the link header.

    Most packets are ordinary. For the others, None is returned, and the general way follows.
    """
    start = plain_ipv4_start(link_type, packet)
    if start is None or len(packet) < start + _ORDINARY.size:
        return None
    version, total_bytes, fragment, protocol, src, dst, *tcp = _ORDINARY.unpack_from(packet, start)
    if version != _IPV4_WITHOUT_OPTIONS or protocol != _TCP or fragment & 0x3FFF:
        return None
    src_port, dst_port, seq, ack, header_words, flags = tcp
    at, end = start + _IPV4.size, start + total_bytes
    begin = at + (header_words >> 4) * 4
    if not at + _TCP_HEADER.size <= begin <= end <= len(packet):
        return None
    payload = packet[begin:end]
    corrupt = bool(payload) and _is_corrupt(src + dst, packet[at:end])
    ends = Endpoint(src, src_port), Endpoint(dst, dst_port)
    return Segment(time_ns, *ends, seq, ack, flags, payload, 0, number, corrupt)


def _ip(packet: bytes, start: int, wire_bytes: int) -> _Ip | None:
    version = packet[start] >> 4
    if version == 4:  # noqa: PLR2004 - IP versions are named by their numbers
        return _ipv4(packet, start, wire_bytes)
    if version == 6:  # noqa: PLR2004 - IP versions are named by their numbers
        return _ipv6(packet, start, wire_bytes)
    return None


def _ipv4(packet: bytes, start: int, wire_bytes: int) -> _Ip:
    first, total_bytes, number, fragment, protocol, src, dst = _IPV4.unpack_from(packet, start)
    position = None
    if protocol == _TCP and fragment & 0x3FFF:  # more fragments, or an offset
        more = bool(fragment & 0x2000)
        position = FragmentPosition((src, dst, number), 8 * (fragment & 0x1FFF), more)
    elif fragment & 0x1FFF:
        protocol = _NO_NEXT_HEADER
    header_bytes = (first & 0x0F) * 4
    if header_bytes < _IPV4.size:
        raise UnreadablePacket(_CONTRADICTION)
    # 0: a packet larger than the field can say, before the network card splits it.
    end = start + total_bytes if total_bytes else wire_bytes
    return _Ip(protocol, src, dst, start + header_bytes, end, position)


def _ipv6(packet: bytes, start: int, wire_bytes: int) -> _Ip:
    payload_bytes, header, src, dst = _IPV6.unpack_from(packet, start)
    at = start + _IPV6.size
    end = at + payload_bytes if payload_bytes else wire_bytes
    position = None
    while header in _EXTENSION_HEADERS:
        following, length, fragment = _EXTENSION.unpack_from(packet, at)
        if header == _FRAGMENT_HEADER:
            if following == _TCP and fragment & 0xFFF9:  # an offset, or more fragments
                (number,) = _FRAGMENT_NUMBER.unpack_from(packet, at)
                more = bool(fragment & 1)
                position = FragmentPosition((src, dst, number), fragment & 0xFFF8, more)
            at += 8
        elif header == _AUTHENTICATION_HEADER:
            at += (length + 2) * 4
        else:
            at += (length + 1) * 8
        header = following
    return _Ip(header, src, dst, at, end, position)


def _segment(time_ns: int, packet: bytes, ip: _Ip, number: int) -> Segment:
    src_port, dst_port, seq, ack, header_words, flags = _TCP_HEADER.unpack_from(packet, ip.start)
    header_bytes = (header_words >> 4) * 4
    start = ip.start + header_bytes
    if header_bytes < _TCP_HEADER.size or start > ip.end:
        raise UnreadablePacket(_CONTRADICTION)
    payload = packet[start : ip.end]
    cut_bytes = ip.end - start - len(payload)
    return Segment(
        time_ns,
        Endpoint(ip.src, src_port),
        Endpoint(ip.dst, dst_port),
        seq,
        ack,
        flags,
        payload,
        cut_bytes,
        number,
        bool(payload) and not cut_bytes and _is_corrupt(ip.src + ip.dst, packet[ip.start : ip.end]),
    )


def _is_corrupt(addresses: bytes, segment: bytes) -> bool:
    """Return whether the checksum of a whole segment is wrong; see `Segment.corrupt`."""
    # The ones' complement sum of 16-bit words is the remainder of division by 65,535.
    pseudo = (int.from_bytes(addresses) + _TCP + len(segment)) % _CHECKSUM_MODULUS
    padding = b"\0" * (len(segment) % 2)
    if (int.from_bytes(segment + padding) + pseudo) % _CHECKSUM_MODULUS == 0:
        return False
    (field,) = _CHECKSUM.unpack_from(segment, 16)
    return field % _CHECKSUM_MODULUS not in (
        0,
        pseudo,
        (pseudo - len(segment)) % _CHECKSUM_MODULUS,
    )
