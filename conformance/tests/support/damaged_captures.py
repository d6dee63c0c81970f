"""Damaged captures are read and judged, or refused: no traceback, no hang, little memory.

`python damaged_captures.py` changes bytes of the captures of `fixtures/captures`, of each kind of
file. Half of the changes are in the file as a whole. The others keep the file intact: they are in
the data of TCP segments, with right checksums, and in the chunks of an MCAP file, with right CRCs.
The number of a file and its kind reproduce it: `--kind mcap --first 4711 --count 1`.

`--fuzz SECONDS` searches for inputs with new code paths instead. It needs atheris, a fuzzer that is
not among the dependencies: `pip install atheris`.
"""

import argparse
import faulthandler
import multiprocessing
import random
import resource
import struct
import sys
import tempfile
import time
import traceback
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from io import BytesIO
from pathlib import Path

from difficult_captures import RAW_IP, packet_of, read
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, DataEnd, Footer, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from scaraspec.api import audit
from scaraspec_recorder.errors import CaptureError
from scaraspec_recorder.sinks.mcap.chunk_writer import MAGIC

CAPTURES = Path(__file__).parents[3] / "fixtures" / "captures"
MOST_MEMORY_MB, MOST_TIME_S = 150, 30
_MOST_EDITS, _LARGEST_BYTES = 8, 60_000
_SUSPICIOUS = b"\x00\x01\x7f\x80\xff\xaa\xcc\x90\x52\x56"
_SECTION = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
_INTERFACE = struct.pack("<IIHHI", 1, 20, RAW_IP, 0, 0) + struct.pack("<I", 20)


def mutated(data: bytes, drawn: random.Random) -> bytes:
    """Return data with a few bytes changed, inserted, removed, repeated or cut off."""
    changed = bytearray(data)
    for _ in range(drawn.randint(1, _MOST_EDITS)):
        at, size = drawn.randrange(len(changed) + 1), drawn.choice((1, 1, 2, 4, 8, 40))
        match drawn.randrange(6):
            case 0 | 1:
                changed[at : at + 1] = drawn.choice(_SUSPICIOUS).to_bytes()
            case 2:
                changed[at : at + size] = drawn.randbytes(size)
            case 3:
                changed[at:at] = drawn.randbytes(size)
            case 4:
                del changed[at : at + size]
            case _:
                changed[at:at] = changed[at : at + size]
    return bytes(changed[: drawn.randrange(len(changed) + 1)] if drawn.random() < 0.1 else changed)


@cache
def _files(suffix: str) -> list[Path]:
    files = sorted(CAPTURES.rglob(f"*.{suffix}"))
    return [file for file in files if file.stat().st_size <= _LARGEST_BYTES]


def _packets(suffix: str, drawn: random.Random) -> list[tuple[int, bytes]]:
    """Return the packets of a capture, some of them with other data, and their times."""
    segments = read(drawn.choice(_files(suffix)))
    for _ in range(drawn.randint(1, _MOST_EDITS)):
        at = drawn.randrange(len(segments))
        segments[at] = segments[at]._replace(payload=mutated(segments[at].payload, drawn))
    return [(segment.time_ns, packet_of(segment)) for segment in segments]


def _pcap(drawn: random.Random) -> bytes:
    content = struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 1 << 18, RAW_IP)
    for time_ns, packet in _packets("pcap", drawn):
        size_bytes = len(packet)
        content += struct.pack("<IIII", *divmod(time_ns, 10**9), size_bytes, size_bytes) + packet
    return content


def _pcapng(drawn: random.Random) -> bytes:
    content = _SECTION + _INTERFACE
    for time_ns, packet in _packets("pcapng", drawn):
        padded = packet + bytes(-len(packet) % 4)
        size_bytes, time_us = 32 + len(padded), time_ns // 1000
        times = time_us >> 32, time_us & 0xFFFFFFFF
        content += struct.pack("<IIIIIII", 6, size_bytes, 0, *times, len(packet), len(packet))
        content += padded + struct.pack("<I", size_bytes)
    return content


def _mcap(drawn: random.Random) -> bytes:
    """Return a recording with changed data in one chunk, right CRCs, and no summary."""
    file = BytesIO(drawn.choice(_files("mcap")).read_bytes())
    records: list[McapRecord] = []
    for record in StreamReader(file, emit_chunks=True).records:
        if isinstance(record, DataEnd):
            break
        records.append(record)
    chunks = [at for at, record in enumerate(records) if isinstance(record, Chunk)]
    chosen, written = drawn.choice(chunks), RecordBuilder()
    written.write(MAGIC)
    for at, record in enumerate(records):
        if at == chosen and isinstance(record, Chunk):
            builder = RecordBuilder()
            for part in breakup_chunk(record, validate_crc=False):
                part.write(builder)
            data = mutated(builder.end(), drawn)  # type: ignore[no-untyped-call] # mcap has no types here
            times = record.message_start_time, record.message_end_time
            changed = Chunk("", data, *times, zlib.crc32(data), len(data))
            changed.write(written)
        else:
            record.write(written)
    DataEnd(0).write(written)
    Footer(0, 0, 0).write(written)
    written.write(MAGIC)
    return bytes(written.end())  # type: ignore[no-untyped-call] # mcap has no types here


INTACT: dict[str, Callable[[random.Random], bytes]] = {
    "pcap": _pcap,
    "pcapng": _pcapng,
    "mcap": _mcap,
}


def damaged(kind: str, number: int) -> bytes:
    """Return a changed file of a kind; every second one is an intact file of changed data."""
    drawn = random.Random(f"{kind} {number}")
    if number % 2:
        return INTACT[kind](drawn)
    return mutated(drawn.choice(_files(kind)).read_bytes(), drawn)


def judge(path: Path) -> None:
    """Audit a capture; it may be refused."""
    with suppress(CaptureError):
        audit(path)


def run(kind: str, numbers: range) -> list[str]:
    """Judge files of a kind; return its figures, and a line for each traceback."""
    failures, slowest_s = [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"damaged.{kind}"
        for number in numbers:
            path.write_bytes(damaged(kind, number))
            faulthandler.dump_traceback_later(MOST_TIME_S, exit=True)
            begun_s = time.monotonic()
            try:
                judge(path)
            except Exception:  # noqa: BLE001 - what it is, is reported
                failures.append(f"{kind} {number}: {traceback.format_exc()}")
            slowest_s = max(slowest_s, time.monotonic() - begun_s)
    faulthandler.cancel_dump_traceback_later()
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    if memory_mb > MOST_MEMORY_MB:
        failures.append(f"{kind}: {memory_mb} MB of memory")
    figures = f"{kind}: {len(numbers)} files, {len(failures)} failures, {memory_mb} MB, "
    return [figures + f"slowest {slowest_s:.2f} s", *failures]


def fuzz(seconds: int) -> None:
    """Search for inputs that take new code paths; atheris ends the process."""
    import atheris  # type: ignore[import-untyped]  # noqa: PLC0415 - an optional tool

    with tempfile.TemporaryDirectory() as folder:
        for file in (each for kind in INTACT for each in _files(kind)):
            (Path(folder) / file.name).write_bytes(file.read_bytes())
        path = Path(folder) / "input"

        def judge_input(data: bytes) -> None:
            path.write_bytes(data)
            judge(path)

        atheris.instrument_all()
        limits = f"-max_total_time={seconds}", f"-timeout={MOST_TIME_S}", "-max_len=60000"
        atheris.Setup([sys.argv[0], *limits, folder], judge_input)
        atheris.Fuzz()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures of each kind; return the exit status."""
    parser = argparse.ArgumentParser(description="Judge damaged captures.")
    parser.add_argument("--kind", choices=INTACT, action="append", help="default: all")
    parser.add_argument("--first", type=int, default=0, help="number of the first file")
    parser.add_argument("--count", type=int, default=5000, help="files of each kind")
    parser.add_argument("--fuzz", type=int, metavar="SECONDS", help="fuzz with atheris")
    options = parser.parse_args(arguments)
    if options.fuzz:
        fuzz(options.fuzz)
    numbers = range(options.first, options.first + options.count)
    failed = False
    # A process of its own for each kind: its memory is measured.
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=1) as pool:
        jobs = [(kind, numbers) for kind in options.kind or INTACT]
        for figures, *failures in pool.starmap(run, jobs, chunksize=1):
            print(figures, *failures, sep="\n")
            failed |= bool(failures)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
