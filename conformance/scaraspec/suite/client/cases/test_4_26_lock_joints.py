"""4.26: locking the joints (0x3B, L551-582)."""

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import (
    RELEASE,
    begin_and_accept,
    expect_finished,
    expect_refused,
)
from scaraspec.suite.engine.case import client_case


@client_case("4.26/1", attended=True)
def test_lock(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Locking the joints succeeds once and is then refused."""
    call = subject.begin("lock_joints")
    line.serve(call, data=b"1", sent=b"")
    line.result("lock_joints")
    expect_finished(subject, call)
    call = subject.begin("lock_joints")
    line.serve(call, data=b"0|12", sent=b"")
    expect_refused(subject, call)


@client_case("4.26/1", name="in-turn")
def test_in_turn(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client releases and locks the joints several times."""
    for _ in range(3):
        call = begin_and_accept(subject, line, RELEASE)
        line.result(RELEASE.name)
        expect_finished(subject, call)
        call = subject.begin("lock_joints")
        line.serve(call, data=b"1", sent=b"")
        line.result("lock_joints")
        expect_finished(subject, call)
