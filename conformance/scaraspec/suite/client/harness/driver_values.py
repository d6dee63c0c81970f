"""Driver values: compare the result that a client reports with the reply that it received.

The driver protocol defines the JSON types and leaves the form of records open. A client may report
the fields by name or in order, a time with or without separators, and a run time in seconds or as
on the wire. No requirement is judged here.
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
"""Single precision keeps seven digits. No number of the protocol needs more."""

_RUN_TIME: Final = RunTime("run_time_s")


def expected_value(value: Any) -> Any:
    """Return the value that a client must report for a decoded reply.

    Args:
        value: The value that the command table decodes.

    Returns:
        JSON types. Times and durations keep their type, because clients may report them in
        several forms.
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
    """Return a value of `expected_value` as text for an operator who looks at the client."""
    match value:
        case dict():
            return ", ".join(f"{key} = {to_display_text(item)}" for key, item in value.items())
        case list():
            return ", ".join(map(to_display_text, value)) or "nothing"
        case float():
            return f"{value:.15g}"
    return "nothing" if value is None else f"{value}"


def matches(reported: Any, expected: Any) -> bool:
    """Whether the reported value equals the expected value."""
    match expected:
        case None:
            return _is_empty(reported)
        case bool() | str():
            return bool(reported == expected)
        case int() | float():
            number = isinstance(reported, int | float) and not isinstance(reported, bool)
            return number and math.isclose(reported, expected, rel_tol=_EXACT, abs_tol=_EXACT**2)
        case datetime() | timedelta():
            return _same_time(reported, expected)
        case list() | dict():
            return _same_items(reported, expected)
    raise TypeError(f"no client reports a value like {expected!r}")


def _same_time(reported: Any, expected: datetime | timedelta) -> bool:
    if isinstance(expected, datetime):
        return (
            isinstance(reported, str) and re.sub(r"\D", "", reported) == f"{expected:%Y%m%d%H%M%S}"
        )
    seconds = expected.total_seconds()
    return matches(reported, seconds) or matches(
        reported, _RUN_TIME.write(int(seconds), DEFAULT).decode()
    )


def _same_items(reported: Any, expected: list[Any] | dict[str, Any]) -> bool:
    if isinstance(expected, dict):
        if isinstance(reported, Mapping):
            if expected.keys() <= reported.keys():
                return all(matches(reported[key], value) for key, value in expected.items())
            reported = list(reported.values())
        expected = list(expected.values())
    return (
        isinstance(reported, list)
        and len(reported) == len(expected)
        and all(map(matches, reported, expected))
    )


def _is_empty(reported: Any) -> bool:
    """Whether this reports no value: null, or a record in which every value is empty."""
    if isinstance(reported, Mapping):
        return not any(reported.values())
    return not any(reported) if isinstance(reported, list) else not reported
