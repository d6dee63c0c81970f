"""ClientCore: the whole client but for its link and its clock (sans I/O).

Requests go in and bytes come out; bytes come in and events come out. Here frames are given to the
exchanges that await them, and time to those that have waited long enough. What an exchange makes
of a frame stands in `operation` and `transfer`; how bytes get to the wire in `blocking` and `aio`.
"""

from collections import deque
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from scaraspec.client.errors import ClientError, LinkLost, LoginFailed
from scaraspec.client.pending_operation import (
    Login,
    PendingOperation,
    Stage,
    TwoStage,
    create_operation,
)
from scaraspec.client.transfer import Download, Upload, chunk_reply
from scaraspec.protocol.commands import BY_NAME, Parsed, parse_frame
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import MAX_FRAME_BYTES, Frame, Framer, Skipped, StreamItem
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.user_message import UserMessage

MAX_REMARKS: Final = 100
DOWNLOAD_LIMIT_BYTES: Final = 16 * 2**20

_SLOWEST_FRAME_S: Final = MAX_FRAME_BYTES * 1.0
"""A frame may come in single bytes, with pauses of up to 1 s between them (2/5)."""

_LEARNED: Final = ("op_get_default", "list_cont")
"""Readings that are found out by waiting in vain once, and followed from then on."""

_ENDS_LINK: Final = ("set_network", "shutdown")
"""After their ``1`` the loss of the link is normal (4.4/6, 4.35/6)."""

_STOP: Final = "emergency_stop"


class FrameAccepted(NamedTuple):
    """A frame was given to the exchange that awaited it."""

    operation: PendingOperation
    frame: Frame


class OperationSettled(NamedTuple):
    """An exchange is over."""

    operation: PendingOperation


class UnexpectedFrame(NamedTuple):
    """A frame that nothing awaited; it was ignored (3/22, 3/33)."""

    frame: Frame


Event = FrameAccepted | OperationSettled | UnexpectedFrame | Skipped


class ClientCore:
    """One connection's worth of client.

    Time passes only in `tick`, which is due when nothing has arrived until `deadline_s`: bytes
    that wait in a socket while the caller is busy are never late.

    Args:
        dialect: The readings to speak; every tolerated one is understood whatever it says.
        login_required: Whether nothing may be sent before a login has succeeded (2/10), as over
            the network; Bluetooth needs none (L83).

    Attributes:
        dialect: As given, but for what was found out about the controller since.
        logged_in: Whether commands may be sent.
        observed_readings: Every reading that the controller's frames gave away, with its options.
        remarks: The latest things that did not conform, one sentence each.
    """

    def __init__(self, dialect: Dialect = DEFAULT, *, login_required: bool = True) -> None:
        self.dialect = dialect
        self.logged_in = not login_required
        self.observed_readings: dict[str, set[str]] = {}
        self.remarks: deque[str] = deque(maxlen=MAX_REMARKS)
        self._framer = Framer(C2A)
        self._open: list[PendingOperation] = []
        self._outbox = bytearray()
        self._lost_reason: str | None = None
        self._expected_link_end = ""
        self._last_received_s = 0.0

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """A command of the table, to be sent by `begin`.

        Args:
            name: Its name.
            value: What its request holds, as the table's payload takes it.

        Raises:
            PayloadError: The document forbids to send the value.
        """
        return create_operation(BY_NAME[name], value, self.dialect)

    def upload(self, name: bytes, content: bytes) -> Upload:
        """A file to the controller (5.2), to be sent by `begin`; raises as `command` does."""
        return Upload(name, content, self.dialect)

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        """A file from the controller (5.3), to be sent by `begin`; raises as `command` does."""
        return Download(name, limit_bytes, self.dialect)

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        """Send the request of an exchange.

        Raises:
            LoginFailed: No login has succeeded yet (2/10).
            LinkLost: The link has ended.
            ClientError: The slot is not free (3/25).
        """
        name = operation.command.name
        if self._lost_reason is not None:
            raise LinkLost(f"{name} is not sent: {self._lost_reason}")
        if not self.logged_in and not isinstance(operation, Login):
            raise LoginFailed(f"{name} is not sent: a login has to succeed first (4.1, L104)")
        if not self.is_free(operation.slot):
            raise ClientError(
                UserMessage(
                    "{name} is not sent: one like it is still unanswered (A-3-14)", name=name
                )
            )
        self._open.append(operation)
        self._send(operation.begin(now_s))

    def is_free(self, slot: str) -> bool:
        """Whether a request may be sent: at most one per opcode is unanswered (3/25)."""
        return not any(e.slot == slot and e.occupies_slot for e in self._open)

    @property
    def deadline_s(self) -> float | None:
        """When `tick` is due if nothing arrives; None if never."""
        deadlines = [self._due_s(e.deadline_s) for e in self._open if e.deadline_s is not None]
        if self._partial_until_s is not None:
            deadlines.append(self._partial_until_s)
        return min(deadlines, default=None)

    def bytes_to_send(self) -> bytes:
        """Hand over what is to be sent."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Take what arrived."""
        self._last_received_s = now_s
        return self._process_items(self._framer.feed(data), now_s)

    def tick(self, now_s: float) -> list[Event]:
        """Let time pass: nothing more has arrived until now."""
        events: list[Event] = []
        if self._partial_until_s is not None and now_s >= self._partial_until_s:
            events += self._process_items(self._framer.finish(), now_s)
        for operation in tuple(self._open):
            if operation.deadline_s is not None and now_s >= self._due_s(operation.deadline_s):
                self._send(operation.expire(now_s))
                events += self._after_step(operation, now_s)
        return events

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        """The link has ended: nothing that is open can be settled any more."""
        if self._lost_reason is not None:
            return []
        events = self._process_items(self._framer.finish(), now_s)
        self._lost_reason = (
            f"the link ended, as it may after {self._expected_link_end}"
            if self._expected_link_end
            else reason
        )
        for operation in tuple(self._open):
            operation.fail(
                LinkLost(f"{operation.command.name} was not finished: {self._lost_reason}")
            )
            events += self._after_step(operation, now_s)
        return events

    @property
    def _partial_until_s(self) -> float | None:
        """When the frame that is arriving is given up (A-3-11); None if there is none, or never."""
        seconds = self.dialect.seconds("partial_timeout")
        if not self._framer.held_bytes or seconds is None:
            return None
        return self._last_received_s + seconds

    def _due_s(self, deadline_s: float) -> float:
        """When silence is too long: as long as a frame is arriving, it may be the one awaited."""
        until_s = self._partial_until_s
        if until_s is None:
            return deadline_s
        return min(max(deadline_s, until_s), deadline_s + _SLOWEST_FRAME_S)

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            self._outbox += frame.encode()

    def _process_items(self, found: Iterable[StreamItem], now_s: float) -> list[Event]:
        events: list[Event] = []
        for item in found:
            if isinstance(item, Skipped):
                self.remarks.append(f"{item.size_bytes} bytes are no frame ({item.why.value})")
                events.append(item)
            else:
                events += self._dispatch(item, now_s)
        return events

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        """Give a frame to the first exchange that awaits it."""
        parsed = parse_frame(frame)
        if parsed is not None:
            for operation in self._open:
                if operation.expects(frame, parsed):
                    self._record_readings(frame, parsed)
                    self._send(operation.take(parsed, frame.data, now_s))
                    return [FrameAccepted(operation, frame), *self._after_step(operation, now_s)]
            self._refuse_stray_chunk(parsed)
        self.remarks.append(f"nothing awaited this frame: {frame}")
        return [UnexpectedFrame(frame)]

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        """Answer a chunk of no transfer with ``0``: each is answered once (5.3/5).

        The error signal of length 0 gets no answer (A-5-10).
        """
        if parsed.part == "request" and parsed.decoded.value and parsed.decoded.value.length:
            self._send([chunk_reply(accepted=False, dialect=self.dialect)])

    def _record_readings(self, frame: Frame, parsed: Parsed) -> None:
        """Keep what a frame says about the controller besides its value."""
        for key, option in parsed.decoded.readings:
            self._observe(key, option)
        if parsed.command.alternate_opcode is not None:
            self._observe("op_get_default", f"0x{frame.opcode:02X}")
        if parsed.command.alternate_reply_opcode is not None:
            self._observe("op_temp_reply", f"0x{frame.opcode:02X}")
        if parsed.part == "result" and self._executing(_STOP) and parsed.command.name != _STOP:
            self._observe("estop_interrupted", "first")
        for complaint in parsed.decoded.issues:
            self.remarks.append(f"{parsed.part} of {parsed.command.name}: {complaint.text}")

    def _observe(self, key: str, option: str) -> None:
        self.observed_readings.setdefault(key, set()).add(option)
        if key in _LEARNED:
            self.dialect = self.dialect.replace(**{key: option})

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        """Draw the consequences of a step of an exchange."""
        for key, option in operation.observed.items():
            self._observe(key, option)
        ended = (
            self._after_two_stage_step(operation, now_s) if isinstance(operation, TwoStage) else []
        )
        if not operation.settled:
            return ended
        self._open.remove(operation)
        if isinstance(operation, Login):
            self.logged_in = operation.error is None
        elif operation.command.name in _ENDS_LINK and operation.error is None:
            self._expected_link_end = operation.command.name
        return [*ended, OperationSettled(operation)]

    def _after_two_stage_step(self, operation: TwoStage, now_s: float) -> list[Event]:
        """What one two-stage command says about others that execute."""
        events: list[Event] = []
        if operation.stage is Stage.EXECUTING:
            for other in self._executing(operation.command.name):
                if other is not operation:  # while one executes none is accepted (A-4-2)
                    other.give_up("it was begun anew before a result of its own came")
                    events += self._after_step(other, now_s)
        elif operation.command.name == _STOP and operation.error is None:
            for other in self._executing():
                other.stopped(now_s)
        return events

    def _executing(self, name: str = "") -> list[TwoStage]:
        """Two-stage commands that were accepted and are not over; only those of a name if given."""
        return [
            e
            for e in self._open
            if isinstance(e, TwoStage)
            and e.stage is Stage.EXECUTING
            and name in ("", e.command.name)
        ]
