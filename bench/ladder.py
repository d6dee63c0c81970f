"""Ladder: the parts of the time of a round trip through the recorder.

Each forwarder does one thing more than the previous one, from the one in C to the recorder. This
module measures the cost of each: as a ratio, in processor time, and in system calls. `stage`
measures one run.
"""

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from bench import peers
from bench.peers import Peer
from bench.stage import DIRECT, Playing, Stage, Turn, spread
from bench.tap_forward import spool_writer

from scaraspec.protocol.direction import A2C
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.spool.records import stream_number

CHUNKS: Final = 200_000
CHUNK: Final = b"\xaa\x09\x00\xcc"  # as the load asks
HOPS: Final = 2
"""Number of chunks of an exchange."""

_TICKS: Final = os.sysconf("SC_CLK_TCK")
_TRACED_S: Final = 1.0
_TRACED_BY_NONE: Final = "TracerPid:\t0\n"
_RARE: Final = 0.01  # per exchange; rarer calls belong to opening and closing
_CALL: Final = re.compile(r"^ *[\d.]+ +[\d.]+ +\d+ +(\d+) +(?:\d+ +)?(\w+)$", re.MULTILINE)


class Step(NamedTuple):
    """A turn of a forwarder, and the processor time of its process in seconds."""

    turn: Turn
    user_s: float
    system_s: float


def print_steps(stage: Stage, rounds: int, seconds: float) -> None:
    """Measure each forwarder, and print the times."""
    dropping, taking = peers.tap(taken=False), peers.tap(taken=True)
    others = (peers.epoll_forwarder(), peers.uvloop_forwarder(), dropping, taking, peers.recorder())

    def measure(playing: Playing, limit: int) -> Step:
        before_s = _spent_s(playing)
        turn = stage.turn(1, seconds, playing, limit)
        user_s, system_s = (b - a for a, b in zip(before_s, _spent_s(playing), strict=True))
        return Step(turn, user_s, system_s)

    steps = stage.beside_c(others, rounds, measure)
    print(
        f"one connection, {rounds} rounds: ratio to the C forwarder, median (minimum to maximum);"
    )
    print("and processor time of the forwarding process, in µs per exchange")
    print(f"  {'':22}{'p50':22}{'p99':22}{'exchanges/s':22}{'user':>6}{'system':>8}")
    for name, measured in steps.items():
        turns = [step.turn for step in measured]
        cells = (spread([getattr(turn, key) for turn in turns]) for key in ("p50", "p99", "rate"))
        user_us, system_us = _spent_us(measured)
        times = "" if name == DIRECT else f"{user_us:6.2f}{system_us:8.2f}"
        print(f"  {name:22}" + "".join(f"{cell:22}" for cell in cells) + times)
    pairs = zip(steps[taking.name], steps[dropping.name], strict=True)
    in_place_ns = [1000 / HOPS * (sum(_spent_us([a])) - sum(_spent_us([b]))) for a, b in pairs]
    print("cost of recording, in ns of processor time per chunk")
    print(f"  alone: {spread(_append_ns(rounds), 0)}; in the tap: {spread(in_place_ns, 0)}")
    _print_calls(stage, (peers.c_forwarder(stage.folder), *others))


def _print_calls(stage: Stage, everyone: Sequence[Peer]) -> None:
    """Print the system calls of each forwarder, in a turn that is not timed."""
    strace = shutil.which("strace")
    if not strace:
        print("system calls per exchange: strace is not installed")
        return
    print(f"system calls per exchange of {HOPS} chunks, without those below {_RARE}")
    for peer in everyone:
        print(f"  {peer.name:22}{_calls(stage, peer, strace)}")


def _calls(stage: Stage, peer: Peer, strace: str) -> str:
    """Return the system calls per exchange as text."""
    with stage.playing(peer) as playing:
        table, status = playing.folder / "calls", Path(f"/proc/{playing.pid}/status")
        command = (strace, "-c", "-f", "-o", str(table), "-p", str(playing.pid))
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as tracing:  # noqa: S603 - strace, and our own process
            try:
                peers.wait_until(
                    lambda: tracing.poll() is not None or _TRACED_BY_NONE not in status.read_text(),
                    lambda: "strace does not begin",
                )
                if tracing.poll() is not None:
                    return "strace has no permission"
                (load,) = stage.load(1, _TRACED_S, playing.port)
            finally:
                tracing.terminate()
        made = Counter({name: int(count) for count, name in _CALL.findall(table.read_text())})
    del made["total"]
    each = {name: count / load.exchanges for name, count in made.most_common()}
    return ", ".join(f"{name} {count:.2f}" for name, count in each.items() if count >= _RARE)


def _spent_s(playing: Playing) -> tuple[float, float]:
    """Return the processor time of the process of a forwarder: user and system."""
    if playing.pid is None:
        return 0.0, 0.0
    fields = Path(f"/proc/{playing.pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) / _TICKS, int(fields[12]) / _TICKS  # utime and stime of proc(5)


def _spent_us(measured: Sequence[Step]) -> tuple[float, float]:
    """Return the processor time per exchange over all turns: user and system."""
    exchanges = sum(step.turn.exchanges for step in measured)
    user_s, system_s = sum(r.user_s for r in measured), sum(r.system_s for r in measured)
    return 1e6 * user_s / exchanges, 1e6 * system_s / exchanges


def _append_ns(rounds: int) -> list[float]:
    """Return the cost of recording a chunk without forwarding, for each round."""
    stream, took = stream_number(1, A2C), []
    with tempfile.TemporaryDirectory(prefix="ladder-") as name:
        append = spool_writer(Path(name), lambda _s, _do: None).append
        for _ in range(rounds):
            begun_ns = time.process_time_ns()
            for number in range(CHUNKS):
                append(Kind.BYTES, stream, begun_ns, number, CHUNK, begun_ns, False)
            took.append((time.process_time_ns() - begun_ns) / CHUNKS)
    return took
