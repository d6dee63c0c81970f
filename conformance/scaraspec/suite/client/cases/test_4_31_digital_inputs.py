"""4.31: reading the digital inputs (0x42, L639-651)."""

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.ports import expect_each_port, expect_ports
from scaraspec.suite.client.harness.request_checks import expect_no_value
from scaraspec.suite.engine.case import client_case

_GET = "get_digital_inputs"
_COUNT = 8


@client_case("4.31/1", "4.31/3", attended=True)
def test_query(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reads all inputs without data and reports port 8 leftmost."""
    expect_ports(subject, line, _GET, "10000010", requirement="4.31/3")


@client_case("4.31/3", "4.31/1", name="each")
def test_each_port(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports each of the eight inputs at its place, in every combination."""
    expect_each_port(subject, line, _GET, _COUNT, requirement="4.31/3")


@client_case("4.31/1", name="error")
def test_error(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A reply of a single 0 is an error, not an input; the next request carries no data."""
    for _ in range(2):
        call = subject.begin(_GET)
        line.serve(call, data=b"0", sent=b"")
        expect_no_value(subject, call)
        expect_ports(subject, line, _GET, "0" * _COUNT)
