"""Mutants of clause 2: connections, the delivery of their bytes, and logins."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.connections import finds, received_bytes, with_framer
from scaraspec.mutants.operators.controller.requests import after
from scaraspec.protocol.commands import Command
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.protocol.hazard import Hazard
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action, Carrier, Close, Request, Session

_receive = RequestFramer.receive

# Connections


def _opens(actions: Callable[[int], list[Action] | None]) -> Core:
    """When a connection opens, `actions` is called; None serves the connection normally."""

    class Opens(ControllerCore):
        def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
            wrong = actions(connection)
            return super().open(connection, now_s, link) if wrong is None else wrong

    return Opens


@mutant("closes-behind-replies", "2/1")
class ClosesAfterReplies(ControllerCore):
    """The device closes a connection after the first reply that is not to a login."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        if frame.opcode != 0x01 and session.connection in self.sessions:
            self._end(session, 0.0)


row(
    "every-third-connection",
    "2/2",
    "Every third connection is accepted but never served.",
    _opens(lambda connection: None if connection % 3 else []),
    subtle=True,
)
row(
    "fifty-connections",
    "2/13",
    "The device serves no new connection after the first fifty.",
    _opens(lambda connection: [Close(connection)] if connection > 50 else None),
    subtle=True,
)
row(
    "every-ninetieth-connection",
    "2/13",
    "Every ninetieth connection is refused.",
    _opens(lambda connection: None if connection % 90 else [Close(connection)]),
    subtle=True,
)


class _LeaksSessions(ControllerCore, ABC):
    """Sixteen sessions can be open; some are never freed."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._leaked = 0

    @abstractmethod
    def _is_leaked(self, session: Session) -> bool: ...

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        if len(self.sessions) + self._leaked >= 16:
            return [Close(connection)]
        return super().open(connection, now_s, link)

    def close(self, connection: int, now_s: float) -> list[Action]:
        session = self.sessions.get(connection)
        self._leaked += session is not None and self._is_leaked(session)
        return super().close(connection, now_s)


@mutant("leaks-half-frames", "2/13", subtle=True)
class LeaksHalfFrames(_LeaksSessions):
    """A session that ends in the middle of a frame is never freed; the limit is 16 sessions."""

    def _is_leaked(self, session: Session) -> bool:
        return session.framer.deadline_s is not None


@mutant("leaks-the-silent", "2/13", subtle=True)
class LeaksIdleSessions(_LeaksSessions):
    """A session without a request after the login is never freed; the limit is 16 sessions."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._active: set[Session] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode != 0x01:
            self._active.add(session)
        super().handle(session, frame, now_s)

    def _is_leaked(self, session: Session) -> bool:
        return session not in self._active


# A further client


@mutant("one-buffer-for-all", "2/12", subtle=True)
class SharesBuffer(ControllerCore):
    """All connections share one receive buffer: bytes of one complete a frame of another."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        shared = next((session.framer for session in self.sessions.values()), None)
        actions = super().open(connection, now_s, link)
        if shared and connection in self.sessions:
            self.sessions[connection].framer = shared
        return actions


@mutant("newcomer-takes-the-replies", "2/12", subtle=True)
class RepliesToNewest(ControllerCore):
    """Replies go to the client that connected last instead of the client that sent the request."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(self.sessions[max(self.sessions)] if self.sessions else session, frame)


@mutant("newcomer-clears-buffers", "2/12", subtle=True)
class ClearsBuffersOnOpen(ControllerCore):
    """A new connection discards the unfinished frames of the other connections."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        for session in self.sessions.values():
            session.framer = RequestFramer(self.dialect)
        return super().open(connection, now_s, link)


@mutant("everyone-hears-all", "2/12")
class RepliesToAll(ControllerCore):
    """Each reply is sent to all clients that are logged in."""

    def emit(self, session: Session, frame: Frame) -> None:
        super().emit(session, frame)
        for other in list(self.sessions.values()):
            if other is not session and other.logged_in:
                super().emit(other, frame)


# Delivery


def _drops_partial(when: Callable[[RequestFramer, list[StreamItem]], bool]) -> Core:
    """A partial frame is discarded after a segment, if the condition holds."""

    def receive(framer: RequestFramer, data: bytes, now_s: float) -> list[StreamItem]:
        found = _receive(framer, data, now_s)
        if when(framer, found):
            framer._framer = framer._new_framer()  # noqa: SLF001 - it is a method of the framer
        return found

    return finds(receive)


def _time_from_first_byte(framer: Any, data: bytes, now_s: float) -> list[StreamItem]:
    held, since_s = framer.buffered_bytes, framer._last_received_s  # noqa: SLF001 - it is a method of the framer
    found = _receive(framer, data, now_s)
    if held and not found:
        framer._last_received_s = since_s  # noqa: SLF001 - it is a method of the framer
    return found


row(
    "segment-is-frame",
    "2/5",
    "A partial frame at the end of a segment is discarded.",
    _drops_partial(lambda _framer, _found: True),
)
row(
    "end-byte-alone",
    "2/5",
    "A segment that consists of the end byte only is ignored.",
    received_bytes(lambda data: b"" if data == b"\xcc" else data),
    subtle=True,
)
row(
    "cut-behind-length",
    "2/5",
    "A frame that is split directly after its length byte is lost.",
    _drops_partial(lambda framer, _found: framer.buffered_bytes == 3),
    subtle=True,
)
row(
    "cut-behind-eighth-byte",
    "2/5",
    "A frame that is split directly after its eighth byte is lost.",
    _drops_partial(lambda framer, _found: framer.buffered_bytes == 8),
    subtle=True,
)
row(
    "impatient-with-pauses",
    "2/5",
    "An unfinished frame is discarded after 0.5 s.",
    with_framer(lambda dialect: RequestFramer(dialect.replace(partial_timeout="0.5"))),
)
row(
    "counts-from-first-byte",
    "2/5",
    "The timeout of a frame starts at its first byte, not at its last byte so far.",
    finds(_time_from_first_byte),
    subtle=True,
)
row(
    "rest-behind-frame",
    "2/5 2/6",
    "A partial frame after a complete one in the same segment is discarded.",
    _drops_partial(lambda _framer, found: bool(found)),
    subtle=True,
)
row(
    "one-frame-per-segment",
    "2/6",
    "Only the first of several frames in one segment is served.",
    finds(lambda framer, data, now_s: _receive(framer, data, now_s)[:1]),
)
row(
    "sixteen-frames-per-segment",
    "2/6",
    "Only the first sixteen frames in one segment are served.",
    finds(lambda framer, data, now_s: _receive(framer, data, now_s)[:16]),
    subtle=True,
)
row(
    "small-buffer",
    "2/6",
    "All bytes of a segment after the first 256 are lost.",
    received_bytes(lambda data: data[:256]),
    subtle=True,
)
row(
    "login-ends-the-segment",
    "2/6",
    "Bytes that follow the login in the same segment are lost.",
    received_bytes(
        lambda data: data[: data[2] + 4] if data[:2] == b"\xaa\x01" and len(data) > 3 else data
    ),
    subtle=True,
)

# Logins


def _permits(when: Callable[[ControllerCore, Command], bool]) -> Core:
    """A command needs no login, if the condition holds."""

    class Permits(ControllerCore):
        def _is_permitted(self, session: Session, command: Command) -> bool:
            return when(self, command) or super()._is_permitted(session, command)

    return Permits


def _permits_names(*names: str) -> Core:
    return _permits(lambda _core, command: command.name in names)


class SilentWithoutLogin(ControllerCore):
    """No command but the login is answered without a login."""

    def emit(self, session: Session, frame: Frame) -> None:
        if session.logged_in or frame.opcode == 0x01:
            super().emit(session, frame)


def _any_login(core: ControllerCore) -> bool:
    return any(session.logged_in for session in core.sessions.values())


def _set_logged_in(_core: ControllerCore, request: Request, right: Any) -> Any:
    request.session.logged_in = True
    return right


@mutant("needs-no-login", "2/11")
class NeedsNoLogin(ControllerCore):
    """All commands are executed without a login."""

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.sessions[connection].logged_in = True


row(
    "one-login-for-all",
    "2/11",
    "While one client is logged in, every client counts as logged in.",
    _permits(lambda core, _command: _any_login(core)),
    subtle=True,
)


@mutant("login-outlives-the-connection", "2/11", subtle=True)
class NeedsOneLogin(ControllerCore):
    """After the first login, no client needs to log in."""

    _opened = False

    def login(self, request: Request) -> bool:
        right = super().login(request)
        self._opened = self._opened or right
        return right

    def _is_permitted(self, session: Session, command: Command) -> bool:
        return self._opened or super()._is_permitted(session, command)


@mutant("uploads-leave-their-login", "2/11", subtle=True)
class UploadsLeaveLogin(ControllerCore):
    """The first client after one that disconnected during an upload is logged in at once."""

    _left = False

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        actions = super().open(connection, now_s, link)
        if self._left and connection in self.sessions:
            self.sessions[connection].logged_in, self._left = True, False
        return actions

    def close(self, connection: int, now_s: float) -> list[Action]:
        session = self.sessions.get(connection)
        self._left = bool(session and session.logged_in and session.transfer)
        return super().close(connection, now_s)


row(
    "refused-but-in",
    "2/11",
    'A wrong password is answered "0", but the session counts as logged in.',
    after("login", _set_logged_in),
)


@mutant("second-refusal-is-in", "2/11", subtle=True)
class SecondRefusalLogsIn(ControllerCore):
    """A client whose login is refused twice on a connection counts as logged in."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._refused: set[int] = set()

    def login(self, request: Request) -> bool:
        right = super().login(request)
        connection = request.session.connection
        if not right:
            request.session.logged_in |= connection in self._refused
            self._refused.add(connection)
        return right


class RefusedClientsDelete(ControllerCore):
    """A client whose login was refused can delete files."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._refused: set[int] = set()

    def login(self, request: Request) -> bool:
        right = super().login(request)
        if not right:
            self._refused.add(request.session.connection)
        return right

    def _is_permitted(self, session: Session, command: Command) -> bool:
        refused = session.connection in self._refused and command.name == "delete_program"
        return refused or super()._is_permitted(session, command)


row(
    "silently-obeys-strangers",
    "2/11",
    "Without a login nothing is answered, but the gripper centre is set.",
    _permits_names("set_gripper_center"),
    SilentWithoutLogin,
)
row(
    "clock-for-strangers",
    "2/11",
    "The clock can be set without a login.",
    _permits_names("set_time"),
    SilentWithoutLogin,
)
row(
    "clock-for-strangers-in-company",
    "2/11",
    "While another client is logged in, the clock can be set without a login.",
    _permits(lambda core, command: command.name == "set_time" and _any_login(core)),
    SilentWithoutLogin,
    subtle=True,
)
row(
    "refused-may-delete",
    "2/11",
    "A client whose login was refused can delete files.",
    RefusedClientsDelete,
    SilentWithoutLogin,
    subtle=True,
)
row(
    "upload-for-strangers",
    "2/11",
    "Files can be uploaded without a login.",
    _permits_names("upload_name", "upload_chunk"),
    SilentWithoutLogin,
)
row(
    "deletes-for-strangers",
    "2/11",
    "Files can be deleted without a login.",
    _permits_names("delete_program"),
    SilentWithoutLogin,
)
row(
    "password-for-strangers",
    "2/11",
    "The password can be changed without a login, because the request contains the old one.",
    _permits_names("set_password"),
    SilentWithoutLogin,
)
row(
    "outputs-for-strangers",
    "2/11",
    "Outputs can be set without a login.",
    _permits_names("set_digital_output"),
    SilentWithoutLogin,
)
row(
    "runs-for-strangers",
    "2/11",
    "Programs can be run without a login.",
    _permits_names("run_program"),
    SilentWithoutLogin,
)
row(
    "jogs-for-strangers",
    "2/11",
    "The arm can be jogged without a login.",
    _permits_names("jog"),
)
row(
    "shuts-down-for-strangers",
    "2/11",
    "The robot can be shut down without a login.",
    _permits_names("shutdown"),
)
row(
    "settings-for-strangers",
    "2/11",
    "Commands that only change state need no login; only motion and loss need one.",
    _permits(lambda _core, command: command.hazard is Hazard.STATE),
)
