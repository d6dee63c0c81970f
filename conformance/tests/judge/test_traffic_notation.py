"""The notation of sessions in these tests: its lines become events."""

from collections.abc import Callable

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind, WireEvent

SESSION = r"""
    login
    > run_program a\x2e
    +2.5
    <90 run_program 11
    > gap 3
    > 3E
    > = AA 09
    2> open
    > close
"""


def test_lines_become_events(script: Callable[[str], list[WireEvent]]) -> None:
    """The connection is opened implicitly, lines are 1 ms apart, and offsets include gaps."""
    events = script(SESSION)
    assert [(e.time_ns // 1_000_000, e.connection, e.direction, e.kind) for e in events] == [
        (1, "1", A2C, Kind.OPENED),
        (2, "1", A2C, Kind.BYTES),
        (3, "1", C2A, Kind.BYTES),
        (4, "1", A2C, Kind.BYTES),
        (2505, "1", C2A, Kind.BYTES),
        (2506, "1", A2C, Kind.GAP),
        (2507, "1", A2C, Kind.BYTES),
        (2508, "1", A2C, Kind.BYTES),
        (2509, "2", A2C, Kind.OPENED),
        (2510, "1", A2C, Kind.CLOSED),
    ]
    assert [e.data.hex() for e in events if e.kind is Kind.BYTES] == [
        "aa010870617373776f7264cc",
        "cc010131aa",
        "aa3002612ecc",
        "cc9030023131aa",
        "aa3e00cc",
        "aa09",
    ]
    assert [e.offset_bytes for e in events if e.direction is A2C] == [0, 0, 12, 18, 21, 25, 0, 27]
    assert events[5].length_bytes == 3


def test_bytes_can_be_recut(script: Callable, recut: Callable) -> None:
    """Only the sizes of the pieces change."""
    events = script("> get_status\n< gap 2\n< get_status 00")
    pieces = list(recut(events, lambda: 1))
    assert b"".join(e.data for e in pieces) == b"".join(e.data for e in events)
    assert {len(e.data) for e in pieces if e.kind is Kind.BYTES} == {1}
    assert [e.offset_bytes for e in pieces if e.direction is C2A] == [0, 2, 3, 4, 5, 6, 7]
