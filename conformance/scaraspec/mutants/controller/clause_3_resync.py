"""Faults of clause 3: what bytes that are no frame, and frames that stop, do to the controller."""

from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.connections import Mortal, OtherFramer, Skips
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Skipped, SkipReason, StreamItem
from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Session

# Stray bytes


@mutant("dies-of-stray-bytes", "3/19")
class DiesOfStrayBytes(Skips):
    """Bytes ahead of a start byte end the program."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if item.why is SkipReason.STRAY:
            self.die(now_s)


@mutant("dies-of-much-garbage", "3/19", subtle=True)
class DiesOfMuchGarbage(Skips):
    """More than 4096 stray bytes at once end the program."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if len(item.data) > 4096:
            self.die(now_s)


@mutant("dies-of-zeros", "3/19")
class DiesOfZeros(Skips):
    """A hundred zeros end the program."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if item.data.startswith(b"\0" * 100):
            self.die(now_s)


@mutant("restarts-at-wrong-end", "3/20", subtle=True)
class RestartsAtWrongEnd(Skips):
    """A wrong end byte ends the program, which is started anew at once: every client is cut off."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die, and live again."""
        if item.why is SkipReason.BAD_END:
            self.die(now_s)
            self.dead = False


class _Deaf(RequestFramer):
    """Hears nothing any more once it has met what it cannot stand."""

    deaf = False

    def unbearable(self, item: Skipped) -> bool:
        """Whether it is that."""
        return item.why is SkipReason.STRAY

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        found = [] if self.deaf else super().receive(data, now_s)
        self.deaf = self.deaf or any(
            self.unbearable(item) for item in found if isinstance(item, Skipped)
        )
        return found


@mutant("deaf-after-stray-bytes", "3/19", "3/31")
class DeafAfterStrayBytes(OtherFramer):
    """After stray bytes nothing is heard any more on a connection, which stays open."""

    framer = _Deaf


@mutant("answers-stray-bytes", "3/19")
class AnswersStrayBytes(Skips):
    """Stray bytes are answered as a login that failed."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Answer."""
        if item.why is SkipReason.STRAY:
            self.emit(session, Frame(C2A, 0x01, b"0"))


@mutant("says-nak", "3/19", "3/20", "3/10")
class SaysNak(Skips):
    """Bytes that are no frame are answered with a frame of the opcode 0x15."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Answer."""
        self.emit(session, Frame(C2A, 0x15))


# Spoilt frames


@mutant("dies-of-wrong-ends", "3/20")
class DiesOfWrongEnds(Skips):
    """A wrong end byte ends the program."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if item.why is SkipReason.BAD_END:
            self.die(now_s)


@mutant("dies-of-swapped-end", "3/20", subtle=True)
class DiesOfSwappedEnd(Skips):
    """An end byte of 0xEC, a digit of which is wrong, ends the program."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if item.data.endswith(b"\xec"):
            self.die(now_s)


class _DeafAfterBadEnd(_Deaf):
    def unbearable(self, item: Skipped) -> bool:
        return item.why is SkipReason.BAD_END


@mutant("deaf-after-wrong-ends", "3/20", "3/31")
class DeafAfterWrongEnds(OtherFramer):
    """After a wrong end byte nothing is heard any more on a connection, which stays open."""

    framer = _DeafAfterBadEnd


@mutant("hundred-wrong-frames", "3/20", subtle=True)
class HundredWrongFrames(Skips):
    """After a hundred spoilt frames, on whatever connections, nobody is served any more."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._count = 0

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Count."""
        self._count += item.why is SkipReason.BAD_END
        if self._count == 100:
            self.die(now_s)


@mutant("dies-of-client-tags", "3/20")
class DiesOfClientTags(Mortal):
    """A tag from a client ends the program."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Die."""
        if data.startswith(b"\xaa\x90"):
            self.die(now_s)
        return super().receive(connection, data, now_s)


@mutant("answers-with-next-opcode", "3/20")
class AnswersWithNextOpcode(Skips):
    """A spoilt frame is answered under the opcode of another command."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Answer."""
        if item.why is SkipReason.BAD_END and len(item.data) > 1:
            self.emit(session, Frame(C2A, 0x0B, b"0"))


@mutant("dies-of-lengths-in-digits", "3/20")
class DiesOfLengthsInDigits(Mortal):
    """A frame that is shorter than its length of 0x30 says ends the program."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Die."""
        if data[2:4] == b"\x30\xcc":
            self.die(now_s)
        return super().receive(connection, data, now_s)


@mutant("dies-of-truncation", "3/20", subtle=True)
class DiesOfTruncation(Mortal):
    """A frame that is cut behind its fifth byte, and followed by another, ends the program."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._short: set[int] = set()

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Die."""
        if connection in self._short and data[:1] == b"\xaa":
            self.die(now_s)
        if data[:1] == b"\xaa" and len(data) == 5 and data[2] > 2:
            self._short.add(connection)
        return super().receive(connection, data, now_s)


@mutant("dies-of-frame-in-frame", "3/20", subtle=True)
class DiesOfFrameInFrame(Mortal):
    """A whole frame inside of a spoilt one ends the program."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Die."""
        inside = any(frame in data[4:] for frame in (b"\xaa\x07\0\xcc", b"\xaa\x08\0\xcc"))
        if inside and data[:1] == b"\xaa" and data[2:3] != b"\0" and data[-1:] == b"\x55":
            self.die(now_s)
        return super().receive(connection, data, now_s)


@mutant("dies-of-lengths-that-count-all", "3/20")
class DiesOfLengthsThatCountAll(Mortal):
    """A length that counts the whole frame makes the program wait for ever, with all clients."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Die."""
        if data[:1] == b"\xaa" and len(data) > 4 and data[2] == len(data) - 1:
            self.die(now_s)
        return super().receive(connection, data, now_s)


@mutant("dies-of-printed-lengths", "3/20")
class DiesOfPrintedLengths(Skips):
    """A request for a download with the length that the document prints ends the program."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if item.why is SkipReason.BAD_END and item.data[1:2] == b"\x54":
            self.die(now_s)


# The other direction


@mutant("dies-of-its-own-form", "3/23")
class DiesOfItsOwnForm(Mortal):
    """A frame in the controller's own form ends the program."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Die."""
        if data[:1] == b"\xcc" and data[-1:] == b"\xaa" and len(data) > 3:
            self.die(now_s)
        return super().receive(connection, data, now_s)


@mutant("answers-in-the-other-form", "3/23", "3/32")
class AnswersInTheOtherForm(ControllerCore):
    """A frame in the controller's own form is answered in the client's."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Answer."""
        session = self.sessions.get(connection)
        if session and data[:1] == b"\xcc" and data[-1:] == b"\xaa":
            self.transmit(session, b"\xaa" + data[1:2] + b"\x01\x30\xcc")
        return super().receive(connection, data, now_s)


@mutant("takes-replies-for-requests", "3/23")
class TakesRepliesForRequests(ControllerCore):
    """A frame in the controller's own form is answered with the network settings."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Answer."""
        if data[:1] == b"\xcc" and data[-1:] == b"\xaa":
            return super().receive(connection, b"\xaa\x04\x00\xcc", now_s)
        return super().receive(connection, data, now_s)


# Frames that stop


@mutant("half-frames-block-all", "3/29", subtle=True)
class HalfFramesBlockAll(ControllerCore):
    """While one client is in the middle of a frame, the others are not heard."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Hear nobody else."""
        for number, session in self.sessions.items():
            if number != connection and session.framer.deadline_s is not None:
                return []
        return super().receive(connection, data, now_s)


class _Patient(RequestFramer):
    def __init__(self, dialect: Dialect) -> None:
        super().__init__(dialect.replace(partial_timeout="none"))


@mutant("half-frames-go-on", "3/29", subtle=True)
class HalfFramesGoOn(OtherFramer):
    """What the last client has half sent stays in the buffer of the next one, for ever."""

    framer = _Patient

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._left: RequestFramer | None = None

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Keep what is left over."""
        session = self.sessions.get(connection)
        self._left = session.framer if session and session.framer.held_bytes else None
        return super().close(connection, now_s)

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        if self._left is not None:
            self.sessions[connection].framer, self._left = self._left, None


@mutant("dies-of-cut-frames", "3/29", subtle=True)
class DiesOfCutFrames(Mortal):
    """A connection that ends in the data of a frame ends the program."""

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Die."""
        session = self.sessions.get(connection)
        cut = session is not None and session.framer.held_bytes > 100
        actions = super().close(connection, now_s)
        if cut:
            self.die(now_s)
            return actions + self._take_actions()
        return actions


@mutant("dies-of-silence", "3/29")
class DiesOfSilence(Skips):
    """When the rest of a frame does not come in time, the program ends."""

    def skipped(self, session: Session, item: Skipped, now_s: float) -> None:  # noqa: ARG002 - one signature
        """Die."""
        if item.why is SkipReason.TRUNCATED:
            self.die(now_s)


@mutant("three-half-frames", "3/29", subtle=True)
class ThreeHalfFrames(ControllerCore):
    """While three clients are in the middle of a frame, no new one is served."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Serve no more."""
        half = [n for n, s in self.sessions.items() if s.framer.held_bytes and n != connection]
        return [] if len(half) >= 3 else super().receive(connection, data, now_s)
