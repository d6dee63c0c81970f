"""Soak test: a long recording, as fast as possible.

The frames of `traffic` pass through the real spool, sink runner, decoder, judge and sinks into
files that rotate each hour, in one process and with a simulated clock. It prints whether memory
stays flat, the size of the files, and the processor time of writing; with ``--profile`` also the
share of each part.
"""

import argparse
import resource
import tempfile
import time
from collections.abc import Iterable
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Final

from bench import sampling, traffic

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.traffic.wire import Kind
from scaraspec_recorder.recordings.archive import Archive, archive_sink
from scaraspec_recorder.recordings.rotation import RotationPolicy, parse_rotation
from scaraspec_recorder.sinks.sink import TICK_NS
from scaraspec_recorder.sinks.sink_runner import SinkRunner, collect_rarely
from scaraspec_recorder.spool.records import stream_number
from scaraspec_recorder.spool.spool import SpoolReader, SpoolWriter

PER_SECOND: Final = 200
POINTS: Final = 12

PLACES: Final = {
    "scaraspec.judge": "judging",
    "scaraspec.protocol": "protocol",
    "scaraspec_recorder": "the rest of the recorder",
    "scaraspec_recorder.sinks.mcap.schemas": "schemas",
    "scaraspec_recorder.sinks.mcap.mcap_sink": "mcap_file",
    "scaraspec_recorder.sinks.mcap.chunk_writer": "chunk_writer",
    "scaraspec_recorder.sinks.rerun": "drawing",
    "scaraspec_recorder.spool": "spool and sink runner",
    "scaraspec_recorder.sinks.sink_runner": "spool and sink runner",
    "__main__": sampling.LEFT_OUT,
    "bench": sampling.LEFT_OUT,
}
"""The labels of a profile; generating the traffic is not part of writing it."""

_START_NS: Final = 1_795_215_600 * traffic.SECOND_NS
_MIB: Final = 1 << 20
_PASSING_NS: Final = 9_973  # minimum time of forwarding; the maximum is twice that

_say = partial(print, flush=True)


class Soak:
    """The writing path with a simulated clock."""

    def __init__(self, folder: Path, rotate: RotationPolicy) -> None:
        self.out = folder / "out"
        self.out.mkdir()
        self._now_ns = _START_NS
        spool = folder / "spool"
        archive = Archive("soak", rotate=rotate)
        sink = partial(archive_sink, archive=archive, now_ns=self._clock)
        self._writer = SpoolWriter(spool, lambda _s, _do: None, now_ns=self._clock)
        self._writer.append(Kind.OPENED, stream_number(1, A2C), _START_NS, 0, b"client > robot")
        self._scribe = SinkRunner(SpoolReader(spool), self.out, [sink], now_ns=self._clock)
        self._offsets = {A2C: 0, C2A: 0}

    def pass_on(self, now_ns: int, frames: Iterable[traffic.Sent]) -> None:
        """Spool the frames up to `now_ns`, and write them."""
        for time_ns, direction, data in frames:
            stream, offset = stream_number(1, direction), self._offsets[direction]
            forwarded_ns = time_ns + _PASSING_NS + time_ns // PER_SECOND % _PASSING_NS
            self._writer.append(Kind.BYTES, stream, time_ns, offset, data, forwarded_ns)
            self._offsets[direction] = offset + len(data)
        self._writer.flush()
        self._now_ns = now_ns
        while self._scribe.step():
            pass

    def finish(self) -> None:
        """End the recording."""
        self._writer.close()
        while self._scribe.step():
            pass
        self._scribe.finish()
        problems = self._scribe.progress.problems
        assert not problems, problems

    def _clock(self) -> int:
        return self._now_ns


def main() -> None:
    """Write hours of traffic, and print memory, sizes and speed."""
    parser = argparse.ArgumentParser(prog="soak", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--hours", type=float, default=1.25, help="simulated hours [1.25]")
    parser.add_argument("--rotate", type=parse_rotation, default="1h", help="when a file ends [1h]")
    parser.add_argument("--profile", action="store_true", help="print the share of each part")
    options = parser.parse_args()
    exchanges = max(int(options.hours * 3600 * PER_SECOND), POINTS)
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        if not options.profile:
            run(Path(name), exchanges, options.rotate)
            return
        with sampling.sampled(PLACES) as samples:
            run(Path(name), exchanges, options.rotate)
        samples.print_table("the writing, in seconds of its processor")


def run(folder: Path, exchanges: int, rotate: RotationPolicy) -> None:
    """Write; print memory during the run, and sizes and speed at the end."""
    hours = exchanges / PER_SECOND / 3600
    _say(f"{exchanges} exchanges, {hours:g} h at {PER_SECOND}/s")
    soak = Soak(folder, rotate)
    collect_rarely()
    written, points, busy_s = 0, 0, 0.0
    resident: list[int] = []
    for now_ns, frames in groupby(traffic.poll(_START_NS, exchanges, PER_SECOND), _tick):
        passed = tuple(frames)
        before_s = time.process_time()
        soak.pass_on(now_ns, passed)
        busy_s += time.process_time() - before_s
        written += sum(sent.direction is A2C for sent in passed)
        resident.append(_resident_bytes())
        if written * POINTS >= exchanges * (points + 1):
            points += 1
            least, most = min(resident) / _MIB, max(resident) / _MIB
            _say(f"  up to {written:9} exchanges: {least:6.1f} to {most:6.1f} MiB resident")
            resident.clear()
    before_s = time.process_time()
    soak.finish()
    busy_s += time.process_time() - before_s
    for suffix in (".mcap", ".rrd"):
        sizes = [path.stat().st_size for path in soak.out.glob(f"*{suffix}")]
        each_bytes = sum(sizes) / exchanges
        day_gb = each_bytes * PER_SECOND * 86_400 / 1e9
        printed = f"{len(sizes)} files, {each_bytes:.0f} bytes an exchange"
        _say(f"  {suffix:6}{printed}, {day_gb:.2f} GB a day")
    child_bytes = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    _say(f"  {child_bytes / _MIB:.0f} MiB at most in the process that compacts an .rrd")
    _say(f"  {exchanges / busy_s:.0f} exchanges written per second of its processor")


def _tick(sent: traffic.Sent) -> int:
    """Return the end of the tick in which a frame was sent."""
    return (sent.time_ns // TICK_NS + 1) * TICK_NS


def _resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


if __name__ == "__main__":
    main()
