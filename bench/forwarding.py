"""Forwarding: the cost of the recorder for the link, compared with peers and with a C forwarder.

A peer and the C forwarder run alternately in slices of a tenth of a second, so that other load
affects both. Prints ratios with their spread over the rounds, and the reached goals, or the profile
that shows the reason; no test depends on it.
"""

import argparse
import contextlib
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from bench import ladder, peers
from bench.peers import Peer
from bench.stage import DIRECT, Stage, Sustained, Turn, spread

BULK_TIMES: Final = 3
BULK_PIECES: Final = 16_384
PIECE_BYTES: Final = 259  # as in exchange.h

Turns = dict[str, list[Turn]]
"""By peer, one a round."""


def main() -> None:
    """Measure and print; say in a sentence why where that cannot be done."""
    options = _options()
    if sys.platform != "linux" or not shutil.which("cc"):
        sys.exit("forwarding: this needs Linux and a C compiler named cc")
    try:
        measure(options)
    except (RuntimeError, subprocess.SubprocessError) as error:
        sys.exit(f"forwarding: {error}")


def measure(options: argparse.Namespace) -> None:
    """Measure and print.

    Raises:
        RuntimeError: A forwarder does not come up.
        subprocess.SubprocessError: A program fails; the output has the reason.
    """
    rest = _reserve_processor()
    with tempfile.TemporaryDirectory(prefix="forwarding-") as name:
        folder = Path(name)
        peers.compile_programs(folder)
        target = peers.free_port()
        stage = Stage(folder, target, rest)
        with peers.running([str(folder / "answer"), str(target)], target, folder / "answer.log"):
            if options.profile:
                ladder.print_steps(stage, options.rounds, options.turn)
            else:
                compare(stage, options)


def compare(stage: Stage, options: argparse.Namespace) -> None:
    """Compare the recorder with its peers, and print which goals are reached."""
    others = [
        peers.uvloop_forwarder(),
        peers.recorder(),
        peers.recorder("… by kernel time", "--timestamps", "kernel"),
        peers.recorder("… durable", "--durable"),
    ]
    if socat := peers.socat():
        others.append(socat)
    else:
        print("socat is not installed and is skipped")
    if options.mitmproxy:
        others.append(peers.mitmproxy(stage.folder / "mitmproxy"))
    one = measure_turns(stage, others, 1, options.rounds, options.turn)
    print_turns("one connection", one)
    many = measure_turns(stage, others, options.connections, options.rounds, options.turn)
    print_turns(f"{options.connections} connections", many)
    print_bulk(measure_bulk(stage, others, options.rounds))
    print_goals(one, many, stage.sustain(options.connections, options.seconds))


def measure_turns(
    stage: Stage, others: Sequence[Peer], connections: int, rounds: int, seconds: float
) -> Turns:
    """Measure round trips of all forwarders through this number of connections."""
    return stage.beside_c(others, rounds, partial(stage.turn, connections, seconds))


def measure_bulk(stage: Stage, others: Sequence[Peer], rounds: int) -> dict[str, list[float]]:
    """Measure a bulk stream through all forwarders."""
    return stage.beside_c(others, rounds, partial(stage.bulk, BULK_TIMES, BULK_PIECES))


def print_turns(what: str, turns: Turns) -> None:
    """Print a table of ratios to the C forwarder."""
    rounds = len(turns[DIRECT])
    print(f"{what}, {rounds} rounds: ratio to the C forwarder, median (minimum to maximum)")
    print(f"  {'':18}{'p50':24}{'p99':24}{'exchanges/s':24}p50 in µs")
    for name, rows in turns.items():
        cells = (spread([getattr(row, key) for row in rows]) for key in ("p50", "p99", "rate"))
        p50_us = statistics.median(row.p50_us for row in rows)
        print(f"  {name:18}" + "".join(f"{cell:24}" for cell in cells) + f"{p50_us:6.1f}")


def print_bulk(taken: dict[str, list[float]]) -> None:
    """Print a table of ratios to the C forwarder."""
    size_mb = BULK_TIMES * BULK_PIECES * PIECE_BYTES / 1e6
    print(f"a bulk stream, {size_mb:.0f} MB per round: bytes/s, ratio to the C forwarder")
    for name, ratios in taken.items():
        print(f"  {name:18}{spread(ratios)}")


def print_goals(one: Turns, many: Turns, long: Sustained) -> None:
    """Print the goals and the measured values."""
    ours, socat, mitmproxy = "scaraspec record", "socat", "mitmproxy"
    print(f"goals of {ours}, which records and decodes")
    _goal("p50, ratio to the C forwarder", [turn.p50 for turn in one[ours]], at_most=1.06)
    _goal("p99, ratio to the C forwarder", [turn.p99 for turn in one[ours]], at_most=1.25)
    _goal("p99, many connections", [turn.p99 for turn in many[ours]], at_most=1.3)
    if socat in one:
        _goal("p50, ratio to socat", _p50_ratios(one, ours, socat), at_most=1)
    if mitmproxy in one:
        _goal("p50 of mitmproxy, ratio to ours", _p50_ratios(one, mitmproxy, ours), at_least=9)
    _goal("long run, ratio to uvloop", [long.rate], at_least=0.9)
    _goal("gaps", [long.gaps], at_most=0)
    _goal("share of decoded exchanges", [long.decoded / long.exchanges], at_least=1)
    _goal("seconds until all is decoded", [long.drained_s], at_most=5)
    written_per_s = long.exchanges / (long.lasted_s + long.drained_s)
    print(f"  ({long.exchanges} exchanges in the long run, {written_per_s:.0f} written per second)")


def _goal(
    what: str, reached: Sequence[float], *, at_most: float = float("inf"), at_least: float = 0
) -> None:
    good = at_least <= statistics.median(reached) <= at_most
    goal = f"at least {at_least:g}" if at_least else f"at most {at_most:g}"
    print(f"  {'reached' if good else 'MISSED':8} {what:32} {goal:14} {spread(reached)}")


def _p50_ratios(turns: Turns, one: str, other: str) -> list[float]:
    """Return the ratio of the p50 of two peers, for each round."""
    return [a.p50 / b.p50 for a, b in zip(turns[one], turns[other], strict=True)]


def _reserve_processor() -> set[int]:
    """Reserve one processor for the link; return the other processors."""
    processors = os.sched_getaffinity(0)
    link = {min(processors)}
    os.sched_setaffinity(0, link)
    return processors - link or link


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="forwarding",
        description="Measure the cost of the recorder for the link, compared with peers.",
    )
    rounds, connections, seconds = _up_to(100, int), _up_to(256, int), _up_to(600, float)
    parser.add_argument("--rounds", type=rounds, default=5, help="turns of each peer [5]")
    parser.add_argument("--turn", type=seconds, default=1.0, help="length of a turn in s [1]")
    parser.add_argument(
        "--connections", type=connections, default=16, help="number of connections [16]"
    )
    parser.add_argument(
        "--seconds", type=seconds, default=10.0, help="length of the long run in s [10]"
    )
    parser.add_argument(
        "--mitmproxy", action="store_true", help="also install and measure mitmproxy"
    )
    parser.add_argument(
        "--profile", action="store_true", help="print the parts of a round trip instead"
    )
    return parser.parse_args()


def _up_to(most: int, number: type[int] | type[float]) -> Callable[[str], float]:
    """Return a parser of positive numbers up to `most`."""

    def read(text: str) -> float:
        with contextlib.suppress(ValueError):
            if 0 < (value := number(text)) <= most:
                return value
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0 and up to {most}")

    return read


if __name__ == "__main__":
    main()
