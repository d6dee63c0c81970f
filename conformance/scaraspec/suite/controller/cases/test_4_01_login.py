"""Clause 4.1: the login (0x01, L102-119)."""

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.passwords import altered, change, expect_changed
from scaraspec.suite.controller.harness.state.preserve import needs_login, password_kept
from scaraspec.suite.controller.harness.suite_passwords import LONG_PASSWORD
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.user_message import UserMessage

_LOGINS = 5

# A-4.1-2: a run must not lock out the user. So a run sends at most one wrong password where it may
# change state, and five where it may destroy data: these, and the old password in clause 4.2.


def _expect_flag(answer: ReceivedFrame) -> None:
    expect(
        answer.accepted is not None,
        "the reply to a login is not a single flag",
        expected="1 or 0",
        observed=f"{answer}",
        requirement="4.1/4",
    )


def _expect_open(
    subject: ControllerUnderTest, line: OutgoingConnection, message: str, requirement: str = "4.1/2"
) -> None:
    answer = line.ask("login", subject.password)
    _expect_flag(answer)
    expect(answer.accepted, message, expected="1", observed=f"{answer}", requirement=requirement)


def _expect_refused(
    subject: ControllerUnderTest, wrong: bytes, what: str, right: bytes | None = None
) -> OutgoingConnection:
    """Try one wrong password, after the correct one if it is given; return the connection used."""
    line = subject.open(login=False)
    if right is not None:
        subject.log_in(line, right)
    answer = line.ask("login", wrong)
    _expect_flag(answer)
    expect(
        not answer.accepted,
        UserMessage("{description} was accepted", description=what),
        expected="0",
        observed=f"{answer}",
        requirement="4.1/3",
    )
    return line


@case("4.1/2", "4.1/4")
def test_right_password(subject: ControllerUnderTest) -> None:
    """The controller answers the correct password with a single 1, also when it is sent again."""
    needs_login(subject)
    line = subject.open(login=False)
    for _ in range(2):
        _expect_open(subject, line, "the correct password was refused")
        more = [seen for seen in line.sync() if seen.name == "login"]
        expect(
            not more,
            "a login was answered more than once",
            expected="one reply",
            observed="; ".join(f"{seen.frame}" for seen in more),
            requirement="4.1/4",
        )


@case("4.1/6")
def test_again(subject: ControllerUnderTest) -> None:
    """The password is accepted on several connections, some of them at the same time."""
    needs_login(subject)
    beside = subject.takes_several
    for number in range(1, _LOGINS + 1):
        line = subject.open(login=False)
        message = UserMessage("login {number} with the correct password was refused", number=number)
        _expect_open(subject, line, message, "4.1/6")
        line.ask("get_version")
        if not beside or number > 1:
            line.close()


@case("4.1/3", "4.1/4", "4.1/7", "4.1/2", hazards=(Hazard.STATE,))
def test_wrong_password(subject: ControllerUnderTest) -> None:
    """A wrong password is refused, and the correct one still works on this and a new connection."""
    needs_login(subject)
    line = _expect_refused(subject, altered(subject.password), "a wrong password")
    line.pump()
    if line.ending is None:
        message = "after a wrong password, the correct one was refused on the same connection"
        try:
            _expect_open(subject, line, message)
        except NoReply:
            if line.ending is None:
                raise
    if line.ending is not None:
        message = "a wrong password closes the connection"
        subject.tolerate("4.1/7", "A-4.1-2", "closes", message)
    line.close()
    _expect_open(
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
    right = subject.password
    _expect_refused(subject, right + b"x", "the correct password with an extra letter").close()
    with password_kept(subject):
        line = subject.open()
        if "set_password" not in subject.ics.unsupported:
            right = LONG_PASSWORD if expect_changed(line, right, LONG_PASSWORD) else right
        line.close()
        last = b"y" if right.endswith(b"x") else b"x"
        behind = "the correct password with another last letter, sent after the correct one,"
        tried: list[tuple[bytes, str, bytes | None]] = [(right[:-1] + last, behind, right)]
        if len(right) > 1:
            tried.append((right[:-1], "the correct password without its last letter", None))
        for wrong, what, before in examples(tried):
            _expect_refused(subject, wrong, what, before).close()
            line = subject.open(login=False)  # three wrong ones in a row may lock out (A-4.1-2)
            subject.log_in(line, right)
            line.close()
        if right != subject.password:
            line = subject.open(login=False)
            subject.log_in(line, right)
            change(line, right, subject.password)
            line.close()
    line = subject.open(login=False)
    line.send("login", data=b"")
    try:
        answer = line.reply("login", within_s=1.0)
    except NoReply:
        return  # an empty request may be ignored (A-3-9)
    if answer.accepted:
        raise CaseFailed("an empty password was accepted", expected="0", observed=f"{answer}")
