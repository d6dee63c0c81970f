"""Faults of clause 4.14: the temperatures of the motors."""

from typing import Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

_TEMPERATURES: Final = 0x0F


@mutant("temperatures-of-three-motors", "4.14/2")
class TemperaturesOfThreeMotors(AltersReplies):
    """The motor of the rotation is not told."""

    opcode = _TEMPERATURES

    def altered(self, data: bytes) -> bytes:
        """Leave the last field away."""
        return data.rpartition(b"|")[0]


@mutant("temperatures-with-units", "4.14/2")
class TemperaturesWithUnits(AltersReplies):
    """Each temperature bears its unit."""

    opcode = _TEMPERATURES

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return b"|".join(field + b"C" for field in data.split(b"|"))


@mutant("temperatures-with-commas", "4.14/2")
class TemperaturesWithCommas(AltersReplies):
    """Temperatures have decimals behind a comma."""

    opcode = _TEMPERATURES

    def altered(self, data: bytes) -> bytes:
        """Add them."""
        return b"|".join(field + b",0" for field in data.split(b"|"))


@mutant("temperatures-without-bars", "4.14/2")
class TemperaturesWithoutBars(AltersReplies):
    """Temperatures follow on each other in two digits each."""

    opcode = _TEMPERATURES

    def altered(self, data: bytes) -> bytes:
        """Leave the bars away."""
        return data.replace(b"|", b"")


@mutant("cold-motor-is-not-told", "4.14/2", subtle=True)
class ColdMotorIsNotTold(AltersReplies):
    """From the third reply on a motor that has not warmed up has an empty field."""

    opcode = _TEMPERATURES
    _count = 0

    def altered(self, data: bytes) -> bytes:
        """Count."""
        self._count += 1
        return data if self._count < 3 else data.replace(b"25", b"", 1)


@mutant("temperatures-under-another-opcode", "4.14/3")
class TemperaturesUnderAnotherOpcode(ControllerCore):
    """The temperatures bear the opcode 0x10, the next one in the row."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Change it."""
        if frame.opcode == _TEMPERATURES:
            frame = frame._replace(opcode=0x10)
        super().emit(session, frame)
