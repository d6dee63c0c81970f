"""A recording that is written as packets gives the same recording when it is read."""

import io
from collections import defaultdict
from ipaddress import IPv6Address
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.pcapng_writer import PcapngWriter

pcap = pytest.importorskip("scaraspec_recorder.sources.pcap_reader")
pytest.importorskip("scapy")

MAPPED = IPv6Address("::ffff:192.0.2.7")
WAY = "192.0.2.20:51234 > 192.0.2.7:8877"
START_NS = 1_795_215_517_000_000_001
DIRECTIONS = st.sampled_from(list(Direction))


def write_and_read(
    events: list[WireEvent], path: Path, port: int = DEFAULT_PORT
) -> list[WireEvent]:
    """Write the events, and read them again."""
    with path.open("wb") as file:
        writer = PcapngWriter(file)
        for event in events:
            writer.write(event)
    capture = pcap.read_pcap(path, port=port)
    found = list(capture)
    assert not capture.summary.notes
    return found


def streams(events: list[WireEvent]) -> dict[tuple[str, Direction], list[tuple[int, bytes]]]:
    """Return the runs of bytes of each stream, with their offsets."""
    runs: dict[tuple[str, Direction], list[tuple[int, bytes]]] = defaultdict(list)
    for event in events:
        if event.kind is Kind.BYTES:
            stream = runs[event.connection, event.direction]
            if stream and stream[-1][0] + len(stream[-1][1]) == event.offset_bytes:
                stream[-1] = (stream[-1][0], stream[-1][1] + event.data)
            else:
                stream.append((event.offset_bytes, event.data))
    return dict(runs)


@st.composite
def conversations(draw: st.DrawFn) -> list[WireEvent]:
    """Draw up to three simultaneous connections with bytes and gaps of all sizes."""
    events = [
        WireEvent(START_NS, str(number), A2C, Kind.OPENED, note=WAY.replace("234", f"23{number}"))
        for number in range(1, draw(st.integers(1, 3)) + 1)
    ]
    names = [event.connection for event in events]
    offsets: dict[tuple[str, Direction], int] = defaultdict(int)
    sizes = st.one_of(st.integers(1, 300), st.sampled_from([65_000, 65_001, 200_000]))
    steps = st.tuples(st.sampled_from(names), DIRECTIONS, st.booleans(), sizes)
    for number, (name, direction, lost, size) in enumerate(draw(st.lists(steps, max_size=12)), 1):
        at = offsets[name, direction]
        offsets[name, direction] += size
        kind, length = (Kind.GAP, size) if lost else (Kind.BYTES, 0)
        data = b"" if lost else bytes((number,)) * size
        events.append(WireEvent(START_NS + number, name, direction, kind, data, at, length))
    for name in names:
        kind = draw(st.sampled_from([Kind.CLOSED, Kind.RESET]))
        events.append(WireEvent(START_NS + 100, name, draw(DIRECTIONS), kind))
    return events


@given(conversations())
def test_bytes_and_gaps_are_kept(
    tmp_path_factory: pytest.TempPathFactory, events: list[WireEvent]
) -> None:
    """Every byte is at its offset, and gaps contain no bytes."""
    found = write_and_read(events, tmp_path_factory.mktemp("pcap") / "out.pcapng")
    assert streams(found) == streams(events)
    lost = sum(event.length_bytes for event in events if event.kind is Kind.GAP)
    assert sum(event.length_bytes for event in found if event.kind is Kind.GAP) == lost


def test_events_are_kept(shift: list[WireEvent], tmp_path: Path) -> None:
    """Times, directions and kinds; each event with bytes is one packet."""

    def printed(events: list[WireEvent]) -> list[tuple[object, ...]]:
        return [
            (e.time_ns, e.connection, e.direction, e.kind, e.data)
            for e in events
            if e.kind is not Kind.GAP  # the next packet shows when it was found missing
        ]

    found = write_and_read(shift, tmp_path / "out.pcapng")
    assert printed(found)[:-1] == printed(shift)[:-1]
    assert found[-1].kind is Kind.CLOSED
    assert found[0].note == "192.168.1.20:51234 → 192.168.1.2:8877"


def test_a_recording_without_the_opening(tmp_path: Path) -> None:
    """There is no handshake, so a reader sees that the capture started late."""
    events = [
        WireEvent(START_NS, "1", A2C, Kind.GAP, length_bytes=-1, note=f"came late ({WAY})"),
        WireEvent(START_NS + 1, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc"),
        WireEvent(START_NS + 2, "1", C2A, Kind.BYTES, b"\xcc\x09\x0200\xaa"),
    ]
    kinds = [(e.direction, e.kind) for e in write_and_read(events, tmp_path / "out.pcapng")]
    assert (A2C, Kind.OPENED) not in kinds
    assert kinds.count((A2C, Kind.BYTES)) == kinds.count((C2A, Kind.BYTES)) == 1


def test_notes_are_comments(tmp_path: Path) -> None:
    """Injected faults and reasons of gaps are comments; the streams are unchanged."""
    scapy = pytest.importorskip("scapy.utils")
    events = [
        WireEvent(START_NS, "1", A2C, Kind.OPENED, note=WAY),
        WireEvent(START_NS + 1, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc"),
        WireEvent(START_NS + 2, "1", A2C, Kind.INJECTED, b"", 4, note="rule 1 “slow”: 250 ms late"),
        WireEvent(START_NS + 3, "1", C2A, Kind.BYTES, b"\xcc\x09\x0200\xaa"),
        WireEvent(START_NS + 4, "1", C2A, Kind.GAP, b"", 6, 3, "the disk was full"),
        WireEvent(START_NS + 5, "1", C2A, Kind.BYTES, b"\xcc\x09\x0200\xaa", 9),
    ]
    path = tmp_path / "out.pcapng"
    found = write_and_read(events, path)
    assert streams(found) == streams(events)
    with scapy.RawPcapNgReader(str(path)) as packets:
        comments = [comment for _, packet in packets for comment in packet.comments or ()]
    assert [bytes(comment).decode() for comment in comments] == [
        "injected: rule 1 “slow”: 250 ms late",
        "not recorded: the disk was full",
    ]


@pytest.mark.parametrize("length", [-1, 3 << 30])
def test_a_gap_that_sequence_numbers_cannot_express(tmp_path: Path, length: int) -> None:
    """It is written as a short gap, and counted."""
    after = 4 + max(length, 0)
    events = [
        WireEvent(START_NS, "1", A2C, Kind.OPENED, note=WAY),
        WireEvent(START_NS + 1, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc"),
        WireEvent(START_NS + 2, "1", A2C, Kind.GAP, b"", 4, length),
        WireEvent(START_NS + 3, "1", A2C, Kind.BYTES, b"\xaa\x0a\x00\xcc", after),
    ]
    writer = PcapngWriter(io.BytesIO())
    for event in events:
        writer.write(event)
    assert writer.shortened_gaps == 1
    found = write_and_read(events, tmp_path / "out.pcapng")
    assert [e.length_bytes for e in found if e.kind is Kind.GAP] == [1]
    assert [e.data for e in found if e.kind is Kind.BYTES] == [events[1].data, events[3].data]


@pytest.mark.parametrize(
    ("note", "shown"),
    [
        ("[2001:db8::1]:50000 > 192.0.2.7:8877", f"[2001:db8::1]:50000 → [{MAPPED}]:8877"),
        ("[::1]:50000 > [::1]:8877", "[::1]:50000 → [::1]:8877"),
        ("192.0.2.20:50000 > robot.local:8870", "192.0.2.20:50000 → 192.0.2.2:8870"),
        ("unknown > 192.0.2.7:8877", "192.0.2.1:49152 → 192.0.2.2:8877"),
        ("serial:///dev/ttyUSB0?baud=115200", "192.0.2.1:49152 → 192.0.2.2:8877"),
        ("", "192.0.2.1:49152 → 192.0.2.2:8877"),
    ],
)
def test_addresses(tmp_path: Path, note: str, shown: str) -> None:
    """Those of the recording; if unknown, addresses reserved for documentation."""
    events = [
        WireEvent(START_NS, "1", A2C, Kind.OPENED, note=note),
        WireEvent(START_NS + 1, "1", A2C, Kind.BYTES, b"\xaa\x09\x00\xcc"),
    ]
    port = int(shown.rpartition(":")[2])
    assert write_and_read(events, tmp_path / "out.pcapng", port)[0].note == shown
