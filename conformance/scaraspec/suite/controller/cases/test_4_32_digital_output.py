"""Clause 4.32: set a digital output (0x43, L653-663); 0x49 reports it (4.34)."""

from collections.abc import Sequence
from typing import Final

from hypothesis import strategies as st

from scaraspec.protocol.commands import PortValue
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import serves_one_at_a_time
from scaraspec.suite.controller.harness.malformed.payloads import (
    Malformed,
    malformed,
    send_malformed,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    ALL_OUTPUTS,
    Bits,
    digits,
    expect_outputs,
    outputs,
    outputs_preserved,
    set_output,
    settable_outputs,
    with_port,
)
from scaraspec.suite.controller.harness.two_stage.commands import JOG, LOCK, MOVE, RELEASE
from scaraspec.suite.controller.harness.two_stage.results import locked_afterwards, release_joints
from scaraspec.suite.controller.harness.two_stage.tasks import executing_task
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseSkipped, expect, expect_equal, expect_in
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage

_MOTION: Final = (Hazard.STATE, Hazard.MOTION)
_FLAGS: Final = (b"0", b"1")
_INVALID_PORTS: Final = (
    *(b"0", b"00", b"41", b"42", b"50", b"99", b"255", b"256"),
    *(b"257", b"272", b"65537", b"4294967297", b"-1", b"-255"),
)
"""The last ones are valid ports if they are truncated or read without their sign."""


@case("4.32/6", "4.32/4")
def test_each_output(line: OutgoingConnection) -> None:
    """A setting that is answered "1" changes only its own port; otherwise nothing changes."""
    settable_outputs(line)
    with outputs_preserved(line) as before:
        current = before
        for port in ALL_OUTPUTS:
            for on in examples((not current[port - 1], current[port - 1])):
                reply = set_output(line, port, on=on)
                if reply.accepted:
                    current = with_port(current, port, on=on)
                description = UserMessage(
                    "output {port} was set to {on:d} and answered {reply}",
                    port=port,
                    on=on,
                    reply=reply,
                )
                expect_outputs(line, current, description)


@case("4.32/6", name="sequences")
def test_sequences(line: OutgoingConnection) -> None:
    """After any sequence of settings, 0x49 reports the last value of each port."""
    ports = settable_outputs(line)
    setting = st.tuples(st.sampled_from(ports), st.booleans())

    @given(st.lists(setting, min_size=1, max_size=6))
    def set_and_check(settings: list[tuple[int, bool]]) -> None:
        current = outputs(line)
        for port, on in settings:
            if set_output(line, port, on=on).accepted:
                current = with_port(current, port, on=on)
        expect_outputs(line, current, "several outputs were set one after another")

    with outputs_preserved(line):
        set_and_check()


@case("4.32/6", "3/30", name="all-at-once")
def test_all_on_and_off(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """All outputs can be set and cleared, and requests in one segment take effect in order."""
    ports = settable_outputs(line)
    with outputs_preserved(line) as before:
        current = before
        for on in (True, False):
            for port in examples(ports):
                if set_output(line, port, on=on).accepted:
                    current = with_port(current, port, on=on)
                description = UserMessage(
                    "output {port} was set to {on:d} like the previous ones", port=port, on=on
                )
                expect_outputs(line, current, description)
        if not serves_one_at_a_time(subject):
            _expect_in_order(line, ports, current)


def _expect_in_order(line: OutgoingConnection, ports: Sequence[int], current: Bits) -> None:
    """Expect that queries between settings in one segment report the outputs set before them."""
    expected_outputs, data = set[str](), b""
    for port in ports:
        current = with_port(current, port, on=True)
        expected_outputs.add(digits(current))
        data += line.request("set_digital_output", PortValue(port, 1)).encode()
        data += line.request("get_digital_outputs").encode()
    line.send_bytes(data)
    accepted = [line.reply("set_digital_output").accepted for _ in ports]
    reported = {line.reply("get_digital_outputs").value for _ in ports}
    if all(accepted):
        message = "queries did not report the outputs set before them"
        expect_equal(reported, expected_outputs, message, requirement="3/30")


@case("4.32/6", name="held")
def test_held(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An output keeps its value after the connection that set it ends."""
    port = settable_outputs(line)[-1]
    on = not outputs(line)[port - 1]
    expected_outputs = with_port(outputs(line), port, on=on)
    set_output(line, port, on=on)
    line.close()
    subject.pause(0.2)
    new_line = subject.open()
    try:
        expect_outputs(
            new_line,
            expected_outputs,
            UserMessage("output {port} was set on a connection that ended", port=port),
        )
    finally:
        set_output(new_line, port, on=not on)


@case("4.32/4", "4.32/6", name="while-running", hazards=PROGRAMS)
def test_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting an output while a program runs is answered "1" and works, or "0" without a change."""
    port = settable_outputs(line)[-1]
    with running(subject, line):
        message = UserMessage("output {port} was set while a program ran", port=port)
        _set_and_check(line, port, message)


@case("4.32/4", "4.32/6", name="while-moving", hazards=_MOTION)
def test_while_moving(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting an output during moves, jogs and with released joints is answered truthfully."""
    unsupported = subject.ics.unsupported
    moving_commands = [name for name in (MOVE, JOG) if name not in unsupported]
    can_release = unsupported.isdisjoint({RELEASE, LOCK})
    if not (moving_commands or can_release):
        raise CaseSkipped("the controller has no command that moves or releases the arm")
    port = settable_outputs(line)[-1]
    with outputs_preserved(line):
        for name in examples(moving_commands):
            with executing_task(subject, line, name):
                message = UserMessage(
                    "output {port} was set during {command}", port=port, command=name
                )
                _set_and_check(line, port, message)
        if can_release:
            with locked_afterwards(subject, line):
                release_joints(subject, line)
                message = UserMessage(
                    "output {port} was set while the joints were released", port=port
                )
                _set_and_check(line, port, message)


def _set_and_check(line: OutgoingConnection, port: int, message: str) -> None:
    before = outputs(line)
    on = not before[port - 1]
    reply = set_output(line, port, on=on)
    expected_outputs = with_port(before, port, on=on) if reply.accepted else before
    expect_outputs(
        line,
        expected_outputs,
        message,
        requirement="4.32/6",
    )


@case("4.32/4", "4.32/6", name="flags")
def test_flags(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply is exactly "1" or "0" for every port of 1 to 40.

    Ports that 0x49 does not report are cleared while all outputs are set. This shows whether a
    port number is confused with another one. The reply for a missing port is open (A-4.32-2,
    A-3-9).
    """
    ports = settable_outputs(line)
    with outputs_preserved(line):
        for port in ports:
            set_output(line, port, on=True)
        current = outputs(line)
        for port in ALL_OUTPUTS:
            on = current[port - 1]
            data = set_output(line, port, on=on).seen.text
            expect_in(
                data,
                _FLAGS,
                UserMessage("the reply for port {port} is not a flag", port=port),
            )
            description = UserMessage(
                "output {port} was set to its current value {on:d}", port=port, on=on
            )
            expect_outputs(line, current, description, requirement="4.32/6")
        for port in examples(range(ALL_OUTPUTS.stop, 41)):
            reply_text, after, line = _try_malformed(
                subject, line, Malformed("no output", b"%d|0" % port)
            )
            message = UserMessage("the reply for port {port} is not a flag", port=port)
            expect_in(reply_text, (*_FLAGS, None), message)
            message = UserMessage("port {port} was cleared, but another output changed", port=port)
            expect_equal(digits(after), digits(current), message, requirement="4.32/6")


@case("4.32/5")
def test_no_such_port(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Setting a port 0 or above 40 is not answered 1, and no output changes."""
    with outputs_preserved(line) as before:
        for port in _INVALID_PORTS:
            for value in examples((b"1", b"0")):
                wrong = Malformed("no such port", port + b"|" + value)
                reply_text, current, line = _try_malformed(subject, line, wrong)
                description = UserMessage(
                    "setting port {port} to {value}", port=port.decode(), value=value.decode()
                )
                expect(
                    reply_text != b"1",
                    UserMessage("{description} was answered 1", description=description),
                    expected="0",
                    observed="1",
                )
                expect_equal(
                    digits(current),
                    digits(before),
                    UserMessage("{description} changed an output", description=description),
                )


@case("4.32/7")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A payload that is not a port and a value changes no output and is not answered 1."""
    ports = settable_outputs(line)
    other, port = ports[0], ports[-1]
    with outputs_preserved(line):
        set_output(line, other, on=True)  # so that one output can be cleared
        before = outputs(line)
        value = PortValue(port, int(not before[port - 1]))
        for wrong in examples(malformed("set_digital_output", value, subject.dialect)):
            reply_text, current, line = _try_malformed(subject, line, wrong)
            if (
                not wrong.firm and current != before
            ):  # a payload that is taken as valid sets its port
                set_output(line, port, on=before[port - 1])
                current = with_port(current, port, on=before[port - 1])
            expect_equal(
                digits(current),
                digits(before),
                UserMessage("an output changed after {wrong}", wrong=wrong),
            )
            expect(
                reply_text != b"1" or not wrong.firm,
                UserMessage("{wrong} was answered 1", wrong=wrong),
                expected="0",
                observed="1",
            )


def _try_malformed(
    subject: ControllerUnderTest, line: OutgoingConnection, wrong: Malformed
) -> tuple[bytes | None, Bits, OutgoingConnection]:
    """Return the reply to 0x43, if any, the outputs then, and the connection to continue with."""
    reply, line = send_malformed(subject, line, "set_digital_output", wrong)
    return (reply.seen.text if reply else None), outputs(line), line


@case("4.32/7", name="values")
def test_other_values(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A value other than 0 and 1 changes nothing; using it as 1 is tolerated (A-4.32-4).

    It never clears an output.
    """
    port = settable_outputs(line)[-1]
    with outputs_preserved(line) as before:
        for on in (True, False):
            set_output(line, port, on=on)
            expected_outputs = with_port(before, port, on=on)
            for value in examples((b"2", b"9", b"10", b"255", b"256")):
                wrong = Malformed("no such value", b"%d|" % port + value)
                _, current, line = _try_malformed(subject, line, wrong)
                if not on and current != expected_outputs:
                    description = UserMessage(
                        "the value {value} is used as 1", value=value.decode()
                    )
                    subject.tolerate("4.32/7", "A-4.32-4", "non-zero = 1", description)
                    set_output(line, port, on=False)
                description = UserMessage(
                    "the value {value} for output {port} changed an output",
                    value=value.decode(),
                    port=port,
                )
                expect_outputs(line, expected_outputs, description)
