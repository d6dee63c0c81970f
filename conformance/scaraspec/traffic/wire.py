"""WireEvent: the output of every source, from which sinks derive everything else.

The raw bytes are the source of truth: this module has bytes, direction, offset and time. What they
mean is derived elsewhere; nothing here depends on frames.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple

from scaraspec.protocol.direction import Direction


class Kind(Enum):
    """What happened on one direction of a connection."""

    OPENED = "opened"  # the connection was opened; direction: the side that opened it
    BYTES = "bytes"  # `data` arrived
    HALF_CLOSED = "half-closed"  # the sender of this direction sends no more (FIN)
    CLOSED = "closed"  # both directions ended in an orderly way
    RESET = "reset"  # the sender of this direction reset the connection (RST)
    GAP = "gap"  # `length_bytes` of this direction were not captured, or may not be
    INJECTED = "injected"  # bytes of this direction's sender were changed on purpose

    __hash__ = object.__hash__


EARLIER_FILE: Final = "in an earlier file of this recording"
"""Note of a gap of bytes that are not lost: rotation has begun a new file."""

UNJUDGED: Final = "not judged: the suite sends invalid bytes on purpose"
"""Note of the opening of a connection whose traffic says nothing about the subject."""


@dataclass(frozen=True, slots=True)
class WireEvent:
    """One event on the wire.

    Attributes:
        time_ns: Nanoseconds since the Unix epoch, on the clock of the observer.
        connection: Names the connection within the recording, for example ``"1"``.
        direction: The side that sent, opened, closed or reset; for a gap or a fault, the side whose
            bytes it affects.
        kind: The kind of event.
        data: The bytes, for ``BYTES``; empty otherwise.
        offset_bytes: Stream offset of the first byte of `data` (or of the gap) in this direction,
            counted from the first byte of the connection, or from the first captured byte if the
            capture began later.
        length_bytes: Length of a gap; -1 if unknown. 0 for every other kind.
        note: Details as text: the reason of a gap, the addresses of an opened connection, the
            injected fault and its target.
        packet: Number of the packet or message in its file, from 1; 0 if unknown.
    """

    time_ns: int
    connection: str
    direction: Direction
    kind: Kind
    data: bytes = b""
    offset_bytes: int = 0
    length_bytes: int = 0
    note: str = ""
    packet: int = field(default=0, compare=False, kw_only=True)

    @property
    def is_loss(self) -> bool:
        """Whether it is a gap of bytes that passed and were not recorded."""
        return self.kind is Kind.GAP and self.length_bytes != 0 and self.note != EARLIER_FILE


class WireRange(NamedTuple):
    """A range of bytes on the wire, as evidence."""

    connection: str
    direction: Direction
    offset_bytes: int
    length_bytes: int
    time_ns: int
    """When its last byte was seen."""
