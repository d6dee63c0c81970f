"""4.25: releasing the joints (0x3A, L518-549)."""

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.two_stage import expect_execution_failed, expect_finished
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples


@client_case("4.25/1", attended=True)
def test_release(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Releasing the joints succeeds once and then fails."""
    for code in examples(("", "12")):
        call = subject.begin("release_joints")
        line.serve(call, data=b"1", sent=b"")
        line.result("release_joints", code)
        if code:
            expect_execution_failed(subject, call)
        else:
            expect_finished(subject, call)
