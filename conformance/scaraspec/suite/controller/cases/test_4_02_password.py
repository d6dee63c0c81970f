"""Clause 4.2: change the password (0x03, L121-141)."""

from scaraspec.protocol.commands import PasswordChange
from scaraspec.protocol.fields import show
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.payloads import malformed, send_malformed
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.passwords import (
    altered_password,
    expect_password_changed,
    request_password_change,
    usable_passwords,
)
from scaraspec.suite.controller.harness.state.preserve import password_preserved
from scaraspec.suite.controller.harness.suite_passwords import PLAIN_PASSWORD
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, NoReply, expect
from scaraspec.user_message import UserMessage

_EMPTY_FIELDS = ("empty in old", "empty in new")
_TRIED_KINDS = ("no-bars", "empty-payload", "last-missing", *_EMPTY_FIELDS)
"""Malformed pairs to try: only a few, as each may count as an attempt with a wrong password."""


def _expect_login(
    subject: ControllerUnderTest,
    password: bytes,
    message: str,
    requirement: str,
    *,
    accepted: bool = True,
) -> None:
    """Log in on a new connection, and expect success or a refusal."""
    line = subject.open(login=False)
    reply = line.ask("login", password)
    expect(
        bool(reply.accepted) is accepted,
        message,
        expected="1" if accepted else "0",
        observed=f"{reply}",
        requirement=requirement,
    )
    line.close()


@case("4.2/4", "4.2/2")
def test_changed(subject: ControllerUnderTest) -> None:
    """After a change, the new password is accepted and the old one is refused."""
    first = old = subject.password
    with password_preserved(subject):
        for new in examples((*usable_passwords(subject), first)):
            line = subject.open(password=old)
            changed = expect_password_changed(line, old, new)
            line.close()
            if not changed:
                subject.tolerate(
                    "4.2/2",
                    "A-4.1-3",
                    "refused",
                    UserMessage("{new} is not accepted as a password", new=show(new)),
                )
                continue
            _expect_login(subject, new, "the new password is refused at the next login", "4.2/4")
            if old == first:  # one wrong attempt is enough (A-4.1-2)
                message = "the old password is still accepted"
                _expect_login(subject, old, message, "4.2/4", accepted=False)
            old = new


@case("4.2/4", "4.2/2", name="repeated")
def test_changed_repeatedly(subject: ControllerUnderTest) -> None:
    """After two and three changes on one connection, only the newest password is accepted."""
    old, new = subject.password, PLAIN_PASSWORD
    with password_preserved(subject):
        for count in examples((2, 3)):
            line = subject.open(password=old)
            for number in range(count):
                if number and not _is_served(line):
                    raise CaseSkipped("a password change ends the login of its connection")
                expect_password_changed(line, old, new)
                old, new = new, old
            line.close()
            message = UserMessage("the newest of {count} passwords is refused", count=count)
            _expect_login(subject, old, message, "4.2/4")
            message = UserMessage("after {count} changes an earlier one is accepted", count=count)
            _expect_login(subject, new, message, "4.2/4", accepted=False)


def _is_served(line: OutgoingConnection) -> bool:
    """Whether the login of this connection is still valid."""
    try:
        return line.ask("get_status").value is not None
    except NoReply:
        return False


def _expect_refused(
    subject: ControllerUnderTest, line: OutgoingConnection, wrong: bytes, new: bytes, correct: bytes
) -> None:
    """Expect that a change with a wrong old password is refused and changes nothing."""
    reply = request_password_change(line, wrong, new)
    expect(
        reply.accepted is False,
        "a password change with a wrong old password was not answered 0",
        expected="0",
        observed=f"{reply}",
    )
    line.close()
    message = "after a refused change, the password is no longer accepted"
    _expect_login(subject, correct, message, "4.2/5")


@case("4.2/3", "4.2/5")
def test_wrong_old_password(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A change with a wrong old password is refused, and the password remains valid."""
    correct = subject.password
    with password_preserved(subject):
        for wrong in examples(filter(None, (altered_password(correct), correct[:-1]))):
            _expect_refused(subject, line, wrong, PLAIN_PASSWORD, correct)
            line = subject.open()


@case("4.2/3", "4.2/5", name="after-a-change")
def test_former_password(subject: ControllerUnderTest) -> None:
    """A change with the former password is refused on connections that were open at the change."""
    former_password, checked = subject.password, False
    with password_preserved(subject):
        lines = [subject.open() for _ in range(2 if subject.supports_multiple_connections else 1)]
        expect_password_changed(lines[0], former_password, PLAIN_PASSWORD)
        for line in lines:
            if not _is_served(line):
                continue  # the change ended its login
            _expect_refused(subject, line, former_password, former_password, PLAIN_PASSWORD)
            checked = True
    if not checked:
        raise CaseSkipped("a password change ends all logins")


@case("4.2/6", "4.2/5", name="malformed")
def test_malformed(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A pair of passwords without separator or with an empty field changes nothing."""
    correct = subject.password
    with password_preserved(subject):
        malformed_pairs = malformed("set_password", PasswordChange(correct, PLAIN_PASSWORD))
        for wrong in examples(pair for pair in malformed_pairs if f"{pair}" in _TRIED_KINDS):
            result = send_malformed(subject, line, "set_password", wrong)
            line = result.line
            if not result.accepted:
                line.close()
                message = "after a malformed change, the password is no longer accepted"
                _expect_login(subject, correct, message, "4.2/5")
                line = subject.open()
                continue
            if f"{wrong}" == "empty in new":
                line.ask("set_password", data=b"|" + correct)
            if f"{wrong}" in _EMPTY_FIELDS:  # split at the first | (A-4.2-3)
                subject.tolerate(
                    "4.2/6", "A-4.2-3", "split", UserMessage("{wrong} was accepted", wrong=wrong)
                )
                continue
            raise CaseFailed(
                UserMessage("{wrong} was accepted", wrong=wrong),
                expected="0",
                observed=f"{result}",
            )
