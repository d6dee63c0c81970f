"""Faults of clause 4.32: setting a digital output."""

import re
from abc import ABC, abstractmethod
from typing import Any

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.commands import Command, PortValue
from scaraspec.protocol.frames import Frame
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import NoSuchPortError
from scaraspec.virtual_controller.session import Request, Session

_SET = 0x43


@mutant("setting-is-echoed", "4.32/4")
class SettingIsEchoed(AltersReplies):
    """A setting is answered with its port and value."""

    opcode = _SET
    _asked = b""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember them."""
        self._asked = frame.data
        super().handle(session, frame, now_s)

    def altered(self, data: bytes) -> bytes:
        """Send them back."""
        return self._asked if data == b"1" else data


@mutant("refusals-of-ports-are-reasoned", "4.32/4")
class RefusalsOfPortsAreReasoned(AltersReplies):
    """A setting that fails is answered with a code behind the 0."""

    opcode = _SET

    def altered(self, data: bytes) -> bytes:
        """Add it."""
        return b"0|05" if data == b"0" else data


@mutant("refuses-and-sets-above-eight", "4.32/4", "4.32/6")
class RefusesAndSetsAboveEight(ControllerCore):
    """A setting of an output above 8 is answered as failed, and is carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say no."""
        return super().set_digital_output(request) and request.value.port <= 8


@mutant("settings-are-lost-while-running", "4.32/4", "4.32/6", subtle=True)
class SettingsAreLostWhileRunning(ControllerCore):
    """While a program runs a setting is answered as done, and is not carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say yes."""
        return True if self.robot.task else super().set_digital_output(request)


@mutant("settings-are-lost-while-moving", "4.32/4", "4.32/6", subtle=True)
class SettingsAreLostWhileMoving(ControllerCore):
    """While the arm moves or jogs a setting is answered as done, and is not carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say yes."""
        task = self.robot.task
        moves = task is not None and task.request.command.name in ("jog", "set_tool_coordinates")
        return moves or super().set_digital_output(request)


@mutant("settings-are-lost-while-released", "4.32/4", "4.32/6", subtle=True)
class SettingsAreLostWhileReleased(ControllerCore):
    """While the joints are released a setting is answered as done, and is not carried out."""

    def set_digital_output(self, request: Request) -> bool:
        """Say yes."""
        return not self.plant.locked or super().set_digital_output(request)


class _Parses(ControllerCore, ABC):
    """Reads settings in a way of its own."""

    @abstractmethod
    def parsed(self, data: bytes) -> PortValue | None:
        """The setting; None to read it as it should be."""

    def _value(self, command: Command, frame: Frame) -> Any:
        read = self.parsed(frame.data) if command.name == "set_digital_output" else None
        return super()._value(command, frame) if read is None else read


@mutant("ports-in-one-byte", "4.32/5")
class PortsInOneByte(_Parses):
    """Of a port number only the lowest byte counts."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Cut it."""
        read = re.fullmatch(rb"([0-9]+)\|([01])", data)
        return PortValue(int(read[1]) & 0xFF, int(read[2])) if read else None


@mutant("ports-from-zero", "4.32/5")
class PortsFromZero(_Parses):
    """Port 0 sets the first output."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Take 0 for 1."""
        read = re.fullmatch(rb"0+\|([01])", data)
        return PortValue(1, int(read[1])) if read else None


@mutant("ports-below-zero", "4.32/5")
class PortsBelowZero(_Parses):
    """A negative port number counts the outputs from the end."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Count backwards."""
        read = re.fullmatch(rb"-([0-9]+)\|([01])", data)
        return PortValue(17 - int(read[1]), int(read[2])) if read else None


@mutant("says-it-has-set-any-port", "4.32/5")
class SaysItHasSetAnyPort(AltersReplies):
    """A setting is always answered as done, whether there is such a port or not."""

    opcode = _SET

    def altered(self, data: bytes) -> bytes:  # noqa: ARG002 - whatever is true
        """Say yes."""
        return b"1"


class _Sets(ControllerCore):
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


@mutant("settings-never-switch-off", "4.32/6")
class SettingsNeverSwitchOff(_Sets):
    """A setting to 0 is answered as done, and has no effect."""

    def put(self, port: int, *, on: bool) -> None:
        """Only switch on."""
        if on:
            super().put(port, on=True)


@mutant("settings-toggle", "4.32/6")
class SettingsToggle(_Sets):
    """A setting to 1 switches an output over, so that a second one switches it off."""

    def put(self, port: int, *, on: bool) -> None:
        """Switch over."""
        super().put(port, on=on and not self.plant.digital_outputs[port])


@mutant("settings-clear-the-others", "4.32/6")
class SettingsClearTheOthers(_Sets):
    """A setting switches all other outputs off."""

    def put(self, port: int, *, on: bool) -> None:
        """Clear first."""
        super().put(port, on=on)
        for other, _ in enumerate(self.plant.digital_outputs, start=1):
            if other != port:
                super().put(other, on=False)


@mutant("settings-of-pairs", "4.32/6", subtle=True)
class SettingsOfPairs(_Sets):
    """Output 16 is set together with output 8."""

    def put(self, port: int, *, on: bool) -> None:
        """Set both."""
        super().put(port, on=on)
        if port == 8:
            super().put(16, on=on)


@mutant("settings-beyond-the-last-wrap", "4.32/6", subtle=True)
class SettingsBeyondTheLastWrap(_Sets):
    """A setting of a port from 17 to 40 is answered as done, and sets one of the outputs."""

    def put(self, port: int, *, on: bool) -> None:
        """Count round."""
        super().put((port - 1) % 16 + 1 if 16 < port <= 40 else port, on=on)


@mutant("highest-output-is-dead", "4.32/6", subtle=True)
class HighestOutputIsDead(_Sets):
    """A setting of output 16 is answered as done, and has no effect."""

    def put(self, port: int, *, on: bool) -> None:
        """Set the others."""
        if port < 16:
            super().put(port, on=on)


@mutant("outputs-show-late", "4.32/6", subtle=True)
class OutputsShowLate(ControllerCore):
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


@mutant("outputs-go-off-with-the-link", "4.32/6", subtle=True)
class OutputsGoOffWithTheLink(ControllerCore):
    """The outputs go off when a connection ends."""

    def close(self, connection: int, now_s: float) -> list[Any]:
        """Switch them off."""
        for port, _ in enumerate(self.plant.digital_outputs, start=1):
            self.plant.digital_outputs[port] = False
        return super().close(connection, now_s)


@mutant("no-more-than-eight-outputs", "4.32/6", subtle=True)
class NoMoreThanEightOutputs(_Sets):
    """While eight outputs are on, no further one comes on, though that is answered as done."""

    def put(self, port: int, *, on: bool) -> None:
        """Count them."""
        if not on or sum(self.plant.digital_outputs) < 8:
            super().put(port, on=on)


@mutant("settings-wear-out", "4.32/6", subtle=True)
class SettingsWearOut(_Sets):
    """After the 150th setting none has an effect any more."""

    _count = 0

    def put(self, port: int, *, on: bool) -> None:
        """Count them."""
        self._count += 1
        if self._count <= 150:
            super().put(port, on=on)


@mutant("settings-as-in-c", "4.32/7")
class SettingsAsInC(_Parses):
    """Numbers of a setting are read as far as they go, and what stands behind is left out."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read on leniently."""
        read = re.match(rb"\s*([0-9]+)[^|]*\|\s*([01])", data)
        return PortValue(int(read[1]), int(read[2])) if read else None


@mutant("settings-with-any-separator", "4.32/7")
class SettingsWithAnySeparator(_Parses):
    """Any byte may stand between port and value."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read on leniently."""
        read = re.fullmatch(rb"([0-9]+)[^0-9]([01])", data, re.DOTALL)
        return PortValue(int(read[1]), int(read[2])) if read else None


@mutant("settings-without-value", "4.32/7")
class SettingsWithoutValue(_Parses):
    """A port without a value is switched on."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Switch it on."""
        read = re.fullmatch(rb"([0-9]+)\|?", data)
        return PortValue(int(read[1]), 1) if read else None


@mutant("settings-of-the-first-two", "4.32/7")
class SettingsOfTheFirstTwo(_Parses):
    """What follows behind port and value is left out."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read the first two."""
        read = re.match(rb"([0-9]+)\|([01])\|", data)
        return PortValue(int(read[1]), int(read[2])) if read else None


@mutant("settings-by-characters", "4.32/7")
class SettingsByCharacters(_Parses):
    """Any character but 0 counts for 1 as a value."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Read the character."""
        read = re.fullmatch(rb"([0-9]+)\|([^0-9|].*)", data, re.DOTALL)
        return PortValue(int(read[1]), 1) if read else None


@mutant("empty-settings-clear-all", "4.32/7")
class EmptySettingsClearAll(ControllerCore):
    """A setting without data switches all outputs off."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Look for it."""
        if frame.opcode == _SET and not frame.data:
            for port, _ in enumerate(self.plant.digital_outputs, start=1):
                self.plant.digital_outputs[port] = False
        super().handle(session, frame, now_s)


@mutant("other-values-set-the-next-port", "4.32/7")
class OtherValuesSetTheNextPort(_Parses):
    """A value of two digits is written over two ports."""

    def parsed(self, data: bytes) -> PortValue | None:
        """Overrun."""
        read = re.fullmatch(rb"([0-9]+)\|[0-9]{2,}", data)
        return PortValue(int(read[1]) - 1, 1) if read else None
