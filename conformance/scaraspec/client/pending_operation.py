"""Pending operations: one request with all its replies, one class per kind of operation.

A pending operation decides which frames it expects, how it interprets them and how long it waits.
It is settled once, with a value or an error. `core` finds the frames and dispatches them;
`transfer` contains the file transfers. No code here reads a clock: the time is passed as `now_s`.
"""

from collections.abc import Callable
from enum import Enum
from typing import Any, Final

from scaraspec.client.errors import (
    ClientError,
    Interrupted,
    LoginFailed,
    ProtocolError,
    Refused,
    ReplyTimeout,
)
from scaraspec.client.replies import interpret_reply
from scaraspec.protocol.commands import Command, Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.readings import Dialect
from scaraspec.user_message import UserMessage

MAX_LIST_PARTS: Final = 4096
"""Limit for a program list without end: about one megabyte of names."""

Progress = Callable[[int, int | None], None]
"""Callback of a transfer: bytes transferred so far, and the file size (None if unknown)."""


class Stage(Enum):
    """The stage of a pending operation."""

    REQUESTED = "requested"  # the first reply is expected
    EXECUTING = "executing"  # accepted: the final result, or the rest of the file, is expected
    SETTLED = "settled"


class PendingOperation:
    """A request with a single reply; the base class of the other operations.

    Attributes:
        command: The row of the command table.
        stage: The current stage.
        accepted: Whether the first reply accepted the request; None before it arrives.
        deadline_s: When to call `expire`; None if there is no timeout.
        value: The value, if the operation is settled without an error.
        error: The error, if the operation failed.
        observed: Readings that the course of the operation shows.
    """

    def __init__(self, command: Command, value: Any, dialect: Dialect) -> None:
        self.command = command
        self.stage = Stage.REQUESTED
        self.accepted: bool | None = None
        self.deadline_s: float | None = None
        self.value: Any = None
        self.error: ClientError | None = None
        self.observed: dict[str, str] = {}
        self._dialect = dialect
        self._request = Frame(A2C, command.opcode, command.request.encode(value, dialect))
        self._opcodes = {command.opcode, command.alternate_reply_opcode}  # opcodes of a reply

    @property
    def slot(self) -> str:
        """The key of which at most one operation may be pending: the command (A-3-14)."""
        return self.command.name

    @property
    def occupies_slot(self) -> bool:
        """Whether another operation of this slot must wait."""
        return self.stage is not Stage.SETTLED

    @property
    def awaited_command(self) -> str:
        """The command whose reply is still due after a timeout; empty if none is."""
        return self.command.name if self.stage is Stage.REQUESTED else ""

    @property
    def settled(self) -> bool:
        """Whether the operation has ended."""
        return self.stage is Stage.SETTLED

    @property
    def has_progress(self) -> bool:
        """Whether there is progress to report."""
        return False

    def report(self, progress: Progress | None) -> None:
        """Report the progress since the last report."""

    def outcome(self) -> Any:
        """Return the value of a settled operation.

        Raises:
            ClientError: The error, if the operation failed.
        """
        if self.error is not None:
            raise self.error
        return self.value

    def begin(self, now_s: float) -> list[Frame]:
        """Start the timeout and return the frames to send."""
        return self._send_request(now_s)

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """Whether the operation expects this frame: its untagged reply (3/33)."""
        return (
            self.stage is Stage.REQUESTED
            and parsed.part == "reply"
            and parsed.command is self.command
            and frame.opcode in self._opcodes
        )

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Process an expected frame and return the frames to send next."""
        try:
            value = interpret_reply(parsed, data)
        except ClientError as error:
            self.accepted = False
            self.fail(error)
            return []
        self.accepted = True
        return self._accept(value, now_s)

    def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - subclasses send again
        """Handle the timeout at `deadline_s` and return the frames to send."""
        self.fail(
            ReplyTimeout(
                UserMessage(
                    "{command} got no reply within {timeout_s:g} s: "
                    "it is unknown whether it took effect",
                    command=self.command.name,
                    timeout_s=self._dialect.seconds("reply_timeout"),
                )
            )
        )
        return []

    def abort(self) -> None:
        """Cancel the operation. A single request cannot be cancelled, so this does nothing."""

    def settle(self, value: Any) -> None:
        """End the operation with a value."""
        self.value = value
        self._close()

    def fail(self, error: ClientError) -> None:
        """End the operation with an error."""
        self.error = error
        self._close()

    def _close(self) -> None:
        self.stage, self.deadline_s = Stage.SETTLED, None

    def _send_request(self, now_s: float) -> list[Frame]:
        """Return the request to send or to repeat, and start the reply timeout."""
        self._start_timeout("reply_timeout", now_s)
        return [self._request]

    def _start_timeout(self, key: str, now_s: float) -> None:
        seconds = self._dialect.seconds(key)
        self.deadline_s = None if seconds is None else now_s + seconds

    def _accept(self, value: Any, now_s: float) -> list[Frame]:  # noqa: ARG002 - subclasses need it
        self.settle(value)
        return []


class Login(PendingOperation):
    """The login (4.1): any reply other than ``1`` is a failure (4.1/8)."""

    def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - nothing is repeated
        """Fail: a controller with one place does not serve a second client (A-2-2)."""
        self.fail(
            ReplyTimeout(
                UserMessage(
                    "login got no reply within {timeout_s:g} s: another client may be connected, "
                    "and this controller may serve only one",
                    timeout_s=self._dialect.seconds("reply_timeout"),
                )
            )
        )
        return []

    def fail(self, error: ClientError) -> None:
        """End the login; a refusal or an invalid reply becomes `LoginFailed`."""
        if isinstance(error, Refused):
            error = LoginFailed("the login failed: the controller refused the password (L116)")
        elif isinstance(error, ProtocolError):
            error = LoginFailed(UserMessage("the login failed: {error}", error=error))
        super().fail(error)


class ProgramListing(PendingOperation):
    """The program list (4.10), in one or more parts, pushed or requested (A-4.10-3).

    The operation waits for pushed parts. If no part arrives before the reply timeout, it requests
    the next part.
    """

    def __init__(self, command: Command, value: Any, dialect: Dialect) -> None:
        super().__init__(command, value, dialect)
        self._names: list[bytes] = []
        self._parts_received = 0
        self._requests_sent = 0

    def expire(self, now_s: float) -> list[Frame]:
        """Request the next part; fail if the last request for a part got no reply."""
        if self._requests_sent > self._parts_received:
            return super().expire(now_s)
        return self._send_request(now_s)

    def _send_request(self, now_s: float) -> list[Frame]:
        self._requests_sent += 1
        return super()._send_request(now_s)

    def _accept(self, value: NameListPart, now_s: float) -> list[Frame]:
        self._parts_received += 1
        self._names += value.names
        if self._parts_received > 1:
            self.observed["list_cont"] = (
                "request" if self._requests_sent == self._parts_received else "push"
            )
        if not value.more:
            self.settle(tuple(self._names))
        elif self._parts_received == MAX_LIST_PARTS:
            self.fail(
                ProtocolError(
                    UserMessage(
                        "the program list does not end after {part_count} parts",
                        part_count=self._parts_received,
                    )
                )
            )
        elif self._dialect["list_cont"] == "request":
            return self._send_request(now_s)
        else:
            self._start_timeout("reply_timeout", now_s)
        return []


class DefaultProgram(PendingOperation):
    """The default program (4.12), requested with 0x0D and after a timeout with 0x13 (A-4.12-1)."""

    def __init__(self, command: Command, value: Any, dialect: Dialect) -> None:
        super().__init__(command, value, dialect)
        if dialect["op_get_default"] == "0x13":
            self._use_printed_opcode()

    def expire(self, now_s: float) -> list[Frame]:
        """Try the printed opcode 0x13; then no reply may mean that no default program is set."""
        if self.command.alternate_opcode not in self._opcodes:
            self._use_printed_opcode()
            return self._send_request(now_s)
        if self._dialect["default_none"] == "silence":
            self.settle(b"")
            return []
        return super().expire(now_s)

    def _use_printed_opcode(self) -> None:
        assert self.command.alternate_opcode is not None
        self._request = self._request._replace(opcode=self.command.alternate_opcode)
        self._opcodes.add(self.command.alternate_opcode)


class TwoStage(PendingOperation):
    """A command with a first reply and a final result with the tag 0x90 (A-3-7).

    The final result has no timeout (A-3-15), except after an emergency stop: then the result may
    arrive late or never (A-4.17-4).
    """

    @property
    def occupies_slot(self) -> bool:
        """Only until the first reply: the controller decides about a second request."""
        return self.stage is Stage.REQUESTED

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """Expect the first reply, then the tagged result; the payload does not decide (4/9)."""
        if self.stage is Stage.EXECUTING:
            return parsed.part == "result" and parsed.command is self.command
        return super().expects(frame, parsed)

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Process the first reply or the final result."""
        if self.stage is Stage.REQUESTED:
            return super().take(parsed, data, now_s)
        if self.deadline_s is not None:
            self.observed["estop_interrupted"] = "after"
        try:
            self.settle(interpret_reply(parsed, data))
        except ClientError as error:
            self.fail(error)
        return []

    def expire(self, now_s: float) -> list[Frame]:
        """Handle a missing first reply, or a missing result after an emergency stop."""
        if self.stage is Stage.REQUESTED:
            return super().expire(now_s)
        self.observed["estop_interrupted"] = "none"
        self.interrupt("an emergency stop ended it, and its own result did not arrive")
        return []

    def on_emergency_stop(self, now_s: float) -> None:
        """Start a timeout for the result: an emergency stop was executed."""
        self._start_timeout("reply_timeout", now_s)

    def interrupt(self, reason: str) -> None:
        """End the operation without a result."""
        self.fail(Interrupted(self.command, None, reason))

    def _accept(self, value: Any, now_s: float) -> list[Frame]:  # noqa: ARG002 - a first reply has no value
        self.stage, self.deadline_s = Stage.EXECUTING, None
        return []


_OPERATION_CLASSES: Final = {
    "login": Login,
    "list_programs": ProgramListing,
    "get_default_program": DefaultProgram,
}


def create_operation(command: Command, value: Any, dialect: Dialect) -> PendingOperation:
    """Create the pending operation of a command.

    Raises:
        PayloadError: The document does not allow `value`.
    """
    default = TwoStage if command.two_stage else PendingOperation
    return _OPERATION_CLASSES.get(command.name, default)(command, value, dialect)
