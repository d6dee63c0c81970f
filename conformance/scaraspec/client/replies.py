"""Interpretation of decoded replies and final results, as a value or as an exception.

Only this module decides whether a reply is a success. `pending_operation` decides which frame is
expected and when.
"""

from typing import Any, Final

from scaraspec.client.errors import Failed, Interrupted, ProtocolError, Refused
from scaraspec.protocol import errors
from scaraspec.protocol.commands import Command, Parsed
from scaraspec.protocol.fields import Defect, show
from scaraspec.protocol.payloads import Acceptance, OptionalRecord, Outcome
from scaraspec.user_message import UserMessage

_SPELLING: Final = frozenset({Defect.TRAILING_NUL, Defect.QUOTES, Defect.BINARY})
"""Defects of the encoding of a text."""
_CODE_LENGTH: Final = 2


def interpret_reply(parsed: Parsed, data: bytes) -> Any:
    """Return the value of a reply or a final result; None for a success without value.

    A success must have the form in the document, except for a trailing NUL (A-T-3): any other form
    is not a success (4.1/8). All other replies are decoded tolerantly.

    Args:
        parsed: The frame, decoded with the command table.
        data: The data of the frame.

    Raises:
        Refused: The reply is ``0``, with or without a code.
        Failed: The final result is ``00|code``; `Interrupted` for the code 00 (A-4.17-4).
        ProtocolError: The reply cannot be decoded.
    """
    command, value = parsed.command, parsed.decoded.value
    defects = {issue.defect for issue in parsed.decoded.issues}
    match value:
        case True | Acceptance(accepted=True) | Outcome(done=True):
            if not defects <= {Defect.TRAILING_NUL}:
                raise _undecodable(parsed, data)
            return None
        case False:
            raise Refused(command)
        case Acceptance():
            raise Refused(command, _code(value.code, data[2:]))
        case Outcome():
            raise _failure(command, _code(value.code, data[3:]))
        case None:
            return _interpret_without_value(parsed, data, defects)
    return value


def _failure(command: Command, code: errors.Code | None) -> Failed:
    if code and code.kind is errors.Kind.IDLE:
        return Interrupted(command, code, "its result is 00|00")
    return Failed(command, code)


def _interpret_without_value(parsed: Parsed, data: bytes, defects: set[Defect]) -> str | None:
    """Interpret a reply without a value: a ``0`` instead of an answer, or an undecodable reply."""
    reply = parsed.command.reply
    if isinstance(reply, OptionalRecord) and defects <= _SPELLING:
        if reply.none_reading:
            return None
        raise Refused(parsed.command)
    if defects == {Defect.CODE} and len(data) == _CODE_LENGTH:
        return show(data)  # a status code that is not in table 8-1 is returned as is (4.8/11)
    raise _undecodable(parsed, data)


def lookup_code(text: str) -> errors.Code:
    """Return the row of table 8-1 for `text`, or a substitute for an unknown code."""
    return errors.lookup(text) or errors.Code(
        text, "a code that is not in table 8-1", "", 0, errors.Kind.RESERVED
    )


def _code(text: str | None, raw: bytes) -> errors.Code | None:
    """Return the decoded code, else the raw one, or None if no code was sent."""
    return lookup_code(text or show(raw)) if text or raw else None


def _undecodable(parsed: Parsed, data: bytes) -> ProtocolError:
    reply_kind = UserMessage("final result" if parsed.part == "result" else "reply")
    issues = parsed.decoded.issues
    reason = issues[0].text if issues else show(data)
    return ProtocolError(
        UserMessage(
            "the {reply_kind} of {command} cannot be decoded: {reason}",
            reply_kind=reply_kind,
            command=parsed.command.name,
            reason=reason,
        )
    )
