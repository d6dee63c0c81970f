"""4.34: reading the digital outputs (0x49, L677-687)."""

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.ports import expect_each_port, expect_ports
from scaraspec.suite.client.harness.request_checks import expect_no_value
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples

_GET = "get_digital_outputs"
_COUNT = 16


@client_case("4.34/1", "4.34/3", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reads all outputs without data and reports port 16 leftmost."""
    expect_ports(subject, line, _GET, "1001000011110000", requirement="4.34/3")


@client_case("4.34/3", "4.34/1", name="each")
def test_each_port(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports each of the sixteen outputs at its place, in every combination."""
    expect_each_port(subject, line, _GET, _COUNT, requirement="4.34/3")


@client_case("4.34/1", name="error")
def test_error(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply of a single 0 is an error, not an output; requests after a setting carry no data."""
    for port in examples((8, 16)):
        call = subject.begin("set_digital_output", port=port, value=0)
        line.serve(call)
        subject.expect_done(call)
        call = subject.begin(_GET)
        line.serve(call, data=b"0", sent=b"")
        expect_no_value(subject, call)
        expect_ports(subject, line, _GET, "0" * _COUNT)
