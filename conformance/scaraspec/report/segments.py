"""Segments: a frame of the evidence cut at its fields, as the page draws it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from scaraspec.report.model import Evidence

_SHOWN_BYTES: Final = 16


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a frame; `more_bytes` of it are not in `shown_hex`.

    `differs` from what a frame of the same kind had in its place that was right.
    """

    shown_hex: str
    more_bytes: int
    name: str = ""
    value: str = ""
    differs: bool = False


def segments(evidence: Evidence, passing: Iterable[Evidence] = ()) -> list[Segment]:
    """The frame cut at its fields; what lies between two of them stands alone.

    Args:
        evidence: The frame.
        passing: Frames that were right; the first of the same kind is what it is held against.
    """
    cut = list(_cut(evidence, _bytes(evidence.frame_hex)))
    right = next((one for one in passing if one.note == evidence.note), None)
    if right is None:
        return cut
    there = [(s.name, s.shown_hex, s.more_bytes) for s in segments(right)]
    return [replace(s, differs=(s.name, s.shown_hex, s.more_bytes) not in there) for s in cut]


def _cut(evidence: Evidence, raw: bytes) -> Iterator[Segment]:
    at = 0
    for field in evidence.fields:
        begin, end = max(field.offset_bytes, at), field.offset_bytes + field.length_bytes
        if begin >= min(end, len(raw)):
            continue
        if begin > at:
            yield _segment(raw[at:begin])
        yield _segment(raw[begin:end], field.name, field.value)
        at = min(end, len(raw))
    if at < len(raw):
        yield _segment(raw[at:])


def _segment(part: bytes, name: str = "", value: str = "") -> Segment:
    shown = part[:_SHOWN_BYTES]
    return Segment(shown.hex(" ").upper(), len(part) - len(shown), name, value)


def _bytes(frame_hex: str) -> bytes:
    """The bytes of a hex text; results that others wrote may hold anything in its place."""
    try:
        return bytes.fromhex(frame_hex)
    except ValueError:
        return b""
