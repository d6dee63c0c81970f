"""WireEvent: all that a source makes, and all that a sink needs to make everything else again.

Raw is the truth: bytes, direction, offset and time are kept here and what they mean is derived
elsewhere. Nothing in this file knows a frame.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from scaraspec.protocol.direction import Direction


class Kind(Enum):
    """What happened on one direction of a connection."""

    OPENED = "opened"  # the connection was made; direction is that of its opener
    BYTES = "bytes"  # `data` arrived
    HALF_CLOSED = "half-closed"  # the sender of this direction sends no more (FIN)
    CLOSED = "closed"  # both directions have ended in order
    RESET = "reset"  # the sender of this direction cut the connection (RST)
    GAP = "gap"  # `length` bytes of this direction passed unrecorded, or may have
    INJECTED = "injected"  # what this direction's sender had sent was tampered with on its way

    __hash__ = object.__hash__


@dataclass(frozen=True, slots=True)
class WireEvent:
    """One thing that happened on the wire.

    Attributes:
        time_ns: Nanoseconds since the Unix epoch, on the clock of the observer.
        connection: Names the connection within the recording, for example ``"1"``.
        direction: Who sent, opened, closed or reset; whose bytes the gap or the fault is in.
        kind: What happened.
        data: The bytes, for ``BYTES``; empty otherwise.
        offset_bytes: Stream offset of the first byte of `data` (or of the gap) in this direction,
            counted from the first byte of the connection; from the first byte seen where the
            observer came late.
        length_bytes: Length of a gap; -1 where it is not known. 0 for every other kind.
        note: Why, in words: the reason of a gap, the addresses of an opened connection, the fault
            that was injected and into what.
    """

    time_ns: int
    connection: str
    direction: Direction
    kind: Kind
    data: bytes = b""
    offset_bytes: int = 0
    length_bytes: int = 0
    note: str = ""


class WireRange(NamedTuple):
    """Where on the wire something is: the evidence for it."""

    connection: str
    direction: Direction
    offset_bytes: int
    length_bytes: int
    time_ns: int
    """When its last byte passed."""
