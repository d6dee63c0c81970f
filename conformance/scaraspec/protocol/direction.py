"""The two directions of the link."""

from enum import Enum


class Direction(Enum):
    """The sender: ``A2C`` is the client (应用层), ``C2A`` the controller (控制层), L92-94."""

    A2C = "A2C"
    C2A = "C2A"

    # Members are singletons: identity hashing keeps dictionaries keyed by direction cheap.
    __hash__ = object.__hash__

    @property
    def start(self) -> int:
        """Start byte of this sender's frames (L92, L94)."""
        return 0xAA if self is Direction.A2C else 0xCC

    @property
    def end(self) -> int:
        """End byte of this sender's frames (L92, L94)."""
        return 0xCC if self is Direction.A2C else 0xAA

    @property
    def opposite(self) -> "Direction":
        """The direction of the reply."""
        return Direction.C2A if self is Direction.A2C else Direction.A2C


A2C = Direction.A2C
C2A = Direction.C2A
