"""Saying: what a client says came of an operation, held against what it was sent.

The driver protocol names the types of JSON and leaves the shape of records open: their fields may
be told by name or in order, a time with or without marks between its digits, a run time in seconds
or as on the wire. No requirement is judged here.
"""

import math
import re
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, Final

from scaraspec.protocol.commands import RunningProgram
from scaraspec.protocol.fields import RunTime
from scaraspec.protocol.payloads import NameListPart
from scaraspec.protocol.readings import DEFAULT

_EXACT: Final = 1e-6
"""Single precision hands on seven digits, as many as any number of the protocol needs."""

_RUN_TIME: Final = RunTime("run_time_s")


def expected_value(value: Any) -> Any:
    """The value of a reply as a client is to say it.

    Args:
        value: As the table decodes it.

    Returns:
        Types of JSON; times and durations as such, because they are said in several ways.
    """
    if isinstance(value, bytes):
        return value.decode("utf-8", "surrogateescape") or None
    if isinstance(value, NameListPart):
        return expected_value(value.names)
    if isinstance(value, RunningProgram):
        return {
            "name": expected_value(value.name),
            "run_time_s": timedelta(seconds=value.run_time_s),
        }
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {key: expected_value(item) for key, item in value._asdict().items()}
    if isinstance(value, tuple):
        return [expected_value(item) for item in value]
    return value


def to_display_text(value: Any) -> str:
    """What `spoken` gives, in words for whoever looks at a client's window."""
    match value:
        case dict():
            return ", ".join(f"{key} = {to_display_text(item)}" for key, item in value.items())
        case list():
            return ", ".join(map(to_display_text, value)) or "nothing"
        case float():
            return f"{value:.15g}"
    return "nothing" if value is None else f"{value}"


def matches(said: Any, expected: Any) -> bool:
    """Whether a client said what was expected of it."""
    match expected:
        case None:
            return _nothing(said)
        case bool() | str():
            return bool(said == expected)
        case int() | float():
            number = isinstance(said, int | float) and not isinstance(said, bool)
            return number and math.isclose(said, expected, rel_tol=_EXACT, abs_tol=_EXACT**2)
        case datetime() | timedelta():
            return _same_time(said, expected)
        case list() | dict():
            return _same_items(said, expected)
    raise TypeError(f"nobody says {expected!r}")


def _same_time(said: Any, expected: datetime | timedelta) -> bool:
    if isinstance(expected, datetime):
        return isinstance(said, str) and re.sub(r"\D", "", said) == f"{expected:%Y%m%d%H%M%S}"
    seconds = expected.total_seconds()
    return matches(said, seconds) or matches(said, _RUN_TIME.write(int(seconds), DEFAULT).decode())


def _same_items(said: Any, expected: list[Any] | dict[str, Any]) -> bool:
    if isinstance(expected, dict):
        if isinstance(said, Mapping):
            if expected.keys() <= said.keys():
                return all(matches(said[key], value) for key, value in expected.items())
            said = list(said.values())
        expected = list(expected.values())
    return (
        isinstance(said, list) and len(said) == len(expected) and all(map(matches, said, expected))
    )


def _nothing(said: Any) -> bool:
    """Whether this says that there is nothing to say: null, or a record without any value."""
    if isinstance(said, Mapping):
        return not any(said.values())
    return not any(said) if isinstance(said, list) else not said
