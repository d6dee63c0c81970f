"""4.12: reading the default program, with opcode 0x0D or 0x13 (A-4.12-1)."""

from contextlib import suppress
from typing import Final

from hypothesis import example

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.fields import NAME_MAX_BYTES
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import NoReply, expect
from scaraspec.suite.engine.strategies import names
from scaraspec.user_message import UserMessage

_NAME: Final = "get_default_program"
_MOMENT_S: Final = 0.1
_LONG_BYTES: Final = (30, 31, 100, 255)


def _expect_reported(
    subject: ClientUnderTest, line: IncomingConnection, data: bytes, reported: str | None
) -> None:
    """Answer with the opcode of the request."""
    call, request = request_operation(subject, line, _NAME)
    if request.frame.opcode != BY_NAME[_NAME].opcode:
        message = "the client requests the default program with the printed opcode"
        subject.tolerate(
            "4.12/1",
            "op_get_default",
            UserMessage("0x{opcode:02X}", opcode=request.frame.opcode),
            message,
        )
    line.send_frame(line.frame(_NAME, data=data)._replace(opcode=request.frame.opcode))
    if len(data) > NAME_MAX_BYTES and not subject.wait_for_answer(call).ok:
        subject.tolerate(
            "T/9",
            "A-5-20",
            "30",
            UserMessage(
                "the client does not accept a name of {size_bytes} bytes", size_bytes=len(data)
            ),
        )
        return
    subject.expect_result(call, reported, requirement="T/9")


@client_case("4.12/1", "T/9", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_default_program without data and reports the reply."""
    _expect_reported(subject, line, b"pro1.txt", "pro1.txt")


@client_case("4.12/1", name="unanswered")
def test_unanswered(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A request with one opcode gets no reply for a moment; a second request is answered."""
    call, first = request_operation(subject, line, _NAME)
    claims_both = subject.dialect["op_get_default"] == "both"
    with suppress(NoReply):
        again = line.request(
            _NAME, call, within_s=subject.answer_timeout_s if claims_both else _MOMENT_S
        )
        expect(not again.frame.data, "the request carries data", observed=f"{again}")
        first = again
    line.send_frame(line.frame(_NAME, data=b"pro1.txt")._replace(opcode=first.frame.opcode))
    subject.expect_result(call, "pro1.txt")


@client_case("T/9", "4.12/1", name="default-program")
def test_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports default programs of many names, and that no default program is set."""

    @example(b"a")
    @example(b"1.rob")
    @example(b"0.rob")
    @example(b"007")  # may be read as a number; the next one as false
    @example(b"no")
    @example(b"pick and place.rob")
    @given(names)
    def each(name: bytes) -> None:
        _expect_reported(subject, line, name, name.decode())

    each()
    for size_bytes in examples(_LONG_BYTES):
        name = "n" * (size_bytes - 4) + ".rob"
        _expect_reported(subject, line, name.encode(), name)
    _expect_reported(subject, line, b"", None)


@client_case("T/9", "4.12/1", name="no-default-program")
def test_none_otherwise(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """No default program is set; the reply is 0 (A-4.12-2)."""
    call, request = request_operation(subject, line, _NAME)
    line.send_frame(line.frame(_NAME, data=b"0")._replace(opcode=request.frame.opcode))
    subject.wait_for_answer(call)
    if not call.ok or call.result == "0":
        subject.tolerate(
            "T/9", "default_none", "empty", "the client takes 0 for a name or an error"
        )
    else:
        subject.expect_result(call, None)
