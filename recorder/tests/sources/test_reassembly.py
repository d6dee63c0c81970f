"""The reassembler delivers every captured byte once, at its offset; other bytes become gaps."""

from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sources.reassembly import STEP_NS, Limits, Reassembler
from scaraspec_recorder.tcp_segment import ACK, FIN, RST, SYN, Endpoint, Segment

CLIENT = Endpoint(bytes([192, 0, 2, 1]), 50000)
CONTROLLER = Endpoint(bytes([192, 0, 2, 2]), 8877)
ADDRESSES = "192.0.2.1:50000 → 192.0.2.2:8877"
CLIENT_ISN = 1000
CONTROLLER_ISN = 9000
REQUEST = bytes.fromhex("aa0900cc")
REPLY = bytes.fromhex("cc09023030aa")


def a2c(time_ns: int, at: int, data: bytes = b"", ack: int = 0, flags: int = ACK) -> Segment:
    """Return a segment of the client; `at` and `ack` are stream offsets; a SYN is before 0."""
    seq = (CLIENT_ISN + 1 + at) % 2**32
    return Segment(time_ns, CLIENT, CONTROLLER, seq, CONTROLLER_ISN + 1 + ack, flags, data)


def c2a(time_ns: int, at: int, data: bytes = b"", ack: int = 0, flags: int = ACK) -> Segment:
    """Return a segment of the controller; see `a2c`."""
    seq = (CONTROLLER_ISN + 1 + at) % 2**32
    return Segment(time_ns, CONTROLLER, CLIENT, seq, CLIENT_ISN + 1 + ack, flags, data)


def handshake(time_ns: int = 0) -> list[Segment]:
    return [
        a2c(time_ns, -1, flags=SYN),
        c2a(time_ns, -1, flags=SYN | ACK),
        a2c(time_ns, 0),
    ]


# The same with other initial sequence numbers, for streams that wrap.


def part(isn: int, time_ns: int, offset: int, octets: bytes, flags: int = 0) -> Segment:
    return Segment(time_ns, CLIENT, CONTROLLER, (isn + 1 + offset) % 2**32, 0, flags, octets)


def acknowledgment(isn: int, time_ns: int, offset: int) -> Segment:
    ack = (isn + 1 + offset) % 2**32
    return Segment(time_ns, CONTROLLER, CLIENT, CONTROLLER_ISN + 1, ack, ACK)


def opening(isn: int, time_ns: int = 0) -> list[Segment]:
    syn = Segment(time_ns, CLIENT, CONTROLLER, isn, 0, SYN)
    answer = acknowledgment(isn, time_ns, 0)
    return [syn, answer._replace(seq=CONTROLLER_ISN, flags=SYN | ACK)]


def opened(time_ns: int = 0, connection: str = "1") -> WireEvent:
    return WireEvent(time_ns, connection, A2C, Kind.OPENED, note=ADDRESSES)


def data(time_ns: int, direction: Direction, offset: int, octets: bytes) -> WireEvent:
    return WireEvent(time_ns, "1", direction, Kind.BYTES, octets, offset)


def gap(
    time_ns: int, direction: Direction, offset: int, length: int, note: str = "not captured"
) -> WireEvent:
    return WireEvent(time_ns, "1", direction, Kind.GAP, b"", offset, length, note)


def run(segments: Iterable[Segment], reassembler: Reassembler | None = None) -> list[WireEvent]:
    reassembler = reassembler or Reassembler()
    events = [event for segment in segments for event in reassembler.receive(segment)]
    return events + reassembler.finish()


def octets(events: Iterable[WireEvent], direction: Direction = A2C) -> bytes:
    return b"".join(event.data for event in events if event.direction is direction)


def gaps(events: Iterable[WireEvent]) -> list[WireEvent]:
    return [event for event in events if event.kind is Kind.GAP]


def kinds(events: Iterable[WireEvent]) -> list[str]:
    return [f"{event.direction.value} {event.kind.value}" for event in events]


def check_order(events: list[WireEvent]) -> None:
    """Check that times never decrease, and that bytes and gaps of a direction are contiguous."""
    assert all(before.time_ns <= after.time_ns for before, after in pairwise(events))
    ends: dict[tuple[str, Direction], int] = {}
    for event in events:
        if event.kind in {Kind.BYTES, Kind.GAP}:
            stream = event.connection, event.direction
            assert event.offset_bytes == ends.get(stream, 0)
            ends[stream] = event.offset_bytes + len(event.data) + max(event.length_bytes, 0)


def test_an_orderly_connection() -> None:
    """Opening, bytes, both half-closes and the close have the times of their segments."""
    segments = [
        *handshake(10),
        a2c(20, 0, REQUEST),
        c2a(30, 0, REPLY, ack=4),
        a2c(40, 4, ack=6, flags=FIN | ACK),
        c2a(50, 6, ack=5, flags=FIN | ACK),
        a2c(60, 5, ack=7),
    ]
    assert run(segments) == [
        opened(10),
        data(20, A2C, 0, REQUEST),
        data(30, C2A, 0, REPLY),
        WireEvent(40, "1", A2C, Kind.HALF_CLOSED),
        WireEvent(50, "1", C2A, Kind.HALF_CLOSED),
        WireEvent(50, "1", C2A, Kind.CLOSED),
    ]


def test_no_delay_without_missing_bytes() -> None:
    """A segment in order is delivered at once."""
    reassembler = Reassembler()
    for segment in handshake():
        reassembler.receive(segment)
    assert reassembler.receive(a2c(5, 0, REQUEST)) == [data(5, A2C, 0, REQUEST)]


def test_data_after_a_half_close() -> None:
    """A half-closed connection still delivers the replies."""
    events = run([*handshake(), a2c(1, 0, flags=FIN | ACK), c2a(2, 0, REPLY, ack=1)])
    assert kinds(events) == ["A2C opened", "A2C half-closed", "C2A bytes"]


@pytest.mark.parametrize(
    "again",
    [
        a2c(3, 0, b"abcdef"),
        a2c(3, 2, b"cd"),
        a2c(3, 5, b"\0"),
        a2c(3, 5, b""),
        a2c(3, 4, b"efg"),
        a2c(3, 0, b"abcdefg"),
    ],
    ids=["whole", "part", "keep-alive", "empty keep-alive", "overlap", "with more"],
)
def test_repeated_bytes_are_delivered_once(again: Segment) -> None:
    """A retransmission or a keep-alive probe adds only new bytes."""
    events = run([*handshake(), a2c(2, 0, b"abcdef"), again, a2c(4, 6, b"gh")])
    assert octets(events) == b"abcdefgh"
    assert not gaps(events)
    check_order(events)


def test_a_zero_window_probe_is_part_of_the_stream() -> None:
    """The byte of the probe is delivered once; its repetition is not."""
    probe = a2c(3, 2, b"c")
    refusal = c2a(3, 0, ack=2)
    events = run([*handshake(), a2c(2, 0, b"ab"), probe, refusal, a2c(4, 2, b"cdef")])
    assert octets(events) == b"abcdef"
    assert not gaps(events)


def test_data_in_the_syn_belong_to_the_stream() -> None:
    """The SYN has one sequence number; its data begins after it."""
    segments = [
        a2c(1, -1, b"ab", flags=SYN),
        c2a(1, -1, ack=2, flags=SYN | ACK),
        a2c(2, 2, b"cd"),
    ]
    assert octets(run(segments)) == b"abcd"


def test_a_swapped_segment_releases_waiting_segments() -> None:
    """Bytes are in order, with the time of the segment that completed them."""
    events = run([*handshake(), a2c(7, 2, b"cd"), a2c(8, 0, b"ab")])
    assert events == [opened(), data(8, A2C, 0, b"ab"), data(8, A2C, 2, b"cd")]


def test_a_capture_in_swapped_order_keeps_its_true_times() -> None:
    """An acknowledgment and a reply captured before their request are delivered after it."""
    swapped = [c2a(30, 0, REPLY, ack=4), a2c(20, 0, REQUEST)]
    events = run([*handshake(), *swapped])
    assert events == [opened(), data(20, A2C, 0, REQUEST), data(30, C2A, 0, REPLY)]


@pytest.mark.parametrize("tick_ns", [10, 0])
def test_a_request_captured_after_the_next_one(tick_ns: int) -> None:
    """A reply between two swapped requests waits for the first, for any clock resolution."""
    one, two, three = (tick_ns * n for n in (2, 3, 4))
    swapped = [a2c(three, 4, REQUEST, ack=6), c2a(two, 0, REPLY, ack=4), a2c(one, 0, REQUEST)]
    assert run([*handshake(), *swapped]) == [
        opened(),
        data(one, A2C, 0, REQUEST),
        data(two, C2A, 0, REPLY),
        data(three, A2C, 4, REQUEST),
    ]


@pytest.mark.parametrize("ahead_ns", [-25, 0, 25])
def test_two_different_clocks_keep_the_order(ahead_ns: int) -> None:
    """Acknowledged bytes are delivered before their acknowledgment."""
    requests = [a2c(20, 0, REQUEST), a2c(40, 4, REQUEST, ack=6), a2c(60, 8, REQUEST, ack=12)]
    replies = [
        c2a(30 + ahead_ns, 0, REPLY, ack=4),
        c2a(50 + ahead_ns, 6, REPLY, ack=8),
        c2a(70 + ahead_ns, 12, REPLY, ack=12),
    ]
    skewed = sorted(requests + replies, key=lambda segment: segment.time_ns)
    events = run([*handshake(), *skewed])
    check_order(events)
    assert kinds(events) == ["A2C opened", *["A2C bytes", "C2A bytes"] * 3]


def test_without_times_the_order_is_that_of_the_capture() -> None:
    """After a lost request each packet keeps its position, although all have the same time."""
    segments = [
        *handshake(),
        c2a(0, 0, REPLY, ack=4),
        a2c(0, 4, REQUEST, ack=6),
        c2a(0, 6, REPLY, ack=8),
        a2c(0, 8, REQUEST, ack=12),
    ]
    assert run(segments) == [
        opened(),
        gap(0, A2C, 0, 4),
        data(0, C2A, 0, REPLY),
        data(0, A2C, 4, REQUEST),
        data(0, C2A, 6, REPLY),
        data(0, A2C, 8, REQUEST),
    ]


def test_a_lost_request_is_a_gap_before_its_reply() -> None:
    """Acknowledged bytes that were not captured are a gap of their length."""
    segments = [
        *handshake(),
        c2a(30, 0, REPLY, ack=4),
        a2c(40, 4, REQUEST, ack=6),
        c2a(50, 6, REPLY, ack=8),
    ]
    assert run(segments) == [
        opened(),
        gap(30, A2C, 0, 4),
        data(30, C2A, 0, REPLY),
        data(40, A2C, 4, REQUEST),
        data(50, C2A, 6, REPLY),
    ]


def test_an_acknowledged_byte_may_be_late() -> None:
    """The gap is declared `late_segments` segments after the proof, not before."""
    reassembler = Reassembler(limits=Limits(late_segments=3))
    for segment in [*handshake(), c2a(5, 0, ack=4)]:
        reassembler.receive(segment)
    assert reassembler.receive(c2a(6, 0, ack=4)) == []
    assert reassembler.receive(c2a(7, 0, ack=4)) == []
    assert reassembler.receive(c2a(8, 0, ack=4)) == [
        gap(5, A2C, 0, 4, "not captured; the last byte may have been the end of the stream (FIN)")
    ]


def test_only_acknowledged_bytes_become_gaps() -> None:
    """Other bytes will be sent again, so the reassembler waits for them."""
    reassembler = Reassembler(limits=Limits(late_segments=3))
    segments = [
        *handshake(),
        a2c(5, 8, b"ij"),
        c2a(6, 0, ack=4),
        a2c(7, 8, b"ij"),
        a2c(8, 8, b"ij"),
        a2c(9, 8, b"ij"),
        a2c(10, 4, b"efgh"),
    ]
    events = run(segments, reassembler)
    assert [event.length_bytes for event in gaps(events)] == [4]
    assert octets(events) == b"efghij"
    check_order(events)


def test_bytes_acknowledged_later_become_gaps_later() -> None:
    """They have their own limit of late segments."""
    reassembler = Reassembler(limits=Limits(late_segments=2))
    segments = [
        *handshake(),
        c2a(5, 0, ack=4),
        a2c(6, 8, b"ij"),
        c2a(7, 0, ack=10),
        a2c(8, 4, b"efgh"),
    ]
    events = run(segments, reassembler)
    assert [event.length_bytes for event in gaps(events)] == [4]
    assert octets(events) == b"efghij"


def test_an_older_acknowledgment_is_ignored() -> None:
    """After a swapped acknowledgment proven bytes stay proven."""
    events = run([*handshake(), c2a(5, 0, ack=4), c2a(4, 0, ack=2)])
    assert [event.length_bytes for event in gaps(events)] == [4]


def test_waiting_for_a_retransmission() -> None:
    """Bytes that are not acknowledged were lost on the way and will be sent again."""
    reassembler = Reassembler(limits=Limits(late_segments=2))
    later = [a2c(10 + at, at, b"x") for at in range(1, 20)]
    events = run([*handshake(), *later, a2c(50, 0, b"x", ack=0)], reassembler)
    assert octets(events) == b"x" * 20
    assert not gaps(events)


def test_the_memory_limit_turns_missing_bytes_into_a_gap() -> None:
    """A capture of one direction has no acknowledgments; captured bytes are not lost."""
    reassembler = Reassembler(limits=Limits(held_bytes=20_000))
    behind = [a2c(9, at, bytes(100)) for at in range(4, 10_004, 100)]
    events = [
        event for segment in [*handshake(), *behind] for event in reassembler.receive(segment)
    ]
    assert len(octets(events)) == 10_000
    assert [event.length_bytes for event in gaps(events)] == [4]


def test_bytes_missing_at_the_end_of_the_capture_are_a_gap() -> None:
    """At the end no further proof is necessary."""
    events = run([*handshake(), a2c(5, 4, b"ef")])
    assert events == [opened(), gap(5, A2C, 0, 4), data(5, A2C, 4, b"ef")]


def test_a_lost_fin_is_noted() -> None:
    """An acknowledgment counts the FIN like a byte; the note of the gap says so."""
    events = run([*handshake(), c2a(5, 0, ack=1)])
    assert "FIN" in events[-1].note


def test_a_fin_after_its_acknowledgment() -> None:
    """The sequence number of a FIN is not a missing byte."""
    events = run([*handshake(), c2a(6, 0, ack=1), a2c(5, 0, flags=FIN | ACK)])
    assert kinds(events) == ["A2C opened", "A2C half-closed"]


def test_a_repeated_fin() -> None:
    """The half-close has the time of the first FIN, or of the bytes before it."""
    fin, again = (a2c(time_ns, 2, flags=FIN | ACK) for time_ns in (5, 9))
    events = run([*handshake(), fin, again, a2c(6, 0, b"ab")])
    assert events[-1] == WireEvent(6, "1", A2C, Kind.HALF_CLOSED)


def test_truncated_packets() -> None:
    """A truncated packet gives its captured bytes and a gap for the rest."""
    cut = a2c(5, 0, b"ab")._replace(cut_bytes=4)
    events = run([*handshake(), cut, a2c(6, 6, b"gh")])
    assert events == [
        opened(),
        data(5, A2C, 0, b"ab"),
        gap(5, A2C, 2, 4),
        data(6, A2C, 6, b"gh"),
    ]


def test_sequence_numbers_wrap() -> None:
    """Offsets continue when the 32-bit number wraps."""
    isn = 2**32 - 3
    parts = [(b"ab", 1), (b"cd", 3), (b"ef", 5)]
    syn = Segment(0, CLIENT, CONTROLLER, isn, 0, SYN)
    segments = [
        Segment(at, CLIENT, CONTROLLER, (isn + at) % 2**32, 0, 0, part) for part, at in parts
    ]
    events = run([syn, segments[1], segments[0], segments[2]])
    assert octets(events) == b"abcdef"
    check_order(events)


def test_a_reply_that_acknowledges_a_fin_precedes_the_reset() -> None:
    """The reply has its own time, also while another connection waits for missing bytes."""
    other = Endpoint(CLIENT.address, CLIENT.port + 1)
    missing = [segment._replace(src=other) for segment in (a2c(1, -1, flags=SYN), a2c(1, 4, b"x"))]
    events = run(
        [
            *handshake(),
            *missing,
            a2c(2, 0, REQUEST),
            a2c(3, 4, flags=FIN | ACK),
            c2a(4, 0, REPLY, ack=5),
            a2c(5, 5, flags=RST),
        ]
    )
    assert [(event.time_ns, event.kind) for event in events if event.connection == "1"] == [
        (0, Kind.OPENED),
        (2, Kind.BYTES),
        (3, Kind.HALF_CLOSED),
        (4, Kind.BYTES),
        (5, Kind.RESET),
    ]


@pytest.mark.parametrize(
    "stray",
    [
        a2c(2, 1 << 29, b"stray"),
        a2c(2, -(1 << 30), b"stray"),
        a2c(2, 1 << 29, flags=RST),
        a2c(2, 0, ack=1 << 29),
    ],
    ids=["ahead", "behind", "reset", "acknowledgment"],
)
def test_segments_far_outside_the_window(stray: Segment) -> None:
    """They are ignored and, if they are not old, counted."""
    reassembler = Reassembler()
    events = run([*handshake(), stray, a2c(3, 0, REQUEST), c2a(4, 0, REPLY, ack=4)], reassembler)
    assert events == [opened(), data(3, A2C, 0, REQUEST), data(4, C2A, 0, REPLY)]
    assert reassembler.far_segments == (stray.seq != a2c(2, -(1 << 30)).seq)


def test_a_long_loss_of_the_capture() -> None:
    """If the stream continues far ahead, it is followed there."""
    far = 1 << 26
    events = run(
        [
            *handshake(),
            a2c(1, 0, REQUEST),
            *(a2c(2, far + at, REQUEST) for at in (0, 4, 8)),
        ]
    )
    assert octets(events) == REQUEST * 3
    check_order(events)


def test_a_late_capture_begins_with_gaps() -> None:
    """An unknown number of bytes is missing; offsets start with the first captured byte."""
    note = f"the capture begins mid-stream ({ADDRESSES})"
    events = run([a2c(5, 700, REQUEST, ack=300), c2a(6, 300, REPLY, ack=704)])
    assert events == [
        gap(5, C2A, 0, -1, note),
        gap(5, A2C, 0, -1, note),
        data(5, A2C, 0, REQUEST),
        data(6, C2A, 0, REPLY),
    ]


def test_a_late_capture_with_swapped_packets() -> None:
    """The stream begins with the lowest captured byte, not with the first one."""
    events = run([a2c(6, 704, b"ef"), a2c(5, 700, b"abcd")])
    assert octets(events) == b"abcdef"
    check_order(events)


def test_a_syn_captured_late() -> None:
    """Packets swapped with the handshake do not make the capture a late one."""
    syn, syn_ack, _ = handshake(1)
    events = run([syn_ack, a2c(2, 0, REQUEST), syn, c2a(3, 0, REPLY, ack=4)])
    assert events == [opened(1), data(2, A2C, 0, REQUEST), data(3, C2A, 0, REPLY)]


def test_a_lost_syn_ack() -> None:
    """It is unknown how many bytes the controller sent before."""
    syn, _, ack = handshake()
    events = run([syn, ack, c2a(3, 0, REPLY)])
    note = "the SYN-ACK was not captured"
    assert events == [opened(), gap(0, C2A, 0, -1, note), data(3, C2A, 0, REPLY)]


@pytest.mark.parametrize(
    "segment", [a2c(1, 0), a2c(1, 0, flags=FIN | ACK), a2c(1, 0, b"why", flags=RST)]
)
def test_keep_alives_do_not_create_a_connection(segment: Segment) -> None:
    """An acknowledgment, FIN or RST of an unknown connection is ignored."""
    assert run([segment]) == []


def test_reset() -> None:
    """RST ends the connection; its payload is not data, and later segments are ignored."""
    reset = a2c(5, 4, b"why", flags=RST | ACK)
    events = run([*handshake(), a2c(4, 0, REQUEST), reset, reset, c2a(6, 0, REPLY)])
    assert events == [
        opened(),
        data(4, A2C, 0, REQUEST),
        WireEvent(5, "1", A2C, Kind.RESET),
    ]


def test_reset_waits_for_swapped_bytes() -> None:
    """Bytes sent before the RST are delivered before it, in any order of the capture."""
    reset, again = a2c(6, 4, flags=RST), c2a(7, 4, flags=RST)
    events = run([*handshake(), a2c(5, 2, b"cd"), reset, again, a2c(4, 0, b"ab")])
    assert kinds(events) == ["A2C opened", "A2C bytes", "A2C bytes", "A2C reset"]
    assert events[-1].time_ns == 6


def test_reset_ends_the_waiting_for_a_retransmission() -> None:
    """After a RST nothing is sent again: missing bytes become a gap before the reset."""
    reassembler = Reassembler(limits=Limits(late_segments=2))
    for segment in [*handshake(), a2c(5, 2, b"cd"), a2c(6, 4, flags=RST)]:
        reassembler.receive(segment)
    other = [
        Segment(7, Endpoint(CLIENT.address, 50001), CONTROLLER, 0, 0, SYN),
        Segment(8, Endpoint(CLIENT.address, 50001), CONTROLLER, 0, 0, SYN),
    ]
    events = [event for segment in other for event in reassembler.receive(segment)]
    assert kinds(events) == ["A2C gap", "A2C bytes", "A2C reset", "A2C opened"]


def test_a_refused_connection() -> None:
    """A SYN answered by RST gives an opening and a refusal without a gap."""
    events = run([a2c(1, -1, flags=SYN), c2a(2, -1, flags=RST | ACK)])
    assert events == [
        opened(1),
        WireEvent(2, "1", C2A, Kind.RESET, note="the connection was refused"),
    ]


def test_an_unanswered_syn_has_no_gap() -> None:
    """Repeated SYNs of one attempt are one connection."""
    assert run([a2c(1, -1, flags=SYN), a2c(2, -1, flags=SYN)]) == [opened(1)]


@pytest.mark.parametrize("isn", [CLIENT_ISN + 70_000, CLIENT_ISN - 70_000])
def test_reused_ports_are_another_connection(isn: int) -> None:
    """A SYN with another number ends the old connection and opens the next one."""
    unfinished = [*handshake(), a2c(1, 2, b"cd")]
    events = run([*unfinished, *opening(isn, 5), part(isn, 6, 0, REQUEST)])
    assert [(event.connection, event.kind, event.offset_bytes) for event in events] == [
        ("1", Kind.OPENED, 0),
        ("1", Kind.GAP, 0),
        ("1", Kind.BYTES, 2),
        ("2", Kind.OPENED, 0),
        ("2", Kind.BYTES, 0),
    ]


def test_reused_ports_after_a_late_start() -> None:
    """A SYN with a number after the captured bytes is not the start of their stream."""
    events = run([a2c(1, 0, REQUEST), *opening(CLIENT_ISN + 70_000, 5)])
    assert [(event.connection, event.kind) for event in events] == [
        ("1", Kind.GAP),
        ("1", Kind.GAP),
        ("1", Kind.BYTES),
        ("2", Kind.OPENED),
    ]


def test_segments_after_the_close() -> None:
    """The last acknowledgment and repeated FINs belong to the ended connection."""
    fins = [a2c(1, 0, flags=FIN | ACK), c2a(2, 0, ack=1, flags=FIN | ACK)]
    assert run([*handshake(), *fins, *fins, a2c(3, 1, ack=1)]) == run([*handshake(), *fins])


def test_the_controller_is_the_destination_of_the_syn() -> None:
    """The opener is the client, also if it uses the controller's port itself."""
    src, dst = Endpoint(CLIENT.address, 8877), Endpoint(CONTROLLER.address, 40_000)
    (event,) = run([Segment(1, src, dst, 5, 0, SYN)])
    assert (event.direction, event.note) == (A2C, "192.0.2.1:8877 → 192.0.2.2:40000")


@pytest.mark.parametrize(
    ("first", "reply", "ports", "sender"),
    [
        (REQUEST, b"", (9000,), C2A),
        (REQUEST, b"", None, A2C),
        (REPLY, b"", None, C2A),
        (b"?", REPLY, None, A2C),
        (b"?", REQUEST, None, C2A),
        (b"?", b"", None, C2A),
    ],
    ids=["port", "AA", "CC", "answered CC", "answered AA", "lower port"],
)
def test_the_controller_of_a_late_capture(
    first: bytes, reply: bytes, ports: tuple[int] | None, sender: Direction
) -> None:
    """Without a SYN the port decides, then the start bytes (L92-94), then the lower port."""
    low, high = Endpoint(CLIENT.address, 9000), Endpoint(CONTROLLER.address, 9001)
    segments = [Segment(1, low, high, 5, 0, 0, first), Segment(2, high, low, 5, 0, 0, reply)]
    events = run(segments, Reassembler(ports))
    assert [event.direction for event in events if event.data == first] == [sender]


def test_other_ports_are_ignored() -> None:
    """Only connections with a selected port are delivered; without ports, all."""
    web = Endpoint(CONTROLLER.address, 80)
    segment = Segment(1, CLIENT, web, 5, 0, SYN)
    assert run([segment]) == []
    assert kinds(run([segment], Reassembler((80, 8877)))) == ["A2C opened"]
    assert kinds(run([segment], Reassembler(None))) == ["A2C opened"]


def test_several_connections_are_in_the_order_of_time() -> None:
    """Missing bytes in one connection delay the later events of the other one."""
    second = Endpoint(bytes(15) + b"\1", 50001)
    controller = Endpoint(bytes(15) + b"\2", 8877)
    segments = [
        *handshake(1),
        Segment(2, second, controller, 0, 0, SYN),
        Segment(2, controller, second, 0, 1, SYN | ACK),
        a2c(3, 2, b"cd"),
        Segment(4, second, controller, 1, 0, 0, REQUEST),
        a2c(5, 0, b"ab"),
    ]
    events = run(segments)
    assert [(event.time_ns, event.connection, event.data) for event in events] == [
        (1, "1", b""),
        (2, "2", b""),
        (4, "2", REQUEST),
        (5, "1", b"ab"),
        (5, "1", b"cd"),
    ]
    assert events[1].note == "[::1]:50001 → [::2]:8877"


def test_the_longest_silent_connection_is_dropped_at_the_limit() -> None:
    """The number of connections is limited; all bytes of the dropped one are delivered."""
    reassembler = Reassembler(limits=Limits(connections=2))
    others = [Endpoint(CLIENT.address, port) for port in (1, 2)]
    segments = [
        *handshake(),
        a2c(1, 2, b"cd"),
        *(Segment(2, other, CONTROLLER, 0, 0, SYN) for other in others),
    ]
    events = [event for segment in segments for event in reassembler.receive(segment)]
    assert [event.connection for event in events] == ["1", "1", "1", "2", "3"]
    assert len(reassembler._followed) == 2


def test_a_clock_set_back() -> None:
    """The time stays constant for a moment; earlier traffic must not cause failures."""
    at, back = 10 * STEP_NS, 3 * STEP_NS
    segments = [
        *handshake(at),
        a2c(at + 5, 0, REQUEST),
        c2a(at + 6 - back, 0, REPLY, ack=4),
        a2c(at + 8 - back, 4, REQUEST, ack=6),
        c2a(0, 6, REPLY, ack=8),
    ]
    reassembler = Reassembler()
    assert run(segments, reassembler) == [
        opened(at),
        data(at + 5, A2C, 0, REQUEST),
        gap(at + 5, C2A, 0, 0, "the capture clock was set back"),
        data(at + 5, C2A, 0, REPLY),
        data(at + 7, A2C, 4, REQUEST),
        data(at + 7, C2A, 6, REPLY),  # without a time
    ]
    assert reassembler.clock_steps == 1


def test_decreasing_times_are_corrected() -> None:
    """A clock set back does not reverse the order of events."""
    events = run([*handshake(10), a2c(20, 0, b"ab"), a2c(5, 2, b"cd")])
    assert [event.time_ns for event in events] == [10, 20, 20]


@st.composite
def cut_streams(draw: st.DrawFn) -> tuple[int, list[tuple[int, bytes]]]:
    """Draw an initial sequence number, and the parts of a stream with their offsets."""
    isn = draw(st.sampled_from([0, 1000, 2**31 - 4, 2**32 - 20, 2**32 - 1]))
    stream = draw(st.binary(min_size=1, max_size=60))
    cuts = sorted(draw(st.sets(st.integers(1, len(stream) - 1), max_size=20))) if stream[1:] else []
    return isn, [(start, stream[start:end]) for start, end in pairwise([0, *cuts, len(stream)])]


@given(cut=cut_streams(), draw=st.data())
def test_any_segmentation_gives_the_same_bytes(
    cut: tuple[int, list[tuple[int, bytes]]], draw: st.DataObject
) -> None:
    """A stream may be split, repeated, joined and shuffled: the same bytes, without a gap."""
    isn, parts = cut
    stream = b"".join(octets for _, octets in parts)
    sent = [
        segment
        for time_ns, (offset, octets) in enumerate(parts, 1)
        for segment in (
            part(isn, time_ns, offset, octets),
            acknowledgment(isn, time_ns, offset + len(octets)),
        )
    ]
    spans = st.tuples(st.integers(0, len(stream)), st.integers(1, len(stream)))
    for start, length in draw.draw(st.lists(spans, max_size=8)):
        sent.append(part(isn, 99, start, stream[start : start + length]))
    sent.append(part(isn, 99, len(stream), b"", FIN))
    events = run([*opening(isn), *draw.draw(st.permutations(sent))])
    assert octets(events) == stream
    assert not gaps(events)
    assert kinds(events)[-1] == "A2C half-closed"
    check_order(events)


@given(cut=cut_streams(), draw=st.data())
def test_lost_segments_become_gaps_of_exactly_their_bytes(
    cut: tuple[int, list[tuple[int, bytes]]], draw: st.DataObject
) -> None:
    """Delivered bytes are at their offsets; gaps cover all others and nothing else."""
    isn, parts = cut
    lost = draw.draw(st.sets(st.sampled_from(parts)))
    swaps = draw.draw(st.lists(st.integers(0, 3), min_size=len(parts), max_size=len(parts)))
    order = sorted(range(len(parts)), key=lambda at: at + swaps[at])
    stream = b"".join(octets for _, octets in parts)
    segments = [
        segment
        for at in order
        for segment in (
            *([] if parts[at] in lost else [part(isn, at + 1, *parts[at])]),
            acknowledgment(isn, at + 1, parts[at][0] + len(parts[at][1])),
        )
    ]
    fin = part(isn, 99, len(stream), b"", FIN)
    events = run([*opening(isn), *segments, fin], Reassembler(limits=Limits(late_segments=10)))
    check_order(events)
    account = bytearray(b"?" * len(stream))
    for event in events:
        at = event.offset_bytes
        if event.kind is Kind.BYTES:
            account[at : at + len(event.data)] = event.data
    for offset, octets in parts:
        expected = b"?" * len(octets) if (offset, octets) in lost else octets
        assert account[offset : offset + len(octets)] == expected
    assert sum(event.length_bytes for event in gaps(events)) == sum(len(part) for _, part in lost)


wild_segments = st.builds(
    Segment,
    time_ns=st.integers(0, 50),
    src=st.sampled_from([CLIENT, CONTROLLER]),
    dst=st.sampled_from([CLIENT, CONTROLLER]),
    seq=st.integers(0, 30) | st.integers(0, 2**32 - 1),
    ack=st.integers(0, 30) | st.integers(0, 2**32 - 1),
    flags=st.sampled_from([0, ACK, ACK, ACK, SYN, SYN | ACK, FIN | ACK, RST, 0xFF]),
    payload=st.binary(max_size=8),
    cut_bytes=st.integers(0, 2),
)


@given(st.lists(wild_segments, max_size=40), st.sampled_from([1, 4, 256]))
def test_any_segments(segments: list[Segment], late_segments: int) -> None:
    """Times never decrease, offsets are contiguous, and no memory remains in use."""
    limits = Limits(late_segments=late_segments, held_bytes=2000, connections=2)
    reassembler = Reassembler(None, limits)
    check_order(run(segments, reassembler))
    assert reassembler._held_bytes == 0
    assert not reassembler._holes
