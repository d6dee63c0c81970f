"""Exchanges: one request and everything that comes of it, one class per shape of conversation.

An exchange says which frames it waits for and what it makes of them, and how long it waits; it is
settled once, with a value or a problem. Whose turn it is, and which bytes are frames, stands in
`core`; file transfers in `transfer`. Nothing here reads a clock: time comes in as `now_s`.
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
"""A program list of a megabyte ends somewhere; one that does not is cut off here."""

Progress = Callable[[int, int | None], None]
"""Told during a transfer: bytes moved so far, and in all where that is known."""


class Stage(Enum):
    """How far an exchange is."""

    REQUESTED = "asked"  # the first reply is due
    EXECUTING = "executing"  # accepted: the final result, or the rest of the file, is due
    SETTLED = "settled"


class PendingOperation:
    """A request with a single reply; the base of the other shapes.

    Attributes:
        command: Its row of the table.
        stage: How far it is.
        accepted: What the first reply said; None until it is in.
        deadline_s: When `expire` is due; None where there is no bound.
        value: What came of it, once settled without a problem.
        problem: Why nothing came of it.
        observed: Readings that its course gave away.
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
        self._opcodes = {command.opcode, command.alternate_reply_opcode}  # what a reply may bear

    @property
    def slot(self) -> str:
        """What at most one exchange at a time may occupy: the opcode (A-3-14)."""
        return self.command.name

    @property
    def occupies_slot(self) -> bool:
        """Whether another exchange of this slot has to wait."""
        return self.stage is not Stage.SETTLED

    @property
    def settled(self) -> bool:
        """Whether all is over."""
        return self.stage is Stage.SETTLED

    @property
    def has_progress(self) -> bool:
        """Whether there is progress to report."""
        return False

    def report(self, progress: Progress | None) -> None:
        """Tell the progress that was made since the last report."""

    def outcome(self) -> Any:
        """The value of a settled exchange.

        Raises:
            ClientError: Its problem, where it has one.
        """
        if self.error is not None:
            raise self.error
        return self.value

    def begin(self, now_s: float) -> list[Frame]:
        """Start the clock; return what to send."""
        return self._send_request(now_s)

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """Whether this frame is due to this exchange: its untagged reply (3/33)."""
        return (
            self.stage is Stage.REQUESTED
            and parsed.part == "reply"
            and parsed.command is self.command
            and frame.opcode in self._opcodes
        )

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Take a frame that was awaited; return what to send next."""
        try:
            value = interpret_reply(parsed, data)
        except ClientError as error:
            self.accepted = False
            self.fail(error)
            return []
        self.accepted = True
        return self._accept(value, now_s)

    def expire(self, now_s: float) -> list[Frame]:  # noqa: ARG002 - other shapes ask again
        """Make of silence what is to be made of it, at `deadline_s`; return what to send."""
        seconds = self._dialect.seconds("reply_timeout")
        self.fail(
            ReplyTimeout(
                f"{self.command.name} got no reply within {seconds:g} s: "
                "whether it took effect is not known"
            )
        )
        return []

    def abort(self) -> None:
        """The caller gave up. A lone request cannot be called back."""

    def settle(self, value: Any) -> None:
        """End it with a value."""
        self.value = value
        self._close()

    def fail(self, error: ClientError) -> None:
        """End it with a problem."""
        self.error = error
        self._close()

    def _close(self) -> None:
        self.stage, self.deadline_s = Stage.SETTLED, None

    def _send_request(self, now_s: float) -> list[Frame]:
        """Send the request, for the first time or again, and wait for its reply."""
        self._start_timeout("reply_timeout", now_s)
        return [self._request]

    def _start_timeout(self, key: str, now_s: float) -> None:
        seconds = self._dialect.seconds(key)
        self.deadline_s = None if seconds is None else now_s + seconds

    def _accept(self, value: Any, now_s: float) -> list[Frame]:  # noqa: ARG002 - other shapes wait on
        self.settle(value)
        return []


class Login(PendingOperation):
    """The login (4.1): any reply but ``1`` is a failure (4.1/8)."""

    def fail(self, error: ClientError) -> None:
        """End it; what the controller said against it is a failed login."""
        if isinstance(error, Refused):
            error = LoginFailed("the login failed: the controller refused the password (L116)")
        elif isinstance(error, ProtocolError):
            error = LoginFailed(f"the login failed: {error}")
        super().fail(error)


class ProgramListing(PendingOperation):
    """The program list (4.10), in one part or several, pushed or fetched (A-4.10-3).

    Parts are taken as pushed; where none comes within the reply time-out the next is asked for.
    """

    def __init__(self, command: Command, value: Any, dialect: Dialect) -> None:
        super().__init__(command, value, dialect)
        self._names: list[bytes] = []
        self._parts_received = 0
        self._requests_sent = 0

    def expire(self, now_s: float) -> list[Frame]:
        """Ask for the next part, unless that is what stays unanswered."""
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
                        "the program list has no end after {parts} parts",
                        parts=self._parts_received,
                    )
                )
            )
        elif self._dialect["list_cont"] == "request":
            return self._send_request(now_s)
        else:
            self._start_timeout("reply_timeout", now_s)
        return []


class DefaultProgram(PendingOperation):
    """The default program (4.12), asked for under 0x0D and, on silence, 0x13 (A-4.12-1)."""

    def __init__(self, command: Command, value: Any, dialect: Dialect) -> None:
        super().__init__(command, value, dialect)
        if dialect["op_get_default"] == "0x13":
            self._use_printed_opcode()

    def expire(self, now_s: float) -> list[Frame]:
        """Try the printed opcode; where silence means that none is set, that is the answer."""
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
    """A command with a first reply and, behind the 0x90 tag, a final result (A-3-7).

    There is no bound for the final result (A-3-15), except where an emergency stop has ended the
    command: then it may come late or never (A-4.17-4).
    """

    @property
    def occupies_slot(self) -> bool:
        """Only until the first reply: what the controller makes of a second request is its own."""
        return self.stage is Stage.REQUESTED

    def expects(self, frame: Frame, parsed: Parsed) -> bool:
        """The reply while asked, the tagged result while executing: never by payload (4/9)."""
        if self.stage is Stage.EXECUTING:
            return parsed.part == "result" and parsed.command is self.command
        return super().expects(frame, parsed)

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        """Take the first reply, or the result that ends it."""
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
        """No first reply; or no result of its own after an emergency stop."""
        if self.stage is Stage.REQUESTED:
            return super().expire(now_s)
        self.observed["estop_interrupted"] = "none"
        self.give_up("an emergency stop ended it, and no result of its own came")
        return []

    def stopped(self, now_s: float) -> None:
        """An emergency stop was carried out: its result comes soon or never."""
        self._start_timeout("reply_timeout", now_s)

    def give_up(self, how: str) -> None:
        """End it without a result."""
        self.fail(Interrupted(self.command, None, how))

    def _accept(self, value: Any, now_s: float) -> list[Frame]:  # noqa: ARG002 - a first reply has no value
        self.stage, self.deadline_s = Stage.EXECUTING, None
        return []


_SHAPES: Final = {
    "login": Login,
    "list_programs": ProgramListing,
    "get_default_program": DefaultProgram,
}


def create_operation(command: Command, value: Any, dialect: Dialect) -> PendingOperation:
    """An exchange of the shape that the command has.

    Raises:
        PayloadError: The document forbids to send `value`.
    """
    shape = _SHAPES.get(command.name, TwoStage if command.two_stage else PendingOperation)
    return shape(command, value, dialect)
