"""Clause 4.33: read an analog input (0x44, L665-675)."""

import re
from typing import Final

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.preserve import ensure_open
from scaraspec.suite.controller.harness.two_stage.commands import try_request
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect
from scaraspec.user_message import UserMessage

_FORMAT: Final = re.compile(rb"1\|[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)")
_ERROR: Final = b"0"
_DEFAULT_PORTS: Final = range(1, 9)  # the default ports (A-4.32-3)
_INVALID_PORTS: Final = (b"00", b"41", b"42", b"49", b"50", b"88", b"99")
_VALUES: Final = (0, 1, 2.5, 5)  # the limit of many converters


def _read_value(line: OutgoingConnection, port: int) -> float | None:
    """Return the value of an analog input; None if the controller reports an error."""
    reply = line.ask("get_analog_input", port)
    data = reply.seen.text
    if data == _ERROR:
        return None
    expect(
        _FORMAT.fullmatch(data),
        UserMessage("the reply for analog input {port} is not a number", port=port),
        expected="1| and a number, or 0",
        observed=f"{reply}",
    )
    return float(data[2:])


@case("4.33/2")
def test_format(line: OutgoingConnection) -> None:
    """Every port from 1 to 40 is answered "1|" and a number, or "0"."""
    for port in examples(range(1, 41)):
        _read_value(line, port)


@case("4.33/2", name="driven", needs=("set_analog",))
def test_driven(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A driven analog input reports its value, 0 as "1|0", and the others do not change."""
    before = [_read_value(line, port) for port in _DEFAULT_PORTS]
    any_driven = False
    try:
        for port in _DEFAULT_PORTS:
            any_driven |= _follows_driven_values(subject, line, port)
            subject.hook("set_analog", port=port, value=before[port - 1] or 0)
        message = "all analog inputs are answered with an error although they are driven"
        expect(any_driven, message, expected="1| and a number", observed="0")
    finally:
        for port, value in zip(_DEFAULT_PORTS, before, strict=True):
            subject.hook("set_analog", port=port, value=value or 0)


def _follows_driven_values(
    subject: ControllerUnderTest, line: OutgoingConnection, port: int
) -> bool:
    """Expect values in any unit (A-4.33-1) that are proportional to the driven ones.

    Returns:
        Whether the input exists: the number of inputs is open (A-4.32-3).
    """
    other = _DEFAULT_PORTS[port % len(_DEFAULT_PORTS)]
    before = _read_value(line, other)
    values = []
    for value in examples(_VALUES):
        subject.hook("set_analog", port=port, value=value)
        values.append(_read_value(line, port))
    if not any(value is not None for value in values):
        return False
    expect(
        None not in values,
        UserMessage("analog input {port} is driven but answered with an error", port=port),
        expected="1| and a number",
        observed="0",
    )
    zero, one, *others = [value or 0.0 for value in values]
    scale = one - zero
    proportional = [zero + scale * value for value in _VALUES[2:]]
    expect(
        scale and all(abs(a - b) <= abs(scale) for a, b in zip(others, proportional, strict=True)),
        UserMessage("analog input {port} does not follow the driven value", port=port),
        expected=UserMessage("values proportional to {values}", values=_VALUES),
        observed=f"{values}",
    )
    after = _read_value(line, other)
    expect(
        (after is None) == (before is None) and abs((after or 0) - (before or 0)) <= abs(scale),
        UserMessage(
            "analog input {other} changed when input {port} was driven", other=other, port=port
        ),
        expected=f"{before}",
        observed=f"{after}",
    )
    return True


@case("4.33/3")
def test_invalid_port(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A port 0 or above 40 is answered "0", or is ignored as an invalid argument (A-3-9)."""
    for port in examples(_INVALID_PORTS):
        line = ensure_open(subject, line)
        reply = try_request(line, "get_analog_input", data=port)
        if reply is None:
            option = "ignore" if line.ending is None else "close"
            message = UserMessage("the invalid port {port} is not answered", port=port.decode())
            subject.tolerate("4.33/3", "A-3-9", option, message)
            continue
        expect(
            reply.seen.text == _ERROR,
            UserMessage("the invalid port {port} was read", port=port.decode()),
            expected="0",
            observed=f"{reply}",
        )
