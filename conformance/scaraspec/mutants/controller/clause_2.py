"""Faults of clause 2: connections, how their bytes are delivered, and who has logged in."""

from abc import ABC, abstractmethod
from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.connections import OtherFramer
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Close, Request, Session

# Connections


@mutant("closes-behind-replies", "2/1")
class ClosesBehindReplies(ControllerCore):
    """The device closes a connection after the first reply that is not to a login."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send, and end the session."""
        super().emit(session, frame)
        if frame.opcode != 0x01 and session.connection in self.sessions:
            self._end(session, 0.0)


@mutant("every-third-connection", "2/2", subtle=True)
class EveryThirdConnection(ControllerCore):
    """Every third connection is accepted, but never served."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Leave these waiting."""
        return super().open(connection, now_s, link) if connection % 3 else []


@mutant("fifty-connections", "2/13", subtle=True)
class FiftyConnections(ControllerCore):
    """The device serves no new connection after the first fifty."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Count them all."""
        return [Close(connection)] if connection > 50 else super().open(connection, now_s, link)


@mutant("every-ninetieth-connection", "2/13", subtle=True)
class EveryNinetiethConnection(ControllerCore):
    """Every ninetieth connection is refused."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Close these."""
        if connection % 90 == 0:
            return [Close(connection)]
        return super().open(connection, now_s, link)


class _Leaky(ControllerCore, ABC):
    """Sixteen sessions can be open; some are never freed."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._leaked = 0

    @abstractmethod
    def leaks(self, session: Session) -> bool:
        """Whether this one is not freed."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Refuse where there is no room."""
        if len(self.sessions) + self._leaked >= 16:
            return [Close(connection)]
        return super().open(connection, now_s, link)

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Free it, or not."""
        session = self.sessions.get(connection)
        if session is not None and self.leaks(session):
            self._leaked += 1
        return super().close(connection, now_s)


@mutant("leaks-half-frames", "2/13", subtle=True)
class LeaksHalfFrames(_Leaky):
    """A session that ends in the middle of a frame is never freed; the limit is 16 sessions."""

    def leaks(self, session: Session) -> bool:
        """Where bytes are left over."""
        return session.framer.deadline_s is not None


@mutant("leaks-the-silent", "2/13", subtle=True)
class LeaksTheSilent(_Leaky):
    """A session without a request after the login is never freed; the limit is 16 sessions."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._asked: set[Session] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember who asks."""
        if frame.opcode != 0x01:
            self._asked.add(session)
        super().handle(session, frame, now_s)

    def leaks(self, session: Session) -> bool:
        """Where nothing was asked."""
        return session not in self._asked


# A further client


@mutant("one-buffer-for-all", "2/12", subtle=True)
class OneBufferForAll(ControllerCore):
    """All connections share one receive buffer: what is half in one goes on in the other."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Give the buffer of another session."""
        shared = next((session.framer for session in self.sessions.values()), None)
        actions = super().open(connection, now_s, link)
        if shared and connection in self.sessions:
            self.sessions[connection].framer = shared
        return actions


@mutant("newcomer-takes-the-replies", "2/12", subtle=True)
class NewcomerTakesTheReplies(ControllerCore):
    """Replies go to the client that connected last instead of the client that sent the request."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send to the last one."""
        super().emit(self.sessions[max(self.sessions)] if self.sessions else session, frame)


@mutant("newcomer-clears-buffers", "2/12", subtle=True)
class NewcomerClearsBuffers(ControllerCore):
    """A new connection discards the unfinished frames of the other connections."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Begin all anew."""
        for session in self.sessions.values():
            session.framer = RequestFramer(self.dialect)
        return super().open(connection, now_s, link)


@mutant("everyone-hears-all", "2/12")
class EveryoneHearsAll(ControllerCore):
    """Each reply is sent to all clients that are logged in."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Send to all."""
        super().emit(session, frame)
        for other in list(self.sessions.values()):
            if other is not session and other.logged_in:
                super().emit(other, frame)


# Delivery


class _KeepsNothing(RequestFramer):
    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        found = super().receive(data, now_s)
        self._framer = self._new_framer()
        return found


@mutant("segment-is-frame", "2/5")
class SegmentIsFrame(OtherFramer):
    """What a segment does not end is thrown away: a frame has to come in one."""

    framer = _KeepsNothing


class _OverlooksEnds(RequestFramer):
    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        return super().receive(b"" if data == b"\xcc" else data, now_s)


@mutant("end-byte-alone", "2/5", subtle=True)
class EndByteAlone(OtherFramer):
    """A segment that consists of the end byte only is ignored."""

    framer = _OverlooksEnds


class _Cut(RequestFramer):
    at_byte = 3

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        found = super().receive(data, now_s)
        if self._framer.held_bytes == self.at_byte:
            self._framer = self._new_framer()
        return found


@mutant("cut-behind-length", "2/5", subtle=True)
class CutBehindLength(OtherFramer):
    """A frame that is split directly after its length byte is lost."""

    framer = _Cut


class _CutLater(_Cut):
    at_byte = 8


@mutant("cut-behind-eighth-byte", "2/5", subtle=True)
class CutBehindEighthByte(OtherFramer):
    """A frame that is split directly after its eighth byte is lost."""

    framer = _CutLater


class _Impatient(RequestFramer):
    def __init__(self, dialect: Dialect) -> None:
        super().__init__(dialect.replace(partial_timeout="0.5"))


@mutant("impatient-with-pauses", "2/5")
class ImpatientWithPauses(OtherFramer):
    """An unfinished frame is discarded after 0.5 s."""

    framer = _Impatient


class _FromTheFirstByte(RequestFramer):
    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        held, since_s = self._framer.held_bytes, self._heard_s
        found = super().receive(data, now_s)
        if held and not found:
            self._heard_s = since_s
        return found


@mutant("counts-from-first-byte", "2/5", subtle=True)
class CountsFromFirstByte(OtherFramer):
    """The time for a frame runs from its first byte, not from its last one so far."""

    framer = _FromTheFirstByte


class _ForgetsTheRest(RequestFramer):
    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        found = super().receive(data, now_s)
        if found:
            self._framer = self._new_framer()
        return found


@mutant("rest-behind-frame", "2/5", "2/6", subtle=True)
class RestBehindFrame(OtherFramer):
    """Where a segment ends a frame and begins another, the beginning is lost."""

    framer = _ForgetsTheRest


class _First(RequestFramer):
    most = 1

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        return super().receive(data, now_s)[: self.most]


@mutant("one-frame-per-segment", "2/6")
class OneFramePerSegment(OtherFramer):
    """Only the first of several frames in one segment is served."""

    framer = _First


class _Sixteen(_First):
    most = 16


@mutant("sixteen-frames-per-segment", "2/6", subtle=True)
class SixteenFramesPerSegment(OtherFramer):
    """Only the first sixteen frames in one segment are served."""

    framer = _Sixteen


@mutant("small-buffer", "2/6", subtle=True)
class SmallBuffer(ControllerCore):
    """All bytes of a segment after the first 256 are lost."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Cut it off."""
        return super().receive(connection, data[:256], now_s)


@mutant("login-ends-the-segment", "2/6", subtle=True)
class LoginEndsTheSegment(ControllerCore):
    """Bytes that follow the login in the same segment are lost."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Cut it off."""
        if data.startswith(b"\xaa\x01") and len(data) > 3:
            data = data[: data[2] + 4]
        return super().receive(connection, data, now_s)


# Logins


@mutant("needs-no-login", "2/11")
class NeedsNoLogin(ControllerCore):
    """All commands are executed without a login."""

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.sessions[connection].logged_in = True


@mutant("one-login-for-all", "2/11", subtle=True)
class OneLoginForAll(ControllerCore):
    """While one client is logged in, every client counts as logged in."""

    def _is_permitted(self, session: Session, command: Command) -> bool:
        anybody = any(each.logged_in for each in self.sessions.values())
        return anybody or super()._is_permitted(session, command)


@mutant("login-outlives-the-connection", "2/11", subtle=True)
class LoginOutlivesTheConnection(ControllerCore):
    """After the first login, no client needs to log in any more."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._opened = False

    def login(self, request: Request) -> bool:
        """Remember it for ever."""
        right = super().login(request)
        self._opened = self._opened or right
        return right

    def _is_permitted(self, session: Session, command: Command) -> bool:
        return self._opened or super()._is_permitted(session, command)


@mutant("uploads-leave-their-login", "2/11", subtle=True)
class UploadsLeaveTheirLogin(ControllerCore):
    """Who connects behind a client that left in the midst of an upload is logged in as that one."""

    _left = False

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Log him in."""
        actions = super().open(connection, now_s, link)
        if self._left and connection in self.sessions:
            self.sessions[connection].logged_in, self._left = True, False
        return actions

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Look what it was about."""
        session = self.sessions.get(connection)
        self._left = bool(session and session.logged_in and session.transfer)
        return super().close(connection, now_s)


@mutant("refused-but-in", "2/11")
class RefusedButIn(ControllerCore):
    """A wrong password is answered "0", but the session counts as logged in."""

    def login(self, request: Request) -> bool:
        """Log in whoever tries."""
        right = super().login(request)
        request.session.logged_in = True
        return right


@mutant("second-refusal-is-in", "2/11", subtle=True)
class SecondRefusalIsIn(ControllerCore):
    """A client whose login is refused twice on a connection counts as logged in."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._refused: set[int] = set()

    def login(self, request: Request) -> bool:
        """Count who is refused."""
        right = super().login(request)
        connection = request.session.connection
        if not right:
            request.session.logged_in |= connection in self._refused
            self._refused.add(connection)
        return right


class _ForStrangers(ControllerCore):
    """Some commands are obeyed without a login."""

    names: frozenset[str] = frozenset()
    silent = False

    def _is_obeyed(self, session: Session, command: Command) -> bool:  # noqa: ARG002 - others tell strangers apart
        return command.name in self.names

    def _is_permitted(self, session: Session, command: Command) -> bool:
        return self._is_obeyed(session, command) or super()._is_permitted(session, command)

    def emit(self, session: Session, frame: Frame) -> None:
        """Keep silent towards strangers, where the fault is silent."""
        if session.logged_in or frame.opcode == 0x01 or not self.silent:
            super().emit(session, frame)


@mutant("silently-obeys-strangers", "2/11")
class SilentlyObeysStrangers(_ForStrangers):
    """Without a login nothing is answered, but the gripper centre is set all the same."""

    names = frozenset({"set_gripper_center"})
    silent = True


@mutant("clock-for-strangers", "2/11")
class ClockForStrangers(_ForStrangers):
    """The clock can be set without a login."""

    names = frozenset({"set_time"})
    silent = True


@mutant("clock-for-strangers-in-company", "2/11", subtle=True)
class ClockForStrangersInCompany(ClockForStrangers):
    """While another client is logged in, the clock can be set without a login."""

    def _is_obeyed(self, session: Session, command: Command) -> bool:
        company = any(each.logged_in for each in self.sessions.values())
        return company and super()._is_obeyed(session, command)


@mutant("refused-may-delete", "2/11", subtle=True)
class RefusedMayDelete(_ForStrangers):
    """A client whose login was refused can delete files."""

    names = frozenset({"delete_program"})
    silent = True

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._refused: set[int] = set()

    def login(self, request: Request) -> bool:
        """Remember who is refused."""
        right = super().login(request)
        if not right:
            self._refused.add(request.session.connection)
        return right

    def _is_obeyed(self, session: Session, command: Command) -> bool:
        refused = session.connection in self._refused
        return refused and super()._is_obeyed(session, command)


@mutant("upload-for-strangers", "2/11")
class UploadForStrangers(_ForStrangers):
    """Files can be uploaded without a login."""

    names = frozenset({"upload_name", "upload_chunk"})
    silent = True


@mutant("deletes-for-strangers", "2/11")
class DeletesForStrangers(_ForStrangers):
    """Files can be deleted without a login."""

    names = frozenset({"delete_program"})
    silent = True


@mutant("password-for-strangers", "2/11")
class PasswordForStrangers(_ForStrangers):
    """The password can be changed without a login, since the request holds the old one."""

    names = frozenset({"set_password"})
    silent = True


@mutant("outputs-for-strangers", "2/11")
class OutputsForStrangers(_ForStrangers):
    """Outputs can be set without a login."""

    names = frozenset({"set_digital_output"})
    silent = True


@mutant("runs-for-strangers", "2/11")
class RunsForStrangers(_ForStrangers):
    """Programs can be run without a login."""

    names = frozenset({"run_program"})
    silent = True


@mutant("jogs-for-strangers", "2/11")
class JogsForStrangers(_ForStrangers):
    """The arm can be jogged without a login."""

    names = frozenset({"jog"})


@mutant("shuts-down-for-strangers", "2/11")
class ShutsDownForStrangers(_ForStrangers):
    """The robot can be shut down without a login."""

    names = frozenset({"shutdown"})


@mutant("settings-for-strangers", "2/11")
class SettingsForStrangers(ControllerCore):
    """What only changes state is obeyed without a login; only motion and loss are guarded."""

    def _is_permitted(self, session: Session, command: Command) -> bool:
        return command.hazard is Hazard.STATE or super()._is_permitted(session, command)
