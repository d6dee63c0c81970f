"""4.16: simulating a program (0x31, L330-354)."""

from hypothesis import example

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import Operation, expect_finished, run_unless_refused
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.strategies import names


@client_case("4.16/1", attended=True)
def test_simulate(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client simulates a program by name until it ends, with opcode 0x31, not 0x30."""
    call = subject.begin("simulate_program", name="pro1.txt")
    line.serve(call, data=b"1", sent=b"pro1.txt")
    line.result("simulate_program")
    expect_finished(subject, call)


@client_case("4.16/1", name="names")
def test_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client simulates programs with names of 1 to 30 bytes after it ran another program."""

    @example(b"abcdefghijklmnopqrstuvwxyz.rob")
    @example(b"a")
    @given(names)
    def each(name: bytes) -> None:
        run_unless_refused(subject, line, Operation("simulate_program", {"name": name.decode()}))

    call = subject.begin("run_program", name="former.rob")
    line.serve(call, data=b"1")
    line.result("run_program")
    expect_finished(subject, call)
    each()
