"""Reads files that define fault injection.

Belongs here: the file format and its error messages. `faults` implements the faults. A file is TOML
with a seed and rules.

    seed = 7                    # seed of random values; default 0

    [[rule]]
    name = "slow status"        # name in the capture, in addition to its number
    fault = "delay"             # kind of fault, and
    delay_ms = 250              # its parameters, see below
    command = "get_status"      # command name, or an opcode such as 0x09
    part = "reply"              # request, reply or result (the final one)
    direction = "C2A"           # A2C: from the client; C2A: from the controller
    connection = 1              # only on this connection, counted from 1
    every = 10                  # every tenth matching frame; or nth, first, probability

Only `fault` and its parameters are required; other keys default to any and all. A rule has at most
one of `nth`, `every`, `first` (a number of frames) and `probability` (0 to 1). Each connection
counts separately. All rules that match a frame are applied, in their order.

    delay      delay_ms                 the frame is sent later
    jitter     jitter_ms                the frame is sent later by up to this time
    fragment   size_bytes, gap_ms       it is sent in pieces, gap_ms apart (default 5)
    coalesce   frames, within_ms        it waits for this number of frames; all are sent together
    drop                                it is not sent
    corrupt    at_bytes, xor            one byte is changed; missing values are random
    truncate   keep_bytes               only its first bytes are sent
    reset                               the connection is reset instead, in both directions
    hold-back  until_command,           it waits for such a frame on its connection, at most
               until_part,              at_most_ms; until_command and at_most_ms are required
               until_direction, at_most_ms

The bytes of a direction keep their order: bytes after a delayed frame are delayed, too.
"""

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import Direction
from scaraspec.protocol.frames import MAX_FRAME_BYTES
from scaraspec.user_message import UserMessage
from scaraspec_recorder.fault_injection.conditions import PARTS, Condition
from scaraspec_recorder.fault_injection.faults import (
    Coalesce,
    Corrupt,
    Delay,
    Drop,
    Fault,
    Fragment,
    HoldBack,
    Jitter,
    Reset,
    Truncate,
)
from scaraspec_recorder.fault_injection.rules import PICKS, Injection, Rule
from scaraspec_recorder.toml_file import TomlError, read_toml

_MOST_RULES: Final = 256
_LONGEST_MS: Final = 3_600_000
_MOST: Final = 1_000_000_000
_NAME_CHARACTERS: Final = 60


class InjectionError(ValueError):
    """The file is invalid. The message is one sentence for the user."""


def load_injection(path: Path) -> Injection:
    """Read a fault injection file.

    Raises:
        InjectionError: The file cannot be read, or its content is invalid.
    """
    try:
        return _injection(_load(path))
    except InjectionError as error:
        raise InjectionError(UserMessage("{path}: {error}", path=path, error=error)) from None


@dataclass(frozen=True, slots=True)
class _Values:
    """Allowed values of a key: description and check."""

    words: str
    holds: Callable[[Any], bool]


def _whole(least: int, most: int) -> _Values:
    return _Values(
        f"a whole number from {least} to {most}",
        lambda value: type(value) is int and least <= value <= most,
    )


def _number(most: float) -> _Values:
    return _Values(
        f"a number above 0, {most:g} at most",
        lambda value: type(value) in (int, float) and 0 < value <= most,
    )


def _one_of(*words: str) -> _Values:
    return _Values(f"one of {', '.join(words)}", lambda value: value in words)


def _is_command(value: object) -> bool:
    return value in BY_NAME if isinstance(value, str) else _OPCODE.holds(value)


def _is_name(value: object) -> bool:
    return isinstance(value, str) and value.isprintable() and len(value) <= _NAME_CHARACTERS


_OPCODE: Final = _whole(0, 0xFF)
_COMMAND: Final = _Values(
    "a command's name such as get_status, or an opcode from 0x00 to 0xFF", _is_command
)
_DIRECTION: Final = _one_of(*(direction.value for direction in Direction))
_PART: Final = _one_of(*PARTS)
_MILLISECONDS: Final = _number(_LONGEST_MS)

_FAULTS: Final[dict[str, type[Fault]]] = {
    "delay": Delay,
    "jitter": Jitter,
    "fragment": Fragment,
    "coalesce": Coalesce,
    "drop": Drop,
    "corrupt": Corrupt,
    "truncate": Truncate,
    "reset": Reset,
    "hold-back": HoldBack,
}

_KEYS: Final[dict[str, _Values]] = {
    "fault": _one_of(*_FAULTS),
    "name": _Values(f"a text of at most {_NAME_CHARACTERS} characters, on one line", _is_name),
    "command": _COMMAND,
    "part": _PART,
    "direction": _DIRECTION,
    "connection": _whole(1, _MOST),
    "nth": _whole(1, _MOST),
    "every": _whole(1, _MOST),
    "first": _whole(1, _MOST),
    "probability": _number(1),
}
"""Keys of all rules and their allowed values."""

_PARAMETERS: Final[dict[str, _Values]] = {
    "delay_ms": _MILLISECONDS,
    "jitter_ms": _MILLISECONDS,
    "size_bytes": _whole(1, MAX_FRAME_BYTES),
    "gap_ms": _MILLISECONDS,
    "frames": _whole(2, 1000),
    "within_ms": _MILLISECONDS,
    "at_bytes": _whole(-MAX_FRAME_BYTES, MAX_FRAME_BYTES - 1),
    "xor": _whole(1, 255),
    "keep_bytes": _whole(1, MAX_FRAME_BYTES - 1),
    "at_most_ms": _MILLISECONDS,
    "until_command": _COMMAND,
    "until_part": _PART,
    "until_direction": _DIRECTION,
}
"""Parameters of the faults and their allowed values."""


def _load(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except TomlError as error:
        raise InjectionError(UserMessage("it {error}", error=error)) from None


def _injection(document: Mapping[str, Any]) -> Injection:
    if wrong := document.keys() - {"seed", "rule"}:
        raise InjectionError(
            UserMessage("{key} is not a key of this file: use seed and [[rule]]", key=min(wrong))
        )
    seed, tables = document.get("seed", 0), document.get("rule")
    if not (values := _whole(0, _MOST)).holds(seed):
        raise InjectionError(
            UserMessage("seed must be {words}, not {seed}", words=values.words, seed=_shown(seed))
        )
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise InjectionError("it has no rule: start each rule with a line [[rule]]")
    if len(tables) > _MOST_RULES:
        raise InjectionError(
            UserMessage(
                "it has {rule_count} rules, but at most {max_rules} are allowed",
                rule_count=len(tables),
                max_rules=_MOST_RULES,
            )
        )
    return Injection(tuple(_rule(f"rule {n}", t) for n, t in enumerate(tables, start=1)), seed)


def _rule(label: str, table: Mapping[str, Any]) -> Rule:
    """Check a rule; `label` names it in messages.

    Raises:
        InjectionError: The rule is invalid.
    """
    if "fault" not in table:
        raise InjectionError(
            UserMessage(
                "{label}: fault is missing: it must be {words}",
                label=label,
                words=_KEYS["fault"].words,
            )
        )
    _check(label, "fault", table["fault"])
    kind = _FAULTS[table["fault"]]
    parameters = {field.name: field.default is MISSING for field in fields(kind)}
    for key, value in table.items():
        if key not in _KEYS and key not in parameters:
            keys = ", ".join((*parameters, *_KEYS))
            raise InjectionError(
                UserMessage(
                    "{label}: {key} is not a key of the fault {fault}: use {keys}",
                    label=label,
                    key=key,
                    fault=table["fault"],
                    keys=keys,
                )
            )
        _check(label, key, value)
    for key, needed in parameters.items():
        if needed and key not in table:
            words = _PARAMETERS[key].words
            raise InjectionError(
                UserMessage(
                    "{label}: {key} is missing: {fault} needs {words}",
                    label=label,
                    key=key,
                    fault=table["fault"],
                    words=words,
                )
            )
    picks = [key for key in PICKS if key in table]
    if len(picks) > 1:
        raise InjectionError(
            UserMessage(
                "{label}: {picks} exclude each other: use one",
                label=label,
                picks=" and ".join(picks),
            )
        )
    pick = picks[0] if picks else ""
    fault = kind(**{key: table[key] for key in parameters if key in table})
    condition = Condition(table.get("command"), table.get("part"), table.get("direction"))
    waited_for = (fault.until,) if isinstance(fault, HoldBack) else ()
    for each in (condition, *waited_for):
        if reason := each.contradiction():
            raise InjectionError(
                UserMessage("{label} matches no frame: {reason}", label=label, reason=reason)
            )
    name = table.get("name")
    full = f"{label} ({name})" if name else label
    return Rule(full, fault, condition, table.get("connection"), pick, table.get(pick, 0))


def _check(label: str, key: str, value: object) -> None:
    values = _KEYS.get(key) or _PARAMETERS[key]
    if not values.holds(value):
        raise InjectionError(
            UserMessage(
                "{label}: {key} must be {words}, not {value}",
                label=label,
                key=key,
                words=values.words,
                value=_shown(value),
            )
        )


def _shown(value: object) -> str:
    return reprlib.repr(value)
