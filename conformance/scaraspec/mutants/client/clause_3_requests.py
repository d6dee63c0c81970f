"""Faults of clause 3: frames that are sent wrongly, and what is sent besides."""

from collections.abc import Iterable
from typing import Any

from scaraspec.client.aio import AsyncClient
from scaraspec.client.core import ClientCore, Event
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.frames import SpoilsFrames
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame

# Layout


@mutant("leaves-out-an-empty-length", "3/1", "3/8")
class LeavesOutAnEmptyLength(SpoilsFrames):
    """The request for the version has no length byte, as it has no data."""

    name = "get_version"

    def spoiled(self, frame: bytes) -> bytes:
        """Leave it out."""
        return frame[:2] + frame[3:]


@mutant("length-ahead-of-the-opcode", "3/1", "3/7")
class LengthAheadOfTheOpcode(SpoilsFrames):
    """In the request to delete a program the length comes ahead of the opcode."""

    name = "delete_program"

    def spoiled(self, frame: bytes) -> bytes:
        """Swap them."""
        return frame[:1] + frame[2:3] + frame[1:2] + frame[3:]


@mutant("starts-as-the-controller", "3/2")
class StartsAsTheController(SpoilsFrames):
    """The request for the network settings starts with CC."""

    name = "get_network"

    def spoiled(self, frame: bytes) -> bytes:
        """Start it so."""
        return b"\xcc" + frame[1:]


@mutant("ends-as-the-controller", "3/3")
class EndsAsTheController(SpoilsFrames):
    """The request for the gripper centre ends with AA."""

    name = "get_gripper_center"

    def spoiled(self, frame: bytes) -> bytes:
        """End it so."""
        return frame[:-1] + b"\xaa"


@mutant("ends-with-line-feed", "3/3")
class EndsWithLineFeed(SpoilsFrames):
    """The request to set the time ends with a line feed."""

    name = "set_time"

    def spoiled(self, frame: bytes) -> bytes:
        """End it so."""
        return frame[:-1] + b"\n"


@mutant("signed-length", "3/6", "3/7", subtle=True)
class SignedLength(SpoilsFrames):
    """A length above 127 is sent as 127."""

    name = "set_password"

    def spoiled(self, frame: bytes) -> bytes:
        """Limit it."""
        return frame[:2] + bytes((min(frame[2], 127),)) + frame[3:]


@mutant("two-bytes-of-length", "3/6", "3/7", subtle=True)
class TwoBytesOfLength(SpoilsFrames):
    """A length above 127 is sent in two bytes of seven bits."""

    name = "set_password"

    def spoiled(self, frame: bytes) -> bytes:
        """Split it."""
        if frame[2] <= 127:
            return frame
        return frame[:2] + bytes((frame[2] | 0x80, frame[2] >> 7)) + frame[3:]


@mutant("counts-the-whole-frame", "3/7")
class CountsTheWholeFrame(SpoilsFrames):
    """The length in the request to set an output counts start, opcode, length and end, too."""

    name = "set_digital_output"

    def spoiled(self, frame: bytes) -> bytes:
        """Count them."""
        return frame[:2] + bytes((len(frame),)) + frame[3:]


@mutant("length-of-the-example", "3/7")
class LengthOfTheExample(SpoilsFrames):
    """The request to set the network has the length 36 that the document prints."""

    name = "set_network"

    def spoiled(self, frame: bytes) -> bytes:
        """Copy it."""
        return frame[:2] + bytes((36,)) + frame[3:]


@mutant("sends-data-behind-zero", "3/8", "3/7")
class SendsDataBehindZero(SpoilsFrames):
    """The request for the motors' temperatures has the length 0 and a byte of data."""

    name = "get_motor_temperatures"

    def spoiled(self, frame: bytes) -> bytes:
        """Put it in."""
        return frame[:3] + b"\0" + frame[3:]


@mutant("tags-its-reset", "3/15")
class TagsItsReset(SpoilsFrames):
    """The request to reset the robot has the tag 90 of its final result."""

    name = "reset"

    def spoiled(self, frame: bytes) -> bytes:
        """Put it in."""
        return frame[:1] + b"\x90" + frame[1:]


@mutant("length-modulo256", "3/28")
class LengthModulo256(ClientCore):
    """Names of any length are sent, and their length modulo 256."""

    _whole = b""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Take it as if it were short."""
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


# Opcodes


@mutant("asks-under-another-opcode", "3/10")
class AsksUnderAnotherOpcode(ClientCore):
    """The joint angles are asked for under 3E, which the document skips."""

    def _send(self, frames: Iterable[Frame]) -> None:
        angles = BY_NAME["get_joint_angles"].opcode
        super()._send(f._replace(opcode=0x3E) if f.opcode == angles else f for f in frames)


@mutant("logs-out", "3/10", subtle=True)
class LogsOut(AsyncClient):
    """It logs out with the opcode 02 before it hangs up."""

    async def close(self) -> None:
        """Log out, and hang up."""
        if self._transport is not None:
            self._transport.write(Frame(A2C, 0x02).encode())
        await super().close()


class _Ticking(ClientCore):
    """Something is sent in every quarter of a second of rest."""

    beat: bytes

    _rests_until_s: float | None = None

    @property
    def deadline_s(self) -> float | None:
        """The next beat, or something earlier."""
        due = super().deadline_s
        beat = self._rests_until_s
        return beat if due is None or (beat is not None and beat < due) else due

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Take the data; the rest begins anew."""
        self._rests_until_s = now_s + 0.25
        return super().feed(data, now_s)

    def tick(self, now_s: float) -> list[Event]:
        """Beat."""
        if self._rests_until_s is not None and now_s >= self._rests_until_s:
            self._outbox += self.beat
            self._rests_until_s = now_s + 0.25
        return super().tick(now_s)

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        """Beat no more."""
        self._rests_until_s = None
        return super().connection_lost(reason, now_s)


@mutant("beats-under-an-undefined-opcode", "3/10", subtle=True)
class BeatsUnderAnUndefinedOpcode(_Ticking):
    """It keeps the connection alive with frames of the opcode 00."""

    beat = Frame(A2C, 0x00).encode()


@mutant("beats-with-single-bytes", "3/32", subtle=True)
class BeatsWithSingleBytes(_Ticking):
    """It keeps the connection alive with bytes that belong to no frame."""

    beat = b"\0"


@mutant("line-ends-behind-frames", "3/32")
class LineEndsBehindFrames(SpoilsFrames):
    """Behind the request to set the default program comes a line end."""

    name = "set_default_program"

    def spoiled(self, frame: bytes) -> bytes:
        """Append it."""
        return frame + b"\r\n"


@mutant("says-quit", "3/32", "3/10", subtle=True)
class SaysQuit(AsyncClient):
    """Before it hangs up it sends the word quit."""

    async def close(self) -> None:
        """Say it, and hang up."""
        if self._transport is not None:
            self._transport.write(b"quit\n")
        await super().close()


# One at a time


@mutant("answers-the-last-asker-first", "3/25")
class AnswersTheLastAskerFirst(ClientCore):
    """A query may be sent again before its answer; the first answer goes to who asked last."""

    def is_free(self, slot: str) -> bool:
        """Always for queries."""
        return slot == "get_status" or super().is_free(slot)

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        """The latest comes first."""
        super().begin(operation, now_s)
        self._open.insert(0, self._open.pop())
