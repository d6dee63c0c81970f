"""Mutants of clauses 4.31, 4.33 and 4.34: reading digital inputs, analog inputs and outputs."""

from collections.abc import Mapping
from types import MappingProxyType

from scaraspec.mutants.controller import mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply, length_byte
from scaraspec.mutants.operators.controller.requests import after, answer, ignores, reads
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

_INPUTS, _ANALOG, _OUTPUTS = "get_digital_inputs", "get_analog_input", "get_digital_outputs"


def _number(data: bytes) -> int:
    """Return the digits after the flag as one number."""
    return int(data.rpartition(b"|")[2], 2)


def _without_flag(data: bytes) -> bytes:
    return data.removeprefix(b"1|")


def _reversed_digits(data: bytes) -> bytes:
    return data[:2] + data[:1:-1]


def _executes(core: ControllerCore) -> bool:
    return core.robot.task is not None


# 4.31

row(
    "inputs-without-flag",
    "4.31/2",
    "The digital inputs are sent without the flag.",
    first_reply(_INPUTS, _without_flag),
)
row(
    "inputs-as-one-byte",
    "4.31/2",
    "The digital inputs are sent as the bits of one byte.",
    first_reply(_INPUTS, lambda data: b"1|" + bytes([_number(data)])),
)
row(
    "inputs-without-port-six",
    "4.31/2",
    "The digital inputs have no digit for port 6, which is missing in the list of L651.",
    first_reply(_INPUTS, lambda data: data[:4] + data[5:]),
)
row(
    "inputs-between-bars",
    "4.31/2",
    "The digits of the digital inputs are separated by bars.",
    first_reply(_INPUTS, lambda data: b"1|" + b"|".join(bytes([digit]) for digit in data[2:])),
)
row(
    "inputs-of-length-three",
    "4.31/4 4.31/2",
    "The length byte of the digital inputs is 3, as the document prints it.",
    length_byte(_INPUTS, lambda _: 3),
)
row(
    "inputs-as-hex-while-running",
    "4.31/4 4.31/2",
    "While a program runs, the digital inputs are sent as two hexadecimal digits.",
    first_reply(_INPUTS, lambda data: b"1|%02X" % _number(data), when=_executes),
    subtle=True,
)
row(
    "inputs-from-port-one",
    "4.31/3 4.31/2",
    "The digital inputs begin with port 1 and end with port 8.",
    first_reply(_INPUTS, _reversed_digits),
)
row(
    "inputs-show-their-neighbour",
    "4.31/3 4.31/2",
    "Input 8 has the state of input 7.",
    answer(_INPUTS, lambda digits: digits[1] + digits[1:]),
)


@mutant("inputs-freeze", "4.31/3", "4.31/2")
class RepeatsFirstInputs(ControllerCore):
    """The digital inputs are read once and never change after that."""

    _first = ""

    def get_digital_inputs(self, request: Request) -> str:
        self._first = self._first or super().get_digital_inputs(request)
        return self._first


# 4.33

row(
    "analog-without-flag",
    "4.33/2",
    "An analog value is sent without the flag.",
    first_reply(_ANALOG, _without_flag),
)
row(
    "analog-with-unit",
    "4.33/2",
    "A unit follows an analog value.",
    first_reply(_ANALOG, lambda data: data + b"V" if data.startswith(b"1|") else data),
)
row(
    "analog-errors-are-reasoned",
    "4.33/2",
    "A port that is no analog input is answered with 0 and a code.",
    first_reply(_ANALOG, {b"0": b"0|05"}),
)
row(
    "analog-comma",
    "4.33/2",
    "An analog value has a decimal comma.",
    first_reply(_ANALOG, lambda data: data.replace(b".", b",")),
)
row(
    "analog-zero-is-error",
    "4.33/2",
    "An analog value of 0 is answered as an error.",
    first_reply(_ANALOG, {b"1|0": b"0", b"1|0.0": b"0"}),
)
row(
    "analog-of-the-first-input",
    "4.33/2",
    "Every analog input is answered with the value of the first.",
    after(
        _ANALOG,
        lambda core, _, value: None if value is None else core.plant.analog_inputs[1],
    ),
)


@mutant("analog-freezes", "4.33/2")
class RepeatsFirstValues(ControllerCore):
    """Each analog input is read once and never changes after that."""

    _values: Mapping[int, float | None] = MappingProxyType({})

    def get_analog_input(self, request: Request) -> float | None:
        self._values = {request.value: super().get_analog_input(request), **self._values}
        return self._values[request.value]


row(
    "analog-ports-from-zero",
    "4.33/3",
    "Port 00 is answered with the analog value of port 01.",
    reads(_ANALOG, lambda data: b"01" if data == b"00" else data),
)
row(
    "analog-ports-by-their-last-digit",
    "4.33/3",
    "Only the last digit of a port number is read.",
    reads(_ANALOG, lambda data: b"0" + data[-1:]),
)
row(
    "analog-errors-are-zero",
    "4.33/3",
    "A port that does not exist is answered with the value 0.",
    first_reply(_ANALOG, {b"0": b"1|0"}),
)

# 4.34

row(
    "outputs-without-flag",
    "4.34/2",
    "The digital outputs are sent without the flag.",
    first_reply(_OUTPUTS, _without_flag),
)
row(
    "eight-outputs",
    "4.34/2",
    "Only eight digital outputs are sent.",
    first_reply(_OUTPUTS, lambda data: data[:2] + data[-8:]),
)
row(
    "outputs-as-hex",
    "4.34/2",
    "The digital outputs are sent as four hexadecimal digits.",
    first_reply(_OUTPUTS, lambda data: b"1|%04X" % _number(data)),
)
row(
    "outputs-in-groups",
    "4.34/2",
    "A bar separates the digits of outputs 9 and 8.",
    first_reply(_OUTPUTS, lambda data: data[:10] + b"|" + data[10:]),
)
row(
    "outputs-of-length-three",
    "4.34/4 4.34/2",
    "The length byte of the digital outputs is 3, as the document prints it.",
    length_byte(_OUTPUTS, lambda _: 3),
)
row(
    "outputs-lose-leading-zeros",
    "4.34/4 4.34/2",
    "While a program runs, the digital outputs are sent without their leading zeros.",
    first_reply(_OUTPUTS, lambda data: b"1|" + (data[2:].lstrip(b"0") or b"0"), when=_executes),
    subtle=True,
)
row(
    "outputs-from-port-one",
    "4.34/3 4.32/6",
    "The digital outputs begin with port 1 and end with port 16.",
    first_reply(_OUTPUTS, _reversed_digits),
)
row(
    "outputs-unanswered-while-running",
    "4.34/2 3/31",
    "While a program runs, requests for the digital outputs are not answered.",
    ignores(_OUTPUTS, lambda core, _: _executes(core)),
    subtle=True,
)
