"""Ports: reads, sets and restores the digital outputs, and reads the inputs.

This module reverses the digits of replies: the leftmost digit is the highest port (L651, L684).
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Final

from scaraspec.protocol.commands import PortValue
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.lag import measure
from scaraspec.suite.controller.harness.state_lag import State
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, expect, expect_equal
from scaraspec.user_message import UserMessage

ALL_OUTPUTS: Final = range(1, 17)
"""The ports of 0x49 (L687)."""

ALL_INPUTS: Final = range(1, 9)
"""The ports of 0x42 (L651)."""

_LOOKS, _LOOK_S = 10, 0.1

Bits = tuple[bool, ...]
"""The states of ports in the order of their numbers, beginning with port 1."""


_FORMS: Final = {
    "get_digital_inputs": (ALL_INPUTS, "4.31/2", "A-4.31-4"),
    "get_digital_outputs": (ALL_OUTPUTS, "4.34/2", "A-4.34-1"),
}


def expect_form(subject: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """Query the states of ports and check the form of the reply (L646, L682).

    Raises:
        CaseFailed: The reply has neither one digit per port nor an error, which is tolerated.
    """
    ports, requirement, register = _FORMS[name]
    answer = line.ask(name)
    if answer.seen.text == b"0":
        subject.tolerate(
            requirement,
            register,
            "0",
            UserMessage("{command} is answered with an error", command=name),
        )
        return
    expect(
        re.fullmatch(rb"1\|[01]{%d}" % len(ports), answer.seen.text),
        UserMessage("the reply to {command} does not have one digit per port", command=name),
        expected=UserMessage(
            "1| and {digit_count} digits, each 0 or 1: {count} bytes",
            digit_count=len(ports),
            count=len(ports) + 2,
        ),
        observed=f"{answer}",
        requirement=requirement,
    )


def outputs(line: OutgoingConnection) -> Bits:
    """Query the states of all digital outputs (0x49).

    Raises:
        CaseFailed: The reply does not have sixteen digits.
        CaseInconclusive: The subject reports an error.
    """
    return _bits(line, "get_digital_outputs", "4.34/2")


def inputs(line: OutgoingConnection) -> Bits:
    """Query the states of all digital inputs (0x42).

    Raises:
        CaseFailed: The reply does not have eight digits.
        CaseInconclusive: The subject reports an error.
    """
    return _bits(line, "get_digital_inputs", "4.31/2")


def _bits(line: OutgoingConnection, name: str, requirement: str) -> Bits:
    answer = line.ask(name)
    if answer.seen.text == b"0":
        raise CaseInconclusive(UserMessage("{command} is answered with an error", command=name))
    if not isinstance(answer.value, str):
        message = UserMessage(
            "the reply to {command} does not have one digit per port", command=name
        )
        raise CaseFailed(
            message, expected="1| and digits", observed=f"{answer}", requirement=requirement
        )
    return tuple(digit == "1" for digit in reversed(answer.value))


def digits(bits: Bits) -> str:
    """Return the digits of a reply with these states, the highest port first."""
    return "".join("1" if bit else "0" for bit in reversed(bits))


def with_port(bits: Bits, port: int, *, on: bool) -> Bits:
    """Return these states with another state of one port."""
    return (*bits[: port - 1], on, *bits[port:])


def set_output(line: OutgoingConnection, port: int, *, on: bool) -> ReceivedFrame:
    """Request to set a digital output (0x43), and return the reply."""
    return line.ask("set_digital_output", PortValue(port, int(on)))


def settable_outputs(line: OutgoingConnection) -> list[int]:
    """Return the ports that 0x43 accepts; each is set to its current state.

    Raises:
        CaseInconclusive: 0x43 accepts none of the ports.
    """
    now = outputs(line)
    ports = [port for port in ALL_OUTPUTS if set_output(line, port, on=now[port - 1]).accepted]
    if not ports:
        raise CaseInconclusive("the subject accepts none of its ports as a digital output")
    return ports


def expect_outputs(
    line: OutgoingConnection, expected: Bits, message: str, *, requirement: str = ""
) -> None:
    """Require that 0x49 returns these states.

    Raises:
        CaseFailed: It returns other states.
    """
    expect_equal(digits(outputs(line)), digits(expected), message, requirement=requirement)


def expect_inputs(
    line: OutgoingConnection, expected: Bits, message: str, *, requirement: str = ""
) -> None:
    """Require that 0x42 returns these states.

    Raises:
        CaseFailed: It returns other states.
    """
    expect_equal(digits(inputs(line)), digits(expected), message, requirement=requirement)


@contextmanager
def outputs_preserved(line: OutgoingConnection) -> Iterator[Bits]:
    """Yield the states of the outputs, and restore them when the context ends.

    If the connection is lost, the end of the run restores them.
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
    """Return the inputs that did not change during a second; observed once per run."""
    traits = line.subject.traits
    if traits.stable_inputs is None:
        seen = [inputs(line)]
        for _ in range(_LOOKS):
            line.wait(_LOOK_S)
            seen.append(inputs(line))
        traits.stable_inputs = frozenset(
            port for port in ALL_INPUTS if len({states[port - 1] for states in seen}) == 1
        )
    return [port for port in ports if port in traits.stable_inputs]


@contextmanager
def inputs_unchanged(line: OutgoingConnection, ports: Iterable[int] = ALL_INPUTS) -> Iterator[Bits]:
    """Yield the states of the inputs. A failure does not count if one of these inputs changes.

    Raises:
        CaseInconclusive: An input has changed.
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


@contextmanager
def readable_inputs(
    line: OutgoingConnection, ports: Iterable[int]
) -> Iterator[tuple[Bits, list[int]]]:
    """Yield the states of the inputs, and those of these ports that do not change.

    Without the command that reports inputs, there are none. See `inputs_unchanged`.
    """
    if "get_digital_inputs" in line.subject.ics.unsupported:
        yield (), []
        return
    stable = stable_inputs(line, ports)
    with inputs_unchanged(line, stable) as states:
        yield states, stable


class InputDriver:
    """Sets the digital inputs with the hook ``set_input``; created by `driven_inputs`.

    Attributes:
        now: The states that were set.
    """

    def __init__(self, subject: ControllerUnderTest, line: OutgoingConnection, now: Bits) -> None:
        self.now = now
        self._subject, self._line = subject, line

    def __call__(self, port: int, *, on: bool) -> None:
        """Set one input."""
        self.set_ports({port: on})

    def set_ports(self, states: Mapping[int, bool]) -> None:
        """Set inputs by port; an operator is asked once for all of them."""
        changes = {port: on for port, on in states.items() if self.now[port - 1] != on}
        for port, on in changes.items():  # also restored if the hook fails
            self.now = with_port(self.now, port, on=on)
        if changes:
            values = ({"port": port, "value": int(on)} for port, on in changes.items())
            self._subject.hook_each("set_input", *values)

    def probe_lag(self) -> None:
        """Measure once how late the inputs are reported, with a change and its reversal."""
        lag = self._subject.lag
        if lag.inputs_driven or self._subject.hooks.asks("set_input"):
            return  # an operator is too slow
        lag.inputs_driven = True
        lags = []
        for on in (not self.now[0], self.now[0]):
            self(1, on=on)
            lags.append(measure(self._subject, self._line, lambda: inputs(self._line) == self.now))
        for each in filter(None, lags):
            lag.note(State.INPUTS, each)


@contextmanager
def driven_inputs(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[InputDriver]:
    """Yield a driver of the inputs, and restore their states when the context ends.

    Raises:
        CaseSkipped: The ICS names no hook ``set_input``.
        CaseInconclusive: The hook failed.
    """
    before = inputs(line)
    drive = InputDriver(subject, line, before)
    try:
        drive.probe_lag()
        yield drive
    finally:
        drive.set_ports(dict(enumerate(before, 1)))
