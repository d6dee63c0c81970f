"""Faults of clauses 4.31 to 4.34: inputs and outputs."""

import re
from abc import ABC, abstractmethod
from typing import Any, ClassVar

from scaraspec.controller.behaviour import SILENCE
from scaraspec.controller.behaviour.base import Silence
from scaraspec.controller.brain import Brain
from scaraspec.controller.faults import fault
from scaraspec.controller.plant import NoSuchPortError
from scaraspec.controller.session import Request, Session
from scaraspec.protocol.commands import Command, PortValue
from scaraspec.protocol.frames import Frame

_INPUTS, _SET, _ANALOG, _OUTPUTS = 0x42, 0x43, 0x44, 0x49


def _number(data: bytes) -> int:
    """The digits behind the flag as one number."""
    return int(data.rpartition(b"|")[2], 2)


class _Says(Brain):
    """Sends other data than it should under an opcode."""

    opcode: ClassVar[int]

    def said(self, data: bytes) -> bytes:
        """What it sends."""
        return data

    def emit(self, session: Session, frame: Frame) -> None:
        """Send that."""
        if frame.opcode == self.opcode:
            frame = frame._replace(data=self.said(frame.data))
        super().emit(session, frame)


class _DeclaresThree(Brain):
    """Declares a length of 3, as the rows print it, and sends all digits."""

    opcode: ClassVar[int]

    def transmit(self, session: Session, data: bytes) -> None:
        """Write the printed length."""
        if data[1] == self.opcode:
            data = data[:2] + b"\3" + data[3:]
        super().transmit(session, data)


# ---------------------------------------------------------------------- 4.31


@fault("4.31/2")
class InputsWithoutFlag(_Says):
    """The digital inputs are sent without the flag before them."""

    opcode = _INPUTS

    def said(self, data: bytes) -> bytes:
        """Leave it away."""
        return data.removeprefix(b"1|")


@fault("4.31/2")
class InputsAsOneByte(_Says):
    """The digital inputs are sent as the bits of one byte."""

    opcode = _INPUTS

    def said(self, data: bytes) -> bytes:
        """Pack them."""
        return b"1|" + bytes([_number(data)])


@fault("4.31/2")
class InputsWithoutPortSix(_Says):
    """The digital inputs have no digit for port 6, as the list of L651 leaves it out."""

    opcode = _INPUTS

    def said(self, data: bytes) -> bytes:
        """Leave it out."""
        return data[:4] + data[5:]


@fault("4.31/2")
class InputsBetweenBars(_Says):
    """The digits of the digital inputs are separated by bars."""

    opcode = _INPUTS

    def said(self, data: bytes) -> bytes:
        """Separate them."""
        return b"1|" + b"|".join(bytes([digit]) for digit in data[2:])


@fault("4.31/4", "4.31/2")
class InputsOfLengthThree(_DeclaresThree):
    """The digital inputs are sent with the printed length of 3."""

    opcode = _INPUTS


@fault("4.31/4", "4.31/2", subtle=True)
class InputsAsHexWhileRunning(_Says):
    """While a program runs the digital inputs are sent as two hexadecimal digits."""

    opcode = _INPUTS

    def said(self, data: bytes) -> bytes:
        """Convert them."""
        return b"1|%02X" % _number(data) if self.robot.task else data


@fault("4.31/3", "4.31/2")
class InputsFromPortOne(_Says):
    """The digital inputs begin with port 1 and end with port 8."""

    opcode = _INPUTS

    def said(self, data: bytes) -> bytes:
        """Turn them round."""
        return data[:2] + data[:1:-1]


@fault("4.31/3", "4.31/2")
class InputsShowTheirNeighbour(Brain):
    """Input 8 shows the state of input 7."""

    def get_digital_inputs(self, request: Request) -> str:
        """Copy a digit."""
        digits = super().get_digital_inputs(request)
        return digits[1] + digits[1:]


@fault("4.31/3", "4.31/2")
class InputsFreeze(Brain):
    """The digital inputs are read once and then stay as they were."""

    _read = ""

    def get_digital_inputs(self, request: Request) -> str:
        """Keep the first."""
        self._read = self._read or super().get_digital_inputs(request)
        return self._read


# ---------------------------------------------------------------------- 4.32


@fault("4.32/4")
class SettingIsEchoed(_Says):
    """A setting is answered with its port and value."""

    opcode = _SET
    _asked = b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember them."""
        self._asked = frame.data
        super().handle(session, frame, now_s)

    def said(self, data: bytes) -> bytes:
        """Send them back."""
        return self._asked if data == b"1" else data


@fault("4.32/4")
class RefusalsOfPortsAreReasoned(_Says):
    """A setting that fails is answered with a code behind the 0."""

    opcode = _SET

    def said(self, data: bytes) -> bytes:
        """Add it."""
        return b"0|05" if data == b"0" else data


@fault("4.32/4", "4.32/6")
class RefusesAndSetsAboveEight(Brain):
    """A setting of an output above 8 is answered as failed, and is carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say no."""
        return super().set_digital_output(request) and request.value.port <= 8


@fault("4.32/4", "4.32/6", subtle=True)
class SettingsAreLostWhileRunning(Brain):
    """While a program runs a setting is answered as done, and is not carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say yes."""
        return True if self.robot.task else super().set_digital_output(request)


@fault("4.32/4", "4.32/6", subtle=True)
class SettingsAreLostWhileMoving(Brain):
    """While the arm moves or jogs a setting is answered as done, and is not carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say yes."""
        task = self.robot.task
        moves = task is not None and task.request.command.name in ("jog", "set_tool_coordinates")
        return moves or super().set_digital_output(request)


@fault("4.32/4", "4.32/6", subtle=True)
class SettingsAreLostWhileReleased(Brain):
    """While the joints are released a setting is answered as done, and is not carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say yes."""
        return not self.plant.locked or super().set_digital_output(request)


class _Parses(Brain, ABC):
    """Reads settings in a way of its own."""

    @abstractmethod
    def parsed(self, data: bytes) -> PortValue | None:
        """The setting; None to read it as it should be."""

    def _value(self, command: Command, frame: Frame) -> Any:
        read = self.parsed(frame.data) if command.name == "set_digital_output" else None
        return super()._value(command, frame) if read is None else read


@fault("4.32/5")
class PortsInOneByte(_Parses):
    """Of a port number only the lowest byte counts."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Cut it."""
        read = re.fullmatch(rb"([0-9]+)\|([01])", data)
        return PortValue(int(read[1]) & 0xFF, int(read[2])) if read else None


@fault("4.32/5")
class PortsFromZero(_Parses):
    """Port 0 sets the first output."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Take 0 for 1."""
        read = re.fullmatch(rb"0+\|([01])", data)
        return PortValue(1, int(read[1])) if read else None


@fault("4.32/5")
class PortsBelowZero(_Parses):
    """A negative port number counts the outputs from the end."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Count backwards."""
        read = re.fullmatch(rb"-([0-9]+)\|([01])", data)
        return PortValue(17 - int(read[1]), int(read[2])) if read else None


@fault("4.32/5")
class SaysItHasSetAnyPort(_Says):
    """A setting is always answered as done, whether there is such a port or not."""

    opcode = _SET

    def said(self, data: bytes) -> bytes:  # noqa: ARG002 - whatever is true
        """Say yes."""
        return b"1"


class _Sets(Brain):
    """Sets outputs in a way of its own."""

    def put(self, port: int, *, on: bool) -> None:
        """Set an output."""
        self.plant.digital_outputs[port] = on

    def set_digital_output(self, request: Request) -> bool:
        """Set it so."""
        port, value = request.value
        try:
            self.put(port, on=value == 1)
        except NoSuchPortError:
            return False
        return True


@fault("4.32/6")
class SettingsNeverSwitchOff(_Sets):
    """A setting to 0 is answered as done, and has no effect."""

    def put(self, port: int, *, on: bool) -> None:
        """Only switch on."""
        if on:
            super().put(port, on=True)


@fault("4.32/6")
class SettingsToggle(_Sets):
    """A setting to 1 switches an output over, so that a second one switches it off."""

    def put(self, port: int, *, on: bool) -> None:
        """Switch over."""
        super().put(port, on=on and not self.plant.digital_outputs[port])


@fault("4.32/6")
class SettingsClearTheOthers(_Sets):
    """A setting switches all other outputs off."""

    def put(self, port: int, *, on: bool) -> None:
        """Clear first."""
        super().put(port, on=on)
        for other, _ in enumerate(self.plant.digital_outputs, start=1):
            if other != port:
                super().put(other, on=False)


@fault("4.32/6", subtle=True)
class SettingsOfPairs(_Sets):
    """Output 16 is set together with output 8."""

    def put(self, port: int, *, on: bool) -> None:
        """Set both."""
        super().put(port, on=on)
        if port == 8:
            super().put(16, on=on)


@fault("4.32/6", subtle=True)
class SettingsBeyondTheLastWrap(_Sets):
    """A setting of a port from 17 to 40 is answered as done, and sets one of the outputs."""

    def put(self, port: int, *, on: bool) -> None:
        """Count round."""
        super().put((port - 1) % 16 + 1 if 16 < port <= 40 else port, on=on)


@fault("4.32/6", subtle=True)
class HighestOutputIsDead(_Sets):
    """A setting of output 16 is answered as done, and has no effect."""

    def put(self, port: int, *, on: bool) -> None:
        """Set the others."""
        if port < 16:
            super().put(port, on=on)


@fault("4.32/6", subtle=True)
class OutputsShowLate(Brain):
    """The outputs are shown as they were before the latest setting."""

    _before = ""

    def set_digital_output(self, request: Request) -> bool:
        """Remember them."""
        self._before = super().get_digital_outputs(request)
        return super().set_digital_output(request)

    def get_digital_outputs(self, request: Request) -> str:
        """Show them once."""
        before, self._before = self._before, ""
        return before or super().get_digital_outputs(request)


@fault("4.32/6", subtle=True)
class OutputsGoOffWithTheLink(Brain):
    """The outputs go off when a connection ends."""

    def close(self, connection: int, now_s: float) -> list[Any]:
        """Switch them off."""
        for port, _ in enumerate(self.plant.digital_outputs, start=1):
            self.plant.digital_outputs[port] = False
        return super().close(connection, now_s)


@fault("4.32/6", subtle=True)
class NoMoreThanEightOutputs(_Sets):
    """While eight outputs are on, no further one comes on, though that is answered as done."""

    def put(self, port: int, *, on: bool) -> None:
        """Count them."""
        if not on or sum(self.plant.digital_outputs) < 8:
            super().put(port, on=on)


@fault("4.32/6", subtle=True)
class SettingsWearOut(_Sets):
    """After the 150th setting none has an effect any more."""

    _count = 0

    def put(self, port: int, *, on: bool) -> None:
        """Count them."""
        self._count += 1
        if self._count <= 150:
            super().put(port, on=on)


@fault("4.32/7")
class SettingsAsInC(_Parses):
    """Numbers of a setting are read as far as they go, and what stands behind is left out."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read on leniently."""
        read = re.match(rb"\s*([0-9]+)[^|]*\|\s*([01])", data)
        return PortValue(int(read[1]), int(read[2])) if read else None


@fault("4.32/7")
class SettingsWithAnySeparator(_Parses):
    """Any byte may stand between port and value."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read on leniently."""
        read = re.fullmatch(rb"([0-9]+)[^0-9]([01])", data, re.DOTALL)
        return PortValue(int(read[1]), int(read[2])) if read else None


@fault("4.32/7")
class SettingsWithoutValue(_Parses):
    """A port without a value is switched on."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Switch it on."""
        read = re.fullmatch(rb"([0-9]+)\|?", data)
        return PortValue(int(read[1]), 1) if read else None


@fault("4.32/7")
class SettingsOfTheFirstTwo(_Parses):
    """What follows behind port and value is left out."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read the first two."""
        read = re.match(rb"([0-9]+)\|([01])\|", data)
        return PortValue(int(read[1]), int(read[2])) if read else None


@fault("4.32/7")
class SettingsByCharacters(_Parses):
    """Any character but 0 counts for 1 as a value."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read the character."""
        read = re.fullmatch(rb"([0-9]+)\|([^0-9|].*)", data, re.DOTALL)
        return PortValue(int(read[1]), 1) if read else None


@fault("4.32/7")
class EmptySettingsClearAll(Brain):
    """A setting without data switches all outputs off."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Look for it."""
        if frame.opcode == _SET and not frame.data:
            for port, _ in enumerate(self.plant.digital_outputs, start=1):
                self.plant.digital_outputs[port] = False
        super().handle(session, frame, now_s)


@fault("4.32/7")
class OtherValuesSetTheNextPort(_Parses):
    """A value of two digits is written over two ports."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Overrun."""
        read = re.fullmatch(rb"([0-9]+)\|[0-9]{2,}", data)
        return PortValue(int(read[1]) - 1, 1) if read else None


# ---------------------------------------------------------------------- 4.33


@fault("4.33/2")
class AnalogWithoutFlag(_Says):
    """An analog value is sent without the flag before it."""

    opcode = _ANALOG

    def said(self, data: bytes) -> bytes:
        """Leave it away."""
        return data.removeprefix(b"1|")


@fault("4.33/2")
class AnalogWithUnit(_Says):
    """An analog value has a unit behind it."""

    opcode = _ANALOG

    def said(self, data: bytes) -> bytes:
        """Add it."""
        return data + b"V" if data.startswith(b"1|") else data


@fault("4.33/2")
class AnalogErrorsAreReasoned(_Says):
    """A port that is no analog input is answered with a code behind the 0."""

    opcode = _ANALOG

    def said(self, data: bytes) -> bytes:
        """Add it."""
        return b"0|05" if data == b"0" else data


@fault("4.33/2")
class AnalogComma(_Says):
    """An analog value has a comma for its decimal point."""

    opcode = _ANALOG

    def said(self, data: bytes) -> bytes:
        """Replace it."""
        return data.replace(b".", b",")


@fault("4.33/2")
class AnalogZeroIsError(_Says):
    """An analog value of 0 is answered as an error."""

    opcode = _ANALOG

    def said(self, data: bytes) -> bytes:
        """Take it for none."""
        return b"0" if data in (b"1|0", b"1|0.0") else data


@fault("4.33/2")
class AnalogOfTheFirstInput(Brain):
    """Every analog input is answered with the value of the first."""

    def get_analog_input(self, request: Request) -> float | None:
        """Read the first."""
        value = super().get_analog_input(request)
        return None if value is None else self.plant.analog_inputs[1]


@fault("4.33/2")
class AnalogFreezes(Brain):
    """An analog input is read once and then stays as it was."""

    def get_analog_input(self, request: Request) -> float | None:
        """Keep the first."""
        kept: dict[int, float | None] = self.__dict__.setdefault("kept", {})
        return kept.setdefault(request.value, super().get_analog_input(request))


@fault("4.33/3")
class AnalogPortsFromZero(Brain):
    """Port 00 is answered with an analog value."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take 0 for 1."""
        if frame.opcode == _ANALOG and frame.data == b"00":
            frame = frame._replace(data=b"01")
        super().handle(session, frame, now_s)


@fault("4.33/3")
class AnalogPortsByTheirLastDigit(Brain):
    """Of a port number only the last digit counts."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Look at that one."""
        if frame.opcode == _ANALOG:
            frame = frame._replace(data=b"0" + frame.data[-1:])
        super().handle(session, frame, now_s)


@fault("4.33/3")
class AnalogErrorsAreZero(_Says):
    """A port that does not exist is answered with the value 0."""

    opcode = _ANALOG

    def said(self, data: bytes) -> bytes:
        """Send a value."""
        return b"1|0" if data == b"0" else data


# ---------------------------------------------------------------------- 4.34


@fault("4.34/2")
class OutputsWithoutFlag(_Says):
    """The digital outputs are sent without the flag before them."""

    opcode = _OUTPUTS

    def said(self, data: bytes) -> bytes:
        """Leave it away."""
        return data.removeprefix(b"1|")


@fault("4.34/2")
class EightOutputs(_Says):
    """Only eight digital outputs are shown."""

    opcode = _OUTPUTS

    def said(self, data: bytes) -> bytes:
        """Leave the others away."""
        return data[:2] + data[-8:]


@fault("4.34/2")
class OutputsAsHex(_Says):
    """The digital outputs are sent as four hexadecimal digits."""

    opcode = _OUTPUTS

    def said(self, data: bytes) -> bytes:
        """Convert them."""
        return b"1|%04X" % _number(data)


@fault("4.34/2")
class OutputsInGroups(_Says):
    """A bar stands between the digits of outputs 9 and 8."""

    opcode = _OUTPUTS

    def said(self, data: bytes) -> bytes:
        """Write it."""
        return data[:10] + b"|" + data[10:]


@fault("4.34/4", "4.34/2")
class OutputsOfLengthThree(_DeclaresThree):
    """The digital outputs are sent with the printed length of 3."""

    opcode = _OUTPUTS


@fault("4.34/4", "4.34/2", subtle=True)
class OutputsLoseLeadingZeros(_Says):
    """While a program runs the digital outputs are sent without their leading zeros."""

    opcode = _OUTPUTS

    def said(self, data: bytes) -> bytes:
        """Drop them."""
        return b"1|" + (data[2:].lstrip(b"0") or b"0") if self.robot.task else data


@fault("4.34/3", "4.32/6")
class OutputsFromPortOne(_Says):
    """The digital outputs begin with port 1 and end with port 16."""

    opcode = _OUTPUTS

    def said(self, data: bytes) -> bytes:
        """Turn them round."""
        return data[:2] + data[:1:-1]


@fault("4.34/2", "3/31", subtle=True)
class OutputsUnansweredWhileRunning(Brain):
    """While a program runs nobody answers what the digital outputs are."""

    def get_digital_outputs(self, request: Request) -> str | Silence:  # type: ignore[override] # that is what is wrong
        """Say nothing."""
        return SILENCE if self.robot.task else super().get_digital_outputs(request)
