"""Segments: a frame of the evidence, split at its fields, as shown on the HTML page."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from scaraspec.report.model import Evidence

_SHOWN_BYTES: Final = 16


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a frame.

    Attributes:
        shown_hex: The first bytes in hex.
        more_bytes: The number of bytes that are not in `shown_hex`.
        name: The name of the field, empty between fields.
        value: The decoded value.
        differs: Whether the part differs from that of a passing frame of the same kind.
    """

    shown_hex: str
    more_bytes: int
    name: str = ""
    value: str = ""
    differs: bool = False


def segments(evidence: Evidence, passing: Iterable[Evidence] = ()) -> list[Segment]:
    """Split a frame at its fields; bytes between two fields are a separate segment.

    Args:
        evidence: The frame.
        passing: Passing frames; the first one of the same kind is used for the comparison.
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
    """Return the bytes of a hex text; empty if it is invalid, as untrusted results may be."""
    try:
        return bytes.fromhex(frame_hex)
    except ValueError:
        return b""
