"""Clause 8: the codes of table 8-1 (L1012-1044), as a client reports them."""

from itertools import cycle
from typing import Final

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import (
    REFUSED_WITH_CODE,
    begin_and_accept,
    begin_and_request,
    expect_execution_failed,
    expect_refused,
    report_idle,
    reported_code,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect_equal, expect_in
from scaraspec.user_message import UserMessage

_MOTORS: Final = tuple(f"{0x10 + mask:02X}" for mask in range(1, 16))
_LETTERS: Final = tuple(code for code in _MOTORS if not code.isdigit())


@client_case("8/4", attended=True)
def test_joints(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports a fault of inner arm, outer arm, wrist, gripper and all motors."""
    for code in examples(("11", "12", "14", "18", "1F")):
        call = subject.begin("get_status")
        line.serve(call, code)
        subject.expect_result(call, code)


@client_case("8/4", name="all")
def test_every_mask(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports each set of faulty joints in the status, a refusal and a failure."""
    for operation, code in examples(zip(cycle(REFUSED_WITH_CODE), _MOTORS, strict=False)):
        call = subject.begin("get_status")
        line.serve(call, code)
        reported = f"{subject.expect_done(call)}"
        expect_equal(reported.upper(), code, "the client reports a wrong status")
        report_idle(subject, line)
        call = begin_and_request(subject, line, operation)
        line.reply(operation.name, data=b"0|" + code.encode())
        expect_refused(subject, call, code)
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name, code)
        expect_execution_failed(subject, call, code)


@client_case("8/6")
def test_small_letters(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client takes codes in lower case for the same codes, not for others or a success."""
    unknown = ""
    for operation, code in examples(zip(cycle(REFUSED_WITH_CODE), _LETTERS, strict=False)):
        sent = code.lower()
        call = subject.begin("get_status")
        line.serve(call, data=sent.encode())
        if subject.wait_for_answer(call).ok:
            expect_in(
                f"{call.result}".upper(),
                (code,),
                UserMessage("the client reports a wrong status for {code}", code=sent),
            )
        else:
            unknown = unknown or sent
        report_idle(subject, line)
        call = begin_and_request(subject, line, operation)
        line.reply(operation.name, data=b"0|" + sent.encode())
        expect_refused(subject, call, code)
        call = begin_and_accept(subject, line, operation)
        line.result(operation.name, data=b"00|" + sent.encode())
        expect_execution_failed(subject, call, code)
        if not unknown and call.ok and reported_code(call) is None:
            unknown = sent
    if unknown:
        subject.tolerate(
            "8/6",
            "A-T-7",
            "upper only",
            UserMessage("the client does not understand the code {code}", code=unknown),
        )
