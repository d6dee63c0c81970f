"""Conversion of typed dataclasses to plain JSON values and back, based on their annotations.

This module does not depend on the results model. Writing never fails for a well-typed object.
Reading validates everything: an invalid value raises an error with its position. Unknown keys are
ignored, so that later versions may add keys.
"""

import math
import reprlib
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, Final, TypeVar, Union, get_args, get_origin, get_type_hints

from scaraspec.user_message import UserMessage

T = TypeVar("T")

_INTEGER_LIMIT: Final = 1 << 63


class MisfitError(ValueError):
    """A plain value has the wrong type; the message contains its position and the value."""


def to_plain(value: Any) -> Any:
    """Convert a value to dicts, lists, strings and numbers; enums become their values."""
    if is_dataclass(value) and not isinstance(value, type):
        members = {f.name: getattr(value, f.name) for f in fields(value)}
        plain = {name: to_plain(member) for name, member in members.items()}
        for name, member in members.items():
            if isinstance(member, UserMessage):
                plain |= {f"{name}_template": member.template, f"{name}_values": member.values}
        return plain
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {to_plain(k): to_plain(v) for k, v in value.items()}
    if isinstance(value, tuple):
        return [to_plain(v) for v in value]
    return value


def from_plain(wanted: type[T], plain: Any) -> T:
    """Create an object of type `wanted` from plain values.

    Raises:
        MisfitError: A value has the wrong type or is missing.
    """
    made: T = _make(wanted, plain, "")
    return made


def _make(wanted: Any, plain: Any, at: str) -> Any:
    origin, args = get_origin(wanted), get_args(wanted)
    if origin in (Union, types.UnionType):
        (inner,) = (arg for arg in args if arg is not type(None))
        return None if plain is None else _make(inner, plain, at)
    if origin is tuple:
        return _make_tuple(args, plain, at)
    if origin is Mapping:
        keys, values = args
        return {
            _make(keys, k, f"a key of {at}"): _make(values, v, _join(at, k))
            for k, v in _a(dict, plain, at).items()
        }
    if is_dataclass(wanted):
        return _make_dataclass(wanted, plain, at)
    if issubclass(wanted, Enum):
        return _make_enum(wanted, plain, at)
    return _make_scalar(wanted, plain, at)


def _make_tuple(args: tuple[Any, ...], plain: Any, at: str) -> tuple[Any, ...]:
    items = _a(list, plain, at)
    if args[-1] is ...:
        args = args[:1] * len(items)
    if len(items) != len(args):
        raise MisfitError(
            UserMessage(
                "{at} has {items_count} items, not {args_count}",
                at=at,
                items_count=len(items),
                args_count=len(args),
            )
        )
    pairs = zip(args, items, strict=True)
    return tuple(_make(arg, item, f"{at}[{i}]") for i, (arg, item) in enumerate(pairs))


def _make_dataclass(wanted: Any, plain: Any, at: str) -> Any:
    values = _a(dict, plain, at)
    made = {}
    for name, (hint, required) in _members(wanted).items():
        if name in values:
            made[name] = _make(hint, values[name], _join(at, name))
        elif required:
            raise MisfitError(UserMessage("{join} is missing", join=_join(at, name)))
    return wanted(**made)


@cache
def _members(wanted: Any) -> dict[str, tuple[Any, bool]]:
    """Return for each member its type, and whether it is required."""
    hints = get_type_hints(wanted)
    return {
        f.name: (hints[f.name], f.default is MISSING and f.default_factory is MISSING)
        for f in fields(wanted)
    }


def _make_enum(wanted: type[Enum], plain: Any, at: str) -> Enum:
    for member in wanted:
        if member.value == plain:
            return member
    names = ", ".join(str(member.value) for member in wanted)
    raise MisfitError(
        UserMessage(
            "{at} is {plain}, not one of {names}", at=at, plain=reprlib.repr(plain), names=names
        )
    )


def _make_scalar(wanted: Any, plain: Any, at: str) -> Any:
    if wanted is float and type(plain) is int:
        plain = float(_bounded(plain, at))
    value = _a(wanted, plain, at)
    if wanted is float and not math.isfinite(value):
        raise MisfitError(UserMessage("{at} is no finite number", at=at))
    return _bounded(value, at) if wanted is int else value


def _bounded(number: int, at: str) -> int:
    if not -_INTEGER_LIMIT <= number < _INTEGER_LIMIT:
        raise MisfitError(UserMessage("{at} does not fit 64 bits", at=at))
    return number


_NAMES: Final = {dict: "an object", list: "an array", str: "a text", int: "an integer"} | {
    float: "a number",
    bool: "true or false",
}


def _a(wanted: type[T], plain: Any, at: str) -> T:
    if type(plain) is not wanted:  # a bool is not accepted as an int
        raise MisfitError(
            UserMessage(
                "{value} is {plain}, not {names}",
                value=at or "the whole",
                plain=reprlib.repr(plain),
                names=_NAMES[wanted],
            )
        )
    return plain


def _join(at: str, name: str) -> str:
    name = name if name.isidentifier() else reprlib.repr(name)
    return f"{at}.{name}" if at else name
