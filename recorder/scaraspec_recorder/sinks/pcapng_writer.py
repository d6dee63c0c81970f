"""Writes wire events as a pcapng file, like a capture of the link.

Bytes, directions and times are those of the recording. The Ethernet, IP and TCP headers are
synthetic, so that every reader reassembles the same streams. Missing bytes leave a hole in the
sequence numbers, followed by an acknowledgment. The comment of this packet gives the reason;
injected faults are also packet comments.
"""

import re
import struct
from array import array
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from typing import BinaryIO, Final

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.tcp_segment import ACK, FIN, RST, SYN, Endpoint

_PSH: Final = 0x08
_SEQUENCES: Final = 1 << 32
_SPREAD: Final = 2_654_435_761  # keeps the first sequence numbers of connections far apart
_LONGEST_HOLE_BYTES: Final = 1 << 30
_MOST_PAYLOAD_BYTES: Final = 65_000  # an event is one packet wherever the length fields allow it
_MOST_COMMENT_BYTES: Final = 65_000  # their length fields are as short
_WINDOW_BYTES: Final = 65_535
_HOPS: Final = 64
_TCP: Final = 6
_PORTS: Final = range(1, 1 << 16)
_EPHEMERAL_PORTS: Final = range(49_152, 1 << 16)

_END: Final = r"\[?([^\s\[\]()]+)\]?:(\d{1,5})"
_WAY: Final = re.compile(f"{_END} (?:>|→|to) {_END}")
_UNKNOWN: Final = {A2C: "192.0.2.1", C2A: "192.0.2.2"}  # for documentation (RFC 5737)
_MACS: Final = {A2C: b"\x02\0\0\0\0\x01", C2A: b"\x02\0\0\0\0\x02"}  # locally administered

_SECTION: Final = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
_NANOSECONDS: Final = struct.pack("<HHB3xHH", 9, 1, 9, 0, 0)  # option if_tsresol, end of options
_INTERFACE: Final = struct.pack("<IIHHI12sI", 1, 32, 1, 0, 0, _NANOSECONDS, 32)
_ENHANCED_PACKET: Final = 6


@dataclass(slots=True)
class _Side:
    """One endpoint of a connection and its sequence number."""

    end: Endpoint
    first: int  # sequence number of its first byte
    next: int
    finished: bool = False


_Link = dict[Direction, _Side]


class PcapngWriter:
    """Writes the packets of a recording.

    Args:
        file: Opened for writing in binary; it stays open.

    Attributes:
        shortened_gaps: Number of gaps whose length is unknown or exceeds the sequence numbers; each
            is written as a hole of one byte.

    Raises:
        OSError: From every method, if the file cannot be written.
    """

    def __init__(self, file: BinaryIO) -> None:
        self.shortened_gaps = 0
        self._file = file
        self._links: dict[str, _Link] = {}
        self._count = 0
        file.write(_SECTION + _INTERFACE)

    def write(self, event: WireEvent) -> None:
        """Write the packets of an event."""
        link = self._links.get(event.connection)
        if link is None or event.kind is Kind.OPENED:
            link = self._open(event)
        time_ns, sender, other = event.time_ns, event.direction, event.direction.opposite
        side = link[sender]
        match event.kind:
            case Kind.BYTES:
                side.next = (side.first + event.offset_bytes) % _SEQUENCES
                for begin in range(0, len(event.data), _MOST_PAYLOAD_BYTES):
                    piece = event.data[begin : begin + _MOST_PAYLOAD_BYTES]
                    self._send(time_ns, link, sender, _PSH | ACK, piece)
            case Kind.GAP:
                end_bytes = event.offset_bytes + max(event.length_bytes, 0)
                if not 0 <= event.length_bytes <= _LONGEST_HOLE_BYTES:
                    self.shortened_gaps += 1
                    side.first = (side.next + 1 - end_bytes) % _SEQUENCES
                side.next = (side.first + end_bytes) % _SEQUENCES
                self._send(time_ns, link, other, ACK, comment=f"not recorded: {event.note}")
            case Kind.INJECTED:
                self._send(time_ns, link, sender, ACK, comment=f"injected: {event.note}")
            case Kind.HALF_CLOSED:
                self._finish(time_ns, link, sender)
            case Kind.CLOSED:
                self._finish(time_ns, link, other)
                self._finish(time_ns, link, sender)
                self._send(time_ns, link, other, ACK)
                del self._links[event.connection]
            case Kind.RESET:
                self._send(time_ns, link, sender, RST | ACK)
                del self._links[event.connection]

    def _open(self, event: WireEvent) -> _Link:
        """Create a synthetic connection, with a handshake if its opening was recorded."""
        ends = _ends(event.note, _EPHEMERAL_PORTS[self._count % len(_EPHEMERAL_PORTS)])
        link = {}
        for direction in Direction:
            self._count += 1
            first = self._count * _SPREAD % _SEQUENCES
            link[direction] = _Side(ends[direction], first, first)
        self._links[event.connection] = link
        if event.kind is Kind.OPENED:
            for side in link.values():
                side.next = (side.first - 1) % _SEQUENCES
            opener, other = event.direction, event.direction.opposite
            self._send(event.time_ns, link, opener, SYN)
            self._send(event.time_ns, link, other, SYN | ACK)
            self._send(event.time_ns, link, opener, ACK)
        return link

    def _finish(self, time_ns: int, link: _Link, sender: Direction) -> None:
        if not link[sender].finished:
            link[sender].finished = True
            self._send(time_ns, link, sender, FIN | ACK)

    def _send(  # noqa: PLR0913, PLR0917 - the fields of a packet
        self,
        time_ns: int,
        link: _Link,
        sender: Direction,
        flags: int,
        payload: bytes = b"",
        comment: str = "",
    ) -> None:
        """Write one packet, and advance the sequence number."""
        side, peer = link[sender], link[sender.opposite]
        acknowledged = peer.next if flags & ACK else 0
        tcp = struct.pack(
            ">HHIIBBHHH",
            side.end.port,
            peer.end.port,
            side.next,
            acknowledged,
            5 << 4,
            flags,
            _WINDOW_BYTES,
            0,
            0,
        )
        ethertype, ip = _ip(side.end.address, peer.end.address, tcp + payload)
        packet = _MACS[sender.opposite] + _MACS[sender] + ethertype + ip
        size_bytes = len(packet)
        packet += bytes(-size_bytes % 4) + _options(comment)
        block_bytes = 32 + len(packet)
        high, low = divmod(time_ns, _SEQUENCES)
        head = (_ENHANCED_PACKET, block_bytes, 0, high, low, size_bytes, size_bytes)
        self._file.write(struct.pack("<7I", *head) + packet + struct.pack("<I", block_bytes))
        side.next = (side.next + len(payload) + bool(flags & (SYN | FIN))) % _SEQUENCES


def _options(comment: str) -> bytes:
    """Return the options of a packet with a comment; empty without one."""
    if not comment:
        return b""
    text = comment.encode()[:_MOST_COMMENT_BYTES]
    return struct.pack("<HH", 1, len(text)) + text + bytes(-len(text) % 4) + bytes(4)


def _ends(note: str, client_port: int) -> dict[Direction, Endpoint]:
    """Return both endpoints from the note of an opening; synthetic ones if it has none."""
    texts, ports = dict(_UNKNOWN), {A2C: client_port, C2A: DEFAULT_PORT}
    if found := _WAY.search(note):
        for direction, groups in ((A2C, (1, 2)), (C2A, (3, 4))):
            text, port = found.group(*groups)
            texts[direction] = text
            ports[direction] = int(port) if int(port) in _PORTS else ports[direction]
    addresses = {}
    for direction, text in texts.items():
        try:
            addresses[direction] = ip_address(text)
        except ValueError:  # a host's name
            addresses[direction] = ip_address(_UNKNOWN[direction])
    packed = {direction: address.packed for direction, address in addresses.items()}
    if len({address.version for address in addresses.values()}) > 1:
        for direction, address in addresses.items():
            if address.version == 4:  # noqa: PLR2004 - IP versions are named by their numbers
                packed[direction] = IPv6Address(f"::ffff:{address}").packed
    return {direction: Endpoint(packed[direction], ports[direction]) for direction in Direction}


def _ip(source: bytes, target: bytes, segment: bytes) -> tuple[bytes, bytes]:
    """Return the Ethertype and the IP packet of a TCP segment, with checksums."""
    pseudo = source + target + struct.pack(">II", len(segment), _TCP)
    checksum = _checksum(pseudo + segment)
    segment = segment[:16] + checksum + segment[18:]
    if len(source) == 16:  # noqa: PLR2004 - the bytes of an IPv6 address
        head = struct.pack(">IHBB", 6 << 28, len(segment), _TCP, _HOPS)
        return b"\x86\xdd", head + source + target + segment
    fields = (0x45, 0, 20 + len(segment), 0, 0x4000, _HOPS, _TCP)
    head = struct.pack(">BBHHHBB", *fields)
    return b"\x08\x00", head + _checksum(head + source + target) + source + target + segment


def _checksum(data: bytes) -> bytes:
    """The Internet checksum (RFC 1071)."""
    total = sum(array("H", data + bytes(len(data) % 2)))  # in the byte order of this machine
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return struct.pack("=H", ~total & 0xFFFF)
