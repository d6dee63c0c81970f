"""Forwarding: what the recorder costs the link, beside its peers and the limit that C sets.

A peer and the C forwarder take turns in slices of a tenth of a second, so that whatever else the
machine does meets both. Prints ratios with their spread over the rounds, and what was reached of
the goals, or the profile that says why; nothing depends on it.
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
        subprocess.SubprocessError: A program fails; it has said why.
    """
    rest = _leave_processors()
    with tempfile.TemporaryDirectory(prefix="forwarding-") as name:
        folder = Path(name)
        peers.compile_programs(folder)
        target = peers.free_port()
        stage = Stage(folder, target, rest)
        with peers.running([str(folder / "answer"), str(target)], target, folder / "answer.log"):
            if options.profile:
                ladder.tell(stage, options.rounds, options.turn)
            else:
                compare(stage, options)


def compare(stage: Stage, options: argparse.Namespace) -> None:
    """Measure the recorder beside its peers, and print what was reached of the goals."""
    others = [peers.uvloop_forwarder(), peers.recorder(), peers.recorder(kernel_time=True)]
    if socat := peers.socat():
        others.append(socat)
    else:
        print("socat is not installed and stays out")
    if options.mitmproxy:
        others.append(peers.mitmproxy(stage.folder / "mitmproxy"))
    one = take_turns(stage, others, 1, options.rounds, options.turn)
    tell("one connection", one)
    many = take_turns(stage, others, options.connections, options.rounds, options.turn)
    tell(f"{options.connections} connections", many)
    tell_bulk(take_bulk(stage, others, options.rounds))
    judge(one, many, stage.sustain(options.connections, options.seconds))


def take_turns(
    stage: Stage, others: Sequence[Peer], connections: int, rounds: int, seconds: float
) -> Turns:
    """Measure round trips of all, through so many connections."""
    return stage.beside_c(others, rounds, partial(stage.turn, connections, seconds))


def take_bulk(stage: Stage, others: Sequence[Peer], rounds: int) -> dict[str, list[float]]:
    """Measure a bulk stream through all."""
    return stage.beside_c(others, rounds, partial(stage.bulk, BULK_TIMES, BULK_PIECES))


def tell(what: str, turns: Turns) -> None:
    """Print a table of ratios to the C forwarder."""
    rounds = len(turns[DIRECT])
    print(f"{what}, {rounds} rounds: times the C forwarder's, median (from least to most)")
    print(f"  {'':18}{'p50':24}{'p99':24}{'exchanges/s':24}p50 in µs")
    for name, rows in turns.items():
        cells = (spread([getattr(row, key) for row in rows]) for key in ("p50", "p99", "rate"))
        p50_us = statistics.median(row.p50_us for row in rows)
        print(f"  {name:18}" + "".join(f"{cell:24}" for cell in cells) + f"{p50_us:6.1f}")


def tell_bulk(taken: dict[str, list[float]]) -> None:
    """Print a table of ratios to the C forwarder."""
    size_mb = BULK_TIMES * BULK_PIECES * PIECE_BYTES / 1e6
    print(f"a bulk stream, {size_mb:.0f} MB a round: bytes/s, times the C forwarder's")
    for name, ratios in taken.items():
        print(f"  {name:18}{spread(ratios)}")


def judge(one: Turns, many: Turns, long: Sustained) -> None:
    """Print the goals, and what was reached."""
    ours, socat, mitmproxy = "scaraspec record", "socat", "mitmproxy"
    print(f"goals of {ours}, which records and decodes")
    _goal("p50 to the C forwarder's", [turn.p50 for turn in one[ours]], at_most=1.06)
    _goal("p99 to the C forwarder's", [turn.p99 for turn in one[ours]], at_most=1.25)
    _goal("p99, many connections", [turn.p99 for turn in many[ours]], at_most=1.3)
    if socat in one:
        _goal("p50 to socat's", _quotients(one, ours, socat), at_most=1)
    if mitmproxy in one:
        _goal("mitmproxy's p50 to ours", _quotients(one, mitmproxy, ours), at_least=9)
    _goal("exchanges to uvloop's, for long", [long.rate], at_least=0.9)
    _goal("gaps", [long.gaps], at_most=0)
    _goal("of the exchanges decoded", [long.decoded / long.exchanges], at_least=1)
    _goal("decoded so many s after the end", [long.drained_s], at_most=5)
    behind = long.exchanges / (long.lasted_s + long.drained_s)
    print(f"  ({long.exchanges} exchanges in the long turn, written at {behind:.0f} a second)")


def _goal(
    what: str, reached: Sequence[float], *, at_most: float = float("inf"), at_least: float = 0
) -> None:
    good = at_least <= statistics.median(reached) <= at_most
    wanted = f"at least {at_least:g}" if at_least else f"at most {at_most:g}"
    print(f"  {'reached' if good else 'MISSED':8} {what:32} {wanted:14} {spread(reached)}")


def _quotients(turns: Turns, one: str, other: str) -> list[float]:
    """The p50 of one peer to that of another, round by round."""
    return [a.p50 / b.p50 for a, b in zip(turns[one], turns[other], strict=True)]


def _leave_processors() -> set[int]:
    """Take one processor for the link, which is what starts here; return those that are left."""
    processors = os.sched_getaffinity(0)
    link = {min(processors)}
    os.sched_setaffinity(0, link)
    return processors - link or link


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="forwarding", description="What the recorder costs the link, beside its peers."
    )
    rounds, connections, seconds = _up_to(100, int), _up_to(256, int), _up_to(600, float)
    parser.add_argument("--rounds", type=rounds, default=5, help="turns of each peer [5]")
    parser.add_argument("--turn", type=seconds, default=1.0, help="their length in s [1]")
    parser.add_argument(
        "--connections", type=connections, default=16, help="how many are many [16]"
    )
    parser.add_argument("--seconds", type=seconds, default=10.0, help="the long turn's length [10]")
    parser.add_argument("--mitmproxy", action="store_true", help="install it, and measure it too")
    parser.add_argument(
        "--profile", action="store_true", help="say instead what a round trip consists of"
    )
    return parser.parse_args()


def _up_to(most: int, number: type[int] | type[float]) -> Callable[[str], float]:
    """Return what reads a positive number that is not more than that."""

    def read(text: str) -> float:
        with contextlib.suppress(ValueError):
            if 0 < (value := number(text)) <= most:
                return value
        raise argparse.ArgumentTypeError(f"{text} is no number from above 0 to {most}")

    return read


if __name__ == "__main__":
    main()
