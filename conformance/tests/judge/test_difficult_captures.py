"""Captures over difficult links cause no failure, and lost packets hide no finding elsewhere.

SCARASPEC_FULL=1 tries more seeds.
"""

import os
import random
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from difficult_captures import LINKS, LOSSES, SOURCE, lose_share, read, write

from scaraspec.api import audit
from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Conclusion, Finding, Verdict
from scaraspec_recorder.sources.reassembly import Reassembler
from scaraspec_recorder.tcp_segment import Segment

CAPTURES = SOURCE.parents[1]
WITH_FAULTS = (
    "field/complaint-1.pcapng",
    "field/complaint-2.pcapng",
    "field/complaint-4.pcapng",
    "cases/interleaved.pcap",
)
CONFORMING = (
    "field/plant-a-morning-shift.pcapng",
    "field/plant-a-torn.pcapng",
    "field/plant-b-other-dialect.pcapng",
    "field/plant-c-serial-bridge-bytewise.pcapng",
    "cases/reply-then-reset.pcap",
    "cases/dst.pcap",
)
SEEDS = range(20 if os.environ.get("SCARASPEC_FULL") else 3)
LEAST_SHARE = 0.8


@pytest.mark.parametrize("name", LINKS)
def test_a_difficult_link(tmp_path: Path, name: str) -> None:
    """Nothing is missing, and nothing is wrong."""
    file = tmp_path / "a.pcap"
    write(file, LINKS[name](read(SOURCE)))
    results, _ = audit(file)
    assert results.verdict is Conclusion.NO_VIOLATION
    assert results.judged >= 200


@pytest.mark.parametrize("name", LOSSES)
def test_losses(tmp_path: Path, name: str) -> None:
    """No violation is found in what was recorded; each loss is listed."""
    file = tmp_path / "a.pcap"
    write(file, LOSSES[name](read(SOURCE)))
    results, _ = audit(file)
    assert results.verdict.exit_status == 3
    assert results.label.startswith("no violation found in what was recorded (")
    assert results.session
    assert results.session.losses


def failures(segments: Iterable[Segment]) -> Iterator[Finding]:
    """Yield the failures in a capture."""
    judge, reassembler = Judge(), Reassembler()
    for event in [*(e for s in segments for e in reassembler.receive(s)), *reassembler.finish()]:
        yield from (f for f in judge.feed(event) if isinstance(f, Finding))
    yield from (f for f in judge.close() if isinstance(f, Finding))


def failed(segments: Iterable[Segment]) -> dict[tuple[str, int], set[int]]:
    """Return requirement and time of each failure, with the times of its evidence."""
    return {
        (f.requirement, f.evidence[-1].time_ns): {place.time_ns for place in f.evidence}
        for f in failures(segments)
        if f.verdict is Verdict.FAIL and f.evidence
    }


def variants(segments: list[Segment], seed: int) -> Iterator[list[Segment]]:
    """Yield the capture with lost packets, and without its beginning and its end."""
    yield list(lose_share(seed, max(0.01, 1.5 / len(segments)))(segments))
    cut = random.Random(seed).randrange(len(segments))
    yield segments[cut:]
    yield segments[:cut]


@pytest.mark.parametrize("name", CONFORMING)
def test_no_loss_causes_a_failure(name: str) -> None:
    """Wherever a conforming capture is cut."""
    segments = read(CAPTURES / name)
    for seed in SEEDS:
        for variant in variants(segments, seed):
            assert not failed(variant)


def test_findings_about_other_bytes_are_still_given() -> None:
    """At least four of five, although each variant has more than one loss."""
    untouched = given = 0
    for name in WITH_FAULTS:
        segments = read(CAPTURES / name)
        due = failed(segments)
        for seed in SEEDS:
            for variant in variants(segments, seed):
                found = failed(variant)
                assert {r for r, _ in found} <= {r for r, _ in due}
                captured = {segment.time_ns for segment in variant}
                left = [key for key, evidence in due.items() if evidence <= captured]
                untouched += len(left)
                given += sum(key in found for key in left)
    assert given >= LEAST_SHARE * untouched, f"{given} of {untouched}"
