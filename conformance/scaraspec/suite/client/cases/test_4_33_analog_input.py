"""4.33: reading an analog input (0x44, L665-675)."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_NAME
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.request_checks import expect_no_value, request_unless_refused
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import expect, show_value
from scaraspec.user_message import UserMessage

_GET: Final = "get_analog_input"
_REPLY: Final = BY_NAME[_GET].reply
_SURE_PORTS: Final = range(1, 9)
_ALL_PORTS: Final = range(9, 41)
_NO_PORTS: Final = (100, 128, 256, 1000)
_BYTES: Final = 2


@client_case("4.33/1", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends the port as two characters, such as 08, and reports the value."""
    call = subject.begin(_GET, port=8)
    line.serve(call, 100, sent=b"08")
    subject.expect_result(call, 100)


@client_case("4.33/1", name="each")
def test_each_port(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends each of the forty ports that it supports as two characters."""
    for port in examples(_SURE_PORTS):
        call = subject.begin(_GET, port=port)
        line.serve(call, port, sent=b"%02d" % port)
        subject.expect_result(call, port)
    for port in examples(_ALL_PORTS):  # a client may support eight only (A-4.32-2)
        call = subject.begin(_GET, port=port)
        with subject.allow_refusal():
            line.serve(call, port, sent=b"%02d" % port)
            subject.expect_result(call, port)


@client_case("4.33/1", name="beyond")
def test_beyond(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client does not send a port number that does not fit two characters."""
    for port in examples(_NO_PORTS):
        call = subject.begin(_GET, port=port)
        sent = request_unless_refused(line, call)
        if sent is not None:
            data = sent.seen.text
            expect(
                len(data) == _BYTES and data.isdigit(),
                UserMessage(
                    "the client sent an invalid request for port {port}, which does not exist",
                    port=port,
                ),
                expected="none, or one of two characters",
                observed=show_value(data),
            )
            line.reply(_GET, None)
            expect_no_value(subject, call)


@client_case("4.33/4", attended=True)
def test_zero(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client distinguishes the value 0 from the error."""
    call = subject.begin(_GET, port=1)
    line.serve(call, data=b"1|0")
    subject.expect_result(call, 0)
    call = subject.begin(_GET, port=1)
    line.serve(call, data=b"0")
    expect_no_value(subject, call)


@client_case("4.33/4", "T/9", name="values")
def test_values(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports values of every size and sign, and no value for an error after each."""

    @example(0.0)
    @example(0.125)
    @example(-0.125)
    @example(1.0)
    @example(4095.0)
    @example(65535.0)
    @given(st.integers(-10_000_000, 10_000_000).map(lambda thousandths: thousandths / 1000))
    def each(value: float) -> None:
        call = subject.begin(_GET, port=2)
        line.serve(call, data=_REPLY.encode(value))
        subject.expect_result(call, value, requirement="4.33/4")
        call = subject.begin(_GET, port=2)
        line.serve(call, data=b"0")
        expect_no_value(subject, call)

    each()


@client_case("4.33/4", name="forms")
def test_forms(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports the value 0 in each of its written forms."""
    for form in examples((b"1|0", b"1|0.0", b"1|0.000", b"1|-0", b"1|00")):
        call = subject.begin(_GET, port=3)
        line.serve(call, data=form)
        subject.expect_result(call, 0)
