"""Password: restores the user's password on the controller."""

from collections.abc import Callable, Iterator
from typing import Any, Final

from scaraspec.protocol.commands import PasswordChange
from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply, expect
from scaraspec.user_message import UserMessage

MOST_ATTEMPTS: Final = 5
"""How many passwords are tried: a controller may lock the suite out after more (A-4.1-2)."""

_BUFFERS_BYTES: Final = (64, 63, 32, 31, 30, 20, 16, 15, 10, 8)


class PasswordLost(CaseInconclusive):
    """No known password opens a login; the message names the last one that the suite has set."""


def restore_password(subject: ControllerUnderTest) -> None:
    """Restore the user's password if a case or the controller has left another one.

    A password with which the login succeeds may still be wrong: a faulty controller may compare
    only its beginning.

    Raises:
        CaseFailed: The controller does not answer, or refuses the change.
        PasswordLost: No known password opens a login.
    """
    if not subject.journal.changes.passwords or not subject.access.needs_login:
        return
    refused: CaseFailed | None = None
    for password in _candidates(subject):
        if not _opens(subject, password):
            continue
        try:
            set_back(subject, password)
        except NoReply:
            raise
        except CaseFailed as error:
            refused = error
        else:
            return
    raise refused or _lost(subject)


def set_back(subject: ControllerUnderTest, password: bytes) -> None:
    """Replace this password by the user's password.

    Raises:
        CaseFailed: The controller does not answer, or refuses the change.
    """
    if password != subject.password:
        line = subject.open(login=False)
        subject.log_in(line, password)
        with subject.journal.restoring():
            set_value(line, "set_password", PasswordChange(password, subject.password))
        line.close()
        expect(
            _opens(subject, subject.password), "the login with the restored password was refused"
        )
    subject.journal.confirm("password-restored")


def working_password(subject: ControllerUnderTest) -> bytes:
    """Return a password with which the login succeeds.

    Raises:
        CaseFailed: The controller does not answer.
        PasswordLost: The login fails with every known password.
    """
    for password in _candidates(subject):
        if _opens(subject, password):
            return password
    raise _lost(subject)


def _candidates(subject: ControllerUnderTest) -> Iterator[bytes]:
    """Yield the passwords to try, beginning with the one that was set last.

    These are at most five, or more if destructive cases are allowed.
    """
    passwords = list(dict.fromkeys(_set_last_first(subject)))
    yield from passwords[:MOST_ATTEMPTS]
    if Hazard.DESTRUCTIVE not in subject.allowed:
        return
    kept_wrongly = dict.fromkeys(_as_kept_wrongly(passwords))
    more = [*passwords[MOST_ATTEMPTS:], *(each for each in kept_wrongly if each not in passwords)]
    subject.notify(
        UserMessage(
            "the login fails with the last passwords that the suite has set: {count} more are "
            "tried, because a faulty controller may have stored another one",
            count=len(more),
        )
    )
    yield from more
    if subject.has_hook("factory_reset"):
        subject.hook("factory_reset")
        yield subject.password


def _set_last_first(subject: ControllerUnderTest) -> Iterator[bytes]:
    """Return the passwords of the journal, the last one first; the user's is first or second."""
    names = subject.journal.changes.passwords[::-1]
    known = [subject.password if name is None else name.encode("latin-1") for name in names]
    return iter((*known[:1], subject.password, *known[1:]))


def _lost(subject: ControllerUnderTest) -> PasswordLost:
    last = next(_set_last_first(subject))
    named = "the user's own" if last == subject.password else show(last)
    return PasswordLost(
        UserMessage(
            "no known password opens a login; the last one that the suite has set is {password}",
            password=named,
        )
    )


def _opens(subject: ControllerUnderTest, password: bytes) -> bool:
    line = subject.open(login=False)
    opened = bool(line.ask("login", password).accepted)
    line.close()
    return opened


def _as_kept_wrongly(passwords: list[bytes]) -> Iterator[bytes]:
    """Yield passwords that a faulty controller may have stored instead of a new password."""
    for password in passwords:
        yield from (password[:size] for size in _BUFFERS_BYTES if size < len(password))
        ways: tuple[Callable[[bytes], bytes], ...] = (
            bytes.lower,
            bytes.upper,
            lambda each: each.lstrip(b"0"),
            bytes.strip,
            lambda each: each.replace(b"$", b""),
        )
        yield from (way(password) for way in ways)


def set_value(
    line: OutgoingConnection, name: str, value: Any = None, *, data: bytes | None = None
) -> None:
    """Set a value.

    Raises:
        CaseFailed: The controller refuses it.
    """
    answer = line.ask(name, value, data=data)
    expect(
        answer.accepted,
        UserMessage("{command} was refused", command=name),
        expected="1",
        observed=f"{answer}",
    )
