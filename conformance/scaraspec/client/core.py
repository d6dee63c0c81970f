"""`ClientCore`: the client without link and clock (sans I/O).

Input: requests and received bytes. Output: bytes to send and events. The core passes each frame to
the pending operation that expects it, and expires operations after their timeout.
`pending_operation` and `transfer` interpret the frames; `blocking` and `aio` do the I/O.
"""

from collections import Counter, deque
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
from scaraspec.protocol.frames import Frame, Framer, Skipped, StreamItem
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.user_message import UserMessage

MAX_REMARKS: Final = 100
DOWNLOAD_LIMIT_BYTES: Final = 16 * 2**20

_LEARNED: Final = ("op_get_default", "list_cont")
"""Readings that the client detects by one timeout, and uses from then on."""

_ENDS_LINK: Final = ("set_network", "shutdown")
"""Commands after whose ``1`` the controller may close the link (4.4/6, 4.35/6)."""

_STOP: Final = "emergency_stop"


class FrameAccepted(NamedTuple):
    """A pending operation expected the frame and processed it."""

    operation: PendingOperation
    frame: Frame


class OperationSettled(NamedTuple):
    """An operation has ended."""

    operation: PendingOperation


class UnexpectedFrame(NamedTuple):
    """A frame that no operation expected; it was ignored (3/22, 3/33)."""

    frame: Frame


Event = FrameAccepted | OperationSettled | UnexpectedFrame | Skipped


class ClientCore:
    """The client of one connection.

    Timeouts expire only in `tick`. Call it when nothing has arrived until `deadline_s`, and after
    bytes that arrived later. So bytes that wait in a socket while the caller is busy never count as
    late, and received bytes do not extend a timeout.

    Replies have no number (A-3-14). A reply that is missing at the timeout is owed: if it comes
    later, it is ignored, and does not answer the next request of the same command. If that request
    times out, too, it is unknown which of them was answered, and the link ends. A reply to an
    emergency stop is never owed: any of them shows that the robot is stopped.

    Args:
        dialect: The readings for sending. Received frames may follow any tolerated reading.
        login_required: Whether a login must succeed before any other command (2/10). True for
            the network; Bluetooth needs no login (L83).

    Attributes:
        dialect: The given readings, updated with what was detected about the controller.
        logged_in: Whether commands may be sent.
        observed_readings: Every reading that the controller's frames show, with its options.
        remarks: The latest deviations from the document, one sentence each.
        must_close: Whether the caller must close the link, because replies cannot be assigned.
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
        self.must_close = False
        self._owed: Counter[str] = Counter()  # replies that did not come in time, by command
        self._ambiguous: set[str] = set()  # a reply was ignored while a request waited for one

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Create the operation of a command; `begin` sends it.

        Args:
            name: Name of the command in the command table.
            value: Value of the request payload.

        Raises:
            PayloadError: The document does not allow this value.
        """
        return create_operation(BY_NAME[name], value, self.dialect)

    def upload(self, name: bytes, content: bytes) -> Upload:
        """Create an upload (5.2); `begin` starts it. Raises the same errors as `command`."""
        return Upload(name, content, self.dialect)

    def download(self, name: bytes, limit_bytes: int = DOWNLOAD_LIMIT_BYTES) -> Download:
        """Create a download (5.3); `begin` starts it. Raises the same errors as `command`."""
        return Download(name, limit_bytes, self.dialect)

    def begin(self, operation: PendingOperation, now_s: float) -> None:
        """Send the request of an operation.

        Raises:
            LoginFailed: No login has succeeded yet (2/10).
            LinkLost: The link has ended.
            ClientError: The slot is not free (3/25).
        """
        name = operation.command.name
        if self._lost_reason is not None:
            raise LinkLost(
                UserMessage(
                    "{command} is not sent: {reason}", command=name, reason=self._lost_reason
                )
            )
        if not self.logged_in and not isinstance(operation, Login):
            raise LoginFailed(
                UserMessage("{command} is not sent: log in first (4.1, L104)", command=name)
            )
        if not self.is_free(operation.slot):
            raise ClientError(
                UserMessage(
                    "{command} is not sent: a request of the same kind is pending (A-3-14)",
                    command=name,
                )
            )
        self._open.append(operation)
        self._send(operation.begin(now_s))

    def is_free(self, slot: str) -> bool:
        """Whether a request may be sent: at most one per opcode is pending (3/25)."""
        return not any(e.slot == slot and e.occupies_slot for e in self._open)

    @property
    def deadline_s(self) -> float | None:
        """When to call `tick` if nothing arrives; None for never."""
        deadlines = [e.deadline_s for e in self._open if e.deadline_s is not None]
        if self._partial_until_s is not None:
            deadlines.append(self._partial_until_s)
        return min(deadlines, default=None)

    def bytes_to_send(self) -> bytes:
        """Return the bytes to send, and clear them."""
        data = bytes(self._outbox)
        self._outbox.clear()
        return data

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        """Process received bytes and return the events."""
        self._last_received_s = now_s
        return self._process_items(self._framer.feed(data), now_s)

    def tick(self, now_s: float) -> list[Event]:
        """Expire timeouts that have passed; feed all bytes that arrived until `now_s` first."""
        events: list[Event] = []
        if self._partial_until_s is not None and now_s >= self._partial_until_s:
            events += self._process_items(self._framer.finish(), now_s)
        for operation in tuple(self._open):
            if operation.deadline_s is not None and now_s >= operation.deadline_s:
                awaited = operation.awaited_command
                self._send(operation.expire(now_s))
                events += self._after_step(operation, now_s)
                if operation.settled and operation.error:
                    events += self._after_missing_reply(awaited, now_s)
        return events

    def _after_missing_reply(self, name: str, now_s: float) -> list[Event]:
        """Note that a reply is owed; end the link if it is unknown which one."""
        if name in self._ambiguous:
            self.must_close = True
            return self.connection_lost(
                UserMessage(
                    "replies to {command} came late, and it is unknown which request they answer: "
                    "connect again",
                    command=name,
                ),
                now_s,
            )
        if name not in ("", _STOP):
            self._owed[name] += 1
        return []

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        """Fail all pending operations, because the link has ended for `reason`."""
        if self._lost_reason is not None:
            return []
        events = self._process_items(self._framer.finish(), now_s)
        self._lost_reason = reason
        if self._expected_link_end:
            self._lost_reason = UserMessage(
                "the link ended, as it may after {command}", command=self._expected_link_end
            )
        for operation in tuple(self._open):
            operation.fail(
                LinkLost(
                    UserMessage(
                        "{command} was not completed: {reason}",
                        command=operation.command.name,
                        reason=self._lost_reason,
                    )
                )
            )
            events += self._after_step(operation, now_s)
        return events

    @property
    def _partial_until_s(self) -> float | None:
        """When a partial frame is discarded (A-3-11); None if there is none, or never."""
        seconds = self.dialect.seconds("partial_timeout")
        if not self._framer.buffered_bytes or seconds is None:
            return None
        return self._last_received_s + seconds

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            self._outbox += frame.encode()

    def _process_items(self, items: Iterable[StreamItem], now_s: float) -> list[Event]:
        events: list[Event] = []
        for item in items:
            if isinstance(item, Skipped):
                self.remarks.append(
                    UserMessage(
                        "{byte_count} bytes are not a frame ({reason})",
                        byte_count=item.size_bytes,
                        reason=item.reason.value,
                    )
                )
                events.append(item)
            else:
                events += self._dispatch(item, now_s)
        return events

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        """Pass a frame to the first operation that expects it."""
        parsed = parse_frame(frame)
        if parsed is not None and self._is_owed(parsed):
            return [UnexpectedFrame(frame)]
        if parsed is not None:
            for operation in self._open:
                if operation.expects(frame, parsed):
                    self._ambiguous.discard(operation.awaited_command)
                    self._record_readings(frame, parsed)
                    self._send(operation.take(parsed, frame.data, now_s))
                    return [FrameAccepted(operation, frame), *self._after_step(operation, now_s)]
            self._refuse_stray_chunk(parsed)
        self.remarks.append(UserMessage("this frame was not expected: {frame}", frame=frame))
        return [UnexpectedFrame(frame)]

    def _is_owed(self, parsed: Parsed) -> bool:
        """Whether a frame is a late reply, which is then ignored."""
        name = parsed.command.name
        if parsed.part != "reply" or not self._owed[name]:
            return False
        self._owed[name] -= 1
        self.remarks.append(
            UserMessage("a reply to {command} came after the timeout and was ignored", command=name)
        )
        if any(operation.awaited_command == name for operation in self._open):
            self._ambiguous.add(name)
        return True

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        """Reply ``0`` to a chunk outside a transfer: each chunk gets one reply (5.3/5).

        The error signal of length 0 gets no reply (A-5-10).
        """
        if parsed.part == "request" and parsed.decoded.value and parsed.decoded.value.length:
            self._send([chunk_reply(accepted=False, dialect=self.dialect)])

    def _record_readings(self, frame: Frame, parsed: Parsed) -> None:
        """Record the readings and the deviations that a frame shows."""
        for key, option in parsed.decoded.readings:
            self._observe(key, option)
        if parsed.command.alternate_opcode is not None:
            self._observe("op_get_default", f"0x{frame.opcode:02X}")
        if parsed.command.alternate_reply_opcode is not None:
            self._observe("op_temp_reply", f"0x{frame.opcode:02X}")
        if parsed.part == "result" and self._executing(_STOP) and parsed.command.name != _STOP:
            self._observe("estop_interrupted", "first")
        for issue in parsed.decoded.issues:
            self.remarks.append(
                UserMessage(
                    "{part} of {command}: {issue}",
                    part=parsed.part,
                    command=parsed.command.name,
                    issue=issue.text,
                )
            )

    def _observe(self, key: str, option: str) -> None:
        self.observed_readings.setdefault(key, set()).add(option)
        if key in _LEARNED:
            self.dialect = self.dialect.replace(**{key: option})

    def _after_step(self, operation: PendingOperation, now_s: float) -> list[Event]:
        """Update the core after a step of an operation, and return the events."""
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
        """Interrupt other executing commands, if this step implies that they have ended."""
        events: list[Event] = []
        if operation.stage is Stage.EXECUTING:
            for other in self._executing(operation.command.name):
                if other is not operation:  # an executing command excludes a new one (A-4-2)
                    other.interrupt("it was started again before its own result arrived")
                    events += self._after_step(other, now_s)
        elif operation.command.name == _STOP and operation.error is None:
            for other in self._executing():
                other.on_emergency_stop(now_s)
        return events

    def _executing(self, name: str = "") -> list[TwoStage]:
        """Return the executing two-stage commands, only those called `name` if given."""
        return [
            e
            for e in self._open
            if isinstance(e, TwoStage)
            and e.stage is Stage.EXECUTING
            and name in ("", e.command.name)
        ]
