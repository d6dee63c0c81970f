"""Clause 4.32: setting a digital output (0x43, L653-663), which 0x49 shows (4.34)."""

from collections.abc import Sequence
from typing import Final

from hypothesis import strategies as st

from scaraspec.protocol.commands import PortValue
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import takes_one_at_a_time
from scaraspec.suite.controller.harness.malformed.payloads import Malformed, malformed, offer
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    ALL_OUTPUTS,
    Bits,
    digits,
    expect_outputs,
    outputs,
    outputs_kept,
    set_output,
    settable,
    with_port,
)
from scaraspec.suite.controller.harness.two_stage.tasks import (
    JOG,
    LOCK,
    MOVE,
    RELEASE,
    lasting,
    locked_again,
    release,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseSkipped, expect, expect_equal, expect_in
from scaraspec.suite.program_files.bench import PROGRAMS, running
from scaraspec.user_message import UserMessage

_MOTION: Final = (Hazard.STATE, Hazard.MOTION)
_FLAGS: Final = (b"0", b"1")
_NO_PORTS: Final = (
    *(b"0", b"00", b"41", b"42", b"50", b"99", b"255", b"256"),
    *(b"257", b"272", b"65537", b"4294967297", b"-1", b"-255"),
)
"""The latter are a port in fewer bits than they have, or without their sign."""


@case("4.32/6", "4.32/4")
def test_each_output(line: OutgoingConnection) -> None:
    """What is answered "1" shows at once at its port and nowhere else; all else changes nothing."""
    settable(line)
    with outputs_kept(line) as before:
        now = before
        for port in ALL_OUTPUTS:
            for on in examples((not now[port - 1], now[port - 1])):
                answer = set_output(line, port, on=on)
                if answer.accepted:
                    now = with_port(now, port, on=on)
                told = UserMessage(
                    "output {port} was set to {on:d}, which was answered {answer}",
                    port=port,
                    on=on,
                    answer=answer,
                )
                expect_outputs(line, now, told)


@case("4.32/6", name="sequences")
def test_sequences(line: OutgoingConnection) -> None:
    """After any sequence of settings 0x49 shows the last of each port."""
    ports = settable(line)
    setting = st.tuples(st.sampled_from(ports), st.booleans())

    @given(st.lists(setting, min_size=1, max_size=6))
    def shows(settings: list[tuple[int, bool]]) -> None:
        now = outputs(line)
        for port, on in settings:
            if set_output(line, port, on=on).accepted:
                now = with_port(now, port, on=on)
        expect_outputs(line, now, "outputs were set one after the other")

    with outputs_kept(line):
        shows()


@case("4.32/6", "3/30", name="all-at-once")
def test_all_on_and_off(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """All outputs can be on together, and off together, and go on in the order of one segment."""
    ports = settable(line)
    with outputs_kept(line) as before:
        now = before
        for on in (True, False):
            for port in examples(ports):
                if set_output(line, port, on=on).accepted:
                    now = with_port(now, port, on=on)
                told = UserMessage(
                    "output {port} was set to {on:d} as all before it were", port=port, on=on
                )
                expect_outputs(line, now, told)
        if not takes_one_at_a_time(subject):
            _expect_in_order(line, ports, now)


def _expect_in_order(line: OutgoingConnection, ports: Sequence[int], now: Bits) -> None:
    """What is asked behind each of many settings is answered as of its place, whenever it comes."""
    due, data = set[str](), b""
    for port in ports:
        now = with_port(now, port, on=True)
        due.add(digits(now))
        data += line.request("set_digital_output", PortValue(port, 1)).encode()
        data += line.request("get_digital_outputs").encode()
    line.send_bytes(data)
    accepted = [line.reply("set_digital_output").accepted for _ in ports]
    shown = {line.reply("get_digital_outputs").value for _ in ports}
    if all(accepted):
        message = "questions for the outputs were not answered as of their place"
        expect_equal(shown, due, message, requirement="3/30")


@case("4.32/6", name="held")
def test_held(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An output keeps its value when the connection that set it has ended."""
    port = settable(line)[-1]
    on = not outputs(line)[port - 1]
    due = with_port(outputs(line), port, on=on)
    set_output(line, port, on=on)
    line.close()
    subject.pause(0.2)
    again = subject.open()
    try:
        expect_outputs(
            again,
            due,
            UserMessage("output {port} was set on a connection that has ended", port=port),
        )
    finally:
        set_output(again, port, on=not on)


@case("4.32/4", "4.32/6", name="while-running", hazards=PROGRAMS)
def test_while_running(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A setting while a program runs is answered "1" and shows, or "0" and changes nothing."""
    port = settable(line)[-1]
    with running(subject, line):
        _set_meanwhile(line, port, "while a program ran")


@case("4.32/4", "4.32/6", name="while-moving", hazards=_MOTION)
def test_while_moving(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The same while the arm moves, and jogs, and while its joints are released."""
    lacks = subject.ics.unsupported
    moves = [name for name in (MOVE, JOG) if name not in lacks]
    releases = lacks.isdisjoint({RELEASE, LOCK})
    if not (moves or releases):
        raise CaseSkipped("the subject has no command that moves or releases the arm")
    port = settable(line)[-1]
    with outputs_kept(line):
        for name in examples(moves):
            with lasting(subject, line, name):
                _set_meanwhile(line, port, f"during a {name}")
        if releases:
            with locked_again(subject, line):
                release(subject, line)
                _set_meanwhile(line, port, "while the joints were released")


def _set_meanwhile(line: OutgoingConnection, port: int, when: str) -> None:
    before = outputs(line)
    on = not before[port - 1]
    answer = set_output(line, port, on=on)
    due = with_port(before, port, on=on) if answer.accepted else before
    expect_outputs(
        line,
        due,
        UserMessage("output {port} was set {when}", port=port, when=when),
        requirement="4.32/6",
    )


@case("4.32/4", "4.32/6", name="flags")
def test_flags(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The reply is "1" or "0" and nothing else, for every port of 1 to 40.

    Ports that 0x49 does not show are switched off while all outputs are on, so that one shows that
    is taken for another. That there are none of them may be told in any way (A-4.32-2, A-3-9).
    """
    ports = settable(line)
    with outputs_kept(line):
        for port in ports:
            set_output(line, port, on=True)
        now = outputs(line)
        for port in ALL_OUTPUTS:
            on = now[port - 1]
            data = set_output(line, port, on=on).seen.text
            expect_in(
                data,
                _FLAGS,
                UserMessage("port {port} is answered with something else than a flag", port=port),
            )
            told = UserMessage("output {port} was set to {on:d}, as it was", port=port, on=on)
            expect_outputs(line, now, told, requirement="4.32/6")
        for port in examples(range(ALL_OUTPUTS.stop, 41)):
            said, after, line = _try(subject, line, Malformed("no output", b"%d|0" % port))
            message = UserMessage(
                "port {port} is answered with something else than a flag", port=port
            )
            expect_in(said, (*_FLAGS, None), message)
            message = UserMessage(
                "port {port} was switched off, and an output has changed", port=port
            )
            expect_equal(digits(after), digits(now), message, requirement="4.32/6")


@case("4.32/5")
def test_no_such_port(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A port 0, or one above 40, is not set, and no output changes in its place."""
    with outputs_kept(line) as before:
        for port in _NO_PORTS:
            for value in examples((b"1", b"0")):
                wrong = Malformed("no such port", port + b"|" + value)
                said, now, line = _try(subject, line, wrong)
                told = UserMessage(
                    "port {decode} set to {decode_2}", decode=port.decode(), decode_2=value.decode()
                )
                expect(
                    said != b"1",
                    UserMessage("{told} is answered as done", told=told),
                    expected="0",
                    observed="1",
                )
                expect_equal(
                    digits(now),
                    digits(before),
                    UserMessage("{told} has changed an output", told=told),
                )


@case("4.32/7")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """No output changes on a payload that is no port and value, nor is one said to be set."""
    ports = settable(line)
    other, port = ports[0], ports[-1]
    with outputs_kept(line):
        set_output(line, other, on=True)  # so that there is something to switch off
        before = outputs(line)
        value = PortValue(port, int(not before[port - 1]))
        for wrong in examples(malformed("set_digital_output", value, subject.dialect)):
            said, now, line = _try(subject, line, wrong)
            if not wrong.firm and now != before:  # what is taken for the good one sets its port
                set_output(line, port, on=before[port - 1])
                now = with_port(now, port, on=before[port - 1])
            expect_equal(
                digits(now),
                digits(before),
                UserMessage("an output has changed on {wrong}", wrong=wrong),
            )
            expect(
                said != b"1" or not wrong.firm,
                UserMessage("{wrong} is answered as done", wrong=wrong),
                expected="0",
                observed="1",
            )


def _try(
    subject: ControllerUnderTest, line: OutgoingConnection, wrong: Malformed
) -> tuple[bytes | None, Bits, OutgoingConnection]:
    """What 0x43 is answered, if anything, what 0x49 shows then, and the line to go on with."""
    answer, line = offer(subject, line, "set_digital_output", wrong)
    return (answer.seen.text if answer else None), outputs(line), line


@case("4.32/7", name="values")
def test_other_values(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A value other than 0 and 1 sets nothing; that it counts for 1 is tolerated (A-4.32-4).

    It never switches off what is on.
    """
    port = settable(line)[-1]
    with outputs_kept(line) as before:
        for on in (True, False):
            set_output(line, port, on=on)
            due = with_port(before, port, on=on)
            for value in examples((b"2", b"9", b"10", b"255", b"256")):
                wrong = Malformed("no such value", b"%d|" % port + value)
                _, now, line = _try(subject, line, wrong)
                if not on and now != due:
                    told = UserMessage("the value {decode} counts for 1", decode=value.decode())
                    subject.tolerate("4.32/7", "A-4.32-4", "non-zero = 1", told)
                    set_output(line, port, on=False)
                told = UserMessage(
                    "the value {decode} for output {port} has changed an output",
                    decode=value.decode(),
                    port=port,
                )
                expect_outputs(line, due, told)
