"""4.1: login."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import (
    await_request,
    begin_operation,
    expect_carries,
    sent_or_answered,
)
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseFailed, expect

_PRINTABLE: Final = st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters="|")
_LONG_BYTES: Final = (16, 17, 31, 32, 33, 64, 127, 128, 200, 255)
_MOMENT_S: Final = 0.05
_REFUSED: Final = "PassWord"
_NOT_SUCCESS: Final = (
    b"0",
    b"",
    b"2",
    b"11",
    b"10",
    b"01",
    b"1|",
    b"1 ",
    b"1\n",
    b"0|01",
    b"OK",
    b"true",
    b"\x01",
    b"1" * 9,
)
"""Replies other than the character 1."""


@client_case("4.1/1", "3/7", attended=True)
def test_connect_logs_in(subject: ClientUnderTest) -> None:
    """The client connects with several passwords and sends each password unchanged."""
    for password in examples(("password", "PassWord", "p")):
        with subject.allow_refusal():
            line, call = subject.begin_connect(password=password)
            request = await_request(line, "login", call)
            expect_carries(subject, request, "login", password.encode())
            line.reply("login")
            subject.expect_done(call)
            line.close()
        subject.wait_for_answer(subject.begin("disconnect"))


@client_case("4.1/1", name="passwords")
def test_passwords(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client logs in with passwords of many characters, including blanks."""

    @example(" a b ")
    @example("\"'\\%s%%{}<>&;#")
    @example("0123456789012345678901234567890123456789")
    @given(st.text(_PRINTABLE, min_size=1, max_size=24))
    def each(password: str) -> None:
        _log_in(subject, line, password.encode())

    each()


@client_case("4.1/1", "T/10", name="long")
def test_long_passwords(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends long passwords completely, or refuses them."""
    for size_bytes in examples(_LONG_BYTES):
        _log_in(subject, line, b"".join(b"%d" % (i % 10) for i in range(size_bytes)))


def _log_in(subject: ClientUnderTest, line: IncomingConnection, password: bytes) -> None:
    call = begin_operation(subject, "login", password)
    if sent_or_answered(subject, line, call) is None:
        return  # refused
    request = await_request(line, "login", call)
    line.reply("login")
    expect_carries(subject, request, "login", password)
    subject.expect_done(call)


@client_case("4.1/5", attended=True)
def test_refused_login(subject: ClientUnderTest) -> None:
    """The login is refused; the client reports it and sends only further logins."""
    line, call = subject.begin_connect()
    line.log_in(call, reply=b"0")
    subject.expect_failure(call, requirement="4.1/8")
    line.wait(_MOMENT_S)
    _expect_logins(line)


@client_case("4.1/5", "T/10", name="told-to")
def test_no_operation_after_a_refused_login(subject: ClientUnderTest) -> None:
    """The login is refused; the client sends no operation that is started afterwards.

    It also must not log in with a password that was not given.
    """
    line, call = subject.begin_connect(password=_REFUSED)
    await_request(line, "login", call)
    line.reply("login", data=b"0")
    subject.expect_failure(call, requirement="4.1/8")
    again = line.auto_responder.last_request_not_granted("login")
    expect(
        again is None or again.text == _REFUSED.encode(),
        "the client logs in with a password that was not given",
        requirement="T/10",
    )
    for name in examples(
        ("get_status", "get_version", "list_programs", "delete_program", "emergency_stop")
    ):
        call = begin_operation(subject, name)
        if line.ended or sent_or_answered(subject, line, call) is None:
            subject.expect_failure(call)
        _expect_logins(line)


def _expect_logins(line: IncomingConnection) -> None:
    """Require that the client sends nothing except logins.

    Raises:
        CaseFailed: The client sends something else.
    """
    line.flush()
    others = [f"{seen.frame}" for seen in line.inbox if seen.name != "login"]
    if others or line.invalid_bytes:
        raise CaseFailed(
            "the client continues after a refused login",
            expected="nothing, or another login",
            observed="; ".join(others) or "invalid bytes",
        )


@client_case("4.1/8")
def test_reply_other_than_success(subject: ClientUnderTest) -> None:
    """The login is answered with values other than 1; the client reports a failed login."""
    for reply in examples(_NOT_SUCCESS):
        line, call = subject.begin_connect()
        line.log_in(call, reply=reply)
        subject.expect_failure(call)
        line.close()
        subject.wait_for_answer(subject.begin("disconnect"))


@client_case("4.1/8", name="unanswered")
def test_link_ends_before_the_answer(subject: ClientUnderTest) -> None:
    """The connection ends before the login is answered; the client reports a failed login."""
    for cut in examples((False, True)):
        line, call = subject.begin_connect()
        await_request(line, "login", call)
        line.reset() if cut else line.close()
        subject.expect_failure(call)
