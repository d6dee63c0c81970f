"""Captures with missing packets cause no failure, and keep the findings about other packets.

`python lost_packets.py [PATH…]` cuts each capture at random places, judges both parts, then removes
one per cent of its packets, about one at least. It prints for each capture, and in total:

- the failures of the whole capture, and the judged variants of it;
- false failures: failures of a variant that share no packet with one of the same requirement in the
  whole capture;
- of the failures whose bytes are all in packets that are left, how many are still given.

Without PATH it reads the captures of `fixtures/captures`, then those of `faults.toml`. The latter
have about ten packets, so that many failures follow the missing packets at once: what they show is
not certain before the first answered request. The exit status is 1 after a false failure, or if
less than 80 % are given in the files.
"""

import argparse
import random
import sys
import tempfile
from bisect import bisect_right
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING

import fault_captures
from difficult_captures import lose_share, read

from scaraspec.judge.judge import Judge
from scaraspec.judge.verdicts import Verdict
from scaraspec.traffic.wire import Kind, WireEvent, WireRange
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.pcapng_writer import PcapngWriter
from scaraspec_recorder.sources.capture import McapCapture, open_capture
from scaraspec_recorder.sources.reassembly import Reassembler
from scaraspec_recorder.tcp_segment import Segment

if TYPE_CHECKING:
    from scaraspec.protocol.direction import Direction

CAPTURES = Path(__file__).parents[3] / "fixtures" / "captures"
LEAST_SHARE = 0.8
_SHARE, _LEAST_PACKETS = 0.01, 1.0
_PROCESSES = 2

Failures = dict[tuple[str, int], set[int]]
"""Failures by requirement and last packet of their evidence, each with all packets of it."""


@dataclass
class Outcome:
    """What missing packets did to the failures of a capture."""

    failures: int = 0
    variants: int = 0
    untouched: int = 0
    given: int = 0
    false: list[str] = field(default_factory=list)
    """The variants with a false failure, with its requirement and packet."""

    def add(self, other: "Outcome") -> None:
        """Add the figures of another capture."""
        self.failures += other.failures
        self.variants += other.variants
        self.untouched += other.untouched
        self.given += other.given
        self.false += other.false

    @property
    def share_kept(self) -> float:
        """The share of the untouched failures that are still given; 1 without any."""
        return self.given / self.untouched if self.untouched else 1.0


class _PacketFinder:
    """Finds the packets of a byte range."""

    def __init__(self) -> None:
        self._streams: dict[tuple[str, Direction], list[WireEvent]] = defaultdict(list)

    def add(self, event: WireEvent) -> None:
        if event.kind is Kind.BYTES:
            self._streams[event.connection, event.direction].append(event)

    def packets(self, place: WireRange) -> list[int]:
        events = self._streams[place.connection, place.direction]
        first = bisect_right(events, place.offset_bytes, key=lambda e: e.offset_bytes) - 1
        end = place.offset_bytes + max(place.length_bytes, 1)
        return [e.packet for e in events[max(first, 0) :] if e.offset_bytes < end]


def segments_of(path: Path) -> list[Segment]:
    """Read the TCP segments of a capture, numbered from 1; a recording is converted before.

    Raises:
        CaptureError: The file cannot be read.
    """
    capture = open_capture(path, port=None)
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(capture, McapCapture):
            path = Path(folder) / "capture.pcapng"
            with path.open("wb") as file:
                writer = PcapngWriter(file)
                for event in capture:
                    writer.write(event)
            if capture.summary.merged:
                raise CaptureError(f"{capture.path} holds several recordings")
        return [s._replace(packet=n) for n, s in enumerate(read(path), 1)]


def failures_of(segments: Iterable[Segment]) -> Failures:
    """Judge the connections on the port of the protocol."""
    judge, reassembler, finder = Judge(), Reassembler(), _PacketFinder()
    for events in (*map(reassembler.receive, segments), reassembler.finish()):
        for event in events:
            finder.add(event)
            deque(judge.feed(event), maxlen=0)
    deque(judge.close(), maxlen=0)
    failures: Failures = {}
    for requirement, tally in judge.tallies.items():
        for finding in tally.findings:
            if finding.verdict is Verdict.FAIL:
                packets = [n for place in finding.evidence for n in finder.packets(place)]
                failures[requirement, packets[-1] if packets else 0] = set(packets)
    return failures


def false_failures(found: Failures, due: Failures) -> Iterator[tuple[str, int]]:
    """Yield the failures that share no packet with one of the same requirement in `due`."""
    for (requirement, packet), packets in found.items():
        if not any(packets & others for (other, _), others in due.items() if other == requirement):
            yield requirement, packet


def variants(segments: Sequence[Segment], seeds: int) -> Iterator[tuple[str, list[Segment]]]:
    """Yield both parts at each of some cuts, and the capture with lost packets."""
    for seed in range(seeds):
        cut = random.Random(seed).randrange(1, len(segments))
        yield f"up to packet {cut}", list(segments[:cut])
        yield f"from packet {cut + 1} on", list(segments[cut:])
        share = max(_SHARE, _LEAST_PACKETS / len(segments))
        yield f"lost with seed {seed}", list(lose_share(seed, share)(list(segments)))


def outcome_of(segments: Sequence[Segment], seeds: int) -> Outcome:
    """Judge all variants of a capture."""
    outcome = Outcome()
    if len(segments) < 2:
        return outcome
    due = failures_of(segments)
    outcome.failures = len(due)
    for name, variant in variants(segments, seeds):
        found, left = failures_of(variant), {s.packet for s in variant}
        kept = [key for key, packets in due.items() if packets <= left]
        outcome.variants += 1
        outcome.untouched += len(kept)
        outcome.given += sum(key in found for key in kept)
        outcome.false += [
            f"{name}: {requirement} in packet {packet}"
            for requirement, packet in false_failures(found, due)
        ]
    return outcome


def _files(paths: Iterable[Path]) -> Iterator[Path]:
    for path in paths:
        yield from sorted(path.rglob("*.*cap*")) if path.is_dir() else (path,)


def _outcome(path: Path, seeds: int) -> Outcome | str:
    try:
        return outcome_of(segments_of(path), seeds)
    except CaptureError as error:
        return f"{error}"


def total_of(paths: Iterable[Path], seeds: int) -> Outcome:
    """Judge all variants of all captures in these files and folders, and print their figures."""
    total, files = Outcome(), list(_files(paths))
    print("failures  variants  false  untouched  given  capture")
    with ProcessPoolExecutor(_PROCESSES) as pool:
        for file, outcome in zip(files, pool.map(_outcome, files, repeat(seeds)), strict=True):
            if isinstance(outcome, str):
                print(f"not read: {outcome}")
                continue
            total.add(outcome)
            _print(outcome, file.name)
            for line in outcome.false:
                print(f"  false failure, {line}")
    _print(total, f"in total: {total.share_kept:.1%} of the untouched are given")
    return total


def _print(outcome: Outcome, name: str) -> None:
    print(
        f"{outcome.failures:8}  {outcome.variants:8}  {len(outcome.false):5}  "
        f"{outcome.untouched:9}  {outcome.given:5}  {name}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures; return the exit status."""
    parser = argparse.ArgumentParser(description="Judge captures with missing packets.")
    parser.add_argument("paths", nargs="*", type=Path, metavar="PATH")
    parser.add_argument("--seeds", type=int, default=20, help="cuts and losses of each capture")
    options = parser.parse_args(arguments)
    files = total_of(options.paths or [CAPTURES], options.seeds)
    false = list(files.false)
    if not options.paths:
        with tempfile.TemporaryDirectory() as folder:
            for capture in fault_captures.captures():
                fault_captures.write(capture["session"], Path(folder) / f"{capture['name']}.pcapng")
            false += total_of([Path(folder)], options.seeds).false
    return 1 if false or files.share_kept < LEAST_SHARE else 0


if __name__ == "__main__":
    sys.exit(main())
