"""Faults of clause 4.22: the initial tool position as it is told."""

from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersLengths, AltersReplies

_GET_POSITION: Final = 0x37


@mutant("position-of-four-numbers", "4.22/2")
class PositionOfFourNumbers(AltersReplies):
    """The initial position is told without the angles that mean nothing."""

    opcode = _GET_POSITION

    def altered(self, data: bytes) -> bytes:
        """Leave them away."""
        return b"|".join(data.split(b"|")[:4])


@mutant("position-with-empty-angles", "4.22/2")
class PositionWithEmptyAngles(AltersReplies):
    """The angles that mean nothing are empty fields."""

    opcode = _GET_POSITION

    def altered(self, data: bytes) -> bytes:
        """Empty them."""
        return b"|".join((*data.split(b"|")[:4], b"", b""))


@mutant("position-between-blanks", "4.22/2")
class PositionBetweenBlanks(AltersReplies):
    """The numbers of the initial position are separated by blanks."""

    opcode = _GET_POSITION

    def altered(self, data: bytes) -> bytes:
        """Put them in."""
        return data.replace(b"|", b" ")


@mutant("position-length-as-printed", "4.22/2")
class PositionLengthAsPrinted(AltersLengths):
    """The length byte of the initial position is two too high, as in the document's row."""

    opcode = _GET_POSITION

    def length(self, size_bytes: int) -> int:
        """Miscount."""
        return size_bytes + 2
