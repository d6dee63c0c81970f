"""Clause 2: who dials whom, and what comes first (L79-L83, L104)."""

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, expect_equal
from scaraspec.user_message import UserMessage


@client_case("2/1", attended=True)
def test_it_dials_anew(subject: ClientUnderTest) -> None:
    """The controller cuts the connection off, and the client opens another one when told to."""
    line = subject.open()
    line.reset()
    subject.wait_for_answer(subject.begin("disconnect"))
    subject.open()


@client_case("2/1", name="unanswered")
def test_it_dials_after_a_login_in_vain(subject: ClientUnderTest) -> None:
    """The controller hangs up in place of answering the login; the client can dial anew."""
    line, call = subject.begin_connect()
    line.request("login", call)
    line.close()
    subject.expect_failure(call)
    subject.open()


@client_case("2/3")
def test_port(subject: ClientUnderTest) -> None:
    """The client dials the port that is named, and 8877 where none is, if it takes such orders."""
    if not subject.access.listen_at_default():
        raise CaseSkipped(
            UserMessage(
                "port {default_port} of this computer cannot be had", default_port=DEFAULT_PORT
            )
        )
    line, call = subject.begin_connect(port=DEFAULT_PORT)
    expect_equal(
        subject.access.connected_port, DEFAULT_PORT, "the port that was named was not taken"
    )
    line.log_in(call)
    subject.expect_done(call)
    subject.wait_for_answer(subject.begin("disconnect"))
    try:
        line, call = subject.begin_connect(port=None)
    except CaseFailed:  # a driver may want to be told the port
        return
    expect_equal(subject.access.connected_port, DEFAULT_PORT, "no port was named, and it dialled")
    line.log_in(call)
    subject.expect_done(call)


@client_case("2/10")
def test_login_comes_first(subject: ClientUnderTest) -> None:
    """On one connection after the other, the login comes before anything else."""
    for _ in range(2):
        line, call = subject.begin_connect()
        first = line.awaited(lambda _: True, subject.answer_timeout_s, "no login was sent")
        expect_equal(first.seen.name, "login", "the first request")
        line.reply("login")
        subject.expect_done(call)
        status = subject.begin("get_status")
        line.serve(status, "00")
        subject.expect_result(status, "00")
        line.close()
        subject.wait_for_answer(subject.begin("disconnect"))
