"""Faults of clause 3: how frames are made, and how their ends are found."""

from abc import ABC, abstractmethod
from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.connections import AltersBytes, OtherFramer, SendsLater
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Request, Session

# Layout


@mutant("swaps-opcode-and-length", "3/1", "3/7")
class SwapsOpcodeAndLength(AltersBytes):
    """In the reply with the version the length byte stands in front of the opcode."""

    def altered(self, data: bytes) -> bytes:
        """Swap the two."""
        return data[:1] + data[2:0:-1] + data[3:] if data[1] == 0x08 else data


@mutant("leaves-the-end-away", "3/1", "3/5")
class LeavesTheEndAway(AltersBytes):
    """The reply with the version has no end byte."""

    def altered(self, data: bytes) -> bytes:
        """Cut it off."""
        return data[:-1] if data[1] == 0x08 else data


@mutant("starts-like-client", "3/4")
class StartsLikeClient(AltersBytes):
    """The reply with the digital inputs begins with 0xAA."""

    def altered(self, data: bytes) -> bytes:
        """Put it there."""
        return b"\xaa" + data[1:] if data[1] == 0x42 else data


@mutant("speaks-like-client", "3/4", "3/5")
class SpeaksLikeClient(AltersBytes):
    """All frames but the login's begin with 0xAA and end with 0xCC."""

    def altered(self, data: bytes) -> bytes:
        """Swap the two."""
        return data if data[1] == 0x01 else b"\xaa" + data[1:-1] + b"\xcc"


@mutant("ends-like-client", "3/5")
class EndsLikeClient(AltersBytes):
    """The reply with the tool coordinates ends with 0xCC."""

    def altered(self, data: bytes) -> bytes:
        """Put it there."""
        return data[:-1] + b"\xcc" if data[1] == 0x38 else data


@mutant("ends-long-frames-with-zero", "3/5", subtle=True)
class EndsLongFramesWithZero(AltersBytes):
    """Frames of more than 200 bytes end with 0x00."""

    def altered(self, data: bytes) -> bytes:
        """Put it there."""
        return data[:-1] + b"\0" if len(data) > 200 else data


# Length


class _OtherLength(AltersBytes, ABC):
    """The length byte says something else."""

    @abstractmethod
    def length(self, opcode: int, size_bytes: int) -> bytes:
        """What stands for this length."""

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        head = 3 if data[1] == 0x90 else 2
        if data[1] == 0x01:
            return data
        return data[:head] + self.length(data[head - 1], data[head]) + data[head + 1 :]


@mutant("length-of-two-bytes", "3/6", subtle=True)
class LengthOfTwoBytes(_OtherLength):
    """A length from 128 on takes two bytes, as in other protocols."""

    def length(self, opcode: int, size_bytes: int) -> bytes:  # noqa: ARG002 - one signature
        """Seven bits a byte."""
        if size_bytes < 128:
            return bytes((size_bytes,))
        return bytes((size_bytes & 0x7F | 0x80, size_bytes >> 7))


@mutant("length-in-digits", "3/6")
class LengthInDigits(_OtherLength):
    """The length of the network settings is sent in ASCII digits."""

    def length(self, opcode: int, size_bytes: int) -> bytes:
        """Write it."""
        return b"%d" % size_bytes if opcode == 0x04 else bytes((size_bytes,))


@mutant("counts-whole-frame", "3/7")
class CountsWholeFrame(_OtherLength):
    """The length counts start, opcode, length and end too."""

    def length(self, opcode: int, size_bytes: int) -> bytes:  # noqa: ARG002 - one signature
        """Count them."""
        return bytes((min(size_bytes + 4, 255),))


@mutant("counts-end-byte", "3/7")
class CountsEndByte(_OtherLength):
    """The length of the joint angles counts the end byte."""

    def length(self, opcode: int, size_bytes: int) -> bytes:
        """Count it."""
        return bytes((size_bytes + (opcode == 0x3C),))


@mutant("copies-printed-length", "3/7")
class CopiesPrintedLength(_OtherLength):
    """The length of the digital outputs is 3, as printed."""

    def length(self, opcode: int, size_bytes: int) -> bytes:
        """Copy it."""
        return bytes((3 if opcode == 0x49 else size_bytes,))


@mutant("pads-nothing", "3/8")
class PadsNothing(AltersBytes):
    """A reply without data has a zero behind its length all the same."""

    def altered(self, data: bytes) -> bytes:
        """Put it in."""
        return data[:3] + b"\0" + data[3:] if data[2] == 0 else data


@mutant("takes-lengths-for-signed", "3/6", "3/9", subtle=True)
class TakesLengthsForSigned(ControllerCore):
    """Of a frame with more than 127 bytes of data the data are taken for frames."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Look behind the length byte for the next frame."""
        if data[:1] == b"\xaa" and len(data) > 2 and data[2] > 127:
            data = data[3:]
        return super().receive(connection, data, now_s)


@mutant("loses-step-at255", "3/6", subtle=True)
class LosesStepAt255(ControllerCore):
    """Behind a frame with 255 bytes of data the next one is answered wrongly."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._lost = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take the opcode of the one before."""
        lost, self._lost = self._lost, len(frame.data) == 255
        super().handle(session, frame._replace(opcode=0x04) if lost else frame, now_s)


# Marks inside of the data


class _EndsAtMark(RequestFramer):
    """A frame ends at the first end byte."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._bytes = b""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:  # noqa: ARG002 - the signature of an inlet
        found: list[StreamItem] = []
        self._bytes += data
        while (end := self._bytes.find(b"\xcc")) >= 0:
            whole, self._bytes = self._bytes[: end + 1], self._bytes[end + 1 :]
            start = whole.find(b"\xaa")
            if start >= 0 and len(whole) - start >= 4:
                found.append(Frame(A2C, whole[start + 1], whole[start + 3 : -1]))
        return found


@mutant("ends-at-first-end-byte", "3/9")
class EndsAtFirstEndByte(OtherFramer):
    """A frame ends at the first 0xCC, whatever its length says."""

    framer = _EndsAtMark


@mutant("begins-anew-at-start-byte", "3/9", subtle=True)
class BeginsAnewAtStartByte(ControllerCore):
    """In data of more than 50 bytes, 0xAA begins a frame anew."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Forget what stood before the last start byte."""
        return super().receive(connection, data[max(data.rfind(b"\xaa", 0, -50), 0) :], now_s)


@mutant("names-end-at-end-byte", "3/9", subtle=True)
class NamesEndAtEndByte(ControllerCore):
    """A frame with a name is searched for more frames behind a 0xCC in the name."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Answer the rest, too."""
        actions = super().receive(connection, data, now_s)
        if data[1:2] == b"\x54" and b"\xcc\xaa" in data[3:-1]:
            actions += super().receive(connection, b"\xaa\x09\x00\xcc", now_s)
        return actions


@mutant("escapes-marks", "3/9", subtle=True)
class EscapesMarks(ControllerCore):
    """In what is received, 0xCC 0xAA is taken for one escaped 0xAA."""

    def upload_chunk(self, request: Request) -> Any:
        """Unescape it."""
        data = request.frame.data
        if b"\xcc\xaa" in data[12:]:
            data = data[:12] + data[12:].replace(b"\xcc\xaa", b"\xaa").ljust(200, b"\0")
        frame = request.frame._replace(data=data)
        return super().upload_chunk(
            Request(request.session, request.command, frame, request.value, request.now_s)
        )


# What is sent besides


@mutant("analog-under-unknown-opcode", "3/10")
class AnalogUnderUnknownOpcode(ControllerCore):
    """A frame with the undefined opcode 0x45 comes with every analog value."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send it behind."""
        super().emit(session, frame)
        if frame.opcode == 0x44:
            super().emit(session, frame._replace(opcode=0x45))


@mutant("beats-like-heart", "3/26", "3/10")
class BeatsLikeHeart(SendsLater):
    """Half a second after every reply a frame with the opcode 0xFE says that it is alive."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send it later."""
        super().emit(session, frame)
        self.send_at(self._now_s + 0.5, session, Frame(C2A, 0xFE))

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember the time."""
        self._now_s = now_s
        super().handle(session, frame, now_s)


@mutant("announces-itself", "3/26", "3/16")
class AnnouncesItself(ControllerCore):
    """A client that has logged in is told the result of the reset at power-on."""

    def login(self, request: Request) -> bool:
        """Tell it."""
        self.send_after_reply(request.session, Frame(C2A, 0x33, b"11", tagged=True))
        return super().login(request)


@mutant("greets-in-words", "3/32", "3/26")
class GreetsInWords(ControllerCore):
    """A client that connects is greeted with a line of text."""

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.transmit(self.sessions[connection], b"UISR4200S ready\r\n")


@mutant("ends-lines", "3/32")
class EndsLines(AltersBytes):
    """A line end follows each reply with the version."""

    def altered(self, data: bytes) -> bytes:
        """Put it behind."""
        return data + b"\r\n" if data[1] == 0x08 else data


@mutant("fills-up-frames", "3/32")
class FillsUpFrames(AltersBytes):
    """Replies with the network settings are filled up with zeros to 64 bytes."""

    def altered(self, data: bytes) -> bytes:
        """Fill up."""
        return data.ljust(64, b"\0") if data[1] == 0x04 else data


@mutant("sends-checksums", "3/32")
class SendsChecksums(AltersBytes):
    """A checksum follows each frame but the login's."""

    def altered(self, data: bytes) -> bytes:
        """Add all bytes."""
        return data if data[1] == 0x01 else data + bytes((sum(data) % 256,))
