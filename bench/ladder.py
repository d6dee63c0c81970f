"""Ladder: why a round trip through the recorder takes as long as it does.

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
"""How many chunks an exchange is."""

_TICKS: Final = os.sysconf("SC_CLK_TCK")
_TRACED_S: Final = 1.0
_TRACED_BY_NONE: Final = "TracerPid:\t0\n"
_RARE: Final = 0.01  # an exchange; the rest is how a connection begins and ends
_CALL: Final = re.compile(r"^ *[\d.]+ +[\d.]+ +\d+ +(\d+) +(?:\d+ +)?(\w+)$", re.MULTILINE)


class Rung(NamedTuple):
    """A forwarder's turn, and what its process spent on it, in seconds of the processor."""

    turn: Turn
    user_s: float
    system_s: float


def tell(stage: Stage, rounds: int, seconds: float) -> None:
    """Measure so many turns of so many seconds of each forwarder, and print what they cost."""
    dropping, taking = peers.tap(taken=False), peers.tap(taken=True)
    others = (peers.epoll_forwarder(), peers.uvloop_forwarder(), dropping, taking, peers.recorder())

    def climb(playing: Playing, limit: int) -> Rung:
        before_s = _spent_s(playing)
        turn = stage.turn(1, seconds, playing, limit)
        user_s, system_s = (b - a for a, b in zip(before_s, _spent_s(playing), strict=True))
        return Rung(turn, user_s, system_s)

    rungs = stage.beside_c(others, rounds, climb)
    print(f"one connection, {rounds} rounds: times the C forwarder's, median (from least to most);")
    print("and of the process that forwards the processor time, in µs an exchange")
    print(f"  {'':22}{'p50':22}{'p99':22}{'exchanges/s':22}{'user':>6}{'system':>8}")
    for name, climbed in rungs.items():
        turns = [rung.turn for rung in climbed]
        cells = (spread([getattr(turn, key) for turn in turns]) for key in ("p50", "p99", "rate"))
        user_us, system_us = _spent_us(climbed)
        times = "" if name == DIRECT else f"{user_us:6.2f}{system_us:8.2f}"
        print(f"  {name:22}" + "".join(f"{cell:22}" for cell in cells) + times)
    pairs = zip(rungs[taking.name], rungs[dropping.name], strict=True)
    in_place_ns = [1000 / HOPS * (sum(_spent_us([a])) - sum(_spent_us([b]))) for a, b in pairs]
    print("taking a record, in ns of the processor a chunk")
    print(f"  by itself: {spread(_append_ns(rounds), 0)}; in the tap: {spread(in_place_ns, 0)}")
    _tell_calls(stage, (peers.c_forwarder(stage.folder), *others))


def _tell_calls(stage: Stage, everyone: Sequence[Peer]) -> None:
    """Print the system calls of each forwarder, in a turn that is not timed."""
    strace = shutil.which("strace")
    if not strace:
        print("system calls an exchange: strace is not installed")
        return
    print(f"system calls an exchange of {HOPS} chunks; those below {_RARE} are left out")
    for peer in everyone:
        print(f"  {peer.name:22}{_calls(stage, peer, strace)}")


def _calls(stage: Stage, peer: Peer, strace: str) -> str:
    """How often which is made, in words."""
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
                    return "strace may not trace it"
                (load,) = stage.load(1, _TRACED_S, playing.port)
            finally:
                tracing.terminate()
        made = Counter({name: int(count) for count, name in _CALL.findall(table.read_text())})
    del made["total"]
    each = {name: count / load.exchanges for name, count in made.most_common()}
    return ", ".join(f"{name} {count:.2f}" for name, count in each.items() if count >= _RARE)


def _spent_s(playing: Playing) -> tuple[float, float]:
    """The processor time of a forwarder's process so far, its own and the system's for it."""
    if playing.pid is None:
        return 0.0, 0.0
    fields = Path(f"/proc/{playing.pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) / _TICKS, int(fields[12]) / _TICKS  # utime and stime of proc(5)


def _spent_us(climbed: Sequence[Rung]) -> tuple[float, float]:
    """The same an exchange, of these turns together, for the system counts in hundredths."""
    exchanges = sum(rung.turn.exchanges for rung in climbed)
    user_s, system_s = sum(r.user_s for r in climbed), sum(r.system_s for r in climbed)
    return 1e6 * user_s / exchanges, 1e6 * system_s / exchanges


def _append_ns(rounds: int) -> list[float]:
    """What taking a chunk costs where nothing else is done, once a round."""
    stream, took = stream_number(1, A2C), []
    with tempfile.TemporaryDirectory(prefix="ladder-") as name:
        append = spool_writer(Path(name), lambda _s, _do: None).append
        for _ in range(rounds):
            begun_ns = time.process_time_ns()
            for number in range(CHUNKS):
                append(Kind.BYTES, stream, begun_ns, number, CHUNK, begun_ns, False)
            took.append((time.process_time_ns() - begun_ns) / CHUNKS)
    return took
