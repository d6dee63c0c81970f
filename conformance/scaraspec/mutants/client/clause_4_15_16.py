"""Faults of clauses 4.15 and 4.16: programs that are run, or simulated, under another name."""

from typing import Final

from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import AltersRequests, ReplacesRequests
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_RUN: Final = "run_program"
_SIMULATE: Final = "simulate_program"
_FIELD_BYTES: Final = 30
_SHORT_BYTES: Final = 16


@mutant("runs-without-extension", "4.15/1")
class RunsWithoutExtension(AltersRequests):
    """The program that is run is named without its extension."""

    name = _RUN

    def altered(self, data: bytes) -> bytes:
        """Cut it off."""
        return data.rpartition(b".")[0] or data


@mutant("runs-padded-names", "4.15/1")
class RunsPaddedNames(AltersRequests):
    """The name of the program that is run is filled up with blanks to 30 bytes."""

    name = _RUN

    def altered(self, data: bytes) -> bytes:
        """Fill it up."""
        return data.ljust(_FIELD_BYTES)


@mutant("runs-short-names", "4.15/1", subtle=True)
class RunsShortNames(AltersRequests):
    """Of the name of the program that is run no more than 16 bytes are sent."""

    name = _RUN

    def altered(self, data: bytes) -> bytes:
        """Cut it."""
        return data[:_SHORT_BYTES]


@mutant("runs-with-the-rest-of-longer-names", "4.15/1", subtle=True)
class RunsWithTheRestOfLongerNames(AltersRequests):
    """A shorter name is followed by the end of the longer one that was in the buffer before."""

    name = _RUN
    _buffer = b""

    def altered(self, data: bytes) -> bytes:
        """Write over it."""
        self._buffer = data + self._buffer[len(data) :]
        return self._buffer


@mutant("runs-up-to-the-first-blank", "4.15/1", subtle=True)
class RunsUpToTheFirstBlank(AltersRequests):
    """Of a name with blanks in it the first word is sent."""

    name = _RUN

    def altered(self, data: bytes) -> bytes:
        """Cut it there."""
        return data.partition(b" ")[0]


@mutant("runs-instead-of-simulating", "4.16/1")
class RunsInsteadOfSimulating(ReplacesRequests):
    """A simulation is asked for as a run, which moves the arm."""

    name = _SIMULATE

    def replaced(self, frame: Frame) -> Frame:
        """Run it."""
        return frame._replace(opcode=BY_NAME[_RUN].opcode)


@mutant("simulation-is-marked", "4.16/1")
class SimulationIsMarked(AltersRequests):
    """The name of the program that is simulated is followed by a mark that it is."""

    name = _SIMULATE

    def altered(self, data: bytes) -> bytes:
        """Append it."""
        return data + b"|1"


@mutant("simulates-what-ran-last", "4.16/1", subtle=True)
class SimulatesWhatRanLast(AltersRequests):
    """Once a program has been run, that is the one which is simulated."""

    name = _SIMULATE
    _ran = b""

    def _altered(self, frame: Frame) -> Frame:
        if frame.opcode == BY_NAME[_RUN].opcode:
            self._ran = frame.data
        return super()._altered(frame)

    def altered(self, data: bytes) -> bytes:
        """Name that."""
        return self._ran or data
