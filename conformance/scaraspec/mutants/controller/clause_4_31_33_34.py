"""Faults of clauses 4.31, 4.33 and 4.34: what inputs and outputs are told to be."""

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersLengths, AltersReplies
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

_INPUTS, _ANALOG, _OUTPUTS = 0x42, 0x44, 0x49


def _number(data: bytes) -> int:
    """The digits behind the flag as one number."""
    return int(data.rpartition(b"|")[2], 2)


class _DeclaresThree(AltersLengths):
    """Declares a length of 3, as the rows print it, and sends all digits."""

    def length(self, size_bytes: int) -> int:  # noqa: ARG002 - however much it is
        """The printed one."""
        return 3


# ---------------------------------------------------------------------- 4.31


@mutant("inputs-without-flag", "4.31/2")
class InputsWithoutFlag(AltersReplies):
    """The digital inputs are sent without the flag before them."""

    opcode = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Leave it away."""
        return data.removeprefix(b"1|")


@mutant("inputs-as-one-byte", "4.31/2")
class InputsAsOneByte(AltersReplies):
    """The digital inputs are sent as the bits of one byte."""

    opcode = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Pack them."""
        return b"1|" + bytes([_number(data)])


@mutant("inputs-without-port-six", "4.31/2")
class InputsWithoutPortSix(AltersReplies):
    """The digital inputs have no digit for port 6, as the list of L651 leaves it out."""

    opcode = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Leave it out."""
        return data[:4] + data[5:]


@mutant("inputs-between-bars", "4.31/2")
class InputsBetweenBars(AltersReplies):
    """The digits of the digital inputs are separated by bars."""

    opcode = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Separate them."""
        return b"1|" + b"|".join(bytes([digit]) for digit in data[2:])


@mutant("inputs-of-length-three", "4.31/4", "4.31/2")
class InputsOfLengthThree(_DeclaresThree):
    """The digital inputs are sent with the printed length of 3."""

    opcode = _INPUTS


@mutant("inputs-as-hex-while-running", "4.31/4", "4.31/2", subtle=True)
class InputsAsHexWhileRunning(AltersReplies):
    """While a program runs the digital inputs are sent as two hexadecimal digits."""

    opcode = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Convert them."""
        return b"1|%02X" % _number(data) if self.robot.task else data


@mutant("inputs-from-port-one", "4.31/3", "4.31/2")
class InputsFromPortOne(AltersReplies):
    """The digital inputs begin with port 1 and end with port 8."""

    opcode = _INPUTS

    def altered(self, data: bytes) -> bytes:
        """Turn them round."""
        return data[:2] + data[:1:-1]


@mutant("inputs-show-their-neighbour", "4.31/3", "4.31/2")
class InputsShowTheirNeighbour(ControllerCore):
    """Input 8 shows the state of input 7."""

    def get_digital_inputs(self, request: Request) -> str:
        """Copy a digit."""
        digits = super().get_digital_inputs(request)
        return digits[1] + digits[1:]


@mutant("inputs-freeze", "4.31/3", "4.31/2")
class InputsFreeze(ControllerCore):
    """The digital inputs are read once and then stay as they were."""

    _read = ""

    def get_digital_inputs(self, request: Request) -> str:
        """Keep the first."""
        self._read = self._read or super().get_digital_inputs(request)
        return self._read


# ---------------------------------------------------------------------- 4.33


@mutant("analog-without-flag", "4.33/2")
class AnalogWithoutFlag(AltersReplies):
    """An analog value is sent without the flag before it."""

    opcode = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Leave it away."""
        return data.removeprefix(b"1|")


@mutant("analog-with-unit", "4.33/2")
class AnalogWithUnit(AltersReplies):
    """An analog value has a unit behind it."""

    opcode = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"V" if data.startswith(b"1|") else data


@mutant("analog-errors-are-reasoned", "4.33/2")
class AnalogErrorsAreReasoned(AltersReplies):
    """A port that is no analog input is answered with a code behind the 0."""

    opcode = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return b"0|05" if data == b"0" else data


@mutant("analog-comma", "4.33/2")
class AnalogComma(AltersReplies):
    """An analog value has a comma for its decimal point."""

    opcode = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Replace it."""
        return data.replace(b".", b",")


@mutant("analog-zero-is-error", "4.33/2")
class AnalogZeroIsError(AltersReplies):
    """An analog value of 0 is answered as an error."""

    opcode = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Take it for none."""
        return b"0" if data in (b"1|0", b"1|0.0") else data


@mutant("analog-of-the-first-input", "4.33/2")
class AnalogOfTheFirstInput(ControllerCore):
    """Every analog input is answered with the value of the first."""

    def get_analog_input(self, request: Request) -> float | None:
        """Read the first."""
        value = super().get_analog_input(request)
        return None if value is None else self.plant.analog_inputs[1]


@mutant("analog-freezes", "4.33/2")
class AnalogFreezes(ControllerCore):
    """An analog input is read once and then stays as it was."""

    def get_analog_input(self, request: Request) -> float | None:
        """Keep the first."""
        kept: dict[int, float | None] = self.__dict__.setdefault("kept", {})
        return kept.setdefault(request.value, super().get_analog_input(request))


@mutant("analog-ports-from-zero", "4.33/3")
class AnalogPortsFromZero(ControllerCore):
    """Port 00 is answered with an analog value."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take 0 for 1."""
        if frame.opcode == _ANALOG and frame.data == b"00":
            frame = frame._replace(data=b"01")
        super().handle(session, frame, now_s)


@mutant("analog-ports-by-their-last-digit", "4.33/3")
class AnalogPortsByTheirLastDigit(ControllerCore):
    """Of a port number only the last digit counts."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Look at that one."""
        if frame.opcode == _ANALOG:
            frame = frame._replace(data=b"0" + frame.data[-1:])
        super().handle(session, frame, now_s)


@mutant("analog-errors-are-zero", "4.33/3")
class AnalogErrorsAreZero(AltersReplies):
    """A port that does not exist is answered with the value 0."""

    opcode = _ANALOG

    def altered(self, data: bytes) -> bytes:
        """Send a value."""
        return b"1|0" if data == b"0" else data


# ---------------------------------------------------------------------- 4.34


@mutant("outputs-without-flag", "4.34/2")
class OutputsWithoutFlag(AltersReplies):
    """The digital outputs are sent without the flag before them."""

    opcode = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Leave it away."""
        return data.removeprefix(b"1|")


@mutant("eight-outputs", "4.34/2")
class EightOutputs(AltersReplies):
    """Only eight digital outputs are shown."""

    opcode = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Leave the others away."""
        return data[:2] + data[-8:]


@mutant("outputs-as-hex", "4.34/2")
class OutputsAsHex(AltersReplies):
    """The digital outputs are sent as four hexadecimal digits."""

    opcode = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Convert them."""
        return b"1|%04X" % _number(data)


@mutant("outputs-in-groups", "4.34/2")
class OutputsInGroups(AltersReplies):
    """A bar stands between the digits of outputs 9 and 8."""

    opcode = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Write it."""
        return data[:10] + b"|" + data[10:]


@mutant("outputs-of-length-three", "4.34/4", "4.34/2")
class OutputsOfLengthThree(_DeclaresThree):
    """The digital outputs are sent with the printed length of 3."""

    opcode = _OUTPUTS


@mutant("outputs-lose-leading-zeros", "4.34/4", "4.34/2", subtle=True)
class OutputsLoseLeadingZeros(AltersReplies):
    """While a program runs the digital outputs are sent without their leading zeros."""

    opcode = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Drop them."""
        return b"1|" + (data[2:].lstrip(b"0") or b"0") if self.robot.task else data


@mutant("outputs-from-port-one", "4.34/3", "4.32/6")
class OutputsFromPortOne(AltersReplies):
    """The digital outputs begin with port 1 and end with port 16."""

    opcode = _OUTPUTS

    def altered(self, data: bytes) -> bytes:
        """Turn them round."""
        return data[:2] + data[:1:-1]


@mutant("outputs-unanswered-while-running", "4.34/2", "3/31", subtle=True)
class OutputsUnansweredWhileRunning(ControllerCore):
    """While a program runs nobody answers what the digital outputs are."""

    def get_digital_outputs(self, request: Request) -> str | Silence:  # type: ignore[override] # that is what is wrong
        """Say nothing."""
        return SILENCE if self.robot.task else super().get_digital_outputs(request)
