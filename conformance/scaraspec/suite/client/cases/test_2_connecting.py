"""Clause 2: which side connects, and which request comes first (L79-L83, L104)."""

from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply, expect_equal
from scaraspec.user_message import UserMessage


@client_case("2/1", attended=True)
def test_reconnects(subject: ClientUnderTest) -> None:
    """The controller resets the connection; the next connect operation succeeds."""
    line = subject.open()
    line.reset()
    subject.wait_for_answer(subject.begin("disconnect"))
    subject.open()


@client_case("2/1", name="unanswered")
def test_reconnects_after_an_unanswered_login(subject: ClientUnderTest) -> None:
    """The controller closes the connection before it answers the login; the client reconnects."""
    line, call = subject.begin_connect()
    line.request("login", call)
    line.close()
    subject.expect_failure(call)
    subject.open()


@client_case("2/3")
def test_port(subject: ClientUnderTest) -> None:
    """The client connects to the given port, and to 8877 without one if its driver allows that."""
    if not subject.access.listen_at_default():
        raise CaseSkipped(
            UserMessage(
                "port {default_port} of this computer is not available", default_port=DEFAULT_PORT
            )
        )
    line, call = subject.begin_connect(port=DEFAULT_PORT)
    expect_equal(
        subject.access.connected_port, DEFAULT_PORT, "the client did not connect to the given port"
    )
    line.log_in(call)
    subject.expect_done(call)
    subject.wait_for_answer(subject.begin("disconnect"))
    try:
        line, call = subject.begin_connect(port=None)
    except CaseFailed:  # a driver may require a port
        return
    expect_equal(
        subject.access.connected_port,
        DEFAULT_PORT,
        "without a given port the client connected to another port than 8877",
    )
    line.log_in(call)
    subject.expect_done(call)


@client_case("2/10")
def test_login_comes_first(subject: ClientUnderTest) -> None:
    """The client sends the login as the first request on each connection."""
    for _ in range(2):
        line, call = subject.begin_connect()
        try:
            first = line.wait_for_frame(
                lambda _: True, subject.answer_timeout_s, "the client sent no login"
            )
        except NoReply:
            line.expect_login(call)
            raise
        expect_equal(first.seen.name, "login", "the first request is not a login")
        line.reply("login")
        subject.expect_done(call)
        status = subject.begin("get_status")
        line.serve(status, "00")
        subject.expect_result(status, "00")
        line.close()
        subject.wait_for_answer(subject.begin("disconnect"))
