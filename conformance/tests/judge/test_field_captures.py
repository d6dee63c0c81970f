"""Field captures that were not written by this project: the judge reports the right findings."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.events import FrameSeen
from scaraspec_recorder.sources.pcap_reader import read_pcap

Judged = Callable[..., Any]

CONFORMING = {
    "plant-a-morning-shift": 136,
    "plant-b-other-dialect": 144,
    "plant-c-serial-bridge-bytewise": 77,
}
"""Captures without failures, and their number of frames."""

LITTLE = {"endian": ("little",), "chunk_trunc": ("full",), "op_get_default": ("0x13",)}
DIALECTS = {
    "plant-a-morning-shift": {
        A2C: LITTLE | {"jog_byte": ("ascii",)},
        C2A: LITTLE
        | {
            "err_bare0": ("0|code",),
            "estop_interrupted": ("first",),
            "list_prefix_sep": ("0|a",),
            "op_temp_reply": ("0x0F",),
        },
    },
    "plant-b-other-dialect": {
        A2C: {
            "endian": ("big",),
            "chunk_trunc": ("truncated",),
            "op_get_default": ("0x13",),
            "jog_byte": ("ascii",),
        },
        C2A: {
            "endian": ("big",),
            "chunk_trunc": ("truncated",),
            "op_get_default": ("0x13",),
            "err_bare0": ("0|code",),
            "estop_interrupted": ("after",),
            "list_cont": ("request",),
            "list_prefix_sep": ("0|a",),
            "op_temp_reply": ("0x0E",),
        },
    },
    "plant-c-serial-bridge-bytewise": {
        A2C: LITTLE,
        C2A: {
            "list_prefix_sep": ("0|a",),
            "op_get_default": ("0x13",),
            "op_temp_reply": ("0x0F",),
        },
    },
}


@pytest.fixture(scope="module")
def capture(judged: Judged, fixtures_dir: Path) -> Callable[[str], Any]:
    """Return a function that judges a capture; each is read once."""
    records: dict[str, Any] = {}

    def read(name: str) -> Any:
        if name not in records:
            path = fixtures_dir / "captures" / "field" / f"{name}.pcapng"
            records[name] = judged(read_pcap(path))
        return records[name]

    return read


def number_of(record: Any, place: Any) -> int:
    """The number of the frame at a place, from 1, as in the README of the captures."""
    frames = [h.place for h in record.happenings if isinstance(h, FrameSeen)]
    return 1 + frames.index(place)


def broken(record: Any) -> list[tuple[str, int]]:
    """The failed requirements, and the frame that shows each failure."""
    failures = [f for f in record.findings if f.verdict is Verdict.FAIL]
    return [(f.requirement, number_of(record, f.evidence[-1])) for f in failures]


@pytest.mark.parametrize("name", CONFORMING)
def test_a_conforming_capture_conforms(capture: Callable[[str], Any], name: str) -> None:
    """All frames decode without issues, no reply is unsolicited, and nothing fails."""
    record = capture(name)
    frames = [h for h in record.happenings if isinstance(h, FrameSeen)]
    assert len(frames) == CONFORMING[name]
    assert all(seen.parsed and not seen.parsed.decoded.issues for seen in frames)
    assert not record.undecodable
    assert not record.unsolicited
    assert broken(record) == []
    assert record.judge.conclusion is Conclusion.CONFORMANT


@pytest.mark.parametrize("name", CONFORMING)
def test_its_dialect_is_seen(capture: Callable[[str], Any], name: str) -> None:
    """The readings of each peer are detected, and none is mixed."""
    seen = capture(name).judge.dialect_seen
    for peer in Direction:
        of_rules = {k: v for k, v in seen.of(peer).items() if k in DIALECTS[name][peer]}
        assert of_rules == DIALECTS[name][peer]
        assert not seen.mixed(peer)


def test_another_dialect_is_tolerated_by_name(capture: Callable[[str], Any]) -> None:
    """The findings name the readings that differ from the default."""
    readings = {f.reading for f in capture("plant-b-other-dialect").findings}
    assert {("endian", "big"), ("chunk_trunc", "truncated")} <= readings


def test_files_are_put_together(capture: Callable[[str], Any]) -> None:
    """The files of two uploads and one download are complete."""
    transfers = capture("plant-a-morning-shift").transfers
    assert [(t.upload, t.name, t.state.value, t.received_bytes) for t in transfers] == [
        (True, b"blob.bin", "done", 645),
        (True, b"pick.rob", "done", 488),
        (False, b"blob.bin", "done", 645),
    ]
    assert transfers[0].content == transfers[2].content
    assert bytes(transfers[1].content[:5] + transfers[1].content[-5:]) == b"SCARAARACS"


def test_a_capture_with_gaps_has_no_failures(capture: Callable[[str], Any]) -> None:
    """What depends on lost bytes is inconclusive, the rest is judged."""
    record = capture("plant-a-torn")
    assert broken(record) == []
    assert record.judge.conclusion is Conclusion.INCONCLUSIVE
    assert {u.certain for u in record.unsolicited} == {False}
    judged = {r for r, tally in record.judge.tallies.items() if tally.verdict is Verdict.PASS}
    assert len(judged) > 40


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("complaint-1", [("3/18", 13), ("3/18", 18)]),
        ("complaint-2", [("T/1", 8)]),
        ("complaint-3", [("5.2/12", 1431)]),
        (
            "complaint-4",
            [(requirement, f) for f in (7, 9, 11, 13, 15) for requirement in ("5.1/4", "5.1/8")],
        ),
    ],
)
def test_cause_of_a_complaint(
    capture: Callable[[str], Any], name: str, expected: list[tuple[str, int]]
) -> None:
    """The expected requirement fails at the expected frame."""
    record = capture(name)
    assert set(expected) <= set(broken(record))
    assert record.judge.conclusion is Conclusion.NONCONFORMANT


def test_no_further_failures(capture: Callable[[str], Any]) -> None:
    """No other requirement fails than the one of the cause and the general one."""
    failed = {name: capture(name).failed for name in ("complaint-1", "complaint-2", "complaint-3")}
    assert failed["complaint-1"] == {"3/18"}
    assert failed["complaint-2"] <= {"T/1", "4.3/2"}
    assert failed["complaint-3"] == {"5.2/12"}
    assert capture("complaint-4").failed == {"5.1/4", "5.1/8"}


def test_the_first_different_byte_is_reported(capture: Callable[[str], Any]) -> None:
    """The finding names the first byte that differs, and both contents."""
    (finding,) = (f for f in capture("complaint-3").findings if f.requirement == "5.2/12")
    assert "from byte 65600 on" in finding.message
    assert finding.expected.endswith("at 65600: 40 41 42 43 44 45 46 47")
    assert finding.observed.endswith("at 65600: 00 00 00 00 00 00 00 00")


def test_wrong_chunk_positions_of_a_client(capture: Callable[[str], Any]) -> None:
    """The evidence shows the expected position and the one that was sent."""
    findings = [f for f in capture("complaint-4").findings if f.requirement == "5.1/4"]
    assert [(f.expected, f.observed) for f in findings] == [
        (str(200 * n), str(n)) for n in range(1, 6)
    ]
    assert {f.evidence[0].direction for f in findings} == {A2C}
