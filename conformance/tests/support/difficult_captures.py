"""Captures over difficult links, and captures with losses, made of a capture from the field.

Each maker takes the TCP segments of a capture and returns those of another one. Over a difficult
link nothing is missing. `python difficult_captures.py FOLDER` writes all of them as pcap files.
"""

import random
import struct
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from scaraspec_recorder.ip_fragments import FragmentBuffer
from scaraspec_recorder.sources.pcap_reader import PcapSummary, _records
from scaraspec_recorder.tcp_segment import FIN, RST, SYN, Endpoint, Segment, dissect

SOURCE = Path(__file__).parents[3] / "fixtures/captures/field/plant-a-morning-shift.pcapng"
HOUR_NS = 3600 * 10**9
_NUMBERS = 1 << 32
RAW_IP = 101

Maker = Callable[[list[Segment]], Iterable[Segment]]


def read(path: Path) -> list[Segment]:
    """Read the segments of a capture."""
    fragments = FragmentBuffer()
    found = (dissect(*record, fragments) for record in _records(path, PcapSummary()))
    return [segment for segment in found if segment]


def write(path: Path, segments: Iterable[Segment]) -> None:
    """Write segments as pcap: raw IP, with right checksums except in corrupt segments."""
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 1 << 18, RAW_IP))
        for segment in segments:
            packet = packet_of(segment)
            seconds, nanoseconds = divmod(segment.time_ns, 10**9)
            sizes = len(packet), len(packet) + segment.cut_bytes
            file.write(struct.pack("<IIII", seconds, nanoseconds, *sizes) + packet)


def packet_of(segment: Segment) -> bytes:
    """Return a segment as an IP packet."""
    src, dst = segment.src, segment.dst
    numbers = src.port, dst.port, segment.seq % _NUMBERS, segment.ack % _NUMBERS
    tcp = struct.pack(">HHIIBBHHH", *numbers, 0x50, segment.flags, 8000, 0, 0) + segment.payload
    size_bytes = len(tcp) + segment.cut_bytes
    pseudo = src.address + dst.address + struct.pack(">HH", 6, size_bytes)
    checksum = (_sum(pseudo + tcp) + 0x1111 * segment.corrupt) % 0xFFFF
    tcp = tcp[:16] + struct.pack(">H", 0xFFFF - checksum) + tcp[18:]
    if len(src.address) == 16:
        head = struct.pack(">IHBB", 6 << 28, size_bytes, 6, 64)
    else:
        head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + size_bytes, 0, 0, 64, 6, 0)
    return head + src.address + dst.address + tcp


def _sum(data: bytes) -> int:
    return int.from_bytes(data + b"\0" * (len(data) % 2)) % 0xFFFF


def is_data(segment: Segment) -> bool:
    """Whether a segment has payload."""
    return bool(segment.payload)


def _from_client(segment: Segment) -> bool:
    return segment.dst.port == 8877


def _each(change: Callable[[int, Segment], Iterable[Segment]]) -> Maker:
    return lambda segments: [s for n, each in enumerate(segments) for s in change(n, each)]


def _split(segment: Segment, size_bytes: int) -> Iterator[Segment]:
    """Yield the segment in pieces; a FIN is in the last one."""
    data = segment.payload
    for at in range(0, max(len(data), 1), size_bytes):
        last = at + size_bytes >= len(data)
        flags = segment.flags if last else segment.flags & ~FIN
        yield segment._replace(
            seq=segment.seq + at, payload=data[at : at + size_bytes], flags=flags
        )


def _probe(segment: Segment) -> Iterator[Segment]:
    """Yield one byte, which a receiver without room for more gets, then the rest."""
    yield segment._replace(payload=segment.payload[:1], flags=segment.flags & ~FIN)
    yield segment._replace(seq=segment.seq + 1, payload=segment.payload[1:])


def _swapped(segments: list[Segment]) -> Iterator[Segment]:
    for at in range(0, len(segments), 3):
        yield from (*segments[at + 1 : at + 2], segments[at], *segments[at + 2 : at + 3])


def _late(segments: list[Segment]) -> list[Segment]:
    moved = list(segments)
    for at in (30, 60, 90, 120):
        moved.insert(at + 15, moved.pop(at))
    return moved


def _keep_alives(segments: list[Segment]) -> Iterator[Segment]:
    for segment, following in pairwise((*segments, segments[-1])):
        yield segment
        if is_data(segment) and following.time_ns > segment.time_ns:
            seq = segment.seq + len(segment.payload) - 1
            yield segment._replace(seq=seq, payload=b"\0", time_ns=segment.time_ns + 1)


def _joined(segments: list[Segment]) -> Iterator[Segment]:
    """Yield segments as a network card delivers them: neighbours of one stream in one."""
    waiting: Segment | None = None
    for segment in segments:
        if waiting:
            follows = (waiting.src, waiting.dst, waiting.seq + len(waiting.payload))
            if is_data(segment) and follows == (segment.src, segment.dst, segment.seq):
                waiting = segment._replace(
                    seq=waiting.seq, payload=waiting.payload + segment.payload
                )
                continue
            yield waiting
        waiting = segment
    if waiting:
        yield waiting


def _set_clock(step_ns: int) -> Maker:
    """The clock is set between a request and its reply, in the middle of the capture."""

    def make(segments: list[Segment]) -> list[Segment]:
        middle = next(
            n
            for n in range(len(segments) // 2, len(segments))
            if is_data(segments[n - 1]) and _from_client(segments[n - 1])
        )
        return [
            s._replace(time_ns=s.time_ns + step_ns * (n >= middle)) for n, s in enumerate(segments)
        ]

    return make


def _ipv6(_: int, segment: Segment) -> list[Segment]:
    src, dst = (Endpoint(bytes(12) + end.address, end.port) for end in (segment.src, segment.dst))
    return [segment._replace(src=src, dst=dst)]


def _moved_numbers(segments: list[Segment]) -> list[Segment]:
    """Sequence numbers that begin again at 0 in the middle of each stream."""
    first: dict[tuple[Endpoint, Endpoint], int] = {}
    for s in segments:
        first.setdefault((s.src, s.dst), s.seq)
    shift = {way: (_NUMBERS - 100 - seq) % _NUMBERS for way, seq in first.items()}
    return [
        s._replace(
            seq=(s.seq + shift[s.src, s.dst]) % _NUMBERS,
            ack=(s.ack + shift.get((s.dst, s.src), 0)) % _NUMBERS,
        )
        for s in segments
    ]


LINKS: dict[str, Maker] = {
    "repeated": _each(lambda n, s: [s, s] if n % 5 == 0 and is_data(s) else [s]),
    "repeated-in-part": _each(
        lambda _, s: [
            s,
            *([s._replace(seq=s.seq + 2, payload=s.payload[2:])] if len(s.payload) > 2 else []),
        ]
    ),
    "swapped": _swapped,
    "late": _late,
    "bytewise": _each(lambda _, s: _split(s, 1)),
    "small-segments": _each(lambda _, s: _split(s, 7)),
    "joined": _joined,
    "keep-alives": _keep_alives,
    "window-probes": _each(lambda _, s: _probe(s) if len(s.payload) > 1 else [s]),
    "stray-segments": _each(
        lambda n, s: [s, s._replace(seq=s.seq + (1 << 30))] if n % 9 == 4 and is_data(s) else [s]
    ),
    "corrupt-copies": _each(
        lambda n, s: (
            [s._replace(payload=s.payload[::-1], corrupt=True), s]
            if n > 20 and n % 7 == 0 and is_data(s)
            else [s]
        )
    ),
    "checksum-offload": _each(lambda _, s: [s._replace(corrupt=_from_client(s))]),
    "clock-set-back": _set_clock(-HOUR_NS),
    "clock-set-forward": _set_clock(HOUR_NS),
    "coarse-clock": _each(lambda _, s: [s._replace(time_ns=s.time_ns // 10**9 * 10**9)]),
    "without-acknowledgments": _each(
        lambda _, s: [s] if is_data(s) or s.flags & (SYN | FIN | RST) else []
    ),
    "half-open-before": lambda segments: [
        segments[0]._replace(seq=segments[0].seq + 12345, time_ns=segments[0].time_ns - 10**9),
        *segments,
    ],
    "reset-with-text": _each(
        lambda _, s: [s._replace(payload=b"connection aborted")] if s.flags & RST else [s]
    ),
    "numbers-begin-again": _moved_numbers,
    "ipv6": _each(_ipv6),
    "ends-early": lambda segments: segments[:150],
}
"""Nothing is missing: the verdict is that of the source."""


def lose(choose: Callable[[int, Segment], bool]) -> Maker:
    """Return a maker that drops the chosen segments."""
    return _each(lambda n, s: [] if choose(n, s) else [s])


def lose_share(seed: int, share: float) -> Maker:
    """Return a maker that drops a share of the segments, drawn with a seed."""

    def make(segments: list[Segment]) -> list[Segment]:
        drawn = random.Random(seed)
        return [s for s in segments if drawn.random() >= share]

    return make


def _nth(number: int, matches: Callable[[Segment], bool]) -> Maker:
    def make(segments: list[Segment]) -> list[Segment]:
        at = [n for n, s in enumerate(segments) if matches(s)][number]
        return segments[:at] + segments[at + 1 :]

    return make


def _is_request(segment: Segment) -> bool:
    return is_data(segment) and _from_client(segment)


def _is_reply(segment: Segment) -> bool:
    return is_data(segment) and not _from_client(segment)


LOSSES: dict[str, Maker] = {
    "login-lost": _nth(0, _is_request),
    "login-reply-lost": _nth(0, _is_reply),
    "query-lost": _nth(5, _is_request),
    "query-reply-lost": _nth(5, _is_reply),
    "chunk-lost": _nth(0, lambda s: _is_request(s) and len(s.payload) > 200),
    "chunk-of-a-download-lost": _nth(0, lambda s: _is_reply(s) and len(s.payload) > 200),
    "acceptance-lost": _nth(0, lambda s: s.payload[:3] == b"\xcc\x30\x01"),
    "final-result-lost": _nth(0, lambda s: s.payload[:3] == b"\xcc\x90\x30"),
    "burst-lost": lose(lambda n, _: 60 <= n < 75),
    "begins-late": lambda segments: segments[47:],
    "client-only": lose(lambda _, s: not _from_client(s)),
    "controller-only": lose(lambda _, s: _from_client(s)),
    "cut-packets": _each(
        lambda _, s: [s._replace(payload=s.payload[:80], cut_bytes=len(s.payload[80:]))]
    ),
    "lost-1-percent-a": lose_share(6, 0.01),
    "lost-1-percent-b": lose_share(5, 0.01),
    "lost-5-percent": lose_share(1, 0.05),
    "lost-20-percent": lose_share(2, 0.2),
}
"""Something is missing: no violation is found in what was recorded."""


def main(arguments: Sequence[str]) -> None:
    """Write all captures into a folder."""
    folder = Path(arguments[0])
    for kind, makers in (("links", LINKS), ("losses", LOSSES)):
        for name, make in makers.items():
            (folder / kind).mkdir(parents=True, exist_ok=True)
            write(folder / kind / f"{name}.pcap", make(read(SOURCE)))


if __name__ == "__main__":
    main(sys.argv[1:])
