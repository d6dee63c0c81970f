"""Passwords: how a case changes the password, and wrong passwords."""

from scaraspec.protocol.commands import PasswordChange
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.suite_passwords import REFUSABLE, settable_passwords
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import expect


def altered_password(password: bytes) -> bytes:
    """Return a wrong password of the same length; in the other letter case if this differs."""
    swapped = password.swapcase()
    last = (password or b"0")[-1]
    return swapped if swapped != password else password[:-1] + bytes((last ^ 1,))


def rotated_password(password: bytes) -> bytes:
    """Return a wrong password with the first letter moved to the end, or else an altered one."""
    other = password[1:] + password[:1]
    return other if other != password else altered_password(password)


def usable_passwords(subject: ControllerUnderTest) -> tuple[bytes, ...]:
    """Return the passwords that cases may set on this controller, the plain one first."""
    return settable_passwords(factory_reset=subject.has_hook("factory_reset"))


def request_password_change(line: OutgoingConnection, old: bytes, new: bytes) -> ReceivedFrame:
    """Request another password, and return the reply."""
    return line.ask("set_password", PasswordChange(old, new))


def expect_password_changed(line: OutgoingConnection, old: bytes, new: bytes) -> bool:
    """Set a password with the correct old one.

    The subject may refuse the same password and those in `REFUSABLE` (A-4.1-3).

    Returns:
        Whether the password was changed.

    Raises:
        CaseFailed: The subject refuses another password.
    """
    answer = request_password_change(line, old, new)
    if answer.accepted is False and (new in REFUSABLE or new == old):
        return False
    expect(
        answer.accepted,
        "a new password was refused although the old one was correct",
        expected="1",
        observed=f"{answer}",
        requirement="4.2/2",
    )
    return True
