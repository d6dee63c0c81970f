"""The virtual controller's core: a state machine without I/O.

It contains the connections, the logins and the order of requests and replies. Every frame enters
through `ControllerCore.handle` and leaves through `ControllerCore.emit`. The method with the name
of the command executes it (see `behaviour`). The server owns sockets, files and clocks: it passes
the time in, in seconds of a monotonic clock that the plant also uses, and performs the actions
that the core returns.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Any

from scaraspec.protocol.commands import BY_OPCODE, Command
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.fields import Defect
from scaraspec.protocol.frames import TAG, Frame, Skipped, StreamItem
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import FLAG, Acceptance, FirstReply, OptionalRecord
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import TransferState
from scaraspec.virtual_controller.behaviour import SILENCE, Behaviour
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.robot import BAD_ARGUMENT
from scaraspec.virtual_controller.session import Action, Carrier, Close, Request, Send, Session
from scaraspec.virtual_controller.store import Store

MAX_QUEUED = 16
"""Maximum number of requests that wait for a busy robot with the reading ``busy_reply=queue``."""

_TOLERATED_DEFECTS = frozenset({Defect.TRAILING_NUL, Defect.LONG_NAME})
"""Defects of a request despite which the controller executes it (A-T-3, A-5-20)."""


def _ignore(_connection: int, _item: StreamItem) -> None: ...


class ControllerCore(Behaviour):
    """The virtual controller as a state machine.

    Args:
        plant: The simulated robot. It uses the same clock as the core.
        store: Programs and settings.
        dialect: One reading of every open point.
        watch: Called with each connection number and frame or run of skipped bytes.
    """

    def __init__(
        self,
        plant: Plant,
        store: Store,
        dialect: Dialect = DEFAULT,
        watch: Callable[[int, StreamItem], None] = _ignore,
    ) -> None:
        super().__init__(plant, store, dialect)
        self._watch = watch
        self._actions: list[Action] = []
        self._queue: deque[tuple[Session, Frame]] = deque()
        # Replies may contain names of any length that a client chose (A-4.9-5).
        self._reply_dialect = dialect.replace(name_max="255")

    # ------------------------------------------------------------------ events

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Handle a new connection of a client.

        Args:
            connection: The connection number, unique among the open connections.
            now_s: The current time in seconds.
            link: Kind of link. A serial client needs no login (L83), and its bytes are ignored
                while a network client is connected (L81; A-2-4).

        Returns:
            The actions to perform.
        """
        self._process_due(now_s)
        others = [session for session in self.sessions.values() if session.carrier == "tcp"]
        limit = self.dialect["max_clients"]
        if not self.powered or (link == "tcp" and others and limit == "one"):
            self._actions.append(Close(connection))
            return self._take_actions()
        if link == "tcp":
            if limit == "newest":
                for session in others:
                    self._end(session, now_s)
            for session in list(self.sessions.values()):
                if session.carrier == "serial":  # a masked client counts as disconnected
                    self._remove_session(session, now_s)
                    self._add_session(session.connection, "serial")
        self._add_session(connection, link)
        return self._take_actions()

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Handle bytes received from a client; return the actions to perform."""
        self._process_due(now_s)
        session = self.sessions.get(connection)
        if session is not None and not self._is_masked(session):
            self._process_items(session, session.framer.receive(data, now_s), now_s)
        return self._take_actions()

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Handle a disconnect or half-close: a jog stops, a finite motion continues (A-2-8)."""
        self._process_due(now_s)
        session = self.sessions.get(connection)
        if session is not None:
            self._end(session, now_s)
        return self._take_actions()

    def advance(self, now_s: float) -> list[Action]:
        """Handle the passage of time or a change of the plant; return the actions to perform."""
        self._process_due(now_s)
        return self._take_actions()

    @property
    def next_event_s(self) -> float | None:
        """When to call `advance` next; None if no time is scheduled."""
        times_s = [self.robot.task.activity.next_event_s] if self.robot.task else []
        for session in self.sessions.values():
            if session.framer.deadline_s is not None:
                times_s.append(session.framer.deadline_s)
            if session.transfer is not None and session.transfer.end.deadline_s is not None:
                # The silence must last longer than the timeout (L795).
                times_s.append(math.nextafter(session.transfer.end.deadline_s, math.inf))
        next_s = min(times_s, default=math.inf)
        return None if next_s == math.inf else next_s

    # ------------------------------------------------------------------ received frames

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Process one frame of a client."""
        command = self._command(frame)
        if command is None:
            self._answer_unknown(session, frame, now_s)
            return
        if not self._is_permitted(session, command):
            match self.dialect["prelogin"]:
                case "failure":
                    self._reply(session, command, frame, _failure(command))
                case "close":
                    self._end(session, now_s)
            return
        if self._defer_while_busy(session, command, frame):
            return
        request = Request(session, command, frame, self._value(command, frame), now_s)
        if command.request.fields and request.value is None and not command.two_stage:
            answer = _failure(command)
        else:
            answer = getattr(self, command.name)(request)
        self._reply(session, command, frame, answer)
        self._send_deferred()
        if not self.powered:
            for other in list(self.sessions.values()):
                self._end(other, now_s)

    def _command(self, frame: Frame) -> Command | None:
        """Return the command of a frame; None if the dialect has no such opcode (A-4.12-1)."""
        command = BY_OPCODE.get(frame.opcode)
        if command and command.alternate_opcode and self.dialect["op_get_default"] == "0x13":
            return command if frame.opcode == command.alternate_opcode else None
        return command

    def _is_permitted(self, session: Session, command: Command) -> bool:
        """Whether the client may use this command; before its login, see A-4-4."""
        if session.logged_in or command.name == "login":
            return True
        reading = self.dialect["prelogin"]
        return reading == "all" or (reading == "reads" and command.hazard is Hazard.READ_ONLY)

    def _answer_unknown(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer an undefined opcode (A-3-9)."""
        match self.dialect["on_unknown"]:
            case "0" if (
                frame.opcode != TAG
            ):  # a reply with this opcode would look like a tagged frame (A-3-5)
                self.emit(session, Frame(C2A, frame.opcode, b"0"))
            case "close":
                self._end(session, now_s)

    def _defer_while_busy(self, session: Session, command: Command, frame: Frame) -> bool:
        """Queue or ignore the request if ``busy_reply`` is not the default; return whether it did.

        The emergency stop is never deferred. It clears the queue, because queued commands must
        not start after it (A-4-2).
        """
        if command.name == "emergency_stop":
            self._queue.clear()
            return False
        if not command.two_stage or self.robot.task is None:
            return False
        if self.dialect["busy_reply"] == "queue" and len(self._queue) < MAX_QUEUED:
            self._queue.append((session, frame))
            return True
        # The document prints the busy reply of the reset (L397).
        return self.dialect["busy_reply"] == "silence" and command.name != "reset"

    def _value(self, command: Command, frame: Frame) -> Any:
        """Return the value of a request; None if the controller must not execute it."""
        payload = command.payload(frame)
        assert payload is not None, "frames of a client have no tag"
        decoded = payload.decode(frame.data)
        if any(issue.defect not in _TOLERATED_DEFECTS for issue in decoded.issues):
            return None
        if ("jog_byte", "ascii") in decoded.readings and self.dialect["jog_byte"] == "binary":
            return None
        return decoded.value

    # ------------------------------------------------------------------ sent frames

    def emit(self, session: Session, frame: Frame) -> None:
        """Send one frame, unless the client has disconnected (A-2-9)."""
        if self.sessions.get(session.connection) is session:
            self._watch(session.connection, frame)
            self.transmit(session, frame.encode())

    def transmit(self, session: Session, data: bytes) -> None:
        """Send bytes unchanged."""
        self._actions.append(Send(session.connection, data))

    def _reply(self, session: Session, command: Command, frame: Frame, answer: Any) -> None:
        """Send a first reply with the opcode of the request, or the printed alternate opcode."""
        if answer is SILENCE:
            return
        opcode = frame.opcode
        if command.alternate_reply_opcode is not None and self.dialect["op_temp_reply"] == "0x0E":
            opcode = command.alternate_reply_opcode
        self.emit(session, Frame(C2A, opcode, command.reply.encode(answer, self._reply_dialect)))

    def _send_deferred(self) -> None:
        deferred, self._deferred = self._deferred, []
        for session, frame in deferred:
            self.emit(session, frame)

    # ------------------------------------------------------------------ clients and time

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        framer = RequestFramer(self.dialect)
        logged_in = carrier == "serial"  # 使用蓝牙通信时不需要登录验证 (L83)
        self.sessions[connection] = Session(connection, carrier, framer, logged_in)

    def _is_masked(self, session: Session) -> bool:
        return session.carrier == "serial" and any(
            other.carrier == "tcp" for other in self.sessions.values()
        )

    def _end(self, session: Session, now_s: float) -> None:
        """Close a session and its connection."""
        self._remove_session(session, now_s)
        self._actions.append(Close(session.connection))

    def _remove_session(self, session: Session, now_s: float) -> None:
        """Remove a session: abort its transfer, drop its queued requests, stop its jog."""
        self.abort_transfer(session)
        del self.sessions[session.connection]
        self._queue = deque(entry for entry in self._queue if entry[0] is not session)
        task = self.robot.task
        if task is not None and task.ends_with_link and task.request.session is session:
            self.robot.stop(now_s)
            self._finish_tasks(now_s)

    def _process_items(self, session: Session, items: list[StreamItem], now_s: float) -> None:
        """Process items that arrived together, in order, until the session ends (A-3-14)."""
        held: list[Action] = []  # with the reading "any-order": actions to perform last
        frames = 0
        for item in items:
            if self.sessions.get(session.connection) is not session:
                break
            self._watch(session.connection, item)
            if isinstance(item, Skipped):
                if self.dialect["resync"] == "close":
                    self._end(session, now_s)
                continue
            frames += 1
            if frames > 1 and self.dialect["pipelining"] == "one":
                continue
            mark = len(self._actions)
            self.handle(session, item, now_s)
            if frames == 1 and self.dialect["pipelining"] == "any-order" and _only_reads(item):
                held = self._actions[mark:]
                del self._actions[mark:]
            self._finish_tasks(now_s)
        self._actions += held

    def _process_due(self, now_s: float) -> None:
        """Expire partial frames and transfers, and finish tasks that have ended by `now_s`."""
        for session in list(self.sessions.values()):
            if items := session.framer.expire(now_s):
                self._process_items(session, items, now_s)
            if session.transfer is not None:
                session.transfer.end.expire(now_s)
                if session.transfer.end.state is TransferState.FAILED:
                    self.abort_transfer(session)
        self._finish_tasks(now_s)

    def _finish_tasks(self, now_s: float) -> None:
        """Send the result of an ended task, and start the next queued request."""
        while True:
            ended = self.robot.settle(now_s)
            if ended is not None:
                task, outcome = ended
                self.send_result(task.request, outcome)
                self._send_deferred()
            elif self.robot.task is None and self._queue:
                self.handle(*self._queue.popleft(), now_s)
            else:
                return

    def _take_actions(self) -> list[Action]:
        actions, self._actions = self._actions, []
        return actions


def _only_reads(frame: Frame) -> bool:
    """Whether a request only reads, so that its reply may be reordered without side effects."""
    command = BY_OPCODE.get(frame.opcode)
    return command is not None and command.hazard is Hazard.READ_ONLY


def _failure(command: Command) -> Any:
    """Return the failure form of a first reply; `SILENCE` if the document has none (A-3-9)."""
    if command.initiator is not A2C:
        return SILENCE
    if isinstance(command.reply, FirstReply):
        return Acceptance(accepted=False, code=BAD_ARGUMENT)
    if isinstance(command.reply, OptionalRecord):
        return None
    return False if command.reply is FLAG else SILENCE
