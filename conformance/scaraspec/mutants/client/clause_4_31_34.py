"""Mutants of clauses 4.31 to 4.34: inputs and outputs."""

from typing import Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.errors import Refused
from scaraspec.mutants.client import mutant, row
from scaraspec.mutants.operators.client.messages import (
    numbered_request,
    refusal_returns,
    reply_data,
    request_after,
    request_data,
    request_fields,
    returned,
    unchecked,
)
from scaraspec.protocol.commands import BY_NAME

_INPUTS: Final = "get_digital_inputs"
_OUTPUTS: Final = "get_digital_outputs"
_SET: Final = "set_digital_output"
_ANALOG: Final = "get_analog_input"


# 4.31

row(
    "input-is-asked-for-by-port",
    "4.31/1",
    "The request for the digital inputs contains a port.",
    request_data(_INPUTS, lambda data: data + b"1"),
)
row(
    "error-names-the-port",
    "4.31/1",
    "From the second time on, the request for the digital inputs contains a port.",
    numbered_request(_INPUTS, lambda data, number: data + b"8" if number > 1 else data),
    subtle=True,
)
row(
    "inputs-are-reversed",
    "4.31/3",
    "The digital inputs are returned with port 1 leftmost.",
    returned(_INPUTS, lambda bits: bits[::-1]),
)
row(
    "inputs-lose-their-zeros",
    "4.31/3",
    "The digital inputs are returned without leading zeros.",
    returned(_INPUTS, lambda bits: f"{int(bits)}"),
    subtle=True,
)
row(
    "input-six-is-skipped",
    "4.31/3",
    "The digital inputs are returned without port 6, as in the document's list.",
    returned(_INPUTS, lambda bits: "0" + bits[:2] + bits[3:]),
    subtle=True,
)
row(
    "inputs-are-rotated",
    "4.31/3",
    "Each digital input is returned one place further left.",
    returned(_INPUTS, lambda bits: bits[1:] + bits[:1]),
    subtle=True,
)

# 4.32

row(
    "output-behind-its-value",
    "4.32/1",
    "The value of an output is sent before the port.",
    request_fields(_SET, lambda fields: fields[::-1]),
)
row(
    "output-behind-comma",
    "4.32/1",
    "Port and value of an output are separated by a comma.",
    request_data(_SET, lambda data: data.replace(b"|", b",")),
)
row(
    "outputs-count-from-zero",
    "4.32/1",
    "The ports of outputs are counted from 0.",
    request_fields(_SET, lambda fields: [b"%d" % (int(fields[0]) - 1), fields[1]]),
    subtle=True,
)
row(
    "outputs-of-one-digit",
    "4.32/1",
    "Only the last digit of the port of an output is sent.",
    request_fields(_SET, lambda fields: [fields[0][-1:], fields[1]]),
    subtle=True,
)
row(
    "outputs-are-set-to-words",
    "4.32/1 4.32/2",
    "The value of an output is sent as the word true or false.",
    request_fields(_SET, lambda fields: [fields[0], b"true" if fields[1] == b"1" else b"false"]),
)
row(
    "outputs-are-set-to-anything",
    "4.32/2",
    "Any whole number is sent as the value of an output.",
    unchecked(_SET, lambda value: value not in (0, 1) and value == int(value), field=1),
    subtle=True,
)
row(
    "outputs-are-set-by-halves",
    "4.32/2",
    "A fraction between 0 and 1 is sent as the value of an output.",
    unchecked(_SET, lambda value: 0 < value < 1, field=1),
    subtle=True,
)

# 4.33

row(
    "analog-port-unpadded",
    "4.33/1",
    "The number of an analog input is sent without leading zero.",
    request_data(_ANALOG, lambda data: data.lstrip(b"0")),
)
row(
    "analog-port-in-three-digits",
    "4.33/1",
    "The number of an analog input is sent in three digits.",
    request_data(_ANALOG, lambda data: data.rjust(3, b"0")),
)
row(
    "analog-port-behind-blank",
    "4.33/1",
    "The number of an analog input is padded with a space.",
    request_data(_ANALOG, lambda data: data.lstrip(b"0").rjust(2)),
)
row(
    "analog-port-in-hexadecimals",
    "4.33/1",
    "The number of an analog input is sent in hexadecimal.",
    request_data(_ANALOG, lambda data: b"%02X" % int(data)),
    subtle=True,
)
row(
    "analog-port-beyond-two-digits",
    "4.33/1",
    "The number of an analog input is sent although it has three digits.",
    unchecked(_ANALOG, lambda value: value > 99),
    subtle=True,
)


@mutant("zero-is-an-error", "4.33/4")
class RaisesOnZero(AsyncClient):
    """The analog value 0 is reported as an error."""

    async def get_analog_input(self, port: int) -> float:
        value = await super().get_analog_input(port)
        if not value:
            raise Refused(BY_NAME[_ANALOG])
        return value


row(
    "error-is-zero",
    "4.33/4",
    "An error is returned as the analog value 0.",
    refusal_returns(_ANALOG, 0.0),
)


@mutant("error-is-the-last-value", "4.33/4", subtle=True)
class RepeatsAnalogValue(AsyncClient):
    """After an error, the previous analog value is returned."""

    _last: float | None = None

    async def get_analog_input(self, port: int) -> float:
        try:
            self._last = await super().get_analog_input(port)
        except Refused:
            if self._last is None:
                raise
        return self._last


row(
    "zero-with-decimals-is-an-error",
    "4.33/4",
    "An analog value between 0 and 1 is reported as an error.",
    reply_data(_ANALOG, lambda data: b"0" if data.startswith(b"1|0.") else data),
    subtle=True,
)

# 4.34

row(
    "output-is-asked-for-by-port",
    "4.34/1",
    "The request for the digital outputs contains a port.",
    request_data(_OUTPUTS, lambda data: data + b"1"),
)
row(
    "output-is-asked-for-as-it-was-set",
    "4.34/1",
    "The request for the digital outputs contains the port that was set last.",
    request_after(_OUTPUTS, _SET, lambda data, last: data + last.partition(b"|")[0]),
    subtle=True,
)
row(
    "outputs-are-reversed",
    "4.34/3",
    "The digital outputs are returned with port 1 leftmost.",
    returned(_OUTPUTS, lambda bits: bits[::-1]),
)
row(
    "output-bytes-are-swapped",
    "4.34/3",
    "The lower eight digital outputs are returned before the upper eight.",
    returned(_OUTPUTS, lambda bits: bits[8:] + bits[:8]),
    subtle=True,
)
row(
    "upper-outputs-are-forgotten",
    "4.34/3",
    "The upper eight digital outputs are returned as 0.",
    returned(_OUTPUTS, lambda bits: "0" * 8 + bits[8:]),
    subtle=True,
)
