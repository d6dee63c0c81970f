"""4.32: setting a digital output (0x43, L653-663)."""

from typing import Final

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.request_checks import numbers_in, request_unless_refused
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect, expect_in, show_value
from scaraspec.user_message import UserMessage

_SET: Final = "set_digital_output"
_PORTS: Final = range(1, 17)  # the outputs in 0x49 (L684)
_NO_PORTS: Final = (257, 264, 65537)
"""The low byte of each of these is a valid port, or its low two bytes are."""

_NO_VALUES: Final = (2, -1, 10, 255, 256, 0.5)


def _expect_setting(sent: ReceivedFrame, port: int, value: int) -> None:
    text = sent.seen.text
    expect(
        numbers_in(sent) == [port, value] and b"." not in text,
        "the client sent a wrong request to set an output",
        expected=f"{port}|{value}",
        observed=show_value(text),
        requirement="4.32/1",
    )


@client_case("4.32/1", attended=True)
def test_set(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Setting an output succeeds once and is then refused."""
    call = subject.begin(_SET, port=8, value=1)
    _expect_setting(line.serve(call), 8, 1)
    subject.expect_done(call)
    call = subject.begin(_SET, port=8, value=0)
    _expect_setting(line.serve(call, value=False), 8, 0)
    subject.expect_failure(call)


@client_case("4.32/1", "4.32/2", name="each")
def test_each_port(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sets each output to 1 and to 0 with the correct port number.

    A port that does not exist is refused or sent unchanged. No other port is set in its place.
    """
    for value in (1, 0, 0):  # 0 twice: a program may have changed the output
        for port in examples(_PORTS):
            call = subject.begin(_SET, port=port, value=value)
            _expect_setting(line.serve(call), port, value)
            subject.expect_done(call)
    for port in examples(_NO_PORTS):
        call = subject.begin(_SET, port=port, value=1)
        sent = request_unless_refused(line, call)
        if sent is not None:
            line.reply(_SET, value=False)
            subject.wait_for_answer(call)
            _expect_setting(sent, port, 1)


@client_case("4.32/2")
def test_other_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses or corrects a value other than 0 and 1."""
    for value in examples(_NO_VALUES):
        call = subject.begin(_SET, port=3, value=value)
        sent = request_unless_refused(line, call)
        if sent is not None:
            text = sent.seen.text.rpartition(b"|")[2]
            expect_in(
                text,
                (b"0", b"1"),
                UserMessage("the client sent an invalid value for {value}", value=value),
            )
            line.reply(_SET, value=False)
            subject.expect_failure(call)
