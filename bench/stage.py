"""Stage: measures one run of a forwarder.

This module has the load, its results, and the check of the recording. `forwarding` and `ladder`
choose the forwarders and evaluate the results.
"""

import json
import re
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from bench import peers
from bench.peers import Peer
from mcap.exceptions import McapError
from mcap.reader import make_reader

from scaraspec_recorder.spool.locks import spool_folder

DIRECT: Final = "direct"
"""Name of the direct connection without a forwarder."""

_EXCHANGES: Final = "/exchanges"

_T = TypeVar("_T")


class Playing(NamedTuple):
    """A running peer: port, folder, and the id of the forwarding process, if any."""

    port: int
    folder: Path
    pid: int | None


class Load(NamedTuple):
    """Results of the load generator for a port; `exchanges` includes unmeasured ones."""

    exchanges: int
    rate: float
    p50_ns: float
    p99_ns: float


class Turn(NamedTuple):
    """A turn of a peer: ratios to the C forwarder, median round trip, and number of exchanges."""

    p50: float
    p99: float
    rate: float
    p50_us: float
    exchanges: int


class Sustained(NamedTuple):
    """A long run of the recorder."""

    rate: float  # ratio to the uvloop forwarder
    exchanges: int
    decoded: int  # 0 if the recording was not finished
    gaps: int
    lasted_s: float  # duration of the turns of both
    drained_s: float  # from the last reply to the end of the recorder


@dataclass(frozen=True)
class Stage:
    """Runs the turns of the forwarders.

    Attributes:
        folder: Holds the programs; takes logs and recordings.
        target: The port of the answerer.
        rest: The processors that the link does not need.
    """

    folder: Path
    target: int
    rest: set[int]

    @contextmanager
    def playing(self, peer: Peer) -> Iterator[Playing]:
        """Run a peer."""
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        port = peers.free_port()
        with peers.running(
            peer.command(port, self.target, folder), port, folder / "log"
        ) as process:
            pid = process.pid
            if peer.link_module:
                pid = peers.set_processors(pid, peer.link_module, self.rest)
            yield Playing(port, folder, pid)

    def beside_c(
        self, others: Sequence[Peer], rounds: int, measure: Callable[[Playing, int], _T]
    ) -> dict[str, list[_T]]:
        """Measure all, once a round and each round in another order; the C one against itself.

        Args:
            others: Who is measured besides.
            rounds: How often.
            measure: Is given who is measured, and the port of the C forwarder.
        """
        limiting = peers.c_forwarder(self.folder)
        everyone = (limiting, *others)
        taken: dict[str, list[_T]] = {DIRECT: [], **{peer.name: [] for peer in everyone}}
        for number in range(rounds):
            with self.playing(limiting) as limit:
                no_peer = Playing(self.target, self.folder, None)
                taken[DIRECT].append(measure(no_peer, limit.port))
                first = number % len(everyone)
                for peer in (*everyone[first:], *everyone[:first]):
                    with self.playing(peer) as playing:
                        taken[peer.name].append(measure(playing, limit.port))
        return taken

    def load(self, connections: int, seconds: float, *ports: int) -> list[Load]:
        """Ask through all ports, slice by slice in turn, each for so many seconds in all.

        Raises:
            subprocess.CalledProcessError: An answer was wrong or did not come.
        """
        command = (str(self.folder / "load"), str(connections), str(seconds), *map(str, ports))
        printed = subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout  # noqa: S603 - our own program, and numbers
        return [Load(**port) for port in json.loads(printed)]

    def bulk(self, times: int, pieces: int, playing: Playing, limit: int) -> float:
        """Send a bulk stream so many times through each; give the ratio of bytes a second.

        Raises:
            subprocess.CalledProcessError: The stream did not arrive.
        """
        ports = (str(playing.port), str(limit))
        command = (str(self.folder / "bulk"), str(times), str(pieces), *ports)
        printed = subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout  # noqa: S603 - our own program, and numbers
        peer, bare = json.loads(printed)
        return float(peer / bare)

    def turn(self, connections: int, seconds: float, playing: Playing, limit: int) -> Turn:
        """Compare a peer with the forwarder that listens on `limit`."""
        peer, bare = self.load(connections, seconds, playing.port, limit)
        return Turn(
            peer.p50_ns / bare.p50_ns,
            peer.p99_ns / bare.p99_ns,
            peer.rate / bare.rate,
            peer.p50_ns / 1000,
            peer.exchanges,
        )

    def sustain(self, connections: int, seconds: float) -> Sustained:
        """Send requests through the recorder and the uvloop forwarder in alternating slices."""
        with self.playing(peers.uvloop_forwarder()) as (bare, _, _):
            with self.playing(peers.recorder()) as (port, folder, _):
                here, limit = self.load(connections, seconds, port, bare)
                ended_s = time.monotonic()
            drained_s = time.monotonic() - ended_s
        gap_counts = re.findall(r"recorded \+ \d+ in (\d+) gaps", (folder / "log").read_text())
        shutil.rmtree(spool_folder(folder))  # it remains if the recording was not finished
        return Sustained(
            here.rate / limit.rate,
            here.exchanges + peers.PROBES,
            _decoded(folder / "capture.mcap"),
            sum(map(int, gap_counts)),
            2 * seconds,
            drained_s,
        )


def spread(values: Sequence[float], places: int = 2) -> str:
    """Return median, minimum and maximum as text with this number of decimal places."""
    middle, least, most = (f"{of(values):.{places}f}" for of in (statistics.median, min, max))
    return middle if len(values) == 1 else f"{middle} ({least} to {most})"


def _decoded(capture: Path) -> int:
    """Return the number of exchanges in a capture; 0 if the file is not closed."""
    with capture.open("rb") as file:
        try:
            summary = make_reader(file).get_summary()
        except McapError:
            return 0
    if not summary or not summary.statistics:
        return 0
    counts = summary.statistics.channel_message_counts
    return sum(counts.get(c.id, 0) for c in summary.channels.values() if c.topic == _EXCHANGES)
