"""Behaviour of the port commands, 4.31 to 4.34; each kind has its own numbering (A-4.32-2)."""

from collections.abc import Iterable

from scaraspec.virtual_controller.behaviour.base import Base
from scaraspec.virtual_controller.plant import NoSuchPortError
from scaraspec.virtual_controller.session import Request


def _digits(values: Iterable[bool]) -> str:
    """Return one digit per port, the highest port leftmost (L651, L684)."""
    return "".join("1" if value else "0" for value in reversed(list(values)))


class Ports(Base):
    """The commands that read and set ports, also while a program runs."""

    def get_digital_inputs(self, _: Request) -> str:
        """4.31: the state of all digital inputs."""
        return _digits(self.plant.digital_inputs)

    def get_digital_outputs(self, _: Request) -> str:
        """4.34: the state of all digital outputs."""
        return _digits(self.plant.digital_outputs)

    def get_analog_input(self, request: Request) -> float | None:
        """4.33: the real value (A-4.33-1)."""
        try:
            return self.plant.analog_inputs[request.value]
        except NoSuchPortError:
            return None

    def set_digital_output(self, request: Request) -> bool:
        """4.32: refused if the port does not exist."""
        port, value = request.value
        try:
            self.plant.digital_outputs[port] = value == 1
        except NoSuchPortError:
            return False
        return True
