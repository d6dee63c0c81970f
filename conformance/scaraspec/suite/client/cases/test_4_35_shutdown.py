"""4.35: the shutdown (0x60, L689-706), and the loss of the link after it."""

import pytest

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import MOVE, begin_and_accept, expect_finished
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect

_OFF = "shutdown"
_READ_S = 1.0


@client_case("4.35/1", attended=True)
def test_refused(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """A shutdown without data is refused while a program runs; the link continues."""
    call = subject.begin(_OFF)
    line.serve(call, data=b"0|01", sent=b"")
    subject.expect_failure(call)
    call = subject.begin("get_status")
    line.serve(call, "01")
    subject.expect_result(call, "01")


@client_case("4.35/1", name="behind-others")
def test_after_a_request_with_data(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The shutdown carries no data after a request with data; the client reports refusals."""
    for code in examples(("01", "03", "12", "1F")):
        call = begin_and_accept(subject, line, MOVE)
        line.result(MOVE.name)
        expect_finished(subject, call)
        call = subject.begin(_OFF)
        line.serve(call, data=b"0|" + code.encode(), sent=b"")
        subject.expect_failure(call)


@client_case("4.35/6", attended=True)
def test_done(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The shutdown is accepted without a final result, and the link ends."""
    call = subject.begin(_OFF)
    line.serve(call, data=b"1", sent=b"")
    subject.expect_done(call)
    line.close()


@pytest.mark.parametrize("cut", [False, True], ids=["closed", "cut-off"])
@client_case("T/9", name="shutdown-unanswered")
def test_link_is_lost_before_the_answer(
    subject: ClientUnderTest, line: IncomingConnection, *, cut: bool
) -> None:
    """The link ends before the shutdown is accepted; the client reports a failure."""
    call = subject.begin(_OFF)
    line.request(_OFF, call)
    line.reset() if cut else line.close()
    subject.expect_failure(call)


@pytest.mark.parametrize("loss", ["closed", "closed-at-once", "reset", "pending"])
@client_case("4.35/6", name="loss")
def test_link_is_lost(subject: ClientUnderTest, line: IncomingConnection, loss: str) -> None:
    """The link is closed or reset after the shutdown is accepted, also with a pending query."""
    if loss == "pending":
        subject.require_concurrency(line)
        other = subject.begin("get_joint_angles")
        line.request("get_joint_angles", other)
    call = subject.begin(_OFF)
    line.serve(call, data=b"1", sent=b"")
    if loss != "closed-at-once":
        subject.answers_within(call, _READ_S)  # a reset discards data that was not read
    if loss == "reset":
        line.reset()
    else:
        line.close()
    subject.expect_done(call, requirement="4.35/6")
    if loss == "pending":
        expect(
            not subject.wait_for_answer(other).ok,
            "the client reports success for a query whose reply was lost with the link",
            expected="an error",
            observed=f"{other}",
        )
    again = subject.open()
    query = subject.begin("get_version")
    again.serve(query, "1.0.0")
    subject.expect_result(query, "1.0.0")
