"""Clause 4.1: the login (0x01, L102-119)."""

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.passwords import (
    altered_password,
    expect_password_changed,
    request_password_change,
)
from scaraspec.suite.controller.harness.state.preserve import needs_login, password_preserved
from scaraspec.suite.controller.harness.suite_passwords import LONG_PASSWORD
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.user_message import UserMessage

_LOGINS = 5

# A-4.1-2: a run must not lock out the user. Therefore a run sends at most one wrong password if it
# may change state, and at most five if it may destroy data. The cases of this clause send four of
# them, and the cases of clause 4.2 send the old password.


def _expect_flag(reply: ReceivedFrame) -> None:
    expect(
        reply.accepted is not None,
        "the reply to a login is not a single flag",
        expected="1 or 0",
        observed=f"{reply}",
        requirement="4.1/4",
    )


def _expect_accepted(
    subject: ControllerUnderTest, line: OutgoingConnection, message: str, requirement: str = "4.1/2"
) -> None:
    reply = line.ask("login", subject.password)
    _expect_flag(reply)
    expect(reply.accepted, message, expected="1", observed=f"{reply}", requirement=requirement)


def _expect_refused(
    subject: ControllerUnderTest, wrong: bytes, description: str, correct: bytes | None = None
) -> OutgoingConnection:
    """Try one wrong password, after the correct one if it is given; return the connection used."""
    line = subject.open(login=False)
    if correct is not None:
        subject.log_in(line, correct)
    reply = line.ask("login", wrong)
    _expect_flag(reply)
    expect(
        not reply.accepted,
        UserMessage("{description} was accepted", description=description),
        expected="0",
        observed=f"{reply}",
        requirement="4.1/3",
    )
    return line


@case("4.1/2", "4.1/4")
def test_right_password(subject: ControllerUnderTest) -> None:
    """The controller answers the correct password with a single 1, also when it is sent again."""
    needs_login(subject)
    line = subject.open(login=False)
    for _ in range(2):
        _expect_accepted(subject, line, "the correct password was refused")
        more = [received for received in line.sync() if received.name == "login"]
        expect(
            not more,
            "a login was answered more than once",
            expected="one reply",
            observed="; ".join(f"{received.frame}" for received in more),
            requirement="4.1/4",
        )


@case("4.1/6")
def test_repeated_logins(subject: ControllerUnderTest) -> None:
    """The password is accepted on several connections, some of them at the same time."""
    needs_login(subject)
    parallel = subject.supports_multiple_connections
    for number in range(1, _LOGINS + 1):
        line = subject.open(login=False)
        message = UserMessage("login {number} with the correct password was refused", number=number)
        _expect_accepted(subject, line, message, "4.1/6")
        line.ask("get_version")
        if not parallel or number > 1:
            line.close()


@case("4.1/3", "4.1/4", "4.1/7", "4.1/2", hazards=(Hazard.STATE,))
def test_wrong_password(subject: ControllerUnderTest) -> None:
    """A wrong password is refused, and the correct one still works on this and a new connection."""
    needs_login(subject)
    line = _expect_refused(subject, altered_password(subject.password), "a wrong password")
    line.pump()
    if line.ending is None:
        message = "after a wrong password, the correct one was refused on the same connection"
        try:
            _expect_accepted(subject, line, message)
        except NoReply:
            if line.ending is None:
                raise
    if line.ending is not None:
        message = "a wrong password closes the connection"
        subject.tolerate("4.1/7", "A-4.1-2", "closes", message)
    line.close()
    _expect_accepted(
        subject,
        subject.open(login=False),
        "after a wrong password, the correct one was refused on a new connection",
    )


@case("4.1/3", "4.1/4", name="near-misses", hazards=(Hazard.STATE, Hazard.DESTRUCTIVE))
def test_near_misses(subject: ControllerUnderTest) -> None:
    """A password that differs from the correct one only at its end is refused; so is an empty one.

    Two of them are tried with the longest password that may be set: a short password would not
    show that only the first bytes are compared.
    """
    needs_login(subject)
    correct = subject.password
    _expect_refused(subject, correct + b"x", "the correct password with an extra letter").close()
    with password_preserved(subject):
        line = subject.open()
        if "set_password" not in subject.ics.unsupported:
            correct = (
                LONG_PASSWORD if expect_password_changed(line, correct, LONG_PASSWORD) else correct
            )
        line.close()
        last_letter = b"y" if correct.endswith(b"x") else b"x"
        description_last = (
            "the correct password with another last letter, sent after the correct one,"
        )
        wrong_passwords: list[tuple[bytes, str, bytes | None]] = [
            (correct[:-1] + last_letter, description_last, correct)
        ]
        if len(correct) > 1:
            wrong_passwords.append(
                (correct[:-1], "the correct password without its last letter", None)
            )
        for wrong, description, correct_first in examples(wrong_passwords):
            _expect_refused(subject, wrong, description, correct_first).close()
            line = subject.open(login=False)  # three wrong ones in a row may lock out (A-4.1-2)
            subject.log_in(line, correct)
            line.close()
        if correct != subject.password:
            line = subject.open(login=False)
            subject.log_in(line, correct)
            request_password_change(line, correct, subject.password)
            line.close()
    line = subject.open(login=False)
    line.send("login", data=b"")
    try:
        reply = line.reply("login", within_s=1.0)
    except NoReply:
        return  # an empty request may be ignored (A-3-9)
    if reply.accepted:
        raise CaseFailed("an empty password was accepted", expected="0", observed=f"{reply}")
