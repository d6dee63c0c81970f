"""Faults of clause 4.24: the move to tool coordinates as it is sent."""

from typing import Final

from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersFields, SendsUnchecked

_MOVE: Final = "set_tool_coordinates"
_FULL_PERCENT: Final = 100


@mutant("speed-comes-last", "4.24/1")
class SpeedComesLast(AltersFields):
    """The speed of a move is sent behind the pose."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Move it."""
        return [*fields[1:], fields[0]]


@mutant("move-without-speed", "4.24/1")
class MoveWithoutSpeed(AltersFields):
    """A move is sent without its speed, as an initial position is."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Leave it away."""
        return fields[1:]


@mutant("move-of-five-numbers", "4.24/1")
class MoveOfFiveNumbers(AltersFields):
    """A move is sent without the angles that mean nothing."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Leave them away."""
        return fields[:5]


@mutant("move-swaps-axes", "4.24/1", subtle=True)
class MoveSwapsAxes(AltersFields):
    """Of a move x and y are sent in each other's place where x is negative."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Swap them."""
        speed, x, y, *rest = fields
        return [speed, y, x, *rest] if x.startswith(b"-") else fields


@mutant("move-in-whole-millimetres", "4.24/1", subtle=True)
class MoveInWholeMillimetres(AltersFields):
    """Of a move whole millimetres are sent."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Cut the rest."""
        cut = [field.partition(b".")[0] for field in fields[1:4]]
        return [fields[0], *cut, *fields[4:]]


@mutant("speed-with-its-unit", "4.24/2")
class SpeedWithItsUnit(AltersFields):
    """The speed of a move is sent with a percent sign."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Add it."""
        return [fields[0] + b"%", *fields[1:]]


@mutant("speed-as-fraction", "4.24/2")
class SpeedAsFraction(AltersFields):
    """The speed of a move is sent as a fraction of full speed."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Divide it."""
        return [b"%.2f" % (int(fields[0]) / _FULL_PERCENT), *fields[1:]]


@mutant("full-speed-is-ninety-nine", "4.24/2", subtle=True)
class FullSpeedIsNinetyNine(AltersFields):
    """Full speed is sent as 99 %, for want of a third digit."""

    name = _MOVE

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Cut it."""
        return [b"99" if fields[0] == b"100" else fields[0], *fields[1:]]


@mutant("speed-zero-is-sent", "4.24/2", subtle=True)
class SpeedZeroIsSent(SendsUnchecked):
    """A speed of 0 %, or less, is sent: the lower bound is not checked."""

    name = _MOVE

    def passes(self, value: float) -> bool:
        """Let it pass."""
        return value == int(value) and value < 1


@mutant("speed-of-byte-size-is-sent", "4.24/2", subtle=True)
class SpeedOfByteSizeIsSent(SendsUnchecked):
    """Any speed is sent that fits a byte."""

    name = _MOVE

    def passes(self, value: float) -> bool:
        """Let it pass."""
        return value == int(value) and _FULL_PERCENT < value < 256


@mutant("half-percents-are-sent", "4.24/2", subtle=True)
class HalfPercentsAreSent(SendsUnchecked):
    """A speed between two whole percentages is sent as it is."""

    name = _MOVE

    def passes(self, value: float) -> bool:
        """Let it pass."""
        return value != int(value)
