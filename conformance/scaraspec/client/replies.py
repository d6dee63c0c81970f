"""Replies: what a decoded reply or final result amounts to, as a value or as an error.

The one place where a yes is told from a no. Who may reply, and when, stands in `operation`.
"""

from typing import Any, Final

from scaraspec.client.errors import Failed, Interrupted, ProtocolError, Refused
from scaraspec.protocol import errors
from scaraspec.protocol.commands import Command, Parsed
from scaraspec.protocol.fields import Defect, show
from scaraspec.protocol.payloads import Acceptance, OptionalRecord, Outcome
from scaraspec.user_message import UserMessage

_SPELLING: Final = frozenset({Defect.TRAILING_NUL, Defect.QUOTES, Defect.BINARY})
_CODE_LENGTH: Final = 2


def interpret_reply(parsed: Parsed, data: bytes) -> Any:
    """The value that a reply or a final result gives; None for a plain success.

    A yes must stand as it is drawn, but for a trailing NUL (A-T-3): anything else is no yes
    (4.1/8). In everything but a yes, what can be understood is taken.

    Args:
        parsed: The frame, read against the table.
        data: Its data.

    Raises:
        Refused: A ``0``, with or without a code.
        Failed: A final ``00|code``; `Interrupted` for the code 00 (A-4.17-4).
        ProtocolError: Nothing can be made of it.
    """
    command, value = parsed.command, parsed.decoded.value
    wrong = {complaint.defect for complaint in parsed.decoded.issues}
    match value:
        case True | Acceptance(accepted=True) | Outcome(done=True):
            if not wrong <= {Defect.TRAILING_NUL}:
                raise _unreadable(parsed, data)
            return None
        case False:
            raise Refused(command)
        case Acceptance():
            raise Refused(command, _code(value.code, data[2:]))
        case Outcome():
            raise _failure(command, _code(value.code, data[3:]))
        case None:
            return _value_of_none(parsed, data, wrong)
    return value


def _failure(command: Command, code: errors.Code | None) -> Failed:
    if code and code.kind is errors.Kind.IDLE:
        return Interrupted(command, code, "its result is 00|00")
    return Failed(command, code)


def _value_of_none(parsed: Parsed, data: bytes, wrong: set[Defect]) -> str | None:
    """What it means that no value was found: a ``0`` for an answer, or nothing sensible."""
    reply = parsed.command.reply
    if isinstance(reply, OptionalRecord) and wrong <= _SPELLING:
        if reply.none_reading:
            return None
        raise Refused(parsed.command)
    if wrong == {Defect.CODE} and len(data) == _CODE_LENGTH:
        return show(data)  # a status that table 8-1 lacks is told as it came (4.8/11)
    raise _unreadable(parsed, data)


def lookup_code(text: str) -> errors.Code:
    """The row of table 8-1 for `text`, or one that says that there is none."""
    return errors.lookup(text) or errors.Code(
        text, "a code that table 8-1 lacks", "", 0, errors.Kind.RESERVED
    )


def _code(text: str | None, raw: bytes) -> errors.Code | None:
    """The code that was understood, else the raw one, else None where none was sent."""
    return lookup_code(text or show(raw)) if text or raw else None


def _unreadable(parsed: Parsed, data: bytes) -> ProtocolError:
    what = "final result" if parsed.part == "result" else "reply"
    complaints = parsed.decoded.issues
    why = complaints[0].text if complaints else show(data)
    return ProtocolError(
        UserMessage(
            "the {what} of {command} cannot be understood: {why}",
            what=what,
            command=parsed.command.name,
            why=why,
        )
    )
