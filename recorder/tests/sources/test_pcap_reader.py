"""Captures of all link and file types give the same events; damaged files give the intact part."""

import gzip
import io
import logging
import struct
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scapy.contrib.geneve import GENEVE
from scapy.contrib.mpls import MPLS
from scapy.layers.inet import IP, TCP, UDP
from scapy.layers.inet6 import IPv6, IPv6ExtHdrFragment, IPv6ExtHdrHopByHop
from scapy.layers.l2 import (
    GRE,
    LLC,
    SNAP,
    CookedLinux,
    CookedLinuxV2,
    Dot1AD,
    Dot1Q,
    Dot3,
    Ether,
    Loopback,
)
from scapy.layers.ppp import PPP, PPPoE
from scapy.layers.vxlan import VXLAN
from scapy.packet import Packet, Raw

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sources.pcap_reader import (
    _MAX_RECORD_BYTES,
    PcapSummary,
    _Source,
    read_pcap,
)

CLIENT, CONTROLLER = "192.0.2.1", "192.0.2.2"
CLIENT6, CONTROLLER6 = "2001:db8::1", "2001:db8::2"
REQUEST = bytes.fromhex("aa0900cc")
REPLY = bytes.fromhex("cc09023030aa")
START_NS = 1_700_000_000_123_456_789
STEP_NS = 1_000_000

ETHERNET, RAW, RAW4, RAW6, NULL, LOOP, SLL, SLL2 = 1, 101, 228, 229, 0, 108, 113, 276


def ip4(*, from_client: bool) -> Packet:
    src, dst = (CLIENT, CONTROLLER) if from_client else (CONTROLLER, CLIENT)
    return IP(src=src, dst=dst)


def ip6(*, from_client: bool) -> Packet:
    src, dst = (CLIENT6, CONTROLLER6) if from_client else (CONTROLLER6, CLIENT6)
    return IPv6(src=src, dst=dst)


MACS: Any = {"src": "02:00:00:00:00:01", "dst": "02:00:00:00:00:02"}
"""Without these, scapy asks the network for the address of the receiver."""


def ether(payload: Packet) -> Packet:
    return Ether(**MACS) / payload


def tcp(*, from_client: bool, seq: int, ack: int, flags: str, port: int = 8877) -> Packet:
    sport, dport = (50000, port) if from_client else (port, 50000)
    return TCP(sport=sport, dport=dport, seq=seq, ack=ack, flags=flags)


def conversation(network: Callable[..., Packet] = ip4, port: int = 8877) -> list[Packet]:
    """Return a handshake, a request, its reply and the end, as network-layer packets."""
    steps = [
        (True, 100, 0, "S", b""),
        (False, 900, 101, "SA", b""),
        (True, 101, 901, "A", b""),
        (True, 101, 901, "PA", REQUEST),
        (False, 901, 105, "PA", REPLY),
        (True, 105, 907, "FA", b""),
        (False, 907, 106, "FA", b""),
        (True, 106, 908, "A", b""),
    ]
    return [
        network(from_client=sent)
        / tcp(from_client=sent, seq=seq, ack=ack, flags=flags, port=port)
        / data
        for sent, seq, ack, flags, data in steps
    ]


def pcap(
    packets: Iterable[bytes],
    link_type: int = ETHERNET,
    *,
    order: str = "<",
    per_second: int = 10**9,
    cut_bytes: int = 1 << 16,
) -> bytes:
    magic = 0xA1B23C4D if per_second == 10**9 else 0xA1B2C3D4
    records = [struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, cut_bytes, link_type)]
    for number, packet in enumerate(packets):
        second, ns = divmod(START_NS + number * STEP_NS, 10**9)
        kept = packet[:cut_bytes]
        lengths = len(kept), len(packet)
        fraction = ns * per_second // 10**9
        records.append(struct.pack(order + "IIII", second, fraction, *lengths) + kept)
    return b"".join(records)


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    body += bytes(-len(body) % 4)
    length = struct.pack(order + "I", len(body) + 12)
    return struct.pack(order + "I", kind) + length + body + length


def option(code: int, value: bytes, order: str = "<") -> bytes:
    return struct.pack(order + "HH", code, len(value)) + value + bytes(-len(value) % 4)


def section(order: str = "<") -> bytes:
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(link_type: int = ETHERNET, resolution: int = 9, order: str = "<") -> bytes:
    options = option(2, b"eth0", order) + option(9, bytes([resolution]), order) + bytes(4)
    return block(1, struct.pack(order + "HHI", link_type, 0, 0) + options, order)


def enhanced_packet(
    packet: bytes, number: int, *, per_second: int = 10**9, order: str = "<", options: bytes = b""
) -> bytes:
    ticks = (START_NS + number * STEP_NS) * per_second // 10**9
    header = struct.pack(
        order + "IIIII", 0, ticks >> 32, ticks & 0xFFFFFFFF, len(packet), len(packet)
    )
    return block(6, header + packet + bytes(-len(packet) % 4) + options, order)


def pcapng(packets: Iterable[bytes], order: str = "<") -> bytes:
    return section(order) + b"".join(
        [
            interface(order=order),
            *(enhanced_packet(packet, at, order=order) for at, packet in enumerate(packets)),
        ]
    )


def frames(packets: Iterable[Packet]) -> list[bytes]:
    return [bytes(ether(packet)) for packet in packets]


def events_of(path: Path, content: bytes) -> list[WireEvent]:
    path.write_bytes(content)
    return list(read_pcap(path))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "capture"


@pytest.fixture
def scapy_log() -> Iterator[list[str]]:
    """Collect the log messages of scapy."""
    reported: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: reported.append(record.getMessage())  # type: ignore[method-assign]  # a handler of one line
    logger = logging.getLogger("scapy")
    logger.addHandler(handler)
    yield reported
    logger.removeHandler(handler)


def expected(addresses: str, resolution_ns: int = 1) -> list[WireEvent]:
    """Return the events of `conversation`, with times rounded down to `resolution_ns`."""

    def at(number: int) -> int:
        return (START_NS + number * STEP_NS) // resolution_ns * resolution_ns

    return [
        WireEvent(at(0), "1", A2C, Kind.OPENED, note=addresses),
        WireEvent(at(3), "1", A2C, Kind.BYTES, REQUEST),
        WireEvent(at(4), "1", C2A, Kind.BYTES, REPLY),
        WireEvent(at(5), "1", A2C, Kind.HALF_CLOSED),
        WireEvent(at(6), "1", C2A, Kind.HALF_CLOSED),
        WireEvent(at(6), "1", C2A, Kind.CLOSED),
    ]


OVER_IPV4 = expected("192.0.2.1:50000 → 192.0.2.2:8877")
OVER_IPV6 = expected("[2001:db8::1]:50000 → [2001:db8::2]:8877")


def ip6_with_extensions(*, from_client: bool) -> Packet:
    complete = IPv6ExtHdrFragment(offset=0, m=0, res2=3, nh=51)
    authentication = Raw(bytes([6, 4]) + bytes(22))  # then TCP; 24 bytes, counted as words less 2
    return ip6(from_client=from_client) / IPv6ExtHdrHopByHop() / complete / authentication


def outer_ip(protocol: int) -> Packet:
    return ether(IP(src="198.51.100.1", dst="198.51.100.2", proto=protocol))


def ethertype_of(packet: Packet) -> int:
    return 0x86DD if IPv6 in packet else 0x0800


def hsr(packet: Packet) -> Packet:
    tag = b"\x10\x2e\x00\x07" + ethertype_of(packet).to_bytes(2, "big")
    return Ether(type=0x892F, **MACS) / Raw(tag) / packet


@pytest.mark.parametrize(
    "wrap",
    [
        lambda packet: ether(Dot1AD(vlan=7) / Dot1Q(vlan=8) / Dot1Q(vlan=9) / packet),
        lambda packet: ether(PPPoE(sessionid=5) / PPP() / packet),
        lambda packet: (
            Dot3(**MACS)
            / LLC(dsap=0xAA, ssap=0xAA, ctrl=3)
            / SNAP(code=ethertype_of(packet))
            / packet
        ),
        hsr,
        lambda packet: (
            Ether(type=0x8847, **MACS) / MPLS(label=3, s=0) / MPLS(label=4, s=1) / packet
        ),
        lambda packet: outer_ip(47) / GRE(proto=ethertype_of(packet), key_present=1) / packet,
        lambda packet: outer_ip(47) / GRE(proto=0x6558) / ether(packet),
        lambda packet: outer_ip(17) / UDP(dport=4789) / VXLAN(vni=3) / ether(packet),
        lambda packet: outer_ip(17) / UDP(dport=6081) / GENEVE(proto=0x6558) / ether(packet),
        lambda packet: outer_ip(41 if IPv6 in packet else 4) / packet,
    ],
    ids=[
        *("three tags", "pppoe", "llc/snap", "hsr", "mpls", "gre", "gre bridge", "vxlan", "geneve"),
        "ip in ip",
    ],
)
def test_encapsulations(path: Path, wrap: Callable[[Packet], Packet]) -> None:
    """Tags and tunnels do not change the events."""
    for network, events in ((ip4, OVER_IPV4), (ip6, OVER_IPV6)):
        packets = [bytes(wrap(packet)) for packet in conversation(network)]
        assert events_of(path, pcap(packets)) == events


def test_packets_that_are_not_decoded_are_counted(path: Path) -> None:
    """The note has the name of the tunnel or of the link type."""
    mirrored = [
        bytes(outer_ip(47) / GRE(proto=0x88BE) / Raw(bytes(ether(packet))))
        for packet in conversation()
    ]
    path.write_bytes(pcap(mirrored))
    capture = read_pcap(path)
    assert not list(capture)
    assert capture.summary.notes[0] == "8 packets in ERSPAN are not decoded"
    path.write_bytes(pcap(mirrored, link_type=127))
    capture = read_pcap(path)
    assert not list(capture)
    assert "IEEE 802.11 with a radiotap header" in capture.summary.notes[0]


@pytest.mark.parametrize(
    ("link_type", "wrap"),
    [
        (ETHERNET, ether),
        (ETHERNET, lambda packet: ether(Dot1Q(vlan=7) / packet)),
        (ETHERNET, lambda packet: ether(Dot1AD(vlan=7) / Dot1Q(vlan=8) / packet)),
        (SLL, lambda packet: CookedLinux() / packet),
        (SLL, lambda packet: CookedLinux() / Dot1Q(vlan=7) / packet),
        (SLL2, lambda packet: CookedLinuxV2() / packet),
        (NULL, lambda packet: Loopback(type=0x1E if IPv6 in packet else 2) / packet),
        (LOOP, lambda packet: Loopback(type=0x18 if IPv6 in packet else 2) / packet),
        (RAW, lambda packet: packet),
    ],
    ids=["ethernet", "vlan", "q-in-q", "sll", "sll vlan", "sll2", "null", "loop", "raw"],
)
def test_link_types(path: Path, link_type: int, wrap: Callable[[Packet], Packet]) -> None:
    """The events do not depend on the link type."""
    for network, events in ((ip4, OVER_IPV4), (ip6, OVER_IPV6)):
        packets = [bytes(wrap(packet)) for packet in conversation(network)]
        assert events_of(path, pcap(packets, link_type)) == events


def test_ipv6_extension_headers(path: Path) -> None:
    """Extension headers are skipped, including that of an unfragmented packet."""
    assert events_of(path, pcap(frames(conversation(ip6_with_extensions)))) == OVER_IPV6


@pytest.mark.parametrize("link_type", [RAW4, RAW6])
def test_raw_ip_of_one_version(path: Path, link_type: int) -> None:
    """Link types for one version of IP are read like the one for both."""
    network, events = (ip4, OVER_IPV4) if link_type == RAW4 else (ip6, OVER_IPV6)
    packets = [bytes(packet) for packet in conversation(network)]
    assert events_of(path, pcap(packets, link_type)) == events


@pytest.mark.parametrize(
    "compress", [bytes, gzip.compress, zstandard.compress], ids=["plain", "gzip", "zstd"]
)
@pytest.mark.parametrize("order", ["<", ">"], ids=["little", "big"])
@pytest.mark.parametrize("per_second", [10**6, 10**9])
def test_pcap_files(
    path: Path, order: str, per_second: int, compress: Callable[[bytes], bytes]
) -> None:
    """Files with both byte orders and both resolutions are read, plain and compressed."""
    content = pcap(frames(conversation()), order=order, per_second=per_second)
    resolution_ns = 10**9 // per_second
    addresses = OVER_IPV4[0].note
    assert events_of(path, compress(content)) == expected(addresses, resolution_ns)


@pytest.mark.parametrize("order", ["<", ">"], ids=["little", "big"])
def test_pcapng_files(path: Path, order: str) -> None:
    """Files with both byte orders are read."""
    assert events_of(path, pcapng(frames(conversation()), order)) == OVER_IPV4


def test_pcapng_other_blocks_are_ignored(path: Path, scapy_log: list[str]) -> None:
    """Comments, statistics, names, secrets and unknown blocks change nothing."""
    comment = option(1, "a comment, 注释".encode()) + bytes(4)
    foreign = [
        block(4, bytes(8)),
        block(5, struct.pack("<III", 0, 0, 0) + comment),
        block(10, struct.pack("<II", 0x544C534B, 4) + b"none"),
        block(0x0BAD, b"who?"),
        block(0x80000001, struct.pack("<I", 77)),
    ]
    content = section() + interface()
    for number, packet in enumerate(frames(conversation())):
        content += foreign[number % len(foreign)]
        content += enhanced_packet(packet, number, options=comment)
    assert events_of(path, content) == OVER_IPV4
    assert scapy_log == []


def test_pcapng_sections_have_their_own_interfaces(path: Path) -> None:
    """Concatenated captures keep their link types and time units."""
    packets = frames(conversation())
    content = section(">") + interface(SLL, 6, ">") + section() + interface()
    content += b"".join(enhanced_packet(packet, at) for at, packet in enumerate(packets[:4]))
    content += section() + interface(ETHERNET, 6)
    content += b"".join(
        enhanced_packet(packet, at, per_second=10**6) for at, packet in enumerate(packets[4:], 4)
    )
    addresses = OVER_IPV4[0].note
    assert events_of(path, content) == [*OVER_IPV4[:2], *expected(addresses, 1000)[2:]]


def test_pcapng_interfaces_have_their_own_time_offset(path: Path) -> None:
    """The offset is added to the times."""
    packets, start_s = frames(conversation()), START_NS // 10**9
    resolution, offset = option(9, b"\x09"), option(14, struct.pack("<q", start_s))
    described = block(1, struct.pack("<HHI", ETHERNET, 0, 0) + resolution + offset + bytes(4))
    content = section() + described
    for number, packet in enumerate(packets):
        ticks = START_NS % 10**9 + number * STEP_NS
        size = len(packet)
        content += block(6, struct.pack("<IIIII", 0, 0, ticks, size, size) + packet)
    assert events_of(path, content) == OVER_IPV4


def test_a_pcapng_packet_without_interface(path: Path) -> None:
    """Its link type is unknown: the file is read up to there."""
    packets = [enhanced_packet(packet, at) for at, packet in enumerate(frames(conversation()))]
    begin = section() + interface() + b"".join(packets) + section()
    path.write_bytes(begin + packets[0])
    capture = read_pcap(path)
    assert list(capture) == OVER_IPV4
    note = f"the file is damaged at byte {len(begin)}: later packets were not read"
    assert capture.summary.notes == [note]


def test_pcapng_packets_without_time(path: Path) -> None:
    """A Simple Packet Block has no time: its events have the time of the event before."""
    first, *others = frames(conversation())
    simple = [block(3, struct.pack("<I", len(packet)) + packet) for packet in others]
    described = block(1, struct.pack("<HHI", ETHERNET, 0, 0))  # without a limit of their length
    content = section() + described + enhanced_packet(first, 0, per_second=10**6) + b"".join(simple)
    events = events_of(path, content)
    assert [event.kind for event in events] == [event.kind for event in OVER_IPV4]
    assert {event.time_ns for event in events} == {START_NS // 1000 * 1000}


def test_ethernet_padding_is_ignored(path: Path) -> None:
    """Short Ethernet frames are padded to 60 bytes."""
    packets = [frame.ljust(60, b"\xee") for frame in frames(conversation())]
    assert events_of(path, pcap(packets)) == OVER_IPV4


def test_packets_larger_than_the_length_field(path: Path) -> None:
    """With segmentation offload a packet may exceed the IP length field, which is then 0."""
    data = bytes(range(256)) * 300
    packets = conversation()[:3]
    large = IP(src=CLIENT, dst=CONTROLLER, len=0) / tcp(
        from_client=True, seq=101, ack=901, flags="A"
    )
    content = pcap([*frames(packets), bytes(ether(large)) + data], cut_bytes=1 << 18)
    assert events_of(path, content)[1:] == [
        WireEvent(START_NS + 3 * STEP_NS, "1", A2C, Kind.BYTES, data)
    ]


def test_a_short_snap_length_causes_gaps(path: Path) -> None:
    """Truncated bytes become gaps of the right length, and are noted."""
    path.write_bytes(pcap(frames(conversation()), cut_bytes=14 + 20 + 20 + 1))
    capture = read_pcap(path)
    printed = [(event.kind, event.data, event.length_bytes) for event in capture]
    assert printed[1:5] == [
        (Kind.BYTES, REQUEST[:1], 0),
        (Kind.GAP, b"", 3),
        (Kind.BYTES, REPLY[:1], 0),
        (Kind.GAP, b"", 5),
    ]
    assert capture.summary.notes == ["packets truncated by the capture; the rest is a gap: 2"]


def test_a_wrong_original_length(path: Path) -> None:
    """The length in the IP header shows how many bytes were truncated."""
    cut = [frame[: 14 + 20 + 20 + 1] for frame in frames(conversation())]
    gaps = [event for event in events_of(path, pcap(cut)) if event.kind is Kind.GAP]
    assert [event.length_bytes for event in gaps] == [3, 5]


def test_link_checksums_are_ignored(path: Path) -> None:
    """The upper bits of pcap's link type declare a checksum after each packet."""
    packets = [frame + b"\xaa\xcc\xaa\xcc" for frame in frames(conversation())]
    assert events_of(path, pcap(packets, 0x2400_0000 | ETHERNET)) == OVER_IPV4


def test_huge_times(path: Path) -> None:
    """They are limited to 64 bits."""
    content = section() + interface(resolution=0)
    # The time is in nanoseconds, but the unit is seconds.
    content += enhanced_packet(frames(conversation())[0], 0)
    (event,) = events_of(path, content)
    assert event.time_ns == 2**63 - 1


def test_truncated_headers_are_noted(path: Path) -> None:
    """The TCP header is incomplete."""
    path.write_bytes(pcap(frames(conversation()), cut_bytes=14 + 20 + 19))
    capture = read_pcap(path)
    assert list(capture) == []
    assert capture.summary.notes[0] == "packets not read: headers are cut off: 8"


@pytest.mark.parametrize("version", [4, 6])
def test_fragments(path: Path, version: int) -> None:
    """They are combined in any order; without one of them the content is a gap."""
    packets = conversation(ip4 if version == 4 else ip6)
    request = packets[3][TCP]
    if version == 4:
        head = IP(src=CLIENT, dst=CONTROLLER, proto=6, flags="MF", id=7)
        first: Packet = head / bytes(request)[:16]
        second: Packet = IP(src=CLIENT, dst=CONTROLLER, proto=6, frag=2, id=7) / bytes(request)[16:]
    else:
        first = ip6(from_client=True) / IPv6ExtHdrFragment(m=1, nh=6, id=7) / bytes(request)[:16]
        second = (
            ip6(from_client=True) / IPv6ExtHdrFragment(offset=2, nh=6, id=7) / bytes(request)[16:]
        )
    for parts in ((first, second), (second, first), (first, first, second)):
        content = pcap(frames([*packets[:3], *parts, *packets[4:]]))
        found = [(event.kind, event.data) for event in events_of(path, content)]
        assert found == [(event.kind, event.data) for event in OVER_IPV4]
    path.write_bytes(pcap(frames([*packets[:3], first, *packets[4:]])))
    capture = read_pcap(path)
    (gap,) = [event for event in capture if event.kind is Kind.GAP]
    assert (gap.direction, gap.offset_bytes, gap.length_bytes) == (A2C, 0, 4)
    assert capture.summary.notes == ["IP packets not read, because fragments are missing: 1"]


def test_impossible_headers_are_noted(path: Path) -> None:
    """Contradictory lengths are not used."""
    short_ip, short_tcp, long_tcp = (bytearray(frame) for frame in frames(conversation()[3:4] * 3))
    short_ip[14] = 0x44  # an IP header of 16 bytes
    short_tcp[14 + 20 + 12] = 0x40  # a TCP header of 16 bytes
    long_tcp[14 + 20 + 12] = 0xF0  # a TCP header beyond the packet
    path.write_bytes(pcap(map(bytes, [short_ip, short_tcp, long_tcp])))
    capture = read_pcap(path)
    assert list(capture) == []
    assert capture.summary.notes[0] == "packets not read: headers contradict each other: 3"


def test_other_traffic_is_ignored(path: Path) -> None:
    """ARP, UDP, other protocols over IPv6, and invalid IP versions."""
    others = [
        ether(Packet()) / b"?",
        ether(IP(src=CLIENT, dst=CONTROLLER) / UDP(sport=8877, dport=8877)),
        ether(IPv6(src=CLIENT6, dst=CONTROLLER6) / UDP(sport=8877, dport=8877)),
    ]
    arp = bytes(12) + b"\x08\x06" + bytes(28)
    no_version = bytes(12) + b"\x08\x00" + bytes(28)
    packets = [*(bytes(other) for other in others), arp, no_version]
    path.write_bytes(pcap([*packets, *frames(conversation())]))
    capture = read_pcap(path)
    assert [event.kind for event in capture] == [event.kind for event in OVER_IPV4]
    assert capture.summary.packets == 13
    assert capture.summary.segments == 8
    assert capture.summary.notes == []


def test_unknown_link_types_are_noted(path: Path) -> None:
    """The note has the link type."""
    path.write_bytes(pcap(frames(conversation()), link_type=147))
    capture = read_pcap(path)
    assert list(capture) == []
    assert capture.summary.notes == [
        "8 packets in link type 147 are not decoded",
        "no TCP connection on port 8877 among 8 packets",
    ]


def test_port_filter(path: Path) -> None:
    """Connections without the port are ignored; those of this protocol are named."""
    path.write_bytes(pcap(frames(conversation(port=9000))))
    for port in (8877, 9000, None):
        assert len(list(read_pcap(path, port=port))) == len(OVER_IPV4)
    capture = read_pcap(path, port=8878)
    assert list(capture) == []
    (note,) = capture.summary.notes
    assert note.startswith("no TCP connection on port 8878 among 8 packets: ")
    assert note.endswith("there are connections of this protocol (port 9000)")


def test_connections_of_other_protocols(path: Path) -> None:
    """They are reported with their ports; only the connection of this protocol is read."""
    http = [
        bytes(ether(IP(src=CLIENT, dst=CONTROLLER) / TCP(sport=5, dport=port, flags=flags) / data))
        for port in (80, 8080)
        for flags, data in (("S", b""), ("A", b"GET / HTTP/1.1"))
    ]
    path.write_bytes(pcap([*http, *frames(conversation(port=9000))]))
    for port in (8877, None):
        capture = read_pcap(path, port=port)
        assert [event.data for event in capture if event.data] == [REQUEST, REPLY]
        others = "2 connections are not of this protocol (ports 80, 8080): not judged"
        assert capture.summary.notes[-1] == others


def test_packets_out_of_order_are_noted(path: Path) -> None:
    """Swapped packets only cause a note."""
    packets = frames(conversation())
    blocks = [enhanced_packet(packet, at) for at, packet in enumerate(packets)]
    blocks[3], blocks[4] = blocks[4], blocks[3]
    path.write_bytes(section() + interface() + b"".join(blocks))
    capture = read_pcap(path)
    assert list(capture) == OVER_IPV4
    assert capture.summary.notes == ["packets not in the order of time: 1"]


def test_a_clock_set_back_is_noted(path: Path) -> None:
    """Later packets keep their order, and there is a note."""
    packets = frames(conversation())
    hour = 3600 * 10**9 // STEP_NS
    blocks = [enhanced_packet(packet, at - hour * (at > 4)) for at, packet in enumerate(packets)]
    path.write_bytes(section() + interface() + b"".join(blocks))
    capture = read_pcap(path)
    bytes_of = [event.data for event in capture if event.data]
    assert bytes_of == [event.data for event in OVER_IPV4 if event.data]
    (note,) = capture.summary.notes
    assert note.startswith("the capture clock was set once")


def test_a_capture_can_be_read_twice(path: Path) -> None:
    """The summary is that of the last iteration."""
    path.write_bytes(pcap(frames(conversation())))
    capture = read_pcap(path)
    assert list(capture) == list(capture) == OVER_IPV4
    assert (capture.summary.packets, capture.summary.connections) == (8, 1)


@pytest.mark.parametrize("write", [pcap, pcapng])
def test_a_truncated_file(
    path: Path, write: Callable[[list[bytes]], bytes], scapy_log: list[str]
) -> None:
    """Truncated at any byte: the events of the complete records, and a note with the position."""
    packets = frames(conversation())
    ends = [len(write(packets[:count])) for count in range(len(packets) + 1)]
    content = write(packets)
    for length in range(ends[0], len(content) + 1):
        path.write_bytes(content[:length])
        capture = read_pcap(path)
        list(capture)
        complete = sum(end <= length for end in ends) - 1
        assert capture.summary.packets == complete
        note = f"the file is damaged at byte {ends[complete]}: later packets were not read"
        assert (note in capture.summary.notes) == (length not in ends)
    assert scapy_log == []


def test_a_truncated_zstd_file(path: Path) -> None:
    """The file is reported as incomplete; two compressed frames are one file."""
    content = pcap(frames(conversation()) * 500)
    packed = zstandard.compress(content[:200_000]) + zstandard.compress(content[200_000:])
    path.write_bytes(packed)
    capture = read_pcap(path)
    assert list(capture) == OVER_IPV4
    assert (capture.summary.packets, capture.summary.whole) == (4000, True)
    path.write_bytes(packed[:-20])
    assert list(capture) == OVER_IPV4
    assert not capture.summary.whole
    assert "is damaged at byte" in capture.summary.notes[-1]


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (bytes.fromhex("34cdb2a1"), "is a modified pcap file: convert it with editcap -F pcapng"),
        (b"snoop\0\0\0", "is a snoop file: convert it with editcap"),
        (b"GMBU", "is a Network Monitor file: convert it with editcap"),
        (bytes.fromhex("00000000 0068ec65 02 04 0060 0000 0050"), "is an ERF file: convert"),
        (b"\xfd7zXZ\0", "is compressed: decompress it with xz -dk"),
        (gzip.compress(b"\x89MCAP0\r\n" + bytes(9), mtime=0), "decompress it with gzip -dk"),
    ],
)
def test_other_formats_are_named(path: Path, head: bytes, message: str) -> None:
    """The message has the command that converts the file."""
    path.write_bytes(head + bytes(100))
    with pytest.raises(CaptureError, match=message):
        read_pcap(path)


def test_a_truncated_compressed_file(path: Path) -> None:
    """The note is that of a plain file."""
    path.write_bytes(gzip.compress(pcap(frames(conversation())), mtime=0)[:-20])
    capture = read_pcap(path)
    list(capture)
    assert "is damaged" in capture.summary.notes[0]


def test_a_huge_record_length(path: Path) -> None:
    """A record of gigabytes is not read into memory."""
    packets = frames(conversation())
    giants = [
        (pcap(packets), struct.pack("<IIII", 0, 0, 0xFFFFFFF0, 0xFFFFFFF0)),
        (pcapng(packets), struct.pack("<II", 6, 0xFFFFFFF0)),
    ]
    for content, giant in giants:
        path.write_bytes(content + giant + bytes(64))
        capture = read_pcap(path)
        assert list(capture) == OVER_IPV4
        assert "is damaged" in capture.summary.notes[0]
    file: Any = io.BufferedReader(io.BytesIO(b"?"))
    source = _Source(file, file, PcapSummary())
    assert source.read(_MAX_RECORD_BYTES + 1) == b""
    assert source.read(_MAX_RECORD_BYTES) == b"?"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is not a capture: neither MCAP, pcap nor pcapng"),
        (b"\x0a\x0d", "is not a capture: neither MCAP, pcap nor pcapng"),
        (b"an mcap file, say", "is not a capture: neither MCAP, pcap nor pcapng"),
        (
            gzip.compress(gzip.compress(b"?", mtime=0), mtime=0),
            "is not a capture: neither MCAP, pcap nor pcapng",
        ),
        (pcap([])[:23], "is damaged in its first bytes"),
        (pcapng([])[:12], "is damaged in its first bytes"),
        (b"\x1f\x8b\x08", "is damaged in its first bytes"),
    ],
)
def test_no_capture(path: Path, content: bytes, reason: str) -> None:
    """A file of another type is refused in one sentence with its name."""
    path.write_bytes(content)
    with pytest.raises(CaptureError) as refusal:
        read_pcap(path)
    assert str(refusal.value) == f"{path} {reason}"


def test_a_missing_file(path: Path) -> None:
    """The error has the file name and the reason of the system."""
    with pytest.raises(CaptureError, match="cannot be read: No such file or directory"):
        read_pcap(path)


def test_missing_scapy(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error has the command that installs the extra."""
    monkeypatch.setitem(sys.modules, "scapy.utils", None)
    with pytest.raises(CaptureError) as refusal:
        read_pcap(path)
    assert str(refusal.value) == "reading pcap files needs scapy: pip install 'scaraspec[pcap]'"


COMPLETE_FILES = [pcap(frames(conversation())), pcapng(frames(conversation()))]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # the file is overwritten
@given(
    complete=st.sampled_from(COMPLETE_FILES),
    damage=st.lists(st.tuples(st.integers(0, 1000), st.binary(max_size=4)), min_size=1, max_size=5),
    port=st.sampled_from([8877, None]),
)
def test_any_damage(
    path: Path, complete: bytes, damage: list[tuple[int, bytes]], port: int | None
) -> None:
    """With any wrong bytes, a file is read up to the damage or refused in one sentence."""
    content = bytearray(complete)
    for at, replacement in damage:
        content[at : at + 4] = replacement
    path.write_bytes(content)
    try:
        capture = read_pcap(path, port=port)
    except CaptureError:
        return
    times = [event.time_ns for event in capture]
    assert times == sorted(times)
