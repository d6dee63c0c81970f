"""Diagnosis of invalid bytes: one diagnosis, so that one fault violates one requirement."""

import re
from enum import Enum
from typing import Final, NamedTuple

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
    """The fault, what was due and what was there, and a hint at its origin.

    `surplus_bytes` is, of a wrong length, how many data bytes there were beyond it.
    """

    fault: Fault
    expected: str = ""
    observed: str = ""
    hint: str = ""
    surplus_bytes: int = 0


def diagnose(found: InvalidBytes) -> Diagnosis:
    """Name the one thing that is wrong with a run of bytes between frames."""
    data, direction = found.data, found.place.direction
    if _FOREIGN.match(data):
        return Diagnosis(Fault.NONE)
    tagged = data[1:2] == bytes((TAG,)) and found.reason is not SkipReason.STRAY
    if tagged and direction is A2C and len(data) > _HEAD_BYTES and len(data) == data[3] + 5:
        return Diagnosis(Fault.TAG, "no tag", UserMessage("{tag:02X}", tag=TAG))
    head = _HEAD_BYTES + (tagged and direction is C2A)
    if (
        found.reason is SkipReason.TRUNCATED
    ):  # no fault, unless it waits for bytes that were never meant
        explained = _length(found, head)
        return explained if explained.hint else Diagnosis(Fault.NONE)
    if found.reason is SkipReason.STRAY:
        return _wrong_start(found) or _stray(found)
    if len(data) < head or (len(data) == _HEAD_BYTES and data[-1]):
        return _stray(found)  # a start byte that begins nothing
    declared = data[head - 1]
    if len(data) == head + declared + 1:
        observed = "another byte" if mask_unframed(data) != data else f"{data[-1]:02X}"
        return Diagnosis(Fault.END, f"{direction.end:02X}", observed)
    if data[-1] == direction.end:
        return _length(found, head)
    if len(data) == head + declared:  # the end byte begins a frame, so it is reported with that
        return Diagnosis(
            Fault.END, f"{direction.end:02X}", UserMessage("{start:02X}", start=direction.start)
        )
    return Diagnosis(Fault.UNCLEAR)


def _stray(found: InvalidBytes) -> Diagnosis:
    return Diagnosis(
        Fault.STRAY,
        "nothing",
        UserMessage("{length_bytes} bytes", length_bytes=found.place.length_bytes),
    )


def _wrong_start(found: InvalidBytes) -> Diagnosis | None:
    """A frame but for its start byte; one of the other direction lacks its end byte as well.

    That byte is a start byte of this direction, so it is not part of these bytes.
    """
    data, direction = found.data, found.place.direction
    if len(data) < _HEAD_BYTES:
        return None
    expected, observed = f"{direction.start:02X}", f"{data[0]:02X}"
    if data[0] == direction.opposite.start and len(data) == data[2] + _HEAD_BYTES:
        return Diagnosis(Fault.START, expected, observed, "a frame of the other direction")
    whole = len(data) >= _SHORTEST_FRAME_BYTES and len(data) == data[2] + _SHORTEST_FRAME_BYTES
    if whole and data[-1] == direction.end:
        return Diagnosis(Fault.START, expected, observed)
    return None


def _length(found: InvalidBytes, head: int) -> Diagnosis:
    """A length byte that is not the number of data bytes, and perhaps where it comes from."""
    data = found.data
    if len(data) <= head:
        return Diagnosis(Fault.UNCLEAR)
    declared, true_bytes = data[head - 1], found.place.length_bytes - head - 1
    copied = find_copied_length(found.place.direction, data)
    hint = f"copied from the document's example, L{copied.line}" if copied else ""
    if declared == found.place.length_bytes and data[-1] == found.place.direction.end:
        hint = hint or "the whole frame is counted"
    surplus = true_bytes - declared
    return Diagnosis(Fault.LENGTH, f"{true_bytes}", str(declared), hint, surplus)
