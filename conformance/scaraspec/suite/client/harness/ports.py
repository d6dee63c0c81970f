"""Ports: the states of all inputs or all outputs that a client reports."""

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.examples import given


def expect_ports(
    subject: ClientUnderTest,
    line: IncomingConnection,
    name: str,
    bits: str,
    *,
    requirement: str = "",
) -> None:
    """Require that the client reads all ports without data and reports the reply.

    Raises:
        CaseFailed: It does not.
    """
    call = subject.begin(name)
    line.serve(call, bits, sent=b"")
    subject.expect_result(call, bits, requirement=requirement)


def expect_each_port(
    subject: ClientUnderTest, line: IncomingConnection, name: str, count: int, *, requirement: str
) -> None:
    """Try each port alone, all ports, none, and drawn combinations.

    Raises:
        CaseFailed: The client reports another value than the reply.
    """

    @example("0" * count)
    @example("1" * count)
    @given(st.text("01", min_size=count, max_size=count))
    def each(bits: str) -> None:
        expect_ports(subject, line, name, bits, requirement=requirement)

    for place in range(count):
        each = example("0" * place + "1" + "0" * (count - 1 - place))(each)
    each()
