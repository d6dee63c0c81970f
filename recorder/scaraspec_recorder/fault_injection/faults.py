"""Faults: what is done to a frame on its way.

Law: a fault changes one parcel and says in words what it did; of a payload it never says anything.
When a parcel goes, and that order is kept, is the injector's affair.
"""

from dataclasses import dataclass
from random import Random
from typing import Any, ClassVar, Protocol

from scaraspec_recorder.fault_injection.conditions import Condition


@dataclass(eq=False, slots=True)
class QueuedFrame:
    """A frame on its way to the other side; or bytes that are none, or the end of the stream.

    Attributes:
        description: What it is, in words.
        data: What will be passed on of it.
        received_s: When it came.
        due_s: When it goes, at the latest.
        number: How many frames had passed on the connection, both ways, with this one.
        direction_number: Its number among the frames of its direction.
        piece_bytes: It goes in pieces of so many bytes; 0 for in one.
        gap_s: How long after each of them.
        followers: It goes already when so many more frames of its direction have come; 0 for never.
        until: It goes already when such a frame has come.
        cut: The connection is cut instead.
        is_end: Its sender sends no more.
        sent: It has been passed on.
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
    """One kind of fault; a dataclass of which the fields are its measures, the keys of a file."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:
        """Do it to a frame; return what was done in words, empty where it came to nothing."""


@dataclass(frozen=True, slots=True)
class Delay:
    """The frame goes later."""

    delay_ms: float

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - nothing is left to chance
        """Put its time off."""
        parcel.due_s += self.delay_ms / 1000
        return f"{self.delay_ms:g} ms late"


@dataclass(frozen=True, slots=True)
class Jitter:
    """The frame goes later, by a time that is drawn for each."""

    jitter_ms: float

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:
        """Put its time off by up to `jitter_ms`."""
        return Delay(round(dice.uniform(0, self.jitter_ms), 3)).apply(parcel, dice)


@dataclass(frozen=True, slots=True)
class Fragment:
    """The frame goes in pieces."""

    size_bytes: int
    gap_ms: float = 5.0

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Have it cut up; nothing comes of a frame that is no longer than a piece."""
        if len(parcel.data) <= self.size_bytes:
            return ""
        parcel.piece_bytes, parcel.gap_s = self.size_bytes, self.gap_ms / 1000
        return f"in pieces of {self.size_bytes} bytes, {self.gap_ms:g} ms apart"


@dataclass(frozen=True, slots=True)
class Coalesce:
    """The frame waits for those behind it, and all go as one piece."""

    frames: int
    within_ms: float

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Have it wait until there are `frames`, for `within_ms` at most."""
        parcel.due_s += self.within_ms / 1000
        parcel.followers = self.frames - 1
        return f"held to go as one with {parcel.followers} more, {self.within_ms:g} ms at most"


@dataclass(frozen=True, slots=True)
class Drop:
    """The frame does not go at all."""

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Leave nothing of it."""
        parcel.data = b""
        return "not passed on"


@dataclass(frozen=True, slots=True)
class Corrupt:
    """One byte of the frame is changed.

    Attributes:
        at_bytes: Which, from 0; from -1 back from the end; None to draw it for each frame.
        xor: What it is combined with; None to draw it for each frame.
    """

    at_bytes: int | None = None
    xor: int | None = None

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:
        """Change it; nothing comes of a frame that has no such byte."""
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
    """Only the beginning of the frame goes."""

    keep_bytes: int

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Leave its first bytes; nothing comes of a frame that has no more."""
        if len(parcel.data) <= self.keep_bytes:
            return ""
        parcel.data = parcel.data[: self.keep_bytes]
        return f"only its first {self.keep_bytes} bytes passed on"


@dataclass(frozen=True, slots=True)
class Reset:
    """The connection is cut instead: both sides are told by RST, and what waits is lost."""

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Have the connection cut in its place."""
        parcel.cut = True
        return "the connection cut instead"


@dataclass(frozen=True, slots=True)
class HoldBack:
    """The frame waits until another one has come, on the same connection, from either side."""

    at_most_ms: float
    until_command: int | str
    until_part: str | None = None
    until_direction: str | None = None

    def apply(self, parcel: QueuedFrame, dice: Random) -> str:  # noqa: ARG002 - as above
        """Have it wait, for `at_most_ms` at most."""
        parcel.due_s += self.at_most_ms / 1000
        parcel.until = self.until
        return f"held back until {parcel.until}, {self.at_most_ms:g} ms at most"

    @property
    def until(self) -> Condition:
        """Which frame it waits for."""
        return Condition(self.until_command, self.until_part, self.until_direction)
