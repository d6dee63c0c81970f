"""4.15: running a program (0x30, L304-328)."""

from hypothesis import example

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import (
    Operation,
    expect_execution_failed,
    expect_finished,
    expect_refused,
    run_unless_refused,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.strategies import names


@client_case("4.15/1", attended=True)
def test_run(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client runs a program by name until it ends."""
    call = subject.begin("run_program", name="pro1.txt")
    line.serve(call, data=b"1", sent=b"pro1.txt")
    line.result("run_program")
    expect_finished(subject, call)


@client_case("4.15/1", name="names")
def test_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client runs programs with names of 1 to 30 bytes, short names after long ones."""

    @example(b"abcdefghijklmnopqrstuvwxyz.rob")
    @example(b"a")
    @example(b"no extension")
    @example(b"my program (2).txt")
    @given(names)
    def each(name: bytes) -> None:
        run_unless_refused(subject, line, Operation("run_program", {"name": name.decode()}))

    each()


@client_case("4/13", "4.15/1", name="missing-program")
def test_missing(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A program is missing, reported in the first reply or the final result (A-4.15-1)."""
    call = subject.begin("run_program", name="none.rob")
    line.serve(call, data=b"0|20", sent=b"none.rob")
    expect_refused(subject, call, "20")
    call = subject.begin("run_program", name="none.rob")
    line.serve(call, data=b"1", sent=b"none.rob")
    line.result("run_program", "20")
    expect_execution_failed(subject, call, "20")
