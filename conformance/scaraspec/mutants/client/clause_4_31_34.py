"""Faults of clauses 4.31 to 4.34: inputs and outputs."""

from typing import Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.errors import Refused
from scaraspec.mutants.client import mutant
from scaraspec.mutants.operators.client.messages import (
    AltersFields,
    AltersReplies,
    AltersRequests,
    SendsUnchecked,
)
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame

_INPUTS: Final = "get_digital_inputs"
_OUTPUTS: Final = "get_digital_outputs"
_SET: Final = "set_digital_output"
_ANALOG: Final = "get_analog_input"
_BYTE: Final = 8


# 4.31


@mutant("input-is-asked-for-by-port", "4.31/1")
class InputIsAskedForByPort(AltersRequests):
    """The digital inputs are asked for with a port, as the heading has it."""

    name = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Name one."""
        return data + b"1"


@mutant("error-names-the-port", "4.31/1", subtle=True)
class ErrorNamesThePort(AltersRequests):
    """After an error the digital inputs are asked for with a port."""

    name = _INPUTS
    _count = 0

    def altered(self, data: bytes) -> bytes:
        """Count."""
        self._count += 1
        return data + b"8" if self._count > 1 else data


@mutant("inputs-are-reversed", "4.31/3")
class InputsAreReversed(AsyncClient):
    """Of the inputs port 1 is told leftmost."""

    async def get_digital_inputs(self) -> str:
        """Turn them round."""
        return (await super().get_digital_inputs())[::-1]


@mutant("inputs-lose-their-zeros", "4.31/3", subtle=True)
class InputsLoseTheirZeros(AsyncClient):
    """The inputs are told as a number: zeros ahead of it are lost."""

    async def get_digital_inputs(self) -> str:
        """Lose them."""
        return f"{int(await super().get_digital_inputs())}"


@mutant("input-six-is-skipped", "4.31/3", subtle=True)
class InputSixIsSkipped(AsyncClient):
    """Of the inputs port 6 is left away, as in the document's list."""

    async def get_digital_inputs(self) -> str:
        """Leave it away."""
        bits = await super().get_digital_inputs()
        return "0" + bits[:2] + bits[3:]


@mutant("inputs-are-rotated", "4.31/3", subtle=True)
class InputsAreRotated(AsyncClient):
    """The inputs are counted from port 0: each is told one place further left."""

    async def get_digital_inputs(self) -> str:
        """Move them."""
        bits = await super().get_digital_inputs()
        return bits[1:] + bits[:1]


# 4.32


@mutant("output-behind-its-value", "4.32/1")
class OutputBehindItsValue(AltersFields):
    """An output is set with the value ahead of the port."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Turn them round."""
        return fields[::-1]


@mutant("output-behind-comma", "4.32/1")
class OutputBehindComma(AltersRequests):
    """Port and value of an output are separated by a comma."""

    name = _SET

    def altered(self, data: bytes) -> bytes:
        """Put it there."""
        return data.replace(b"|", b",")


@mutant("outputs-count-from-zero", "4.32/1", subtle=True)
class OutputsCountFromZero(AltersFields):
    """Outputs are counted from 0."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Count so."""
        return [b"%d" % (int(fields[0]) - 1), fields[1]]


@mutant("outputs-of-one-digit", "4.32/1", subtle=True)
class OutputsOfOneDigit(AltersFields):
    """Of the number of an output one digit is sent."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Cut it."""
        return [fields[0][-1:], fields[1]]


@mutant("outputs-are-set-to-words", "4.32/1", "4.32/2")
class OutputsAreSetToWords(AltersFields):
    """An output is set to the word true or false."""

    name = _SET

    def fields(self, fields: list[bytes]) -> list[bytes]:
        """Write it."""
        return [fields[0], b"true" if fields[1] == b"1" else b"false"]


@mutant("outputs-are-set-to-anything", "4.32/2", subtle=True)
class OutputsAreSetToAnything(SendsUnchecked):
    """An output is set to any whole number that the user names."""

    name, place = _SET, 1

    def passes(self, value: float) -> bool:
        """Let it pass."""
        return value not in (0, 1) and value == int(value)


@mutant("outputs-are-set-by-halves", "4.32/2", subtle=True)
class OutputsAreSetByHalves(SendsUnchecked):
    """Of the value of an output only the range is checked: a half is sent."""

    name, place = _SET, 1

    def passes(self, value: float) -> bool:
        """Let it pass."""
        return 0 < value < 1


# 4.33


@mutant("analog-port-unpadded", "4.33/1")
class AnalogPortUnpadded(AltersRequests):
    """The number of an analog input is sent as it is: 8 for 08."""

    name = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Leave the zero away."""
        return data.lstrip(b"0")


@mutant("analog-port-in-three-digits", "4.33/1")
class AnalogPortInThreeDigits(AltersRequests):
    """The number of an analog input is sent in three digits."""

    name = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Fill it up."""
        return data.rjust(3, b"0")


@mutant("analog-port-behind-blank", "4.33/1")
class AnalogPortBehindBlank(AltersRequests):
    """The number of an analog input is filled up with a blank."""

    name = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Fill it up."""
        return data.lstrip(b"0").rjust(2)


@mutant("analog-port-in-hexadecimals", "4.33/1", subtle=True)
class AnalogPortInHexadecimals(AltersRequests):
    """The number of an analog input is sent in hexadecimals: 0A for 10."""

    name = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Write it so."""
        return b"%02X" % int(data)


@mutant("analog-port-beyond-two-digits", "4.33/1", subtle=True)
class AnalogPortBeyondTwoDigits(SendsUnchecked):
    """The number of an analog input is sent even where it has three digits."""

    name = _ANALOG

    def passes(self, value: float) -> bool:
        """Let it pass."""
        return value > 99


@mutant("zero-is-an-error", "4.33/4")
class ZeroIsAnError(AsyncClient):
    """The analog value 0 is taken for an error."""

    async def get_analog_input(self, port: int) -> float:
        """Take it for one."""
        value = await super().get_analog_input(port)
        if not value:
            raise Refused(BY_NAME[_ANALOG])
        return value


@mutant("error-is-zero", "4.33/4")
class ErrorIsZero(AsyncClient):
    """An error is told as the analog value 0."""

    async def get_analog_input(self, port: int) -> float:
        """Overlook it."""
        try:
            return await super().get_analog_input(port)
        except Refused:
            return 0.0


@mutant("error-is-the-last-value", "4.33/4", subtle=True)
class ErrorIsTheLastValue(AsyncClient):
    """After an error the analog value before it is told again."""

    _last: float | None = None

    async def get_analog_input(self, port: int) -> float:
        """Keep it."""
        try:
            self._last = await super().get_analog_input(port)
        except Refused:
            if self._last is None:
                raise
        return self._last


@mutant("zero-with-decimals-is-an-error", "4.33/4", subtle=True)
class ZeroWithDecimalsIsAnError(AltersReplies):
    """Only the whole digits of an analog value are understood: 0.0 is taken for an error."""

    name = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Take it for one."""
        return b"0" if data.startswith(b"1|0.") else data


# 4.34


@mutant("output-is-asked-for-by-port", "4.34/1")
class OutputIsAskedForByPort(AltersRequests):
    """The digital outputs are asked for with a port, as the heading has it."""

    name = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Name one."""
        return data + b"1"


@mutant("output-is-asked-for-as-it-was-set", "4.34/1", subtle=True)
class OutputIsAskedForAsItWasSet(AltersRequests):
    """Once an output has been set, the outputs are asked for with its number."""

    name = _OUTPUTS
    _port = b""

    def _altered(self, frame: Frame) -> Frame:
        if frame.opcode == BY_NAME[_SET].opcode:
            self._port = frame.data.partition(b"|")[0]
        return super()._altered(frame)

    def altered(self, data: bytes) -> bytes:
        """Name it."""
        return data + self._port


@mutant("outputs-are-reversed", "4.34/3")
class OutputsAreReversed(AsyncClient):
    """Of the outputs port 1 is told leftmost."""

    async def get_digital_outputs(self) -> str:
        """Turn them round."""
        return (await super().get_digital_outputs())[::-1]


@mutant("output-bytes-are-swapped", "4.34/3", subtle=True)
class OutputBytesAreSwapped(AsyncClient):
    """Of the outputs the lower eight are told ahead of the upper eight."""

    async def get_digital_outputs(self) -> str:
        """Swap them."""
        bits = await super().get_digital_outputs()
        return bits[_BYTE:] + bits[:_BYTE]


@mutant("upper-outputs-are-forgotten", "4.34/3", subtle=True)
class UpperOutputsAreForgotten(AsyncClient):
    """Of the outputs the upper eight are told as 0."""

    async def get_digital_outputs(self) -> str:
        """Forget them."""
        return "0" * _BYTE + (await super().get_digital_outputs())[_BYTE:]
