"""Mutants of clause 3: the layout of frames, and how their ends are found."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.connections import (
    SendsLater,
    received_bytes,
    with_framer,
)
from scaraspec.mutants.operators.controller.replies import frame_bytes
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Request, Session

# Layout


def _reply_bytes(opcode: int, change: Callable[[bytes], bytes]) -> Core:
    """The bytes of first replies with one opcode are changed."""
    return frame_bytes(lambda data: change(data) if data[1] == opcode else data)


def _except_login(change: Callable[[bytes], bytes]) -> Core:
    """The bytes of all frames but the replies to logins are changed."""
    return frame_bytes(lambda data: data if data[1] == 0x01 else change(data))


def _length(encode: Callable[[int, int], bytes]) -> Core:
    """The length is encoded by a function of the opcode and the number of data bytes."""

    def change(data: bytes) -> bytes:
        head = 3 if data[1] == 0x90 else 2
        return data[:head] + encode(data[head - 1], data[head]) + data[head + 1 :]

    return _except_login(change)


def _two_bytes(_opcode: int, size_bytes: int) -> bytes:
    if size_bytes < 128:
        return bytes((size_bytes,))
    return bytes((size_bytes & 0x7F | 0x80, size_bytes >> 7))


row(
    "swaps-opcode-and-length",
    "3/1 3/7",
    "In the reply with the version the length byte precedes the opcode.",
    _reply_bytes(0x08, lambda data: data[:1] + data[2:0:-1] + data[3:]),
)
row(
    "leaves-the-end-away",
    "3/1 3/5",
    "The reply with the version has no end byte.",
    _reply_bytes(0x08, lambda data: data[:-1]),
)
row(
    "starts-like-client",
    "3/4",
    "The reply with the digital inputs begins with 0xAA.",
    _reply_bytes(0x42, lambda data: b"\xaa" + data[1:]),
)
row(
    "speaks-like-client",
    "3/4 3/5",
    "All frames except the replies to logins begin with 0xAA and end with 0xCC.",
    _except_login(lambda data: b"\xaa" + data[1:-1] + b"\xcc"),
)
row(
    "ends-like-client",
    "3/5",
    "The reply with the tool coordinates ends with 0xCC.",
    _reply_bytes(0x38, lambda data: data[:-1] + b"\xcc"),
)
row(
    "ends-long-frames-with-zero",
    "3/5",
    "Frames of more than 200 bytes end with 0x00.",
    frame_bytes(lambda data: data[:-1] + b"\0" if len(data) > 200 else data),
    subtle=True,
)

# Length

row(
    "length-of-two-bytes",
    "3/6",
    "A length from 128 on is encoded in two bytes, as in other protocols.",
    _length(_two_bytes),
    subtle=True,
)
row(
    "length-in-digits",
    "3/6",
    "The length of the network settings is sent in ASCII digits.",
    _length(lambda opcode, size: b"%d" % size if opcode == 0x04 else bytes((size,))),
)
row(
    "counts-whole-frame",
    "3/7",
    "The length also counts start, opcode, length and end.",
    _length(lambda _opcode, size: bytes((min(size + 4, 255),))),
)
row(
    "counts-end-byte",
    "3/7",
    "The length of the joint angles counts the end byte.",
    _length(lambda opcode, size: bytes((size + (opcode == 0x3C),))),
)
row(
    "copies-printed-length",
    "3/7",
    "The length of the digital outputs is 3, as printed.",
    _length(lambda opcode, size: bytes((3 if opcode == 0x49 else size,))),
)
row(
    "counts-end-byte-of-login",
    "3/7",
    "The length of the reply to a login counts the end byte.",
    _reply_bytes(0x01, lambda data: data[:2] + bytes((data[2] + 1,)) + data[3:]),
)
row(
    "pads-nothing",
    "3/8",
    "A reply without data contains a zero after its length.",
    frame_bytes(lambda data: data[:3] + b"\0" + data[3:] if data[2] == 0 else data),
)
row(
    "takes-lengths-for-signed",
    "3/6 3/9",
    "The data of a frame with more than 127 bytes of data are read as frames.",
    received_bytes(lambda data: data[3:] if data[:1] == b"\xaa" and data[2:3] > b"\x7f" else data),
    subtle=True,
)


@mutant("loses-step-at255", "3/6", subtle=True)
class MisreadsAfterLongestFrame(ControllerCore):
    """The request after a frame with 255 bytes of data is answered with the network settings."""

    _lost = False

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        lost, self._lost = self._lost, len(frame.data) == 255
        super().handle(session, frame._replace(opcode=0x04) if lost else frame, now_s)


# Start and end bytes in the data


class _EndsAtEndByte(RequestFramer):
    """A frame ends at the first end byte."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._bytes = b""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:  # noqa: ARG002 - a framer's signature
        found: list[StreamItem] = []
        self._bytes += data
        while (end := self._bytes.find(b"\xcc")) >= 0:
            whole, self._bytes = self._bytes[: end + 1], self._bytes[end + 1 :]
            start = whole.find(b"\xaa")
            if start >= 0 and len(whole) - start >= 4:
                found.append(Frame(A2C, whole[start + 1], whole[start + 3 : -1]))
        return found


row(
    "ends-at-first-end-byte",
    "3/9",
    "A frame ends at the first 0xCC, whatever its length byte is.",
    with_framer(_EndsAtEndByte),
)
row(
    "begins-anew-at-start-byte",
    "3/9",
    "In data of more than 50 bytes, 0xAA starts a new frame.",
    received_bytes(lambda data: data[max(data.rfind(b"\xaa", 0, -50), 0) :]),
    subtle=True,
)


@mutant("names-end-at-end-byte", "3/9", subtle=True)
class FindsFramesInNames(ControllerCore):
    """A download whose name contains 0xCC 0xAA is also answered with the status."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        actions = super().receive(connection, data, now_s)
        if data[1:2] == b"\x54" and b"\xcc\xaa" in data[3:-1]:
            actions += super().receive(connection, b"\xaa\x09\x00\xcc", now_s)
        return actions


@mutant("escapes-marks", "3/9", subtle=True)
class UnescapesChunks(ControllerCore):
    """0xCC 0xAA in a received chunk is read as one escaped 0xAA."""

    def upload_chunk(self, request: Request) -> Any:
        head, data = request.frame.data[:12], request.frame.data[12:]
        if b"\xcc\xaa" in data:
            data = data.replace(b"\xcc\xaa", b"\xaa").ljust(200, b"\0")
        frame = request.frame._replace(data=head + data)
        return super().upload_chunk(replace(request, frame=frame))


# Additional frames and bytes


@mutant("analog-under-unknown-opcode", "3/10")
class SendsUndefinedOpcode(ControllerCore):
    """A frame with the undefined opcode 0x45 follows every analog value."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        if frame.opcode == 0x44:
            super().emit(session, frame._replace(opcode=0x45))


@mutant("beats-like-heart", "3/26", "3/10")
class SendsHeartbeats(SendsLater):
    """Half a second after every reply a frame with the opcode 0xFE is sent as a heartbeat."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        self.send_later(0.5, session, Frame(C2A, 0xFE))


@mutant("announces-itself", "3/26", "3/16")
class AnnouncesReset(ControllerCore):
    """After each login the final result of a reset is sent."""

    def login(self, request: Request) -> bool:
        self.send_after_reply(request.session, Frame(C2A, 0x33, b"11", tagged=True))
        return super().login(request)


@mutant("greets-in-words", "3/32", "3/26")
class SendsGreeting(ControllerCore):
    """A line of text is sent to a client that connects."""

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.transmit(self.sessions[connection], b"UISR4200S ready\r\n")


row(
    "ends-lines",
    "3/32",
    "A line end follows each reply with the version.",
    _reply_bytes(0x08, lambda data: data + b"\r\n"),
)
row(
    "fills-up-frames",
    "3/32",
    "Replies with the network settings are padded with zeros to 64 bytes.",
    _reply_bytes(0x04, lambda data: data.ljust(64, b"\0")),
)
row(
    "sends-checksums",
    "3/32",
    "A checksum follows each frame except the replies to logins.",
    _except_login(lambda data: data + bytes((sum(data) % 256,))),
)
