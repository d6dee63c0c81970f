"""Finding frames: our framer compared with the dissection of scapy on the same bytes.

The framer is given 64 KiB reads, and one frame a read as on a real link; scapy is given each frame
by itself, already cut out, which spares it the search.
"""

import random
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Final

from scapy.fields import ByteField, FieldLenField, StrLenField
from scapy.packet import Packet

from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Framer

FRAMES: Final = 100_000
SCAPY_FRAMES: Final = 5_000
ROUNDS: Final = 7
READ_BYTES: Final = 65_536


class ScapyFrame(Packet):
    """The frame of clause 3 as a scapy layer."""

    fields_desc = [  # noqa: RUF012 - scapy's interface
        ByteField("start", 0xCC),
        ByteField("opcode", 0),
        FieldLenField("length", None, length_of="data", fmt="B"),
        StrLenField("data", b"", length_from=lambda packet: packet.length),
        ByteField("end", 0xAA),
    ]


def frames_per_second(work: Callable[[Sequence[bytes]], int], reads: Sequence[bytes]) -> float:
    """Return the frames per second that `work` finds in `reads`."""
    begun = time.perf_counter()
    found = work(reads)
    return found / (time.perf_counter() - begun)


def framer(reads: Sequence[bytes]) -> int:
    """Find frames with our framer."""
    one = Framer(C2A)
    return sum(len(one.feed(data)) for data in reads)


def scapy(reads: Sequence[bytes]) -> int:
    """Find frames with scapy."""
    return sum(ScapyFrame(data).end == C2A.end for data in reads)


def main() -> None:
    """Measure alternately, and print the ratios of the rounds."""
    draw = random.Random(1)  # noqa: S311 - a fixed mixture of frames, no secret
    texts = (b"00", b"1", b"20.4|30.5|38.0|0", b"1|10000000")
    frames = [Frame(C2A, 0x09, draw.choice(texts)).encode() for _ in range(FRAMES)]
    stream = b"".join(frames)
    reads = [stream[at : at + READ_BYTES] for at in range(0, len(stream), READ_BYTES)]
    ratios: dict[str, list[float]] = {"64 KiB a read": [], "one frame a read": []}
    print(f"frames/s, ratio to scapy, {ROUNDS} alternating rounds")
    for _ in range(ROUNDS):
        peer = frames_per_second(scapy, frames[:SCAPY_FRAMES])
        ratios["64 KiB a read"].append(frames_per_second(framer, reads) / peer)
        ratios["one frame a read"].append(frames_per_second(framer, frames) / peer)
    for name, values in ratios.items():
        middle = statistics.median(values)
        print(f"  {name:17} {middle:6.1f} times ({min(values):.1f} to {max(values):.1f})")


if __name__ == "__main__":
    main()
