"""The text interface of the operations: arguments from text, results as text or JSON.

It is derived from the command table: which arguments an operation takes, how they are parsed from
a command line, and how a result is formatted. No code here sends anything.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from enum import Enum
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, Final

from scaraspec.client.errors import Failed, Refused
from scaraspec.client.operations import parse_direction
from scaraspec.client.results import State, Status
from scaraspec.protocol.commands import BY_NAME, COMMANDS, Command
from scaraspec.protocol.fields import (
    Bits,
    Clock,
    Diagnostics,
    Field,
    Name,
    PayloadError,
    Text,
    show,
)
from scaraspec.protocol.payloads import Jog
from scaraspec.user_message import UserMessage

_ESCAPE: Final = re.compile(rb"\\(?:x([0-9a-fA-F]{2})|\\)")

TRANSFERS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {"upload": ("local", "[remote]"), "download": ("remote", "[local]")}
)
"""The operations for the four commands of clause 5; arguments in brackets are optional."""


def parameter_names(command: Command) -> tuple[str, ...]:
    """Return the parameter names of a command, in the order of its request."""
    if isinstance(command.request, Jog):
        return ("direction",)
    return tuple(field.name for field in command.request.fields)


OPERATIONS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {c.name: parameter_names(c) for c in COMMANDS if c.clause[0] == "4"} | dict(TRANSFERS)
)
"""Every operation of a client in the command table, with its parameter names."""


def parse_arguments(name: str, texts: Sequence[str]) -> list[Any]:
    """Parse the arguments of an operation.

    Raises:
        PayloadError: There are too few or too many arguments, or one is not valid.
    """
    names = OPERATIONS[name]
    required_count = sum(not parameter.startswith("[") for parameter in names)
    if not required_count <= len(texts) <= len(names):
        raise PayloadError(
            UserMessage(
                "{command} takes {parameters}: {given_count} given",
                command=name,
                parameters=" ".join(names).upper() or UserMessage("no arguments"),
                given_count=len(texts),
            )
        )
    if name in TRANSFERS:
        remote = ["[remote]", "remote"]
        return [
            parse_name(text) if parameter in remote else text
            for parameter, text in zip(names, texts, strict=False)
        ]
    request = BY_NAME[name].request
    if isinstance(request, Jog):
        return [parse_direction(text) for text in texts]
    return [_parse(field, text) for field, text in zip(request.fields, texts, strict=True)]


def _parse(field: Field, text: str) -> Any:
    if isinstance(field, Name):
        return parse_name(text)
    if isinstance(field, Text):
        return text
    if isinstance(field, Clock) and not text.isdigit():
        try:
            return datetime.fromisoformat(text)
        except ValueError:
            pass  # the field reports the error
    diagnostics = Diagnostics()
    value = field.read(text.encode("utf-8", "surrogateescape"), diagnostics)
    if diagnostics.issues:
        raise PayloadError(diagnostics.issues[0].text)
    return value


def name_text(name: str) -> str:
    r"""Return a name as printable text from which `parse_name` makes the same bytes.

    Bytes that are not UTF-8, and unprintable characters, become ``\xNN``; a backslash is doubled.
    So different names are never shown alike (A-T-2).

    Args:
        name: The name as the client returns it, with surrogate escapes.
    """
    return "".join(
        char.replace("\\", "\\\\") if char.isprintable() else _escaped(char) for char in name
    )


def _escaped(char: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in char.encode("utf-8", "surrogateescape"))


def parse_name(text: str) -> bytes:
    r"""Return the bytes of a name that `name_text` or the user has written.

    ``\xNN`` is a byte, and ``\\`` a backslash. Any other backslash is itself.
    """
    data = text.encode("utf-8", "surrogateescape")
    return _ESCAPE.sub(lambda found: bytes.fromhex(found[1].decode()) if found[1] else b"\\", data)


def _other_encoding(name: str) -> str:
    """Return how a name reads in GB18030 if it is not UTF-8; empty if it is."""
    data = name.encode("utf-8", "surrogateescape")
    try:
        data.decode()
    except UnicodeDecodeError:
        text = show(data)
        return f"  (GB18030: {text})" if "\\x" not in text else ""
    return ""


_STATES: Final = {
    State.IDLE: UserMessage("idle"),
    State.RUNNING: UserMessage("running"),
    State.ERROR: UserMessage("error"),
}


def format_result(name: str, result: Any) -> list[str]:
    """Format a result as lines for the user, with units. Lines with words are messages."""
    fields = {} if name in TRANSFERS else {f.name: f for f in BY_NAME[name].reply.fields}
    match result:
        case None:
            texts = {
                "get_running_program": UserMessage("no program runs"),
                "get_default_program": UserMessage("none"),
            }
            return [texts.get(name, UserMessage("done"))]
        case Status():
            code: str = result.code
            if result.meaning != result.state.value:
                meaning = UserMessage.of(result.meaning, result.meaning, {})
                code = UserMessage("{code}, {meaning}", code=code, meaning=meaning)
            return [UserMessage("{state} ({code})", state=_STATES[result.state], code=code)]
        case tuple() if hasattr(result, "_asdict"):
            width = max(map(len, fields))
            return [
                f"{key:<{width}}  {_plain(value)} {fields[key].unit}".rstrip()
                for key, value in result._asdict().items()
            ]
        case tuple():
            return [_plain(item) for item in result] or [UserMessage("no programs")]
        case str() if isinstance(fields.get("bits"), Bits):
            return [UserMessage("{bits}  (ports {count} to 1)", bits=result, count=len(result))]
    return [_plain(result)]


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    text = str(value)
    return f"{name_text(text)}{_other_encoding(text)}"


def to_json(value: Any, text: Callable[[str], str] = str) -> Any:
    """Convert a result to JSON types.

    Args:
        value: The result.
        text: Converts strings, which have surrogate escapes for bytes that are not UTF-8.
    """
    match value:
        case tuple() if hasattr(value, "_asdict"):
            return {key: to_json(item, text) for key, item in value._asdict().items()}
        case tuple():
            return [to_json(item, text) for item in value]
        case Enum():
            return value.name.lower()
        case datetime():
            return value.isoformat()
        case PurePath():
            return str(value)
    return text(value) if isinstance(value, str) else value


def error_to_json(error: Exception) -> dict[str, Any]:
    """Convert an error to JSON types: kind, message, and the code if it can have one."""
    json_error: dict[str, Any] = {"kind": type(error).__name__, "message": str(error)}
    if isinstance(error, Refused | Failed):
        code = error.code
        json_error["code"] = code and code.text
        json_error["meaning"] = code and code.meaning
        json_error["joints"] = to_json(code.joints) if code else []
    return json_error
