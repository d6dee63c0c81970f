"""Faults that can be applied to a frame.

A fault changes one queued frame and returns a description without payload data. The injector
decides when a frame is sent and keeps the order.
"""

from dataclasses import dataclass
from random import Random
from typing import Any, ClassVar, Protocol

from scaraspec_recorder.fault_injection.conditions import Condition


@dataclass(eq=False, slots=True)
class QueuedFrame:
    """A queued frame, other bytes, or the end of the stream.

    Attributes:
        description: Description of the frame.
        data: Bytes that are still to be sent.
        received_s: Time of reception.
        due_s: Latest time of sending.
        number: Number of the frame on the connection, both directions together.
        direction_number: Number of the frame in its direction.
        piece_bytes: Size of the pieces it is sent in; 0 sends it at once.
        gap_s: Delay after each piece.
        followers: It is sent earlier after this many further frames of its direction; 0 for never.
        until: It is sent earlier after a frame that matches this condition.
        cut: The connection is reset instead.
        is_end: It stands for the half-close of the sender.
        sent: It has been sent.
    """

    description: str
    data: bytes
    received_s: float
    due_s: float
    number: int = 0
    direction_number: int = 0
    piece_bytes: int = 0
    gap_s: float = 0.0
    followers: int = 0
    until: Condition | None = None
    cut: bool = False
    is_end: bool = False
    sent: bool = False


class Fault(Protocol):
    """One kind of fault: a dataclass whose fields are the parameters in a rules file."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:
        """Apply the fault to a frame. Return a description; empty if nothing changed."""


@dataclass(frozen=True, slots=True)
class Delay:
    """The frame is sent later."""

    delay_ms: float

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - not random
        """Delay the frame."""
        parcel.due_s += self.delay_ms / 1000
        return f"{self.delay_ms:g} ms late"


@dataclass(frozen=True, slots=True)
class Jitter:
    """The frame is sent later by a random delay."""

    jitter_ms: float

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:
        """Delay the frame by up to `jitter_ms`."""
        return Delay(round(dice.uniform(0, self.jitter_ms), 3)).apply(parcel, dice)


@dataclass(frozen=True, slots=True)
class Fragment:
    """The frame is sent in pieces."""

    size_bytes: int
    gap_ms: float = 5.0

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Split the frame; no effect if it is not longer than a piece."""
        if len(parcel.data) <= self.size_bytes:
            return ""
        parcel.piece_bytes, parcel.gap_s = self.size_bytes, self.gap_ms / 1000
        return f"in pieces of {self.size_bytes} bytes, {self.gap_ms:g} ms apart"


@dataclass(frozen=True, slots=True)
class Coalesce:
    """The frame waits for the following frames and is sent together with them."""

    frames: int
    within_ms: float

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Wait until there are `frames`, at most `within_ms`."""
        parcel.due_s += self.within_ms / 1000
        parcel.followers = self.frames - 1
        return f"held to go as one with {parcel.followers} more, {self.within_ms:g} ms at most"


@dataclass(frozen=True, slots=True)
class Drop:
    """The frame is not sent."""

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Remove all bytes."""
        parcel.data = b""
        return "not passed on"


@dataclass(frozen=True, slots=True)
class Corrupt:
    """One byte of the frame is changed.

    Attributes:
        at_bytes: Index of the byte; negative counts from the end; None is random.
        xor: Value that the byte is XORed with; None is random.
    """

    at_bytes: int | None = None
    xor: int | None = None

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:
        """Change the byte; no effect if the frame has no such byte."""
        size_bytes = len(parcel.data)
        at = dice.randrange(max(size_bytes, 1)) if self.at_bytes is None else self.at_bytes
        xor = dice.randint(1, 255) if self.xor is None else self.xor
        at += size_bytes * (at < 0)
        if not 0 <= at < size_bytes:
            return ""
        changed = bytearray(parcel.data)
        changed[at] ^= xor
        parcel.data = bytes(changed)
        return f"its byte {at} changed by xor 0x{xor:02X}"


@dataclass(frozen=True, slots=True)
class Truncate:
    """Only the first bytes of the frame are sent."""

    keep_bytes: int

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Keep the first bytes; no effect if the frame has no more."""
        if len(parcel.data) <= self.keep_bytes:
            return ""
        parcel.data = parcel.data[: self.keep_bytes]
        return f"only its first {self.keep_bytes} bytes passed on"


@dataclass(frozen=True, slots=True)
class Reset:
    """The connection is reset instead of sending the frame. Queued bytes are lost."""

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Reset the connection instead."""
        parcel.cut = True
        return "the connection cut instead"


@dataclass(frozen=True, slots=True)
class HoldBack:
    """The frame waits for another frame on the same connection, in either direction."""

    at_most_ms: float
    until_command: int | str
    until_part: str | None = None
    until_direction: str | None = None

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Wait at most `at_most_ms`."""
        parcel.due_s += self.at_most_ms / 1000
        parcel.until = self.until
        return f"held back until {parcel.until}, {self.at_most_ms:g} ms at most"

    @property
    def until(self) -> Condition:
        """Condition of the frame to wait for."""
        return Condition(self.until_command, self.until_part, self.until_direction)
