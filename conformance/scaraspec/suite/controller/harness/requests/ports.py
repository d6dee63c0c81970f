"""Ports: reading and setting the digital outputs, and putting them back; reading the inputs.

Digits are turned round here once and for all: the leftmost is the highest port (L651, L684).
"""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

from scaraspec.protocol.commands import PortValue
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, expect, expect_equal
from scaraspec.user_message import UserMessage

ALL_OUTPUTS: Final = range(1, 17)
"""The ports of 0x49 (L687)."""

ALL_INPUTS: Final = range(1, 9)
"""The ports of 0x42 (L651)."""

_LOOKS, _LOOK_S = 10, 0.1

Bits = tuple[bool, ...]
"""The states of ports in the order of their numbers, that of port 1 first."""


_FORMS: Final = {
    "get_digital_inputs": (ALL_INPUTS, "4.31/2", "A-4.31-4"),
    "get_digital_outputs": (ALL_OUTPUTS, "4.34/2", "A-4.34-1"),
}


def expect_form(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """Ask for the states of ports, and hold what comes against its form (L646, L682).

    Raises:
        CaseFailed: It is neither one digit a port nor an error, which is tolerated.
    """
    ports, requirement, register = _FORMS[name]
    answer = line.ask(name)
    if answer.seen.text == b"0":
        subject.tolerate(
            requirement, register, "0", UserMessage("{name} is answered with an error", name=name)
        )
        return
    expect(
        re.fullmatch(rb"1\|[01]{%d}" % len(ports), answer.seen.text),
        UserMessage("{name} is not answered with one digit a port", name=name),
        expected=f"1| and {len(ports)} digits, each 0 or 1: {len(ports) + 2} bytes",
        observed=f"{answer}",
        requirement=requirement,
    )


def outputs(line: OutgoingConnection) -> Bits:
    """The states of all digital outputs (0x49).

    Raises:
        CaseFailed: They are not sixteen digits.
        CaseInconclusive: The subject reports an error.
    """
    return _bits(line, "get_digital_outputs", "4.34/2")


def inputs(line: OutgoingConnection) -> Bits:
    """The states of all digital inputs (0x42).

    Raises:
        CaseFailed: They are not eight digits.
        CaseInconclusive: The subject reports an error.
    """
    return _bits(line, "get_digital_inputs", "4.31/2")


def _bits(line: OutgoingConnection, name: str, requirement: str) -> Bits:
    answer = line.ask(name)
    if answer.seen.text == b"0":
        raise CaseInconclusive(UserMessage("{name} is answered with an error", name=name))
    if not isinstance(answer.value, str):
        message = UserMessage("{name} is not answered with one digit a port", name=name)
        raise CaseFailed(
            message, expected="1| and digits", observed=f"{answer}", requirement=requirement
        )
    return tuple(digit == "1" for digit in reversed(answer.value))


def digits(bits: Bits) -> str:
    """States as they are sent, the highest port first."""
    return "".join("1" if bit else "0" for bit in reversed(bits))


def with_port(bits: Bits, port: int, *, on: bool) -> Bits:
    """These states but for one port."""
    return (*bits[: port - 1], on, *bits[port:])


def set_output(line: OutgoingConnection, port: int, *, on: bool) -> ReceivedFrame:
    """Set a digital output (0x43), or try to."""
    return line.ask("set_digital_output", PortValue(port, int(on)))


def settable_outputs(line: OutgoingConnection) -> list[int]:
    """The ports of 0x49 that 0x43 takes for outputs; each is set to what it is.

    Raises:
        CaseInconclusive: There are none.
    """
    now = outputs(line)
    ports = [port for port in ALL_OUTPUTS if set_output(line, port, on=now[port - 1]).accepted]
    if not ports:
        raise CaseInconclusive("the subject takes none of its ports for a digital output")
    return ports


def expect_outputs(
    line: OutgoingConnection, expected: Bits, message: str, *, requirement: str = ""
) -> None:
    """Fail the subject unless 0x49 shows these states.

    Raises:
        CaseFailed: It does not.
    """
    expect_equal(digits(outputs(line)), digits(expected), message, requirement=requirement)


def expect_inputs(
    line: OutgoingConnection, expected: Bits, message: str, *, requirement: str = ""
) -> None:
    """Fail the subject unless 0x42 shows these states.

    Raises:
        CaseFailed: It does not.
    """
    expect_equal(digits(inputs(line)), digits(expected), message, requirement=requirement)


@contextmanager
def outputs_preserved(line: OutgoingConnection) -> Iterator[Bits]:
    """Give the states of the outputs, and put back afterwards what has changed.

    What cannot be put back on this connection any more is left to the end of the run.
    """
    before = outputs(line)
    try:
        yield before
    finally:
        with suppress(CaseFailed, CaseInconclusive):
            for port, (was, now) in enumerate(zip(before, outputs(line), strict=False), 1):
                if was != now:
                    set_output(line, port, on=was)


def stable_inputs(line: OutgoingConnection, ports: Iterable[int]) -> list[int]:
    """Those of the inputs that do not change by themselves, as far as a moment shows."""
    seen = [inputs(line)]
    for _ in range(_LOOKS):
        line.wait(_LOOK_S)
        seen.append(inputs(line))
    return [port for port in ports if len({states[port - 1] for states in seen}) == 1]


@contextmanager
def inputs_unchanged(line: OutgoingConnection, ports: Iterable[int] = ALL_INPUTS) -> Iterator[Bits]:
    """Give the states of the inputs; what fails while these change is not a failure.

    Raises:
        CaseInconclusive: They have changed in between.
    """
    before = inputs(line)

    def changed() -> bool:
        now = inputs(line)
        return any(now[port - 1] != before[port - 1] for port in ports)

    message = "the inputs changed while programs read them"
    try:
        yield before
    except CaseFailed:
        if changed():
            raise CaseInconclusive(message) from None
        raise
    if changed():
        raise CaseInconclusive(message)


class InputDriver:
    """Drives the digital inputs by the hook ``set_input``; made by `driven_inputs`.

    Attributes:
        now: How they are driven.
    """

    def __init__(self, subject: ControllerUnderTest, now: Bits) -> None:
        self.now = now
        self._subject = subject

    def __call__(self, port: int, *, on: bool) -> None:
        """Drive one input."""
        if self.now[port - 1] != on:
            self._subject.hook("set_input", port=port, value=int(on))
            self.now = with_port(self.now, port, on=on)


@contextmanager
def driven_inputs(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[InputDriver]:
    """Drive the inputs, and afterwards drive them back to what they were.

    Raises:
        CaseSkipped: There is no hook for it.
        CaseInconclusive: The hook failed.
    """
    before = inputs(line)
    drive = InputDriver(subject, before)
    try:
        yield drive
    finally:
        for port, on in enumerate(before, 1):
            drive(port, on=on)
