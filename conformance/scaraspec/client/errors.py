"""The exceptions of the client: errors of the controller and of the link.

A mistake of the caller is a `PayloadError` (a value that the document does not allow) or an
`OSError` (a local file); both are raised before anything is sent.
"""

from scaraspec.protocol.commands import Command
from scaraspec.protocol.errors import Code
from scaraspec.user_message import UserMessage


class ClientError(Exception):
    """Base class of the client's exceptions. The text is one sentence for the user."""


class LoginFailed(ClientError):  # noqa: N818 - named after the event, like its siblings
    """The reply to the login was not ``1``, or no login has succeeded yet (4.1, L116; 4.1/5)."""


class Refused(ClientError):  # noqa: N818 - named after the event, like its siblings
    """The first reply refused the command; the robot did nothing (L311-316; 4/13).

    Attributes:
        command: The refused command.
        code: The reason; None if the controller gave none (FLAG replies, a bare ``0``).
    """

    def __init__(self, command: Command, code: Code | None = None) -> None:
        if command.name == "emergency_stop":
            reason = "the controller has nothing to stop (L363)"
        else:
            reason = _reason(code)
        super().__init__(
            UserMessage("{command} was refused: {reason}", command=command.name, reason=reason)
        )
        self.command = command
        self.code = code


class Failed(ClientError):  # noqa: N818 - named after the event, like its siblings
    """The final result is ``00|code``: the command started and was not completed (L323-328).

    Attributes:
        command: The failed command.
        code: The reason; None if the controller gave none.
    """

    def __init__(self, command: Command, code: Code | None = None, text: str = "") -> None:
        super().__init__(
            text
            or UserMessage("{command} failed: {reason}", command=command.name, reason=_reason(code))
        )
        self.command = command
        self.code = code


class Interrupted(Failed):
    """The command was interrupted: result ``00|00``, or no result after a stop (A-4.17-4)."""

    def __init__(self, command: Command, code: Code | None, reason: str) -> None:
        super().__init__(
            command,
            code,
            UserMessage("{command} was interrupted: {reason}", command=command.name, reason=reason),
        )


class ReplyTimeout(ClientError):  # noqa: N818 - named after the event, like its siblings
    """No reply before the timeout (A-3-15). It is unknown whether the request took effect."""


class LinkLost(ClientError):  # noqa: N818 - named after the event, like its siblings
    """The link was not established, or it ended.

    It is unknown whether a pending request took effect.
    """


class TransferFailed(ClientError):  # noqa: N818 - named after the event, like its siblings
    """A file transfer was not completed (clause 5).

    Attributes:
        reason: The reason, as a clause of a sentence.
    """

    def __init__(self, transfer: str, reason: str) -> None:
        super().__init__(
            UserMessage("the {transfer} failed: {reason}", transfer=transfer, reason=reason)
        )
        self.reason = reason


class ProtocolError(ClientError):
    """The reply cannot be decoded according to the document."""


def _reason(code: Code | None) -> str:
    if code is None:
        return "the controller gives no reason"
    return UserMessage("{code}, {meaning}", code=code.text, meaning=code.meaning)
