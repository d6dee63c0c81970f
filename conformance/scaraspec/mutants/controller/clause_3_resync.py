"""Mutants of clause 3: the effect of bytes that are no frame, and of unfinished frames."""

from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.connections import (
    Crashes,
    HandlesSkipped,
    crashes_on_bytes,
    crashes_on_skipped,
    on_skipped,
    received_bytes,
    with_framer,
)
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Skipped, SkipReason, StreamItem
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Session


def _ignores_after(why: SkipReason) -> Core:
    """Bytes are ignored on a connection after a run of skipped bytes."""

    class Ignores(RequestFramer):
        _ignoring = False

        def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
            found = [] if self._ignoring else super().receive(data, now_s)
            self._ignoring |= any(
                isinstance(item, Skipped) and item.reason is why for item in found
            )
            return found

    return with_framer(Ignores)


class LosesNextFrame(RequestFramer):
    """The frame after stray bytes that arrive alone is ignored."""

    _loses = False

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        found = super().receive(data, now_s)
        if self._loses and found and isinstance(found[0], Frame):
            self._loses = False
            return found[1:]
        self._loses |= bool(found) and all(isinstance(item, Skipped) for item in found)
        return found


def _restart(core: Crashes, _session: Session, item: Skipped, now_s: float) -> None:
    if item.reason is SkipReason.BAD_END:
        core.crash(now_s)
        core.crashed = False


def _refuse_login(core: Crashes, session: Session, item: Skipped, _now_s: float) -> None:
    if item.reason is SkipReason.STRAY:
        core.emit(session, Frame(C2A, 0x01, b"0"))


def _answer_list(core: Crashes, session: Session, item: Skipped, _now_s: float) -> None:
    if item.reason is SkipReason.BAD_END and len(item.data) > 1:
        core.emit(session, Frame(C2A, 0x0B, b"0"))


def _contains_frame(data: bytes) -> bool:
    inside = any(frame in data[4:] for frame in (b"\xaa\x07\0\xcc", b"\xaa\x08\0\xcc"))
    return inside and data[:1] == b"\xaa" and data[2:3] != b"\0" and data[-1:] == b"\x55"


def _is_reply(data: bytes) -> bool:
    return data[:1] == b"\xcc" and data[-1:] == b"\xaa"


# Stray bytes

row(
    "dies-of-stray-bytes",
    "3/19",
    "The controller crashes on bytes before a start byte.",
    crashes_on_skipped(lambda item: item.reason is SkipReason.STRAY),
)
row(
    "dies-of-much-garbage",
    "3/19",
    "The controller crashes on more than 4096 stray bytes at once.",
    crashes_on_skipped(lambda item: len(item.data) > 4096),
    subtle=True,
)
row(
    "dies-of-zeros",
    "3/19",
    "The controller crashes on a hundred zeros.",
    crashes_on_skipped(lambda item: item.data.startswith(b"\0" * 100)),
)
row(
    "restarts-at-wrong-end",
    "3/20",
    "The controller restarts after a wrong end byte: every connection is closed.",
    on_skipped(_restart),
    subtle=True,
)
row(
    "deaf-after-stray-bytes",
    "3/19 3/31",
    "After stray bytes all bytes on a connection are ignored, but it stays open.",
    _ignores_after(SkipReason.STRAY),
)
row(
    "loses-request-after-stray-bytes",
    "3/19",
    "The request after stray bytes that arrive alone is ignored; later ones are served.",
    with_framer(LosesNextFrame),
)
row(
    "answers-stray-bytes",
    "3/19",
    "Stray bytes are answered as a refused login.",
    on_skipped(_refuse_login),
)
row(
    "says-nak",
    "3/19 3/20 3/10",
    "Bytes that are no frame are answered with a frame of the opcode 0x15.",
    on_skipped(lambda core, session, _item, _now_s: core.emit(session, Frame(C2A, 0x15))),
)

# Malformed frames

row(
    "dies-of-wrong-ends",
    "3/20",
    "The controller crashes on a wrong end byte.",
    crashes_on_skipped(lambda item: item.reason is SkipReason.BAD_END),
)
row(
    "dies-of-swapped-end",
    "3/20",
    "The controller crashes on the end byte 0xEC, in which one bit is wrong.",
    crashes_on_skipped(lambda item: item.data.endswith(b"\xec")),
    subtle=True,
)
row(
    "deaf-after-wrong-ends",
    "3/20 3/31",
    "After a wrong end byte all bytes on a connection are ignored, but it stays open.",
    _ignores_after(SkipReason.BAD_END),
)


@mutant("hundred-wrong-frames", "3/20", subtle=True)
class CrashesOnHundredthFrame(HandlesSkipped):
    """The controller crashes on the hundredth frame with a wrong end byte, on any connections."""

    _count = 0

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - overrides
        self._count += item.reason is SkipReason.BAD_END
        if self._count == 100:
            self.crash(now_s)


row(
    "dies-of-client-tags",
    "3/20",
    "The controller crashes on a tag from a client.",
    crashes_on_bytes(lambda data: data.startswith(b"\xaa\x90")),
)
row(
    "answers-with-next-opcode",
    "3/20",
    "A frame with a wrong end byte is answered with the opcode of another command.",
    on_skipped(_answer_list),
)
row(
    "dies-of-lengths-in-digits",
    "3/20",
    "The controller crashes on a frame that is shorter than its length byte of 0x30.",
    crashes_on_bytes(lambda data: data[2:4] == b"\x30\xcc"),
)


@mutant("dies-of-truncation", "3/20", subtle=True)
class CrashesOnTruncation(Crashes):
    """The controller crashes on a frame that follows one cut after its fifth byte."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._cut: set[int] = set()

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        if connection in self._cut and data[:1] == b"\xaa":
            self.crash(now_s)
        if data[:1] == b"\xaa" and len(data) == 5 and data[2] > 2:
            self._cut.add(connection)
        return super().receive(connection, data, now_s)


row(
    "dies-of-frame-in-frame",
    "3/20",
    "The controller crashes on a complete frame inside a malformed one.",
    crashes_on_bytes(_contains_frame),
    subtle=True,
)
row(
    "dies-of-lengths-that-count-all",
    "3/20",
    "The controller crashes on a length that counts the whole frame.",
    crashes_on_bytes(
        lambda data: data[:1] == b"\xaa" and len(data) > 4 and data[2] == len(data) - 1
    ),
)
row(
    "dies-of-printed-lengths",
    "3/20",
    "The controller crashes on a request for a download with the length that is printed.",
    crashes_on_skipped(
        lambda item: item.reason is SkipReason.BAD_END and item.data[1:2] == b"\x54"
    ),
)

# The other direction

row(
    "dies-of-its-own-form",
    "3/23",
    "The controller crashes on a frame with the start and end bytes of a reply.",
    crashes_on_bytes(lambda data: _is_reply(data) and len(data) > 3 and data[2] == len(data) - 4),
)


@mutant("answers-in-the-other-form", "3/23", "3/32")
class AnswersRepliesAsClient(ControllerCore):
    """A frame in the form of a reply is answered with a frame in the form of a request."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        session = self.sessions.get(connection)
        if session and _is_reply(data):
            self.transmit(session, b"\xaa" + data[1:2] + b"\x01\x30\xcc")
        return super().receive(connection, data, now_s)


row(
    "takes-replies-for-requests",
    "3/23",
    "A frame in the form of a reply is answered with the network settings.",
    received_bytes(lambda data: b"\xaa\x04\x00\xcc" if _is_reply(data) else data),
)

# Unfinished frames


@mutant("half-frames-block-all", "3/29", subtle=True)
class IgnoresOthersDuringFrame(ControllerCore):
    """While one client is in the middle of a frame, bytes of the others are ignored."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        for number, session in self.sessions.items():
            if number != connection and session.framer.deadline_s is not None:
                return []
        return super().receive(connection, data, now_s)


class KeepsPartialFrame(ControllerCore):
    """The next connection uses the framer of one that was closed during a frame."""

    _left: RequestFramer | None = None

    def close(self, connection: int, now_s: float) -> list[Action]:
        session = self.sessions.get(connection)
        self._left = session.framer if session and session.framer.buffered_bytes else None
        return super().close(connection, now_s)

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        if self._left is not None:
            self.sessions[connection].framer, self._left = self._left, None


row(
    "half-frames-go-on",
    "3/29",
    "A partial frame never times out, and stays in the buffer of the next connection.",
    KeepsPartialFrame,
    with_framer(lambda dialect: RequestFramer(dialect.replace(partial_timeout="none"))),
    subtle=True,
)


@mutant("dies-of-cut-frames", "3/29", subtle=True)
class CrashesOnCutFrame(Crashes):
    """The controller crashes when a connection is closed after 100 bytes of a frame."""

    def close(self, connection: int, now_s: float) -> list[Action]:
        session = self.sessions.get(connection)
        cut = session is not None and session.framer.buffered_bytes > 100
        actions = super().close(connection, now_s)
        if cut:
            self.crash(now_s)
        return actions + self._take_actions()


row(
    "dies-of-silence",
    "3/29",
    "The controller crashes when a partial frame times out.",
    crashes_on_skipped(lambda item: item.reason is SkipReason.TRUNCATED),
)


@mutant("three-half-frames", "3/29", subtle=True)
class IgnoresFourthPartialFrame(ControllerCore):
    """While three clients are in the middle of a frame, bytes of the others are ignored."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        partial = [
            n for n, s in self.sessions.items() if s.framer.buffered_bytes and n != connection
        ]
        return [] if len(partial) >= 3 else super().receive(connection, data, now_s)
