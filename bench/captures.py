"""Captures for benchmarks: the traffic of a client that polls its robot, as pcapng."""

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bench import traffic

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.pcapng_writer import PcapngWriter

PER_SECOND: Final = 200
_START_NS: Final = 1_795_215_517_000_000_000
_REPLY_NS: Final = 1_500_000
_NEVER_REPEATED: Final = ("get_joint_angles", "get_tool_coordinates", "get_analog_input")


def write_polling(path: Path, exchanges: int) -> None:
    """Write a client that polls a robot: most values change only while the arm moves."""
    _write(path, traffic.poll(_START_NS, exchanges, PER_SECOND))


def write_changing(path: Path, exchanges: int) -> None:
    """Write a client that polls values that never repeat."""
    _write(path, _changing(exchanges))


def _changing(exchanges: int) -> Iterator[traffic.Sent]:
    dice = random.Random(0)  # noqa: S311 - values, no secret
    yield from traffic.poll(_START_NS, 1, PER_SECOND)  # the login
    for number in range(1, exchanges):
        command = BY_NAME[_NEVER_REPEATED[number % len(_NEVER_REPEATED)]]
        time_ns = _START_NS + number * traffic.SECOND_NS // PER_SECOND
        asked = b"1" if command.name == "get_analog_input" else b""
        fields = {"get_joint_angles": 4, "get_tool_coordinates": 6}.get(command.name, 1)
        values = "|".join(f"{dice.uniform(-1, 1):.6f}" for _ in range(fields))
        yield traffic.Sent(time_ns, A2C, Frame(A2C, command.opcode, asked).encode())
        reply = Frame(C2A, command.opcode, values.encode()).encode()
        yield traffic.Sent(time_ns + _REPLY_NS, C2A, reply)


def _write(path: Path, frames: Iterator[traffic.Sent]) -> None:
    sent = {A2C: 0, C2A: 0}
    with path.open("wb") as file:
        writer = PcapngWriter(file)
        writer.write(WireEvent(_START_NS, "1", A2C, Kind.OPENED))
        for frame in frames:
            at = (frame.time_ns, "1", frame.direction, Kind.BYTES)
            writer.write(WireEvent(*at, frame.data, sent[frame.direction]))
            sent[frame.direction] += len(frame.data)
