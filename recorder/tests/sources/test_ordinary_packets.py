"""Ordinary packets are read in a short way, which gives the same result as the general one."""

import gzip
import random
import struct
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from difficult_captures import RAW_IP, packet_of
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder import tcp_segment
from scaraspec_recorder.encapsulation import UnreadablePacket
from scaraspec_recorder.ip_fragments import FragmentBuffer
from scaraspec_recorder.sources import pcap_reader
from scaraspec_recorder.sources.pcap_reader import read_pcap
from scaraspec_recorder.sources.reassembly import Limits, Reassembler
from scaraspec_recorder.tcp_segment import ACK, FIN, RST, SYN, Endpoint, Segment, dissect

PORT, SECOND_NS = 8877, 10**9
CONTROLLER = Endpoint(bytes((192, 0, 2, 1)), PORT)
LINKS = {
    1: bytes(12) + b"\x08\x00",
    RAW_IP: b"",
    113: bytes(14) + b"\x08\x00",
    276: b"\x08\x00" + bytes(18),
}
"""Link headers before IPv4, by link type."""


class GeneralReassembler(Reassembler):
    """A reassembler without the short way."""

    def _receive_in_order(self, segment: Segment) -> list[WireEvent] | None:  # noqa: ARG002 - none is in order
        return None


def conversation(client: Endpoint, start: int, sizes: Iterable[int]) -> Iterator[Segment]:
    """Yield a connection: requests and replies of these sizes, acknowledged, and its end."""
    ends, numbers = (client, CONTROLLER), [start, start + 77]

    def sent(at: int, flags: int, data: bytes = b"") -> Segment:
        ack = numbers[1 - at] if flags & ACK else 0
        segment = Segment(0, ends[at], ends[1 - at], numbers[at], ack, flags, data)
        numbers[at] += len(data) + bool(flags & (SYN | FIN))
        return segment

    yield sent(0, SYN)
    yield sent(1, SYN | ACK)
    yield sent(0, ACK)
    for turn, size in enumerate(sizes):
        at = turn % 2
        yield sent(at, ACK, bytes((0xAA, 0xCC, turn % 256))[:size] * size)
        if size % 3:
            yield sent(1 - at, ACK)
    yield sent(0, ACK | FIN)
    yield sent(1, ACK | FIN)
    yield sent(0, ACK)


def capture(seed: int) -> list[Segment]:
    """Return a capture of several connections; many have losses, repetitions or other ends."""
    dice = random.Random(seed)
    talks = []
    for number in range(dice.randint(1, 3)):
        client = Endpoint(bytes((192, 0, 2, 9)), 40000 + dice.choice((number, 0)))
        start = dice.choice((1000, 2**32 - 20, 2**32 - 200))
        sizes = [dice.randint(1, 12) for _ in range(dice.randint(0, 30))]
        talks.append(list(conversation(client, start, sizes)))
    segments = []
    while any(talks):
        talk = dice.choice([each for each in talks if each])
        segments.append(talk.pop(0))
        if not dice.randint(0, 40):
            talk.clear()
    changed = [again for each in segments for again in _change(each, dice)]
    if dice.random() < 0.3:
        changed = changed[dice.randint(0, len(changed)) :]
    return list(_timed(changed, dice))


def _change(segment: Segment, dice: random.Random) -> Iterator[Segment]:
    """Yield the segment, or what a difficult link or a lossy capture makes of it."""
    data, chance = segment.payload, dice.random()
    if chance > 0.15:
        yield segment
    elif chance > 0.12:
        yield from (segment, segment)
    elif chance > 0.09 and data:
        cut = dice.randint(0, len(data))
        yield segment._replace(payload=data[:cut])
        yield segment._replace(seq=segment.seq + cut, payload=data[cut:])
    elif chance > 0.07:
        yield segment._replace(corrupt=bool(data))
        yield from [segment] * dice.randint(0, 1)
    elif chance > 0.06:
        yield segment._replace(seq=segment.seq - 1, payload=data[:1])
    elif chance > 0.05 and data:
        yield segment
        yield segment._replace(payload=bytes(len(data)))
    elif chance > 0.045:
        yield segment._replace(flags=segment.flags | dice.choice((RST, FIN)))
    elif chance > 0.04 and data:
        yield segment._replace(payload=data[:-1], cut_bytes=1)
    elif chance > 0.035:
        yield segment._replace(ack=segment.ack + dice.choice((1, 5, 1 << 25)))


def _timed(segments: list[Segment], dice: random.Random) -> Iterator[Segment]:
    time_ns = 1_700_000_000 * SECOND_NS
    for number, segment in enumerate(segments, 1):
        steps = (1000, 10**6, 0, -5000, -5 * SECOND_NS, 90 * SECOND_NS)
        time_ns += dice.choices(steps, (60, 30, 5, 3, 1, 1))[0]
        yield segment._replace(
            time_ns=time_ns if dice.random() > 0.01 else 0,
            packet=number,
            seq=segment.seq % 2**32,
            ack=segment.ack % 2**32,
        )


def swapped(segments: list[Segment], dice: random.Random) -> list[Segment]:
    """Swap some neighbours."""
    result = list(segments)
    for at, _ in pairwise(range(len(result))):
        if dice.random() < 0.03:
            result[at : at + 2] = result[at + 1], result[at]
    return result


def outcome(reassembler: Reassembler, segments: list[Segment]) -> Any:
    """Return the events of each segment, and all counters."""
    events = [reassembler.receive(segment) for segment in segments] + [reassembler.finish()]
    return (
        [(event, event.packet) for some in events for event in some],
        list(map(len, events)),
        reassembler.connections,
        reassembler.clock_steps,
        reassembler.far_segments,
        reassembler.corrupt_segments,
        reassembler.conflicts,
        reassembler.unreliable,
    )


@given(seed=st.integers(0, 2**32), late=st.sampled_from((0, 3, 256)))
@settings(max_examples=300)
def test_segments_in_order(seed: int, late: int) -> None:
    """The events come with the same segments, and all counters are equal."""
    segments = swapped(capture(seed), random.Random(seed))
    limits = Limits(late_segments=late, connections=2)
    general = outcome(GeneralReassembler(limits=limits), segments)
    assert outcome(Reassembler(limits=limits), segments) == general


def dissected(packets: list[tuple[int, bytes]]) -> list[Any]:
    """Return what is read of each packet."""
    found: list[Any] = []
    for number, (link, packet) in enumerate(packets, 1):
        try:
            found.append(dissect(1, link, packet, len(packet), FragmentBuffer(), number=number))
        except UnreadablePacket as error:
            found.append(f"{error}")
    return found


@given(seed=st.integers(0, 2**32))
@settings(max_examples=200)
def test_packets(seed: int) -> None:
    """Whatever the bytes of a packet are, the same segment is read, or the same reason given."""
    dice = random.Random(seed)
    packets = []
    for segment in capture(seed)[:20]:
        link, head = dice.choice(list(LINKS.items()))
        packet = bytearray(head + packet_of(segment) + bytes(dice.choice((0, 0, 6))))
        for _ in range(dice.choice((0, 1, 3))):
            packet[dice.randrange(min(len(packet), 60))] = dice.randrange(256)
        packets.append((link, bytes(packet[: dice.choice((len(packet), dice.randrange(80)))])))
    short = dissected(packets)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tcp_segment, "_ordinary", lambda *_: None)
        assert dissected(packets) == short


def pcap(packets: list[tuple[int, bytes]], order: str) -> bytes:
    """Return a pcap file."""
    parts = [struct.pack(f"{order}IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 1 << 18, RAW_IP)]
    for time_ns, packet in packets:
        seconds, micros = divmod(time_ns // 1000, 10**6)
        parts += (struct.pack(f"{order}4I", seconds, micros, *[len(packet)] * 2), packet)
    return b"".join(parts)


def block(order: str, kind: int, body: bytes) -> bytes:
    """Return a block of a pcapng file."""
    size = len(body) + -len(body) % 4 + 12
    return (
        struct.pack(f"{order}II", kind, size)
        + body.ljust(size - 12, b"\0")
        + struct.pack(f"{order}I", size)
    )


def pcapng(packets: list[tuple[int, bytes]], order: str) -> bytes:
    """Return a pcapng file of two sections, in which some packets have a comment."""
    half = len(packets) // 2
    parts: list[bytes] = []
    for some in (packets[:half], packets[half:]):
        head = struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1)
        interface = struct.pack(f"{order}HHI", RAW_IP, 0, 0)
        parts += (block(order, 0x0A0D0D0A, head), block(order, 1, interface))
        for number, (time_ns, packet) in enumerate(some):
            high, low = divmod(time_ns // 1000, 2**32)
            body = struct.pack(f"{order}5I", 0, high, low, *[len(packet)] * 2)
            body += packet.ljust(len(packet) + -len(packet) % 4, b"\0")
            if number % 5 == 4:
                body += struct.pack(f"{order}HH4sHH", 1, 4, b"note", 0, 0)
            parts.append(block(order, 6, body))
    return b"".join(parts)


def read(path: Path) -> Any:
    """Return the events and the summary of a file."""
    found = read_pcap(path, port=PORT)
    events = [(event, event.packet) for event in found]
    return events, found.summary.packets, found.summary.notes, found.summary.complete


@given(seed=st.integers(0, 2**32), packed=st.booleans())
@settings(max_examples=150)
def test_files(tmp_path_factory: pytest.TempPathFactory, seed: int, packed: bool) -> None:  # noqa: FBT001 - drawn
    """Intact, cut off or damaged anywhere: the same packets and notes."""
    dice = random.Random(seed)
    packets = [(segment.time_ns, packet_of(segment)) for segment in capture(seed)]
    make = dice.choice((pcap, pcapng))
    content = bytearray(make(packets, dice.choice("<>")))
    for _ in range(dice.choice((0, 0, 1, 2))):
        content[dice.randrange(len(content))] = dice.randrange(256)
    data = bytes(content[: dice.choice((len(content), dice.randrange(40, len(content) + 40)))])
    if packed:
        data = gzip.compress(data)
        data = data[: dice.choice((len(data), dice.randrange(20, len(data))))]
    path = tmp_path_factory.getbasetemp() / "capture"
    path.write_bytes(data)
    try:
        short = read(path)
    except Exception as error:  # noqa: BLE001 - the general way must raise the same
        short = repr(error)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("_ordinary_pcap", "_ordinary_pcapng"):
            patch.setattr(pcap_reader, name, lambda *_: iter(()))
        patch.setattr(pcap_reader, "_READ_AHEAD_BYTES", dice.choice((1, 100, 1 << 16)))
        try:
            general = read(path)
        except Exception as error:  # noqa: BLE001 - see above
            general = repr(error)
    assert short == general
