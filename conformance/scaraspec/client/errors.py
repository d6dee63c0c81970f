"""What can keep a client from doing what it was asked: one class each, one sentence each.

Errors that come from the controller or the link live here. What a caller did wrong is a
`PayloadError` (a value that the document forbids) or an `OSError` (a local file), raised before
anything is sent.
"""

from scaraspec.protocol.commands import Command
from scaraspec.protocol.errors import Code


class ClientError(Exception):
    """The base of all errors of this room; its text is one sentence for a user."""


class LoginFailed(ClientError):  # noqa: N818 - it says what happened, like its siblings
    """The login was not answered with ``1``, or none has succeeded yet (4.1, L116; 4.1/5)."""


class Refused(ClientError):  # noqa: N818 - it says what happened, like its siblings
    """The first reply said no: nothing was done (L311-316; 4/13).

    Attributes:
        command: What was refused.
        code: The reason; None where the controller gave none (FLAG replies, a bare ``0``).
    """

    def __init__(self, command: Command, code: Code | None = None) -> None:
        if command.name == "emergency_stop":
            reason = "the controller sees nothing to stop (L363)"
        else:
            reason = _reason(code)
        super().__init__(f"{command.name} was refused: {reason}")
        self.command = command
        self.code = code


class Failed(ClientError):  # noqa: N818 - it says what happened, like its siblings
    """The final result said ``00|code``: it was begun and not done (L323-328).

    Attributes:
        command: What failed.
        code: The reason; None where the controller gave none.
    """

    def __init__(self, command: Command, code: Code | None = None, text: str = "") -> None:
        super().__init__(text or f"{command.name} failed: {_reason(code)}")
        self.command = command
        self.code = code


class Interrupted(Failed):
    """It was ended before its time: ``00|00``, or no result at all after a stop (A-4.17-4)."""

    def __init__(self, command: Command, code: Code | None, how: str) -> None:
        super().__init__(command, code, f"{command.name} was interrupted: {how}")


class ReplyTimeout(ClientError):  # noqa: N818 - it says what happened, like its siblings
    """No reply came in time (A-3-15); whether the request took effect is not known."""


class LinkLost(ClientError):  # noqa: N818 - it says what happened, like its siblings
    """The link could not be made, or it ended; whether a pending request took effect is open."""


class TransferFailed(ClientError):  # noqa: N818 - it says what happened, like its siblings
    """A file did not arrive whole (clause 5).

    Attributes:
        reason: Why, one clause of English.
    """

    def __init__(self, what: str, reason: str) -> None:
        super().__init__(f"the {what} failed: {reason}")
        self.reason = reason


class ProtocolError(ClientError):
    """The controller's answer makes no sense by the document."""


def _reason(code: Code | None) -> str:
    return f"{code.text}, {code.meaning}" if code else "the controller gives no reason"
