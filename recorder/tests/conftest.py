"""Settings of hypothesis, and fixtures for all tests of the recorder: traffic to record."""

import math
import os
from collections.abc import Callable
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from mcap.reader import make_reader

from scaraspec.protocol.commands import BY_NAME, JointValues, PortValue, Pose, RunningProgram
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.protocol.transfer import Chunk
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.translation import VARIABLE
from scaraspec_recorder.spool.forwarded_chunks import ForwardedChunk

# A failure prints the blob that reproduces it; examples are the same on every computer.
settings.register_profile("scaraspec", print_blob=True, deadline=None, derandomize=True)
settings.load_profile("scaraspec")
os.environ[VARIABLE] = "en"  # tests read messages, whatever the locale of the developer

START_NS = 1_795_215_517_000_000_000
PASSWORD = b"open sesame"
_SILENT = object()


class Talk:
    """A conversation as wire events, with one frame per event."""

    def __init__(self, connection: str = "1") -> None:
        self.connection = connection
        self.time_ns = START_NS
        self.events: list[WireEvent] = []
        self._offsets = {A2C: 0, C2A: 0}

    def send(self, direction: Direction, data: bytes, after_s: float = 0.001) -> None:
        self.time_ns += int(after_s * 1e9)
        offset = self._offsets[direction]
        self._offsets[direction] += len(data)
        self.events.append(
            WireEvent(self.time_ns, self.connection, direction, Kind.BYTES, data, offset)
        )

    def mark(self, direction: Direction, kind: Kind, note: str = "", length: int = 0) -> None:
        offset = self._offsets[direction]
        self._offsets[direction] += max(length, 0)
        self.events.append(
            WireEvent(self.time_ns, self.connection, direction, kind, b"", offset, length, note)
        )

    def ask(self, name: str, value: Any = None, reply: Any = _SILENT) -> None:
        command = BY_NAME[name]
        initiator, other = command.initiator, command.initiator.opposite
        request = Frame(initiator, command.opcode, command.request.encode(value))
        self.send(initiator, request.encode())
        if reply is not _SILENT:
            answer = Frame(other, command.opcode, command.reply.encode(reply))
            self.send(other, answer.encode(), after_s=0.002)

    def result(self, name: str, outcome: Outcome) -> None:
        command = BY_NAME[name]
        assert command.result
        frame = Frame(C2A, command.opcode, command.result.encode(outcome), tagged=True)
        self.send(C2A, frame.encode())

    def poll(self, joints: JointValues, status: str) -> None:
        """Query everything that is drawn."""
        inner = math.radians(joints.inner_arm)
        outer = inner + math.radians(joints.outer_arm)
        x = 200 * (math.cos(inner) + math.cos(outer))
        y = 200 * (math.sin(inner) + math.sin(outer))
        turn = joints.inner_arm + joints.outer_arm + joints.rotation
        running = RunningProgram(b"pick.rob", 0) if status == "01" else None
        self.ask("get_status", None, status)
        self.ask("get_joint_angles", None, joints)
        self.ask("get_tool_coordinates", None, Pose(x, y, joints.wrist, turn, 0.0, 0.0))
        self.ask("get_motor_temperatures", None, JointValues(31.0, 32.0, 28.0, 27.5))
        self.ask("get_running_program", None, running)
        self.ask("get_digital_inputs", None, "10000001")
        self.ask("get_digital_outputs", None, "1000000000000100")
        self.ask("get_analog_input", 1, 42.5)
        self.time_ns += 50_000_000

    def upload(self, name: bytes, content: bytes) -> None:
        self.ask("upload_name", name, reply=True)
        for position in range(0, len(content), 200):
            piece = content[position : position + 200]
            self.ask("upload_chunk", Chunk(len(content), position, len(piece), piece), reply=True)


@pytest.fixture
def talk() -> Talk:
    """An empty conversation."""
    return Talk()


@pytest.fixture(scope="session")
def new_talk() -> Callable[[], Talk]:
    """The class of conversations, for tests that hypothesis calls repeatedly."""
    return Talk


@pytest.fixture(scope="session")
def program_file() -> bytes:
    """A user program of the repository."""
    folder = Path(__file__).parents[2] / "fixtures" / "programs"
    return (folder / "pick-and-place.rob").read_bytes()


@pytest.fixture(scope="session")
def shift(program_file: bytes) -> list[WireEvent]:
    """A short session with a transfer, a program run, a refusal, an emergency stop, invalid bytes
    and a gap."""
    talk = Talk()
    talk.mark(A2C, Kind.OPENED, "192.168.1.20:51234 to 192.168.1.2:8877")
    talk.ask("login", PASSWORD, reply=True)
    talk.ask("set_time", datetime(2026, 11, 20, 22, 58, 37), reply=True)  # noqa: DTZ001 - the robot's clock knows no zone
    talk.upload(b"pick.rob", program_file)
    talk.ask("run_program", b"pick.rob", Acceptance(accepted=True))
    for step in range(20):
        talk.poll(JointValues(3.0 * step, 60.0 - step, 250.0 - step, 2.0 * step), "01")
    talk.ask("run_program", b"pick.rob", Acceptance(accepted=False, code="01"))
    talk.ask("set_digital_output", PortValue(5, 1), reply=True)
    talk.ask("emergency_stop", None, Acceptance(accepted=True))
    talk.result("emergency_stop", Outcome(done=True))
    talk.result("run_program", Outcome(done=False, code="00"))
    talk.send(C2A, b"\x00noise")
    talk.poll(JointValues(60.0, 40.0, 230.0, 40.0), "12")
    talk.mark(C2A, Kind.GAP, "the recorder's queue overflowed", length=37)
    talk.time_ns += 6_000_000_000
    talk.poll(JointValues(60.0, 40.0, 230.0, 40.0), "00")
    talk.mark(A2C, Kind.HALF_CLOSED)
    talk.mark(C2A, Kind.HALF_CLOSED)
    talk.mark(A2C, Kind.CLOSED)
    return talk.events


@pytest.fixture(scope="session")
def passed(shift: list[WireEvent]) -> list[WireEvent]:
    """The same events with kernel timestamps and a forwarding time 20 µs later."""
    facts = {field.name for field in fields(WireEvent)}
    return [
        ForwardedChunk(
            **{name: getattr(event, name) for name in facts},
            forwarded_ns=event.time_ns + 20_000,
            kernel_time=True,
        )
        if event.kind is Kind.BYTES
        else event
        for event in shift
    ]


def _damage_chunk(path: Path, number: int) -> None:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary
    chunk = summary.chunk_indexes[number]
    data = bytearray(path.read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length - 20] ^= 0x55
    path.write_bytes(data)


@pytest.fixture(scope="session")
def damage_chunk() -> Callable[[Path, int], None]:
    """Return a function that flips bits in the chunk with a given number in a finished MCAP
    file."""
    return _damage_chunk
