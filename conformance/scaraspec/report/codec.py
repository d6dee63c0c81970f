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


class InvalidValueError(ValueError):
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


def from_plain(target: type[T], plain: Any) -> T:
    """Create an object of type `target` from plain values.

    Raises:
        InvalidValueError: A value has the wrong type or is missing.
    """
    result: T = _make(target, plain, "")
    return result


def _make(target: Any, plain: Any, at: str) -> Any:
    origin, args = get_origin(target), get_args(target)
    if origin in (Union, types.UnionType):
        (inner,) = (arg for arg in args if arg is not type(None))
        return None if plain is None else _make(inner, plain, at)
    if origin is tuple:
        return _make_tuple(args, plain, at)
    if origin is Mapping:
        keys, values = args
        return {
            _make(keys, k, f"a key of {at}"): _make(values, v, _join(at, k))
            for k, v in _checked(dict, plain, at).items()
        }
    if is_dataclass(target):
        return _make_dataclass(target, plain, at)
    if issubclass(target, Enum):
        return _make_enum(target, plain, at)
    return _make_scalar(target, plain, at)


def _make_tuple(args: tuple[Any, ...], plain: Any, at: str) -> tuple[Any, ...]:
    items = _checked(list, plain, at)
    if args[-1] is ...:
        args = args[:1] * len(items)
    if len(items) != len(args):
        raise InvalidValueError(
            UserMessage(
                "{position} has {item_count} items, not {expected_count}",
                position=at,
                item_count=len(items),
                expected_count=len(args),
            )
        )
    pairs = zip(args, items, strict=True)
    return tuple(_make(arg, item, f"{at}[{i}]") for i, (arg, item) in enumerate(pairs))


def _make_dataclass(target: Any, plain: Any, at: str) -> Any:
    values = _checked(dict, plain, at)
    result = {}
    for name, (hint, required) in _members(target).items():
        if name in values:
            result[name] = _make(hint, values[name], _join(at, name))
            if (template := values.get(f"{name}_template")) is not None:
                result[name] = _message(result[name], template, values, _join(at, name))
        elif required:
            raise InvalidValueError(UserMessage("{position} is missing", position=_join(at, name)))
    return target(**result)


def _message(text: str, template: Any, values: Mapping[str, Any], at: str) -> UserMessage:
    named = _make(
        Mapping[str, str], values.get(f"{at.rpartition('.')[2]}_values", {}), f"{at}_values"
    )
    return UserMessage.of(text, _checked(str, template, f"{at}_template"), named)


@cache
def _members(target: Any) -> dict[str, tuple[Any, bool]]:
    """Return for each member its type, and whether it is required."""
    hints = get_type_hints(target)
    return {
        f.name: (hints[f.name], f.default is MISSING and f.default_factory is MISSING)
        for f in fields(target)
    }


def _make_enum(target: type[Enum], plain: Any, at: str) -> Enum:
    for member in target:
        if member.value == plain:
            return member
    names = ", ".join(str(member.value) for member in target)
    raise InvalidValueError(
        UserMessage(
            "{position} is {value}, not one of {names}",
            position=at,
            value=reprlib.repr(plain),
            names=names,
        )
    )


def _make_scalar(target: Any, plain: Any, at: str) -> Any:
    if target is float and type(plain) is int:
        plain = float(_bounded(plain, at))
    value = _checked(target, plain, at)
    if target is float and not math.isfinite(value):
        raise InvalidValueError(UserMessage("{position} is not a finite number", position=at))
    return _bounded(value, at) if target is int else value


def _bounded(number: int, at: str) -> int:
    if not -_INTEGER_LIMIT <= number < _INTEGER_LIMIT:
        raise InvalidValueError(UserMessage("{position} does not fit 64 bits", position=at))
    return number


_TYPE_NAMES: Final = {dict: "an object", list: "an array", str: "a string", int: "an integer"} | {
    float: "a number",
    bool: "true or false",
}


def _checked(target: type[T], plain: Any, at: str) -> T:
    if type(plain) is not target:  # a bool is not accepted as an int
        raise InvalidValueError(
            UserMessage(
                "{position} is {value}, not {expected}",
                position=at or "the document",
                value=reprlib.repr(plain),
                expected=_TYPE_NAMES[target],
            )
        )
    return plain


def _join(at: str, name: str) -> str:
    name = name if name.isidentifier() else reprlib.repr(name)
    return f"{at}.{name}" if at else name
