"""Faults of clause 8: the codes of table 8-1."""

from abc import ABC, abstractmethod

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance
from scaraspec.virtual_controller.behaviour.base import refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session


class _OtherCodes(ControllerCore, ABC):
    """Codes of refusals and failures are written otherwise."""

    @abstractmethod
    def code(self, code: bytes) -> bytes:
        """What stands for a code."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Put it in."""
        head, bar, code = frame.data.partition(b"|")
        if head in (b"0", b"00") and bar and len(code) == 2:
            frame = frame._replace(data=head + bar + self.code(code))
        super().emit(session, frame)


@mutant("codes-as-numbers", "8/1")
class CodesAsNumbers(_OtherCodes):
    """The code of a refusal is a number in one byte."""

    def code(self, code: bytes) -> bytes:
        """Write the number."""
        return bytes((int(code) if code.isdigit() else int(code, 16),))


@mutant("status-as-number", "8/1")
class StatusAsNumber(AltersReplies):
    """The status is two bytes, each a number."""

    opcode = 0x09

    def altered(self, data: bytes) -> bytes:
        """Write the numbers."""
        return bytes(int(digit, 16) for digit in data.decode())


@mutant("codes-in-decimal", "8/2")
class CodesInDecimal(_OtherCodes):
    """The codes from 0x10 on are written in decimal."""

    def code(self, code: bytes) -> bytes:
        """Write it."""
        return b"%02d" % int(code, 16)


@mutant("status-in-decimal", "8/2", "8/4")
class StatusInDecimal(AltersReplies):
    """The status of motors at fault is written in decimal."""

    opcode = 0x09

    def altered(self, data: bytes) -> bytes:
        """Write it."""
        return b"%02d" % int(data, 16)


@mutant("failures-in-decimal", "8/2")
class FailuresInDecimal(_OtherCodes):
    """The codes of final results are written in decimal."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Leave refusals as they are."""
        if frame.tagged:
            super().emit(session, frame)
        else:
            ControllerCore.emit(self, session, frame)

    def code(self, code: bytes) -> bytes:
        """Write it."""
        return b"%02d" % int(code, 16)


@mutant("busy-code-of-its-own", "8/2")
class BusyCodeOfItsOwn(_OtherCodes):
    """A robot that runs a program refuses others with the code 30, which no table has."""

    def code(self, code: bytes) -> bytes:
        """Say it."""
        return b"30" if code == b"01" else code


@mutant("reserved-while-busy", "8/3", "4/15")
class ReservedWhileBusy(_OtherCodes):
    """A robot that runs a program refuses others with the reserved code 07."""

    def code(self, code: bytes) -> bytes:
        """Say it."""
        return b"07" if code == b"01" else code


@mutant("missing-is-bad-argument", "8/5")
class MissingIsBadArgument(_OtherCodes):
    """A program that is not there is refused with the code 05."""

    def code(self, code: bytes) -> bytes:
        """Say it."""
        return b"05" if code == b"20" else code


@mutant("missing-simulation-is-an-angle", "8/5")
class MissingSimulationIsAnAngle(ControllerCore):
    """The simulation of a program that is not there is refused with the code 06."""

    def simulate_program(self, request: Request) -> Acceptance:
        """Say it."""
        answer = super().simulate_program(request)
        return refused("06") if answer.code == "20" else answer


@mutant("runs-what-was-deleted", "8/5", subtle=True)
class RunsWhatWasDeleted(ControllerCore):
    """A program that ran last stays in memory: it runs again although it was deleted."""

    def run_program(self, request: Request) -> Acceptance:
        """Keep the file."""
        name, store = request.value, self.store
        if name in store:
            self._kept = name, store.read(name)
        elif getattr(self, "_kept", (b"",))[0] == name:
            store.write(*self._kept)
            answer = super().run_program(request)
            store.delete(name)
            return answer
        return super().run_program(request)
