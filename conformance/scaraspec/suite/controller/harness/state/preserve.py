"""Preserve: restores the settings that a case changes, whatever happens during the case.

If the connection is lost, another one is opened. The end of the run restores what could not be
restored here.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress

from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import has_clock
from scaraspec.suite.controller.harness.state.password import restore_password
from scaraspec.suite.controller.harness.state.restore import ITEMS
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, CaseSkipped, NoReply
from scaraspec.user_message import UserMessage


def ensure_open(subject: ControllerUnderTest, line: OutgoingConnection) -> OutgoingConnection:
    """Return this connection. If it has ended, close all connections and return a new one."""
    line.pump()
    if line.ending is None and not line.closed:
        return line
    subject.close_lines()
    return subject.open()


@contextmanager
def settings_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection, *names: str
) -> Iterator[None]:
    """Restore the items of these names when the context ends.

    Raises:
        CaseFailed: The controller does not report their values.
    """
    items = [item for item in ITEMS if item.name in names]
    before = {}
    for item in items:
        with suppress(NoReply):  # there may be no default program (A-4.12-2)
            before[item.name] = item.read(subject, line)
    try:
        yield
    finally:
        for item in items:
            with suppress(CaseFailed, CaseInconclusive):
                if (value := before.get(item.name)) is not None:
                    item.write(subject, ensure_open(subject, line), value)


def clock_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> AbstractContextManager[None]:
    """Return a context that restores the clock, if it can be read and set."""
    return settings_preserved(subject, line, *["clock"] * has_clock(subject))


@contextmanager
def password_preserved(subject: ControllerUnderTest) -> Iterator[None]:
    """Restore the password of the user when the context ends.

    Raises:
        CaseSkipped: The link needs no password.
    """
    needs_login(subject)
    try:
        yield
    finally:
        with suppress(CaseFailed, CaseInconclusive):
            subject.close_lines()
            restore_password(subject)


def needs_login(subject: ControllerUnderTest) -> None:
    """Require a link that needs a login.

    Raises:
        CaseSkipped: It does not need one (L83).
    """
    if not subject.access.needs_login:
        raise CaseSkipped("this link needs no login")


def patient(subject: ControllerUnderTest, lasts_s: float) -> None:
    """Require that a case may wait for a time, in seconds of the subject's clock.

    Raises:
        CaseSkipped: ``--patience`` does not allow it.
    """
    duration_s = lasts_s / subject.ics.time_scale
    if duration_s > subject.access.wait_limit_s:
        raise CaseSkipped(
            UserMessage(
                "it takes {duration_s:.0f} s: allow this with --patience", duration_s=duration_s
            )
        )
