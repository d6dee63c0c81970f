"""Segments: a frame of the evidence cut at its fields, as the page draws it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from scaraspec.report.model import Evidence

_SHOWN_BYTES: Final = 16


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a frame; `more_bytes` of it are not in `shown_hex`."""

    shown_hex: str
    more_bytes: int
    name: str = ""
    value: str = ""


def segments(evidence: Evidence) -> list[Segment]:
    """The frame cut at its fields; what lies between two of them stands alone."""
    return list(_cut(evidence, _bytes(evidence.frame_hex)))


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
