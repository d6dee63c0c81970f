"""The text interface of the operations: arguments from text, results as text or JSON.

It is derived from the command table: which arguments an operation takes, how they are parsed from
a command line, and how a result is formatted. No code here sends anything.
"""

from collections.abc import Mapping, Sequence
from datetime import datetime
from enum import Enum
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, Final

from scaraspec.client.errors import Failed, Refused
from scaraspec.client.operations import parse_direction
from scaraspec.client.results import Status
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
                parameters=" ".join(names).upper() or "no arguments",
                given_count=len(texts),
            )
        )
    if name in TRANSFERS:
        return list(texts)
    request = BY_NAME[name].request
    if isinstance(request, Jog):
        return [parse_direction(text) for text in texts]
    return [_parse(field, text) for field, text in zip(request.fields, texts, strict=True)]


def _parse(field: Field, text: str) -> Any:
    if isinstance(field, Name | Text):
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


def format_result(name: str, result: Any) -> list[str]:
    """Format a result as lines for the user, with units."""
    fields = {} if name in TRANSFERS else {f.name: f for f in BY_NAME[name].reply.fields}
    match result:
        case None:
            texts = {"get_running_program": "no program runs", "get_default_program": "none"}
            return [texts.get(name, "done")]
        case Status():
            meaning = "" if result.meaning == result.state.value else f", {result.meaning}"
            return [f"{result.state.value} ({result.code}{meaning})"]
        case tuple() if hasattr(result, "_asdict"):
            width = max(map(len, fields))
            return [
                f"{key:<{width}}  {_plain(value)} {fields[key].unit}".rstrip()
                for key, value in result._asdict().items()
            ]
        case tuple():
            return [_plain(item) for item in result] or ["no programs"]
        case str() if isinstance(fields.get("bits"), Bits):
            return [f"{result}  (ports {len(result)} to 1)"]
    return [_plain(result)]


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    return show(str(value).encode("utf-8", "surrogateescape"), limit=255)


def to_json(value: Any) -> Any:
    """Convert a result to JSON types. Undecodable bytes in names become surrogate escapes."""
    match value:
        case tuple() if hasattr(value, "_asdict"):
            return {key: to_json(item) for key, item in value._asdict().items()}
        case tuple():
            return [to_json(item) for item in value]
        case Enum():
            return value.name.lower()
        case datetime():
            return value.isoformat()
        case PurePath():
            return str(value)
    return value


def error_to_json(error: Exception) -> dict[str, Any]:
    """Convert an error to JSON types: kind, message, and the code if it can have one."""
    json_error: dict[str, Any] = {"kind": type(error).__name__, "message": str(error)}
    if isinstance(error, Refused | Failed):
        code = error.code
        json_error["code"] = code and code.text
        json_error["meaning"] = code and code.meaning
        json_error["joints"] = to_json(code.joints) if code else []
    return json_error
