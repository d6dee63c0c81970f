"""Clause 8: the codes of table 8-1 (L1012-1044), as a client tells them."""

from itertools import cycle
from typing import Final

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.executing import (
    REASONED,
    code_of,
    executing,
    failed,
    is_idle,
    ordered,
    refused,
)
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect_equal, expect_in
from scaraspec.user_message import UserMessage

_MOTORS: Final = tuple(f"{0x10 + mask:02X}" for mask in range(1, 16))
_LETTERS: Final = tuple(code for code in _MOTORS if not code.isdigit())


@client_case("8/4", attended=True)
def test_joints(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A fault of the inner arm, the outer arm, the wrist, the gripper and of all is told."""
    for code in examples(("11", "12", "14", "18", "1F")):
        call = subject.begin("get_status")
        line.serve(call, code)
        subject.gives(call, code)


@client_case("8/4", name="all")
def test_every_mask(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Each set of faulty joints is told, as the status, in a refusal and in a failure."""
    for order, code in examples(zip(cycle(REASONED), _MOTORS, strict=False)):
        call = subject.begin("get_status")
        line.serve(call, code)
        said = f"{subject.done(call)}"
        expect_equal(said.upper(), code, "the status that the client tells")
        is_idle(subject, line)
        call = ordered(subject, line, order)
        line.reply(order.name, data=b"0|" + code.encode())
        refused(subject, call, code)
        call = executing(subject, line, order)
        line.result(order.name, code)
        failed(subject, call, code)


@client_case("8/6")
def test_small_letters(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Codes in small letters are taken for those in capitals: for no other one, and for no yes."""
    unknown = ""
    for order, code in examples(zip(cycle(REASONED), _LETTERS, strict=False)):
        sent = code.lower()
        call = subject.begin("get_status")
        line.serve(call, data=sent.encode())
        if subject.settled(call).ok:
            expect_in(
                f"{call.result}".upper(),
                (code,),
                UserMessage("the status that is told for {sent}", sent=sent),
            )
        else:
            unknown = unknown or sent
        is_idle(subject, line)
        call = ordered(subject, line, order)
        line.reply(order.name, data=b"0|" + sent.encode())
        refused(subject, call, code)
        call = executing(subject, line, order)
        line.result(order.name, data=b"00|" + sent.encode())
        failed(subject, call, code)
        if not unknown and call.ok and code_of(call) is None:
            unknown = sent
    if unknown:
        subject.tolerate(
            "8/6",
            "A-T-7",
            "upper only",
            UserMessage("the code {unknown} is not understood", unknown=unknown),
        )
