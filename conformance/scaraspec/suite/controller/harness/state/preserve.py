"""Keeping: what a case changes of the subject's state, and puts back, whatever happens in between.

The connection may be lost; then another one is opened. What cannot be put back even so
is left to the end of the run.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.password import restore_password
from scaraspec.suite.controller.harness.state.restore import ITEMS
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, CaseSkipped, NoReply
from scaraspec.user_message import UserMessage


def ensure_open(subject: ControllerUnderTest, line: OutgoingConnection) -> OutgoingConnection:
    """This connection, or another one in place of all where the subject has ended it."""
    line.pump()
    if line.ending is None and not line.closed:
        return line
    subject.close_lines()
    return subject.open()


@contextmanager
def settings_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection, *names: str
) -> Iterator[None]:
    """Put back afterwards what the items of these names were.

    Raises:
        CaseFailed: The subject does not say what they are.
    """
    items = [item for item in ITEMS if item.name in names]
    before = {}
    for item in items:
        with suppress(NoReply):  # as where there is no default program (A-4.12-2)
            before[item.name] = item.read(subject, line)
    try:
        yield
    finally:
        for item in items:
            with suppress(CaseFailed, CaseInconclusive):
                if (value := before.get(item.name)) is not None:
                    item.write(subject, ensure_open(subject, line), value)


@contextmanager
def password_preserved(subject: ControllerUnderTest) -> Iterator[None]:
    """Set the password again afterwards that the tester named, if it is another one by then.

    Raises:
        CaseSkipped: The link needs none.
    """
    needs_login(subject)
    try:
        yield
    finally:
        with suppress(CaseFailed, CaseInconclusive):
            subject.close_lines()
            restore_password(subject)


def needs_login(subject: ControllerUnderTest) -> None:
    """Go on only over a link that needs a login.

    Raises:
        CaseSkipped: It does not (L83).
    """
    if not subject.access.needs_login:
        raise CaseSkipped("this link needs no login")


def patient(subject: ControllerUnderTest, lasts_s: float) -> None:
    """Go on only where a case may last so many of the subject's seconds.

    Raises:
        CaseSkipped: It may not.
    """
    ours_s = lasts_s / subject.ics.time_scale
    if ours_s > subject.access.wait_limit_s:
        raise CaseSkipped(
            UserMessage("it lasts {ours_s:.0f} s: grant them with --patience", ours_s=ours_s)
        )
