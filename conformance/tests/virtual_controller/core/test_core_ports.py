"""Inputs and outputs: 4.31 to 4.34."""

from typing import Any

import pytest


def test_inputs_are_reported_port_8_first(bench: Any) -> None:
    """The first digit is that of port 8 (4.31/3, L651)."""
    client = bench.client()
    assert client.ask("get_digital_inputs") == b"1|00000000"
    bench.plant.digital_inputs[1] = True
    bench.plant.digital_inputs[7] = True
    assert client.ask("get_digital_inputs") == b"1|01000001"


def test_outputs_are_reported_port_16_first(bench: Any) -> None:
    """The first digit is that of port 16 (4.32/6, 4.34/3)."""
    client = bench.client()
    assert client.ask("set_digital_output", b"8|1") == b"1"
    assert client.ask("set_digital_output", b"16|1") == b"1"
    assert client.ask("get_digital_outputs") == b"1|1000000010000000"
    assert client.ask("set_digital_output", b"8|0") == b"1"
    assert client.ask("get_digital_outputs") == b"1|1000000000000000"


@pytest.mark.parametrize(
    "data", [b"0|1", b"17|1", b"41|1", b"8|2", b"8|-1", b"8", b"8|", b"8|1|1", b"8 1", b"x|1", b""]
)
def test_an_impossible_output_is_refused_and_changes_nothing(bench: Any, data: bytes) -> None:
    """An invalid port or value is refused (4.32/5, 4.32/7)."""
    client = bench.client()
    assert client.ask("set_digital_output", data) == b"0"
    assert client.ask("get_digital_outputs") == b"1|0000000000000000"


@pytest.mark.parametrize("port", [b"08", b"8"])
@pytest.mark.parametrize("padding", ["drawn", "free"])
def test_analog_input_value(bench_of: Any, port: bytes, padding: str) -> None:
    """4.33; a port number may have one or two digits (A-4.32-1)."""
    bench = bench_of(port_pad=padding)
    client = bench.client()
    assert client.ask("get_analog_input", port) == b"1|0"
    bench.plant.analog_inputs[8] = 4.75
    assert client.ask("get_analog_input", port) == b"1|4.75"


@pytest.mark.parametrize("port", [b"00", b"09", b"41", b"", b"x", b"-1", b"1|1"])
def test_an_invalid_analog_input_is_answered_0(bench: Any, port: bytes) -> None:
    """A port without an analog input gets the reply 0 (4.33/3)."""
    assert bench.client().ask("get_analog_input", port) == b"0"
