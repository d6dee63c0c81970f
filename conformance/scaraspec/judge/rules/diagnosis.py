"""Diagnosis of invalid bytes: one diagnosis, so that one fault violates one requirement."""

import re
from enum import Enum
from typing import Final, NamedTuple

from scaraspec.protocol.commands import is_known_opcode
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import TAG, SkipReason
from scaraspec.protocol.redaction import mask_unframed
from scaraspec.protocol.wrong_lengths import find_copied_length
from scaraspec.traffic.events import InvalidBytes
from scaraspec.user_message import UserMessage

_SHORTEST_FRAME_BYTES: Final = 4
_HEAD_BYTES: Final = 3  # start, opcode, length
_FOREIGN: Final = re.compile(rb"(?:[A-Z]{3,8} [!-~]{1,2048} )?(?:HTTP|RTSP|SIP)/\d|SSH-\d")
"""First bytes of port scanners and other protocols: such a peer is not the SUT."""


class Fault(Enum):
    """The kind of malformation."""

    STRAY = "stray bytes"
    START = "start byte"
    TAG = "tag"
    END = "end byte"
    LENGTH = "length"
    UNCLEAR = "unclear"
    NONE = "none"


class Diagnosis(NamedTuple):
    """The fault, the expected and the observed value, and a hint at the cause.

    `surplus_bytes` is the number of data bytes beyond a wrong length.
    """

    fault: Fault
    expected: str = ""
    observed: str = ""
    hint: str = ""
    surplus_bytes: int = 0


def diagnose(invalid: InvalidBytes) -> Diagnosis:
    """Return the one fault of a run of bytes between frames."""
    data, direction = invalid.data, invalid.place.direction
    if _FOREIGN.match(data):
        return Diagnosis(Fault.NONE)
    if invalid.mixed:
        hint = UserMessage(
            "the bytes of {mixed} are mixed: two threads write at once", mixed=invalid.mixed
        )
        return _stray(invalid)._replace(hint=hint)
    tagged = data[1:2] == bytes((TAG,)) and invalid.reason is not SkipReason.STRAY
    if tagged and direction is A2C and len(data) > _HEAD_BYTES and len(data) == data[3] + 5:
        return Diagnosis(Fault.TAG, "no tag", f"{TAG:02X}")
    head = _HEAD_BYTES + (tagged and direction is C2A)
    if invalid.reason is SkipReason.TRUNCATED:
        # No fault, unless a wrong length announces bytes that do not exist.
        explained = _length(invalid, head)
        return explained if explained.hint else _announces_too_much(invalid, head)
    if invalid.reason is SkipReason.STRAY:
        return _wrong_start(invalid) or _stray(invalid)
    if len(data) < head or (len(data) == _HEAD_BYTES and data[-1]):
        return _stray(invalid)  # a start byte without a frame
    declared = data[head - 1]
    if len(data) == head + declared + 1:
        observed = "another byte" if mask_unframed(data) != data else f"{data[-1]:02X}"
        return Diagnosis(Fault.END, f"{direction.end:02X}", observed)
    if data[-1] == direction.end:
        return _length(invalid, head)
    if len(data) == head + declared:  # the next frame starts in place of the end byte
        return Diagnosis(Fault.END, f"{direction.end:02X}", f"{direction.start:02X}")
    return Diagnosis(Fault.UNCLEAR)


def _announces_too_much(invalid: InvalidBytes, head: int) -> Diagnosis:
    """A text frame that is complete, but whose length byte announces more data.

    The end byte is the last byte, or the next frame follows it. A text does not contain it.
    """
    data, direction = invalid.data, invalid.place.direction
    end = data.find(direction.end, head)
    text, rest = data[head:end], data[end + 1 : end + 3]
    if end < 0 or not all(0x20 <= byte < 0x7F for byte in text):  # noqa: PLR2004 - printable ASCII
        return Diagnosis(Fault.NONE)
    known = rest[-1:] == bytes((TAG,)) or (rest and is_known_opcode(rest[-1], tagged=False))
    if rest and not (rest[0] == direction.start and len(rest) > 1 and known):
        return Diagnosis(Fault.NONE)
    declared = data[head - 1]
    return Diagnosis(Fault.LENGTH, f"{len(text)}", str(declared), "", len(text) - declared)


def _stray(invalid: InvalidBytes) -> Diagnosis:
    return Diagnosis(
        Fault.STRAY,
        "nothing",
        UserMessage("{count} bytes", count=invalid.place.length_bytes),
    )


def _wrong_start(invalid: InvalidBytes) -> Diagnosis | None:
    """A frame that is valid except for its start byte.

    The last byte of a frame of the other direction is a start byte of this direction, so it is not
    part of these bytes.
    """
    data, direction = invalid.data, invalid.place.direction
    if len(data) < _HEAD_BYTES:
        return None
    expected, observed = f"{direction.start:02X}", f"{data[0]:02X}"
    if data[0] == direction.opposite.start and len(data) == data[2] + _HEAD_BYTES:
        return Diagnosis(Fault.START, expected, observed, "a frame of the other direction")
    whole = len(data) >= _SHORTEST_FRAME_BYTES and len(data) == data[2] + _SHORTEST_FRAME_BYTES
    if whole and data[-1] == direction.end:
        return Diagnosis(Fault.START, expected, observed)
    return None


def _length(invalid: InvalidBytes, head: int) -> Diagnosis:
    """A length byte that is not the number of data bytes, with its likely origin as the hint."""
    data = invalid.data
    if len(data) <= head:
        return Diagnosis(Fault.UNCLEAR)
    declared, true_bytes = data[head - 1], invalid.place.length_bytes - head - 1
    copied = find_copied_length(invalid.place.direction, data)
    hint = (
        UserMessage("copied from the document's example, L{line}", line=copied.line)
        if copied
        else ""
    )
    if declared == invalid.place.length_bytes and data[-1] == invalid.place.direction.end:
        hint = hint or "it counts the whole frame"
    surplus = true_bytes - declared
    return Diagnosis(Fault.LENGTH, f"{true_bytes}", str(declared), hint, surplus)
