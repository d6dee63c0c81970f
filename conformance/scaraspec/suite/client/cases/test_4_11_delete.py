"""4.11: deleting a program."""

from typing import Final

from hypothesis import example

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.strategies import names

_NAMES: Final = (
    *(b"a", b"PRO1.TXT", b"pro1", b"my program.rob", b"pro1.2.txt", b"0123456789" * 3),
    *(b"100%%d.rob", b"~it's.rob"),
)


@client_case("4.11/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Deleting a program succeeds once and is then refused."""
    call, _ = request_operation(subject, line, "delete_program")
    line.reply("delete_program", data=b"1")
    subject.expect_done(call)
    call, _ = request_operation(subject, line, "delete_program")
    line.reply("delete_program", data=b"0")
    subject.expect_failure(call)


@client_case("4.11/1", name="names")
def test_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends names in both cases, with and without extension, unchanged."""

    @given(names)
    def each(name: bytes) -> None:
        with subject.allow_refusal():
            call, _ = request_operation(subject, line, "delete_program", name)
            line.reply("delete_program", data=b"1")
            subject.expect_done(call)

    for name in _NAMES:
        each = example(name)(each)
    each()
