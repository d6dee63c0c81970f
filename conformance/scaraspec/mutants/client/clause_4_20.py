"""Faults of clause 4.20: the gripper centre as it is set."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, Final

from scaraspec.client.core import ClientCore
from scaraspec.client.pending_operation import PendingOperation
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersFields, AltersRequests
from scaraspec.protocol.commands import BY_NAME, Point
from scaraspec.protocol.frames import Frame

_SET: Final = "set_gripper_center"


@mutant("gripper-back-to-front", "4.20/1")
class GripperBackToFront(AltersFields):
    """The gripper centre is sent as z, y and x."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Turn them round."""
        return fields[::-1]


@mutant("gripper-between-blanks", "4.20/1")
class GripperBetweenBlanks(AltersRequests):
    """The numbers of the gripper centre are separated by blanks, as they are printed."""

    name = _SET

    def altered(self, data: bytes) -> bytes:
        """Print them."""
        return data.replace(b"|", b" ")


@mutant("gripper-in-brackets", "4.20/1")
class GripperInBrackets(AltersRequests):
    """The gripper centre is sent in brackets, as the text writes (x,y,z)."""

    name = _SET

    def altered(self, data: bytes) -> bytes:
        """Write it so."""
        return b"(" + data + b")"


@mutant("gripper-with-decimal-commas", "4.20/1", subtle=True)
class GripperWithDecimalCommas(AltersRequests):
    """Decimals of the gripper centre are written with a comma, as the user's country has it."""

    name = _SET

    def altered(self, data: bytes) -> bytes:
        """Write them so."""
        return data.replace(b".", b",")


class _WritesNumbers(ClientCore, ABC):
    """The numbers of the gripper centre are written in another way."""

    _ordered: Point | None = None

    @abstractmethod
    def written(self, number: float) -> bytes:
        """Write one."""

    def command(self, name: str, value: Any = None) -> PendingOperation:
        """Remember what was ordered."""
        self._ordered = value if name == _SET else None
        return super().command(name, value)

    def _send(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            if self._ordered is not None and frame.opcode == BY_NAME[_SET].opcode:
                frame = frame._replace(data=b"|".join(map(self.written, self._ordered)))  # noqa: PLW2901 - one of two
            super()._send([frame])


@mutant("large-numbers-with-exponent", "4.20/1", subtle=True)
class LargeNumbersWithExponent(_WritesNumbers):
    """Numbers are written by %g: a million is 1e+06."""

    def written(self, number: float) -> bytes:
        """Write it so."""
        return b"%g" % number if abs(number) >= 1 else b"%.3f" % number


@mutant("small-numbers-with-exponent", "4.20/1", subtle=True)
class SmallNumbersWithExponent(_WritesNumbers):
    """Numbers are written as the language prints them: a hundred-thousandth is 1e-05."""

    def written(self, number: float) -> bytes:
        """Write it so."""
        return repr(number).encode()


@mutant("zeros-are-left-away", "4.20/1", subtle=True)
class ZerosAreLeftAway(_WritesNumbers):
    """The number 0 is an empty field."""

    def written(self, number: float) -> bytes:
        """Write it so."""
        return b"%.3f" % number if number else b""


@mutant("small-negatives-are-positive", "4.20/1", subtle=True)
class SmallNegativesArePositive(_WritesNumbers):
    """Numbers between -1 and 0 lose their sign: whole part and fraction are written apart."""

    def written(self, number: float) -> bytes:
        """Write it so."""
        return b"%.3f" % (abs(number) if number > -1 else number)
