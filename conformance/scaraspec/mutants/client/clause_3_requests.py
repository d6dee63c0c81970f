"""Mutants of clause 3: malformed requests, and bytes between them."""

import asyncio
from collections.abc import Iterable
from typing import Any

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.frames import frame_bytes
from scaraspec.mutants.operators.client.messages import request_frame
from scaraspec.mutants.operators.client.process_memory import memory
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame

# Layout


def _two_length_bytes(frame: bytes) -> bytes:
    if frame[2] <= 127:
        return frame
    return frame[:2] + bytes((frame[2] | 0x80, frame[2] >> 7)) + frame[3:]


row(
    "leaves-out-an-empty-length",
    "3/1 3/8",
    "The request for the version has no length byte.",
    frame_bytes("get_version", lambda frame: frame[:2] + frame[3:]),
)
row(
    "length-ahead-of-the-opcode",
    "3/1 3/7",
    "In the request to delete a program, the length precedes the opcode.",
    frame_bytes("delete_program", lambda frame: frame[:1] + frame[2:3] + frame[1:2] + frame[3:]),
)
row(
    "starts-as-the-controller",
    "3/2",
    "The request for the network settings starts with CC.",
    frame_bytes("get_network", lambda frame: b"\xcc" + frame[1:]),
)
row(
    "ends-as-the-controller",
    "3/3",
    "The request for the gripper center ends with AA.",
    frame_bytes("get_gripper_center", lambda frame: frame[:-1] + b"\xaa"),
)
row(
    "ends-with-line-feed",
    "3/3",
    "The request to set the time ends with a line feed.",
    frame_bytes("set_time", lambda frame: frame[:-1] + b"\n"),
)
row(
    "signed-length",
    "3/6 3/7",
    "A length above 127 is sent as 127.",
    frame_bytes("set_password", lambda frame: frame[:2] + bytes((min(frame[2], 127),)) + frame[3:]),
    subtle=True,
)
row(
    "two-bytes-of-length",
    "3/6 3/7",
    "A length above 127 is sent in two bytes of seven bits.",
    frame_bytes("set_password", _two_length_bytes),
    subtle=True,
)
row(
    "counts-the-whole-frame",
    "3/7",
    "The length in the request to set an output is the size of the whole frame.",
    frame_bytes("set_digital_output", lambda frame: frame[:2] + bytes((len(frame),)) + frame[3:]),
)
row(
    "length-of-the-example",
    "3/7",
    "The request to set the network has the length 36 that the document prints.",
    frame_bytes("set_network", lambda frame: frame[:2] + bytes((36,)) + frame[3:]),
)
row(
    "counts-the-end-of-a-login",
    "3/7",
    "The length of a login is one more than its number of data bytes.",
    frame_bytes("login", lambda frame: frame[:2] + bytes((frame[2] + 1,)) + frame[3:]),
)


def _short_after_the_first(frame: bytes) -> bytes:
    again = memory().setdefault("again", False)
    memory()["again"] = True
    return frame[:2] + bytes((frame[2] - again,)) + frame[3:]


row(
    "counts-less-in-later-logins",
    "3/7",
    "From the second login on, the length is one less than the number of data bytes.",
    frame_bytes("login", _short_after_the_first),
    subtle=True,
)
row(
    "sends-data-behind-zero",
    "3/8 3/7",
    "The request for the motor temperatures has the length 0 and one byte of data.",
    frame_bytes("get_motor_temperatures", lambda frame: frame[:3] + b"\0" + frame[3:]),
)
row(
    "tags-its-reset",
    "3/15",
    "The request to reset the robot has the tag 90 of its final result.",
    frame_bytes("reset", lambda frame: frame[:1] + b"\x90" + frame[1:]),
)


@mutant("mixes-requests", "3/1", subtle=True)
class MixesRequests(AsyncClient):
    """The bytes of two requests that are sent at the same time are mixed."""

    def _update(self) -> None:
        data = self._core.bytes_to_send()
        if self._transport is not None and data:
            self._transport.write(data[:3])
            asyncio.get_running_loop().call_soon(self._transport.write, data[3:])
        super()._update()


@mutant("length-modulo256", "3/28")
class LengthModulo256(ClientCore):
    """The name of a program to delete may have any length, which is sent modulo 256."""

    _whole = b""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if name == "delete_program" and len(value) > 255:
            self._whole, value = value, value[:1]
        return super().command(name, value)

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            if self._whole and frame.opcode == BY_NAME["delete_program"].opcode:
                head = bytes((A2C.start, frame.opcode, len(self._whole) % 256))
                self._outbox += head + self._whole + bytes((A2C.end,))
                self._whole = b""
            else:
                super()._send([frame])


# Opcodes, and bytes between frames


def _sent_before_close(data: bytes) -> type[AsyncClient]:
    """Before the client closes the connection, it sends these bytes."""

    class SentBeforeClose(AsyncClient):
        async def close(self) -> None:
            if self._transport is not None:
                self._transport.write(data)
            await super().close()

    return SentBeforeClose


def _heartbeat(data: bytes) -> type[ClientCore]:
    """After each quarter of a second without received bytes, the client sends these bytes."""

    class Heartbeat(ClientCore):
        next_s: float | None = None

        @property
        def deadline_s(self) -> float | None:
            due_s, next_s = super().deadline_s, self.next_s
            return next_s if due_s is None or (next_s is not None and next_s < due_s) else due_s

        def feed(self, received: bytes, now_s: float) -> list[Event]:
            self.next_s = now_s + 0.25
            return super().feed(received, now_s)

        def tick(self, now_s: float) -> list[Event]:
            if self.next_s is not None and now_s >= self.next_s:
                self._outbox += data
                self.next_s = now_s + 0.25
            return super().tick(now_s)

        def connection_lost(self, reason: str, now_s: float) -> list[Event]:
            self.next_s = None
            return super().connection_lost(reason, now_s)

    return Heartbeat


row(
    "asks-under-another-opcode",
    "3/10",
    "The joint angles are requested with the opcode 3E, which the document skips.",
    request_frame("get_joint_angles", lambda frame: frame._replace(opcode=0x3E)),
)
row(
    "logs-out",
    "3/10",
    "Before the client closes the connection, it sends a frame with the opcode 02.",
    _sent_before_close(Frame(A2C, 0x02).encode()),
    subtle=True,
)
row(
    "beats-under-an-undefined-opcode",
    "3/10",
    "The client keeps the connection alive with frames that have the opcode 00.",
    _heartbeat(Frame(A2C, 0x00).encode()),
    subtle=True,
)
row(
    "beats-with-single-bytes",
    "3/32",
    "The client keeps the connection alive with bytes that belong to no frame.",
    _heartbeat(b"\0"),
    subtle=True,
)
row(
    "line-ends-behind-frames",
    "3/32",
    "A line end follows the request to set the default program.",
    frame_bytes("set_default_program", lambda frame: frame + b"\r\n"),
)
row(
    "says-quit",
    "3/32 3/10",
    "Before the client closes the connection, it sends the word quit.",
    _sent_before_close(b"quit\n"),
    subtle=True,
)


# One at a time


@mutant("answers-the-last-asker-first", "3/25")
class RepeatsQueryBeforeReply(ClientCore):
    """The status is requested again before its reply, and the last caller gets the first reply."""

    def is_free(self, slot: str) -> bool:
        return slot == "get_status" or super().is_free(slot)

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        super().begin(operation, now_s)
        self._open.insert(0, self._open.pop())
