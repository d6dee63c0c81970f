"""Parsers of durations and sizes that users write, such as 30s, 1h or 512MB.

Results are whole nanoseconds and bytes.
"""

import re
import reprlib
from dataclasses import dataclass
from typing import Final

from scaraspec.user_message import UserMessage

SECOND_NS: Final = 1_000_000_000

_DURATIONS_NS: Final = {
    "ms": SECOND_NS // 1000,
    "s": SECOND_NS,
    "m": 60 * SECOND_NS,
    "min": 60 * SECOND_NS,
    "h": 3600 * SECOND_NS,
    "d": 86_400 * SECOND_NS,
}
_SIZES_BYTES: Final = {
    "b": 1,
    **{f"{prefix}b": 1000**power for power, prefix in enumerate("kmgt", start=1)},
    **{f"{prefix}ib": 1024**power for power, prefix in enumerate("kmgt", start=1)},
}
_QUANTITY: Final = re.compile(r"\s*([0-9]{1,12}(?:\.[0-9]{1,9})?)\s*([A-Za-z]{1,3})\s*")


class QuantityError(ValueError):
    """The text is not a valid quantity. The message is one sentence for the user."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of duration and size; None for no limit."""

    duration_ns: int | None = None
    size_bytes: int | None = None


def parse_duration(text: str) -> int:
    """Return the nanoseconds of, for example, ``500ms``, ``30s``, ``1.5min``, ``1h``, ``30d``.

    Raises:
        QuantityError: The text is not a duration, or the duration is 0.
    """
    if (duration_ns := _read(text, _DURATIONS_NS)) is None:
        raise QuantityError(
            UserMessage(
                "{text} is not a duration such as 500ms, 30s, 1h or 30d", text=reprlib.repr(text)
            )
        )
    return duration_ns


def parse_size(text: str) -> int:
    """Return the bytes of, for example, ``512MB`` (of 1000 kB) or ``2GiB`` (of 1024 MiB).

    Raises:
        QuantityError: The text is not a size, or the size is 0.
    """
    if (size_bytes := _read(text, _SIZES_BYTES)) is None:
        raise QuantityError(
            UserMessage("{text} is not a size such as 512MB or 2GiB", text=reprlib.repr(text))
        )
    return size_bytes


def parse_limits(text: str) -> Limits:
    """Return the limits of a text such as ``1h``, ``512MB`` or ``1h,512MB``.

    Raises:
        QuantityError: A part is neither a duration nor a size, or a kind occurs twice.
    """
    limits = Limits()
    for part in text.split(","):
        duration_ns, size_bytes = _read(part, _DURATIONS_NS), _read(part, _SIZES_BYTES)
        if duration_ns is None and size_bytes is None:
            rule = "neither a duration such as 1h nor a size such as 512MB"
            raise QuantityError(UserMessage("{part} is {rule}", part=reprlib.repr(part), rule=rule))
        if (duration_ns and limits.duration_ns) or (size_bytes and limits.size_bytes):
            raise QuantityError(
                UserMessage(
                    "{text} has two limits of the same kind: use one", text=reprlib.repr(text)
                )
            )
        limits = Limits(limits.duration_ns or duration_ns, limits.size_bytes or size_bytes)
    return limits


def show_duration(duration_ns: int) -> str:
    """Return a duration as text in its largest whole unit, such as ``36 h``, or rounded."""
    units = ("d", "h", "min", "s")
    for unit in units:
        number, rest_ns = divmod(duration_ns, _DURATIONS_NS[unit])
        if number and not rest_ns:
            return f"{number} {unit}"
    unit = next((each for each in units if duration_ns >= _DURATIONS_NS[each]), "s")
    return f"{duration_ns / _DURATIONS_NS[unit]:.3g} {unit}"


def show_size(size_bytes: int) -> str:
    """Return a size as text, such as ``20 GB``."""
    for unit in ("GB", "MB", "kB"):
        if (number := size_bytes / _SIZES_BYTES[unit.lower()]) >= 1:
            return f"{number:.4g} {unit}"
    return f"{size_bytes} bytes"


def _read(text: str, units: dict[str, int]) -> int | None:
    """Return the quantity in its smallest unit; None if the text is invalid or the value is 0."""
    found = _QUANTITY.fullmatch(text)
    unit = units.get(found[2].lower()) if found else None
    return round(float(found[1]) * unit) or None if found and unit else None
